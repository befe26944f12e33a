//! `tandem bench`: what a loop, a message and a cycle cost on this machine, beside what others pay, in the same run.
//!
//! ```text
//! jitter    how late a loop wakes            beside cyclictest and a bare loop on the same processor
//! latency   a message and back; the cell's hops   beside raw shared memory, a futex, iceoryx2 itself
//! recovery  kill -9: noticed, stopped, back  beside a bare pidfd, iceoryx2's own dead-node event and respawn
//! kernels   what a control cycle computes    beside parry3d where the question is the same
//! soak      a thousand kills of all roles    held to: nothing left, nothing grown
//! endurance a million cycles                 held to: no number lost, nothing asked of the system, no slower
//! ```
//! **Rule:** a figure counts as a ratio to its baseline in the same run only. The cases take turns, round after round,
//! so that what else the machine does meets all of them; a quantile is the median over the rounds of that round's quantile,
//! and a maximum says more about the machine than about us.
//! **Rule:** what was not measured is not printed. A baseline that is not there is said to be absent.

mod cell;
mod conditions;
mod cyclictest;
mod endurance;
mod exchange;
mod hops;
mod jitter;
mod kernels;
mod latency;
mod loops;
mod recovery;
mod rehearsal;
mod report;
mod respawn;
mod series;
mod soak;

use std::io;
use std::path::PathBuf;
use std::time::Duration;

pub use conditions::Conditions;
pub use endurance::{Endurance, Shell};
pub use exchange::peer;
pub use report::{Finding, Report, Row};
pub use series::{QUANTILES, Series};

/// Which bench.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bench {
    /// How late a loop wakes.
    Jitter,
    /// What a message costs, and how long a cell takes from sensor to arm.
    Latency,
    /// How long a killed process is missed.
    Recovery,
    /// What a control cycle computes.
    Kernels,
    /// Whether kills leave something behind.
    Soak {
        /// How many.
        kills: u32,
    },
    /// Whether a cell is at the end as it was at the beginning.
    Endurance(Endurance),
}

impl Bench {
    /// Its word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Jitter => "jitter",
            Self::Latency => "latency",
            Self::Recovery => "recovery",
            Self::Kernels => "kernels",
            Self::Soak { .. } => "soak",
            Self::Endurance(_) => "endurance",
        }
    }
}

/// What a bench is asked for.
#[derive(Clone, Debug)]
pub struct Options {
    /// How long a case is measured in a round.
    pub time: Duration,
    /// How often the cases take turns.
    pub rounds: u32,
    /// Processor of the measured loop; the last one when none is named.
    pub cpu: Option<u32>,
    /// The cell that is run live; none leaves out what needs one.
    pub cell: Option<PathBuf>,
    /// Is told how far a long one has come.
    pub tell: fn(&str),
}

/// Why a bench could not be run.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// The cell file is refused.
    #[error("{0}")]
    Config(tandem_config::Faults),
    /// The operating system refuses something.
    #[error("{what}: {cause}")]
    Io {
        /// What was tried.
        what: String,
        /// What it says.
        cause: io::Error,
    },
    /// A process that is measured did not do its part.
    #[error("{who}: {what}")]
    Peer {
        /// Which.
        who: String,
        /// What it did instead.
        what: String,
    },
    /// The bus.
    #[error(transparent)]
    Bus(#[from] tandem_bus::BusError),
    /// A role refuses its parameters.
    #[error("{0}")]
    Refused(String),
}

impl BenchError {
    fn io(what: impl Into<String>) -> impl FnOnce(io::Error) -> Self {
        let what = what.into();
        move |cause| Self::Io { what, cause }
    }

    fn peer(who: impl Into<String>, what: impl Into<String>) -> Self {
        Self::Peer { who: who.into(), what: what.into() }
    }
}

/// Runs a bench.
///
/// # Errors
/// A file is refused, or a process that is measured fails.
pub fn run(bench: Bench, options: &Options) -> Result<Report, BenchError> {
    let mut report = Report::begin(bench);
    loops::keep_awake();
    match bench {
        Bench::Jitter => jitter::run(options, &mut report)?,
        Bench::Latency => latency::run(options, &mut report)?,
        Bench::Recovery => recovery::run(options, &mut report)?,
        Bench::Kernels => kernels::run(options, &mut report)?,
        Bench::Soak { kills } => soak::run(kills, options, &mut report)?,
        Bench::Endurance(wanted) => endurance::run(wanted, options, &mut report)?,
    }
    report.end();
    Ok(report)
}
