//! The bus as its users see it: one suite for both kinds, then what only shared memory can get wrong.

mod conformance;
mod crash;
mod isolation;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use tandem_bus::{Identity, Instance, Node, Read};
use tandem_msg::{Header, Message};
use tempfile::TempDir;

/// Longer than any healthy open on a busy machine.
const PATIENCE: Duration = Duration::from_secs(10);
const CONFIG_HASH: u64 = 7;

/// An instance of its own for one test; gone with it.
struct Scratch {
    instance: Instance,
    directory: TempDir,
}

impl Scratch {
    fn new() -> Self {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let directory = TempDir::new().expect("a temporary directory");
        let id = format!("test-{}-{count}", std::process::id());
        let instance = Instance::new(&id, &root(directory.path())).expect("a valid name");
        Self { instance, directory }
    }

    fn node(&self, role: &str, epoch: u64) -> Node {
        Node::new(&self.instance, identity(role, epoch), PATIENCE)
    }

    fn path(&self) -> &Path {
        self.directory.path()
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let removed = self.instance.remove();
        if !std::thread::panicking() {
            removed.expect("everything of the instance can be removed");
            assert_eq!(self.instance.shared_memory(), Vec::<PathBuf>::new());
        }
    }
}

/// Reads until what is `wanted` is heard: a peer is connected by a thread of its own, soon but not at once.
fn hear<M: Message>(reader: &mut impl Read<M>, wanted: impl Fn(&Header) -> bool) -> M {
    within_patience("a value is heard", || wanted(reader.read().header()));
    *reader.held()
}

/// Waits until `reached`.
fn within_patience(what: &str, mut reached: impl FnMut() -> bool) {
    let start = Instant::now();
    while !reached() {
        assert!(start.elapsed() < PATIENCE, "{what}");
        std::thread::yield_now();
    }
}

fn root(directory: &Path) -> PathBuf {
    directory.join("bus")
}

fn identity(role: &str, epoch: u64) -> Identity {
    Identity { role: role.to_owned(), epoch, config_hash: CONFIG_HASH }
}
