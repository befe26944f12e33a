//! What this host offers a realtime loop and a cell, and how to mend what it lacks.
//!
//! First everything is looked at and, where it can be, tried (scheduling, locking, waking up, flushing to disk):
//! that is a [`Host`]. Then [`CHECKS`] judge it, which neither wait nor change anything, so that a test may hand
//! them a host of its own making. Printing is the command line's business.
//!
//! The checks come in the order in which they depend on each other: processors and clocks, the kernel, what this
//! user may do, memory, files, the cell, and last a trial of the loop itself, which all the others may spoil. So the
//! first that is not well is the one to mend.

mod cell;
mod host;
mod idle;
mod kernel;
mod limits;
mod machine;
mod memory;
mod processors;
mod storage;
#[cfg(test)]
mod tests;
mod wake_up;

use std::path::Path;

use serde::Serialize;

use host::Host;

/// How a check came out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// As a cell wants it.
    Ok,
    /// It could not be found out.
    Unknown,
    /// A cell runs, with less certainty.
    Degraded,
    /// A cell does not run.
    Bad,
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

/// What a check is about: its name, and why it matters.
#[derive(Clone, Copy)]
struct Subject(&'static str, &'static str);

impl Subject {
    fn ok(self, found: impl Into<String>) -> Check {
        Check { name: self.0, verdict: Verdict::Ok, found: found.into(), matters: self.1, fix: None }
    }

    fn unknown(self, found: impl Into<String>, fix: impl Into<String>) -> Check {
        self.not_well(Verdict::Unknown, found, fix)
    }

    fn degraded(self, found: impl Into<String>, fix: impl Into<String>) -> Check {
        self.not_well(Verdict::Degraded, found, fix)
    }

    fn bad(self, found: impl Into<String>, fix: impl Into<String>) -> Check {
        self.not_well(Verdict::Bad, found, fix)
    }

    fn not_well(self, verdict: Verdict, found: impl Into<String>, fix: impl Into<String>) -> Check {
        Check { name: self.0, verdict, found: found.into(), matters: self.1, fix: Some(fix.into()) }
    }

    /// The kernel has no such file.
    fn not_told(self, mount: &str) -> Check {
        self.unknown("not told by the kernel", format!("mount {mount}"))
    }
}

/// All checks, in the order in which they depend on each other.
const CHECKS: [fn(&Host) -> Check; 34] = [
    processors::count,
    processors::quota,
    processors::load,
    processors::steal,
    processors::siblings,
    processors::isolation,
    processors::interrupts,
    machine::clocksource,
    machine::tsc,
    machine::timer_resolution,
    machine::governor,
    idle::states,
    idle::request,
    kernel::preemption,
    kernel::throttling,
    limits::fifo,
    limits::timer_slack,
    limits::memory_lock,
    limits::open_files,
    memory::available,
    memory::huge_pages,
    memory::page_moving,
    memory::swap,
    memory::shared_memory,
    memory::shared_memory_mount,
    memory::remove_ipc,
    storage::run_directory,
    storage::leftovers,
    storage::disk,
    storage::flush,
    cell::files,
    cell::model,
    cell::database,
    wake_up::wake_up,
];

/// Looks at this host, and at that cell when one is named. Takes about a second, and up to 3 s when the cell's
/// database does not answer; needs no rights, though with some it sees more.
pub fn examine(cell: Option<&Path>) -> Vec<Check> {
    let host = Host::this(cell);
    CHECKS.iter().map(|check| check(&host)).collect()
}
