//! Where files go: the run directory, the journal's disk, and what dead cells left.

use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::Check;
use crate::live;

/// A step waits for its journal entry; this is hardly felt.
const FLUSH_GOOD: Duration = Duration::from_millis(30);
const FLUSHES: usize = 5;

pub(super) fn run_directory() -> Check {
    const NAME: &str = "run_directory";
    let matters = "a running cell keeps its files here";
    match live::prepare_base() {
        Ok(path) => Check::ok(NAME, path.display().to_string(), matters),
        Err(error) => Check::failed(NAME, error.to_string(), matters, "set XDG_RUNTIME_DIR to a directory of yours"),
    }
}

pub(super) fn leftovers() -> Check {
    const NAME: &str = "leftovers";
    let matters = "a cell that was killed with all its processes leaves files and shared memory";
    let dead = live::dead_cells();
    // Running cells have a run directory; a dead one's is listed above.
    let has_directory = |instance: &str| live::base().join(instance).is_dir();
    let mut orphans: Vec<String> = tandem_bus::leftovers()
        .into_iter()
        .filter(|object| !has_directory(&object.instance))
        .map(|object| object.instance)
        .collect();
    orphans.sort();
    orphans.dedup();
    if dead.is_empty() && orphans.is_empty() {
        return Check::ok(NAME, "none", matters);
    }
    let names: Vec<String> =
        dead.iter().filter_map(|path| path.file_name()?.to_str().map(str::to_owned)).chain(orphans.clone()).collect();
    let fix = if orphans.is_empty() {
        "nothing: the next `tandem run` removes them".to_owned()
    } else {
        let files: Vec<String> = orphans.iter().map(|instance| format!("/dev/shm/tandem-{instance}_*")).collect();
        format!("if no other user or container runs these cells: rm {}", files.join(" "))
    };
    Check::degraded(NAME, names.join(", "), matters, fix)
}

/// Where the journal lies unless the cell file says otherwise; see [`crate::strategy::store::default_url`].
pub(super) fn state_folder() -> PathBuf {
    let home = || Some(PathBuf::from(std::env::var_os("HOME")?).join(".local/state"));
    let state = std::env::var_os("XDG_STATE_HOME").map(PathBuf::from).or_else(home);
    state.map_or_else(std::env::temp_dir, |state| state.join("tandem"))
}

pub(super) fn flush(folder: &Path) -> Check {
    const NAME: &str = "flush";
    let matters = "the next step begins when the journal entry of the last one is on disk";
    match flush_time(folder) {
        Ok(time) => {
            let found = format!("{:.1} ms", time.as_secs_f64() * 1e3);
            if time <= FLUSH_GOOD {
                Check::ok(NAME, found, matters)
            } else {
                Check::degraded(
                    NAME,
                    found,
                    matters,
                    "put the journal on a faster disk: `[store] url` in the cell file",
                )
            }
        }
        Err(error) => Check::failed(
            NAME,
            format!("{}: {error}", folder.display()),
            matters,
            "make the folder writable, or set `[store] url` in the cell file",
        ),
    }
}

/// Median time to write a page and have it on disk.
fn flush_time(folder: &Path) -> io::Result<Duration> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::doctor::Verdict;

    #[test]
    fn a_folder_that_cannot_be_written_is_a_failure_with_its_name() {
        let folder = tempfile::NamedTempFile::new().expect("a temporary file");
        let check = flush(folder.path());
        assert_eq!(check.verdict, Verdict::Failed);
        assert!(check.found.starts_with(&folder.path().display().to_string()), "{check:?}");
    }

    #[test]
    fn a_trial_leaves_no_file() {
        let folder = tempfile::TempDir::new().expect("a temporary directory");
        assert_ne!(flush(folder.path()).verdict, Verdict::Failed);
        assert_eq!(fs::read_dir(folder.path()).expect("readable").count(), 0);
    }
}
