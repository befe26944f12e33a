//! The end of whoever wants to look.

use core::sync::atomic::{Ordering, fence};
use core::time::Duration;
use std::fs::File;
use std::io;
use std::path::Path;

use tandem_msg::{Code, Role, Stamp};

use super::mapping::Mapping;
use super::page::{Earlier, Guarded, INPUTS_MAX, Input, LAYOUT, Obtained, Page, started};
use crate::Record;

/// How often a snapshot is tried again when an incarnation begins meanwhile.
const ATTEMPTS: u32 = 8;

/// Reads the statistics of one role, whoever is its present incarnation. The file
/// is mapped read-only: a reader cannot disturb the loop, whatever it does.
///
/// ```
/// use tandem_cycle::stats::{Reader, Snapshot};
///
/// fn p99_us(file: &std::path::Path) -> Result<u64, String> {
///     let reader = Reader::open(file).map_err(|error| error.to_string())?;
///     let mut snapshot = Snapshot::default(); // 90 KB: to be used again
///     reader.read(&mut snapshot).map_err(|error| error.to_string())?;
///     Ok(snapshot.record.lateness.quantile_ns(0.99) / 1_000)
/// }
/// assert!(p99_us("no such file".as_ref()).is_err());
/// ```
pub struct Reader {
    page: Mapping,
}

/// Why no statistics can be read.
#[derive(Debug)]
pub enum OpenError {
    /// There is no such file yet, or it cannot be read.
    Io(io::Error),
    /// Written by another build of Tandem.
    OtherBuild,
}

/// Why there is no snapshot now; the next may succeed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReadError {
    /// An incarnation is just beginning, or ended while it began.
    Beginning,
}

impl core::fmt::Display for OpenError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Io(cause) => cause.fmt(f),
            Self::OtherBuild => {
                f.write_str("written by another build of tandem: use the one the cell was started with")
            }
        }
    }
}

impl core::error::Error for OpenError {}

impl core::fmt::Display for ReadError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Beginning => f.write_str("the role is just starting"),
        }
    }
}

impl core::error::Error for ReadError {}

/// What a role's loop has found out, at one instant.
#[derive(Clone, Debug, Default)]
pub struct Snapshot {
    /// Whose loop it is.
    pub role: Code<Role>,
    /// Its incarnation.
    pub epoch: u64,
    /// The incarnation's process.
    pub pid: u32,
    /// When the incarnation set its loop up.
    pub started: Stamp,
    /// Spacing of the cycles.
    pub period: Duration,
    /// Offset on the shared grid.
    pub phase: Duration,
    /// What earlier incarnations counted.
    pub earlier: Earlier,
    /// Which realtime set-up is in force.
    pub obtained: Obtained,
    /// What the loop asked of the system since it was warm.
    pub guarded: Guarded,
    /// Counts, lateness and execution time of this incarnation.
    pub record: Record,
    /// Ages of the inputs; those without a name are not used.
    pub inputs: [Input; INPUTS_MAX],
}

impl Reader {
    /// Opens the statistics of a role.
    ///
    /// # Errors
    /// There is no such file, it is not readable, or another build wrote it.
    pub fn open(path: &Path) -> Result<Self, OpenError> {
        let file = File::open(path).map_err(OpenError::Io)?;
        // A shorter file would be a fault of the bus when it is read.
        if file.metadata().map_err(OpenError::Io)?.len() != size_of::<Page>() as u64 {
            return Err(OpenError::OtherBuild);
        }
        let page = Mapping::of(&file, false).map_err(OpenError::Io)?;
        match page.layout.get() {
            // 0: its first writer has not said yet.
            0 | LAYOUT => Ok(Self { page }),
            _ => Err(OpenError::OtherBuild),
        }
    }

    /// Cycles the present incarnation has run; a heartbeat that costs one load.
    pub fn cycles(&self) -> u64 {
        self.page.record.cycles()
    }

    /// The present incarnation; 0 while one is beginning.
    pub fn epoch(&self) -> u64 {
        self.page.epoch.load(Ordering::Acquire)
    }

    /// Copies everything.
    ///
    /// # Errors
    /// An incarnation is just beginning; `snapshot` is then without meaning.
    pub fn read(&self, snapshot: &mut Snapshot) -> Result<(), ReadError> {
        for _ in 0..ATTEMPTS {
            let epoch = self.epoch();
            self.copy(snapshot);
            fence(Ordering::Acquire);
            if epoch != 0 && self.page.epoch.load(Ordering::Relaxed) == epoch {
                snapshot.epoch = epoch;
                return Ok(());
            }
            core::hint::spin_loop();
        }
        Err(ReadError::Beginning)
    }

    fn copy(&self, snapshot: &mut Snapshot) {
        let page = &*self.page;
        snapshot.role = Code::from_raw(page.role.get() as u32);
        snapshot.pid = page.pid.get() as u32;
        snapshot.started = started(page);
        snapshot.period = Duration::from_nanos(page.period_ns.get());
        snapshot.phase = Duration::from_nanos(page.phase_ns.get());
        snapshot.earlier = page.earlier.get();
        snapshot.obtained = page.obtained.get();
        snapshot.guarded = page.guarded.get();
        page.record.copy_to(&mut snapshot.record);
        for (input, copy) in page.inputs.iter().zip(&mut snapshot.inputs) {
            input.copy_to(copy);
        }
    }
}
