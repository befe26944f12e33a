//! Where the statistics of live cells lie: one file a role in shared memory.

use std::path::{Path, PathBuf};

use tandem_bus::Instance;
use tandem_cycle::stats::{OpenError, Reader};
use tandem_msg::{Coded, Role};

use super::rundir;

/// A cell that is running on this host, of this user.
#[derive(Clone, Debug)]
pub struct RunningCell {
    directory: PathBuf,
    instance: Instance,
}

impl RunningCell {
    /// The name of its instance: cell, process of the supervisor, time.
    pub fn name(&self) -> &str {
        self.instance.id()
    }

    /// Its run directory.
    pub fn directory(&self) -> &Path {
        &self.directory
    }

    /// Its place on the bus.
    pub fn instance(&self) -> &Instance {
        &self.instance
    }

    /// Statistics of a role's loop. They stay readable when the role is started
    /// anew, and for as long as the reader lives.
    ///
    /// # Errors
    /// The role has not come so far yet, or another build runs the cell.
    pub fn statistics(&self, role: Role) -> Result<Reader, OpenError> {
        Reader::open(&file(&self.instance, role))
    }
}

/// The cells that are running, by name.
pub fn running_cells() -> Vec<RunningCell> {
    let running = rundir::living().into_iter();
    let mut cells: Vec<RunningCell> = running
        .filter_map(|directory| Some(RunningCell { instance: rundir::instance_at(&directory).ok()?, directory }))
        .collect();
    cells.sort_by(|a, b| a.name().cmp(b.name()));
    cells
}

/// The file of a role.
pub(super) fn file(instance: &Instance, role: Role) -> PathBuf {
    instance.shared_file(&format!("stats_{}", role.name()))
}
