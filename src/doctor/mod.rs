//! What this host offers a realtime loop and a cell, and how to mend what it lacks.
//!
//! [`examine`] looks, and answers with data; printing is the command line's
//! business. What can be tried is tried (scheduling, locking, waking up, flushing
//! to disk) rather than concluded from a version number. The checks come in the
//! order in which they depend on each other, so the first that fails is the one to mend.

mod kernel;
mod limits;
mod machine;
mod memory;
mod storage;
mod trial;

use std::path::{Path, PathBuf};

use serde::Serialize;

/// How a check came out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// As a cell wants it.
    Ok,
    /// A cell runs, with less certainty.
    Degraded,
    /// A cell does not run.
    Failed,
}

/// One check.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Check {
    /// What was looked at, one word.
    pub name: &'static str,
    /// How it came out.
    pub verdict: Verdict,
    /// What was found.
    pub found: String,
    /// Why it matters to a cell.
    pub matters: &'static str,
    /// What to do; `None` when all is well.
    pub fix: Option<String>,
}

impl Check {
    fn ok(name: &'static str, found: impl Into<String>, matters: &'static str) -> Self {
        Self { name, verdict: Verdict::Ok, found: found.into(), matters, fix: None }
    }

    fn degraded(name: &'static str, found: impl Into<String>, matters: &'static str, fix: impl Into<String>) -> Self {
        Self { name, verdict: Verdict::Degraded, found: found.into(), matters, fix: Some(fix.into()) }
    }

    fn failed(name: &'static str, found: impl Into<String>, matters: &'static str, fix: impl Into<String>) -> Self {
        Self { name, verdict: Verdict::Failed, found: found.into(), matters, fix: Some(fix.into()) }
    }
}

/// The files the kernel tells about itself in; a test puts its own there.
#[derive(Clone, Debug)]
struct Host {
    root: PathBuf,
}

impl Host {
    fn this() -> Self {
        Self { root: PathBuf::from("/") }
    }

    /// A file's text without the white space around it; `None` when it cannot be read.
    fn read(&self, path: &str) -> Option<String> {
        std::fs::read_to_string(self.root.join(path)).ok().map(|text| text.trim().to_owned())
    }

    /// A file's number.
    fn number(&self, path: &str) -> Option<i64> {
        self.read(path)?.parse().ok()
    }

    /// Names in a folder, sorted.
    fn list(&self, path: &str) -> Vec<String> {
        let entries = std::fs::read_dir(self.root.join(path)).into_iter().flatten().flatten();
        let mut names: Vec<_> = entries.filter_map(|entry| entry.file_name().into_string().ok()).collect();
        names.sort();
        names
    }
}

/// The word in brackets, as in `always [madvise] never`.
fn chosen(line: &str) -> Option<&str> {
    line.split_once('[')?.1.split_once(']').map(|(word, _)| word)
}

/// Looks at this host. Takes about a second; needs no rights, though with some it sees more.
pub fn examine() -> Vec<Check> {
    let host = Host::this();
    vec![
        machine::processors(),
        machine::clocksource(&host),
        machine::timer_resolution(),
        machine::governor(&host),
        machine::steal(&host),
        kernel::preemption(&host),
        kernel::throttling(&host),
        limits::fifo(),
        limits::memory_lock(),
        limits::open_files(),
        memory::huge_pages(&host),
        memory::swap(&host),
        memory::shared_memory(Path::new("/dev/shm")),
        storage::run_directory(),
        storage::leftovers(),
        storage::flush(&storage::state_folder()),
        trial::wake_up(),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use tempfile::TempDir;

    /// A host whose kernel tells what the test wants.
    pub(super) struct FakeHost(TempDir);

    impl FakeHost {
        pub(super) fn new() -> Self {
            Self(TempDir::new().expect("a temporary directory"))
        }

        pub(super) fn with(self, path: &str, text: &str) -> Self {
            let file = self.0.path().join(path);
            fs::create_dir_all(file.parent().expect("a folder")).expect("writable");
            fs::write(file, text).expect("writable");
            self
        }

        pub(super) fn host(&self) -> Host {
            Host { root: self.0.path().to_owned() }
        }
    }

    /// Every check has its own name, and whatever is not well has a fix.
    #[test]
    fn a_host_is_examined_and_every_trouble_has_a_fix() {
        let checks = examine();
        let mut names: Vec<_> = checks.iter().map(|check| check.name).collect();
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), checks.len());
        assert!(checks.len() >= 12);
        for check in &checks {
            assert_eq!(check.fix.is_none(), check.verdict == Verdict::Ok, "{check:?}");
            assert!(!check.found.is_empty(), "{check:?}");
        }
    }

    #[test]
    fn the_chosen_word_stands_in_brackets() {
        assert_eq!(chosen("always [madvise] never"), Some("madvise"));
        assert_eq!(chosen("none"), None);
    }
}
