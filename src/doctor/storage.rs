//! Where files go: the run directory, the journal's disk, and what dead cells left.

use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::{Check, Host, Subject};
use crate::live;

/// A step waits for its journal entry; this is hardly felt.
const FLUSH_GOOD: Duration = Duration::from_millis(30);
const FLUSHES: usize = 5;
/// A box leaves a few kB in the journal.
const DISK_WANTED: u64 = 256 << 20;

pub(super) fn run_directory(host: &Host) -> Check {
    let it = Subject("run_directory", "a running cell keeps its files here");
    match &host.run_directory {
        Ok(path) => it.ok(path.display().to_string()),
        Err(error) => it.bad(error, "set XDG_RUNTIME_DIR to a directory of yours"),
    }
}

pub(super) fn leftovers(host: &Host) -> Check {
    let it = Subject("leftovers", "a cell that was killed with all its processes leaves files and shared memory");
    let names: Vec<&str> = host.dead_cells.iter().chain(&host.orphans).map(String::as_str).collect();
    if names.is_empty() {
        return it.ok("none");
    }
    let fix = if host.orphans.is_empty() {
        "nothing: the next `tandem run` removes them".to_owned()
    } else {
        let files: Vec<String> = host.orphans.iter().map(|instance| format!("/dev/shm/tandem-{instance}_*")).collect();
        format!("if no other user or container runs these cells: rm {}", files.join(" "))
    };
    it.degraded(names.join(", "), fix)
}

/// Cells that have shared memory and no run directory. A running cell has one; a dead one's is told apart.
pub(super) fn orphans() -> Vec<String> {
    let has_directory = |instance: &str| live::base().join(instance).is_dir();
    let objects = tandem_bus::leftovers().into_iter().map(|object| object.instance);
    let mut orphans: Vec<String> = objects.filter(|instance| !has_directory(instance)).collect();
    orphans.sort();
    orphans.dedup();
    orphans
}

/// Where the journal lies unless the cell file says otherwise; see [`crate::strategy::store::default_url`].
pub(super) fn state_folder() -> PathBuf {
    let home = || Some(PathBuf::from(std::env::var_os("HOME")?).join(".local/state"));
    let state = std::env::var_os("XDG_STATE_HOME").map(PathBuf::from).or_else(home);
    state.map_or_else(std::env::temp_dir, |state| state.join("tandem"))
}

pub(super) fn disk(host: &Host) -> Check {
    let it = Subject("disk", "when the journal's disk is full, no step may begin");
    let place = host.state_folder.display();
    match host.disk_free {
        Some(free) if free >= DISK_WANTED => it.ok(format!("{} MB free in {place}", free >> 20)),
        Some(free) => it
            .degraded(format!("{} MB free in {place}", free >> 20), "make room, or set `[store] url` in the cell file"),
        None => {
            it.unknown(format!("{place} cannot be asked"), "make the folder, or set `[store] url` in the cell file")
        }
    }
}

pub(super) fn flush(host: &Host) -> Check {
    let it = Subject("flush", "the next step begins when the journal entry of the last one is on disk");
    match &host.flush {
        Ok(time) => {
            let found = format!("{:.1} ms", time.as_secs_f64() * 1e3);
            if *time <= FLUSH_GOOD {
                it.ok(found)
            } else {
                it.degraded(found, "put the journal on a faster disk: `[store] url` in the cell file")
            }
        }
        Err(error) => it.bad(
            format!("{}: {error}", host.state_folder.display()),
            "make the folder writable, or set `[store] url` in the cell file",
        ),
    }
}

/// Median time to write a page and have it on disk.
pub(super) fn flush_time(folder: &Path) -> io::Result<Duration> {
    fs::create_dir_all(folder)?;
    let path = folder.join(format!(".tandem-doctor-{}", std::process::id()));
    let mut file = File::create(&path)?;
    let mut once = || {
        let start = Instant::now();
        file.write_all(&[0_u8; 4096])?;
        file.sync_data()?;
        Ok(start.elapsed())
    };
    let times: io::Result<Vec<Duration>> = (0..FLUSHES).map(|_| once()).collect();
    fs::remove_file(&path)?;
    let mut times = times?;
    times.sort_unstable();
    Ok(times[FLUSHES / 2])
}
