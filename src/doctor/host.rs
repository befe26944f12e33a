//! What was found on a host, before it is judged.

use std::path::{Path, PathBuf};
use std::time::Duration;

use rustix::process::{Resource, getrlimit};
use rustix::time::{ClockId, clock_getres};
use tandem_cycle::setup::{Granted, acquire};

use super::cell::{self, CellFound};
use super::storage;
use super::wake_up::{self, WISH, WakeUp};
use crate::live;

/// The highest priority the shipped cell asks for.
pub(super) const PRIORITY: u8 = 80;
const SHARED_MEMORY: &str = "/dev/shm";

/// A host: the files its kernel tells about itself in, and what was asked of it or tried on it.
#[derive(Clone, Debug)]
pub(super) struct Host {
    /// Where `proc`, `sys`, `dev`, `etc` and `run` are.
    pub(super) root: PathBuf,
    /// Processors this process may use.
    pub(super) processors: usize,
    /// Resolution of CLOCK_MONOTONIC.
    pub(super) resolution: Duration,
    /// What a loop is granted; `None` when the trial could not be run.
    pub(super) granted: Option<Granted>,
    /// Bytes that may be locked; `None` = without limit.
    pub(super) lockable: Option<u64>,
    /// Files that may be open; `None` = without limit.
    pub(super) open_files: Option<u64>,
    /// Bytes free for shared memory; `None` when it is not mounted.
    pub(super) shared_free: Option<u64>,
    /// Where running cells keep their files, or why they cannot.
    pub(super) run_directory: Result<PathBuf, String>,
    /// Cells that are dead and have left a run directory.
    pub(super) dead_cells: Vec<String>,
    /// Cells that have shared memory and no run directory.
    pub(super) orphans: Vec<String>,
    /// Where the journal lies unless the cell file says otherwise.
    pub(super) state_folder: PathBuf,
    /// Bytes free there.
    pub(super) disk_free: Option<u64>,
    /// Median time to write a page there and have it on disk.
    pub(super) flush: Result<Duration, String>,
    /// The cell that was asked about.
    pub(super) cell: Option<CellFound>,
    /// A short run of the loop; `None` when it could not be run.
    pub(super) wake_up: Option<WakeUp>,
}

impl Host {
    /// Looks at this host and tries what can be tried.
    pub(super) fn this(cell: Option<&Path>) -> Self {
        let state_folder = storage::state_folder();
        // First what makes the folder, then how much room there is in it.
        let flush = storage::flush_time(&state_folder).map_err(|error| error.to_string());
        let dead_cells = live::dead_cells();
        let names = dead_cells.iter().filter_map(|path| Some(path.file_name()?.to_str()?.to_owned()));
        Self {
            root: PathBuf::from("/"),
            processors: std::thread::available_parallelism().map_or(1, usize::from),
            resolution: Duration::try_from(clock_getres(ClockId::Monotonic)).unwrap_or(Duration::MAX),
            granted: granted(),
            // Root may lock without limit whatever RLIMIT_MEMLOCK says.
            lockable: getrlimit(Resource::Memlock).current.filter(|_| !rustix::process::geteuid().is_root()),
            open_files: getrlimit(Resource::Nofile).current,
            shared_free: free(Path::new(SHARED_MEMORY)),
            run_directory: live::prepare_base().map_err(|error| error.to_string()),
            dead_cells: names.collect(),
            orphans: storage::orphans(),
            disk_free: free(&state_folder),
            state_folder,
            flush,
            cell: cell.map(cell::look),
            wake_up: std::thread::spawn(wake_up::trial).join().ok().flatten(),
        }
    }

    /// A file's text without the white space around it; `None` when it cannot be read.
    pub(super) fn read(&self, path: &str) -> Option<String> {
        std::fs::read_to_string(self.root.join(path)).ok().map(|text| text.trim().to_owned())
    }

    /// A file's number.
    pub(super) fn number(&self, path: &str) -> Option<i64> {
        self.read(path)?.parse().ok()
    }

    /// Names in a folder, sorted.
    pub(super) fn list(&self, path: &str) -> Vec<String> {
        let entries = std::fs::read_dir(self.root.join(path)).into_iter().flatten().flatten();
        let mut names: Vec<_> = entries.filter_map(|entry| entry.file_name().into_string().ok()).collect();
        names.sort();
        names
    }
}

/// Bytes an ordinary user may still write there.
fn free(mount: &Path) -> Option<u64> {
    let space = rustix::fs::statvfs(mount).ok()?;
    Some(space.f_bavail.saturating_mul(space.f_frsize))
}

/// Tried on a thread of its own, which takes the setting with it.
fn granted() -> Option<Granted> {
    std::thread::spawn(|| acquire(&WISH).ok()).join().ok().flatten()
}

/// The word in brackets, as in `always [madvise] never`.
pub(super) fn chosen(line: &str) -> Option<&str> {
    line.split_once('[')?.1.split_once(']').map(|(word, _)| word)
}

/// The processors of a list as the kernel writes it, `0-2,5`.
pub(super) fn cpu_list(text: &str) -> Vec<u32> {
    let range = |part: &str| {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        Some(first.trim().parse().ok()?..=last.trim().parse().ok()?)
    };
    text.split(',').filter_map(range).flatten().collect()
}
