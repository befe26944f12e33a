//! A cell in lockstep that is measured, with a database of its own; and the rests a busy realtime thread has to take.

use std::path::Path;
use std::time::Duration;

use tandem_config::Cell;
use tandem_msg::Stamp;

use super::cell::Scratch;
use super::{BenchError, loops};
use crate::lockstep::SimCell;
use crate::strategy::Library;
use crate::strategy::store::{RunRecord, Store};
use crate::supervisor::RunOptions;

/// What a cell in lockstep needs besides its file.
pub(super) struct Rehearsal {
    id: String,
    store: Store,
    library: Library,
    file: String,
    _scratch: Scratch,
}

impl Rehearsal {
    /// Opens a database for a run of that cell.
    ///
    /// # Errors
    /// What the database says.
    pub(super) fn new(file: &Path, cell: &Cell, boxes: u32, seed: u64) -> Result<Self, BenchError> {
        let refused = |error: &dyn std::fmt::Display| BenchError::Refused(format!("{}: {error}", file.display()));
        let scratch = Scratch::new()?;
        let url = format!("sqlite://{}", scratch.path().join("journal.db").display());
        let store = Store::open(&url).map_err(|error| refused(&error))?;
        store.seed(&cell.strategies).map_err(|error| refused(&error))?;
        let id = format!("bench-{}-{seed}", loops::now().0);
        let record = RunRecord {
            id: id.clone(),
            cell: cell.name.clone(),
            product: cell.product.name.clone(),
            config_hash: cell.hash,
            seed,
            boxes,
            started_ns: 0,
        };
        store.begin(&record).map_err(|error| refused(&error))?;
        let library = store.library().map_err(|error| refused(&error))?;
        Ok(Self { id, store, library, file: file.display().to_string(), _scratch: scratch })
    }

    /// The cell, at its beginning.
    ///
    /// # Errors
    /// A role refuses its parameters.
    pub(super) fn cell(&self, cell: &Cell, boxes: u32, seed: u64) -> Result<SimCell, BenchError> {
        let options = RunOptions { boxes, seed, run_id: self.id.clone() };
        SimCell::new(cell, self.library.clone(), options).map_err(|error| self.refused(&error))
    }

    /// Where its steps are written.
    pub(super) fn store(&self) -> &Store {
        &self.store
    }

    /// What a part of it said, with the name of its file.
    pub(super) fn refused(&self, error: &dyn std::fmt::Display) -> BenchError {
        BenchError::Refused(format!("{}: {error}", self.file))
    }
}

/// Working without a rest for longer, a realtime thread is taken for a runaway one.
const BURST: Duration = Duration::from_millis(50);
const REST: Duration = Duration::from_millis(6);

/// The rests of a thread that works all the time.
pub(super) struct Rests(Stamp);

impl Rests {
    /// Work begins.
    pub(super) fn begin() -> Self {
        Self(loops::now())
    }

    /// Rests when it is time.
    pub(super) fn take(&mut self) {
        if self.0.age_at(loops::now()) > BURST {
            std::thread::sleep(REST);
            self.0 = loops::now();
        }
    }
}
