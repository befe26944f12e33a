//! Why a live cell could not be run.

use std::error::Error;
use std::io;
use std::path::PathBuf;

use tandem_bus::BusError;
use tandem_config::Faults;
use tandem_cycle::GridError;
use tandem_cycle::setup::Denied;
use tandem_msg::{Coded, Role};

/// Why a live cell could not be run, or one of its roles not be started.
#[derive(Debug, thiserror::Error)]
pub enum LiveError {
    /// The run directory cannot be made or removed.
    #[error("run directory {path}: {cause}; make it writable, or set XDG_RUNTIME_DIR to a directory that is")]
    RunDirectory {
        /// The directory.
        path: PathBuf,
        /// What the system says.
        cause: io::Error,
    },
    /// The bus.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// Files a role reads differ from what its supervisor accepted.
    #[error("{0}")]
    Config(Faults),
    /// A schedule that is no grid.
    #[error("timing.{}: {cause}", role.name())]
    Schedule {
        /// The role.
        role: Role,
        /// What is wrong with it.
        cause: GridError,
    },
    /// The host does not grant what the cell file enforces.
    #[error("{}: {denied}", role.name())]
    Denied {
        /// The role.
        role: Role,
        /// What is missing.
        denied: Denied,
    },
    /// A loop misses more of its cycles than the cell file allows.
    #[error("timing.{}: more grid points were missed than overrun_limit allows; the loop is left", role.name())]
    Overloaded {
        /// The role.
        role: Role,
    },
    /// The file of a loop's statistics cannot be made.
    #[error("statistics {path}: {cause}; is /dev/shm mounted and not full? `tandem doctor` says more")]
    Statistics {
        /// The file.
        path: PathBuf,
        /// What the system says.
        cause: io::Error,
    },
    /// A role refuses its files or parameters.
    #[error("{}: {cause}", role.name())]
    Build {
        /// The role.
        role: Role,
        /// Why.
        cause: Box<dyn Error + Send + Sync>,
    },
    /// A role did not come up.
    #[error("{what} before the cell was ready{}", said(last_words))]
    NotReady {
        /// Which, and how it was lost.
        what: String,
        /// The last it wrote.
        last_words: String,
    },
    /// Signals cannot be listened for.
    #[error("signals cannot be handled: {0}")]
    Signals(io::Error),
    /// The means to coordinate threads cannot be had.
    #[error("the warden's event descriptor cannot be made: {0}; are there too many open files?")]
    Threads(io::Error),
    /// A part of the supervisor's process failed; this is a defect of Tandem.
    #[error("the {thread} thread ended unexpectedly; this is a defect, its message stands above")]
    Panicked {
        /// Which.
        thread: &'static str,
    },
    /// A supervisor was asked for as a role.
    #[error("the supervisor is no role process; start the cell with `tandem run`")]
    NoSuchRole,
}

impl LiveError {
    /// The documented exit code of the process: 3 when a file or a setting is to be
    /// corrected, else 1.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Config(_) | Self::Schedule { .. } | Self::Denied { .. } | Self::Build { .. } => 3,
            _ => 1,
        }
    }
}

fn said(last_words: &str) -> String {
    if last_words.is_empty() { String::new() } else { format!("; it said: {last_words}") }
}
