//! One running cell on this host, as the bus sees it: a name, a directory, a prefix.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::time::Duration;

use iceoryx2::config::Config;
use iceoryx2::node::{Node, NodeState, NodeView};
use iceoryx2::prelude::{CallbackProgression, FileName, LogLevel, SemanticString, ipc, set_log_level};

use crate::BusError;

/// Where Linux keeps POSIX shared memory; iceoryx2's root path does not move it.
const SHARED_MEMORY: &str = "/dev/shm";
/// Every shared-memory object of every cell begins with this.
const FAMILY: &str = "tandem-";
/// Ends the instance's name in a prefix; not allowed inside one, so no prefix is the beginning of another.
const END: char = '_';
const ID_LENGTH_MAX: usize = 40;
/// iceoryx2 stores paths in 255 bytes and appends directory and file names of up to 100.
const ROOT_LENGTH_MAX: usize = 150;
/// How long iceoryx2 itself waits for another process that is creating the same thing.
const CREATION_PATIENCE: Duration = Duration::from_millis(200);

/// One running cell on this host. Instances of different names never meet.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Instance {
    id: String,
    root: PathBuf,
}

/// What [`Instance::clean_dead`] did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cleaned {
    /// Dead processes whose leftovers were removed.
    pub removed: u32,
    /// Dead processes whose leftovers could not be removed; [`Instance::remove`] will.
    pub remaining: u32,
}

/// A shared-memory object of some cell.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Leftover {
    /// The object.
    pub path: PathBuf,
    /// The instance it belongs to.
    pub instance: String,
}

impl Instance {
    /// The instance `id` whose files lie in `root`; nothing is created yet.
    ///
    /// # Errors
    /// `InvalidId` and `InvalidRoot`.
    pub fn new(id: &str, root: &Path) -> Result<Self, BusError> {
        let allowed = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '-';
        if id.is_empty() || id.len() > ID_LENGTH_MAX || !id.chars().all(allowed) {
            return Err(BusError::InvalidId { id: id.to_owned() });
        }
        let length = root.as_os_str().len();
        if root.to_str().is_none() || length > ROOT_LENGTH_MAX {
            return Err(BusError::InvalidRoot { path: root.to_owned(), length, allowed: ROOT_LENGTH_MAX });
        }
        Ok(Self { id: id.to_owned(), root: root.to_owned() })
    }

    /// Its name.
    pub fn id(&self) -> &str {
        &self.id
    }

    /// The directory its files lie in.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// What every shared-memory object of this instance begins with.
    pub fn prefix(&self) -> String {
        format!("{FAMILY}{}{END}", self.id)
    }

    /// Where a shared-memory file of this instance lies that is not the bus's own; removed with the instance.
    pub fn shared_file(&self, name: &str) -> PathBuf {
        Path::new(SHARED_MEMORY).join(format!("{}{name}", self.prefix()))
    }

    /// The whole configuration of iceoryx2 for this instance; nothing is left to files or defaults that matter.
    pub(crate) fn config(&self) -> Config {
        // Our errors carry what matters; upstream's log would write into a cycle.
        set_log_level(LogLevel::Fatal);
        let mut config = Config::default();
        let root = self.root.to_str().expect("checked when the instance was named");
        config.global.set_root_path(&root.try_into().expect("checked when the instance was named"));
        config.global.prefix = FileName::new(self.prefix().as_bytes()).expect("checked when the instance was named");
        config.global.creation_timeout = CREATION_PATIENCE;
        config.global.service.cleanup_dead_nodes_on_open = false;
        config.global.node.cleanup_dead_nodes_on_creation = false;
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        config
    }

    /// Removes what processes of this instance that died without saying so have
    /// left on the bus, so that their successors can take their places. Waits up
    /// to `patience` for another cleaner.
    ///
    /// # Realtime
    /// Takes tens of milliseconds, allocates, and makes system calls: not for a cycle.
    pub fn clean_dead(&self, patience: Duration) -> Cleaned {
        let mut cleaned = Cleaned::default();
        let listed = Node::<ipc::Service>::list(&self.config(), |state| {
            if let NodeState::Dead(dead) = state {
                // Without its details a node would be looked for under iceoryx2's global configuration, which is
                // not ours. It died while it was being created and holds no port.
                let ours = dead.details().is_some();
                if ours && dead.blocking_remove_stale_resources(patience).is_ok() {
                    cleaned.removed += 1;
                } else {
                    cleaned.remaining += 1;
                }
            }
            CallbackProgression::Continue
        });
        if listed.is_err() {
            cleaned.remaining += 1;
        }
        cleaned
    }

    /// Shared-memory objects of this instance that exist now.
    pub fn shared_memory(&self) -> Vec<PathBuf> {
        let prefix = self.prefix();
        objects().filter(|(_, name)| name.starts_with(&prefix)).map(|(path, _)| path).collect()
    }

    /// Removes everything of this instance: its directory and its shared memory.
    /// Only when none of its processes is alive. Removing it twice is no error.
    ///
    /// # Errors
    /// The first file that could not be removed; the others are removed all the same.
    pub fn remove(&self) -> Result<(), BusError> {
        let files = self.shared_memory().into_iter().map(|path| (fs::remove_file(&path), path));
        let root = std::iter::once((fs::remove_dir_all(&self.root), self.root.clone()));
        let mut first = Ok(());
        for (outcome, path) in files.chain(root) {
            match outcome {
                Err(cause) if cause.kind() != ErrorKind::NotFound && first.is_ok() => {
                    first = Err(BusError::Remove { path, cause });
                }
                _ => {}
            }
        }
        first
    }
}

/// Shared-memory objects of all cells of this host, running or dead.
pub fn leftovers() -> Vec<Leftover> {
    let instance = |name: &str| Some(name.strip_prefix(FAMILY)?.split_once(END)?.0.to_owned());
    objects().filter_map(|(path, name)| Some(Leftover { path, instance: instance(&name)? })).collect()
}

fn objects() -> impl Iterator<Item = (PathBuf, String)> {
    let entries = fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten();
    entries.filter_map(|entry| Some((entry.path(), entry.file_name().into_string().ok()?)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_that_could_leave_its_directory_is_refused() {
        for id in ["", "..", "a/b", "A", "a_b", &"x".repeat(41)] {
            let refused = Instance::new(id, Path::new("/tmp/x"));
            assert!(matches!(refused, Err(BusError::InvalidId { .. })), "{id}: {refused:?}");
        }
    }

    #[test]
    fn a_directory_too_long_for_the_bus_is_refused_with_its_length() {
        let refused = Instance::new("a", Path::new(&"/x".repeat(100))).expect_err("200 bytes");
        assert!(refused.to_string().contains("200 bytes long, allowed up to 150"), "{refused}");
    }

    #[test]
    fn no_prefix_begins_another() {
        let prefix = |id| Instance::new(id, Path::new("/tmp/x")).expect("valid").prefix();
        assert!(!prefix("ab").starts_with(&prefix("a")));
    }
}
