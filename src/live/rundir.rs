//! The run directory: what one running cell has on this host, and what dead ones left.
//!
//! ```text
//! $XDG_RUNTIME_DIR/tandem/<instance>/owner    locked while the cell runs
//!                                    bus/     files of the bus
//! ```
//! Without XDG_RUNTIME_DIR the temporary directory holds `tandem-<user>/` instead.
//! The lock is the kernel's: it is gone with its process, however that ended. So a
//! directory whose lock is free belongs to a dead cell.

use std::fs::{self, File};
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::path::{Path, PathBuf};

use rustix::fs::{FlockOperation, flock};
use tandem_bus::{BusError, Instance};

use super::LiveError;

const OWNER: &str = "owner";
const BUS: &str = "bus";
/// Of the cell's name, in the name of its instance.
const NAME_LENGTH_MAX: usize = 12;

/// The run directory of this process's cell; removed with everything in it when dropped.
pub(super) struct RunDir {
    path: PathBuf,
    instance: Instance,
    /// Holds the lock.
    _owner: File,
}

impl RunDir {
    /// Makes a run directory for the cell of that name, under a name no other has.
    pub(super) fn create(cell: &str) -> Result<Self, LiveError> {
        let base = prepare_base()?;
        let id = instance_id(cell);
        let (path, building) = (base.join(&id), base.join(format!(".{id}")));
        let refused = |cause| LiveError::RunDirectory { path: path.clone(), cause };
        // Locked before it gets its name, so that nobody takes it for a dead cell's.
        private_directory(&building).map_err(refused)?;
        let owner = File::create(building.join(OWNER)).map_err(refused)?;
        flock(&owner, FlockOperation::NonBlockingLockExclusive).map_err(|cause| refused(cause.into()))?;
        fs::rename(&building, &path).map_err(refused)?;
        let instance = Instance::new(&id, &path.join(BUS))?;
        Ok(Self { path, instance, _owner: owner })
    }

    /// The instance on the bus.
    pub(super) fn instance(&self) -> &Instance {
        &self.instance
    }

    /// The directory.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Removes everything of this cell. Only when its other processes have ended.
    pub(super) fn remove(self) -> Result<(), LiveError> {
        remove(&self.path, &self.instance)
    }
}

impl Drop for RunDir {
    fn drop(&mut self) {
        // Reported by `remove`, when it can be; this is the way out after an error, which is told instead.
        let _ = remove(&self.path, &self.instance);
    }
}

/// The instance a role joins, by the run directory it was given.
pub(super) fn instance_at(path: &Path) -> Result<Instance, BusError> {
    let id = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    Instance::new(id, &path.join(BUS))
}

/// Run directories of cells that are dead: their supervisor was killed.
pub fn dead_cells() -> Vec<PathBuf> {
    named().into_iter().filter(|path| is_dead(path)).collect()
}

/// Run directories of cells that are running.
pub(super) fn living() -> Vec<PathBuf> {
    named().into_iter().filter(|path| !is_dead(path)).collect()
}

fn named() -> Vec<PathBuf> {
    let entries = fs::read_dir(base()).into_iter().flatten().flatten();
    // A name with a dot is one that is just being made.
    let named = entries.filter(|entry| !entry.file_name().as_encoded_bytes().starts_with(b"."));
    named.map(|entry| entry.path()).collect()
}

/// Removes what dead cells of this user left. What cannot be removed is left to `tandem doctor`.
pub(crate) fn sweep() {
    for path in dead_cells() {
        if let Ok(instance) = instance_at(&path) {
            let _ = remove(&path, &instance);
        }
    }
}

/// Where the run directories of this user lie.
pub fn base() -> PathBuf {
    match std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from) {
        Some(runtime) if runtime.is_absolute() && runtime.is_dir() => runtime.join("tandem"),
        _ => std::env::temp_dir().join(format!("tandem-{}", rustix::process::geteuid().as_raw())),
    }
}

/// Makes the directory all run directories lie in, and refuses one that another user could write to.
pub(crate) fn prepare_base() -> Result<PathBuf, LiveError> {
    let base = base();
    let refused = |cause| LiveError::RunDirectory { path: base.clone(), cause };
    private_directory(&base).map_err(refused)?;
    let found = fs::symlink_metadata(&base).map_err(refused)?;
    if found.is_dir() && found.uid() == rustix::process::geteuid().as_raw() && found.mode() & 0o022 == 0 {
        Ok(base)
    } else {
        Err(refused(io::Error::other("not a directory of this user alone; remove it or set XDG_RUNTIME_DIR")))
    }
}

fn private_directory(path: &Path) -> io::Result<()> {
    fs::DirBuilder::new().recursive(true).mode(0o700).create(path)
}

/// Letters and digits of the cell's name, the process and the time: unique on this host until it is started anew.
fn instance_id(cell: &str) -> String {
    let allowed = |c: &char| c.is_ascii_lowercase() || c.is_ascii_digit();
    let name: String = cell.chars().filter(allowed).take(NAME_LENGTH_MAX).collect();
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Realtime);
    let since = (now.tv_sec as u64).wrapping_mul(1_000_000).wrapping_add(now.tv_nsec as u64 / 1_000);
    format!("{name}-{}-{:x}", std::process::id(), since & 0xfff_ffff_ffff)
}

fn is_dead(path: &Path) -> bool {
    File::open(path.join(OWNER)).is_ok_and(|owner| flock(&owner, FlockOperation::NonBlockingLockExclusive).is_ok())
}

fn remove(path: &Path, instance: &Instance) -> Result<(), LiveError> {
    let bus = instance.remove();
    match fs::remove_dir_all(path) {
        Err(cause) if cause.kind() != io::ErrorKind::NotFound => {
            Err(LiveError::RunDirectory { path: path.to_owned(), cause })
        }
        _ => Ok(bus?),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_run_directory_is_alive_while_it_is_held_and_leaves_nothing() {
        let run = RunDir::create("s471").expect("the temporary directory is writable");
        let path = run.path().to_owned();
        assert!(path.join(OWNER).exists() && !is_dead(&path), "{path:?}");
        assert_eq!(instance_at(&path).expect("its own name"), *run.instance());
        run.remove().expect("nobody uses it");
        assert!(!path.exists());
    }

    #[test]
    fn what_a_dead_cell_left_is_swept() {
        let base = prepare_base().expect("the temporary directory is writable");
        let left = base.join(format!("left-{}", std::process::id()));
        private_directory(&left.join(BUS)).expect("writable");
        File::create(left.join(OWNER)).expect("writable");
        assert!(dead_cells().contains(&left));
        sweep();
        assert!(!left.exists());
    }

    #[test]
    fn instance_names_are_ones_the_bus_accepts() {
        for cell in ["s471", "A cell with Spaces, and a very long name", ""] {
            let id = instance_id(cell);
            assert!(Instance::new(&id, Path::new("/tmp/x")).is_ok(), "{id}");
        }
    }
}
