//! A cell on a virtual clock with a database of its own, and what it told.

use std::path::Path;

use tandem::lockstep::SimCell;
use tandem::strategy::JournalEntry;
use tandem::strategy::store::{RunRecord, Store};
use tandem::supervisor::{Event, EventKind, Outcome, RunOptions, Summary};
use tandem_config::Cell;

/// A run in lockstep.
pub(crate) struct Rig {
    /// Boxed: the roles are some hundred kilobytes each, and a test's stack is small.
    pub(crate) sim: Box<SimCell>,
    store: Store,
    run: String,
    pub(crate) events: Vec<Event>,
    _folder: tempfile::TempDir,
}

/// The shipped cell, set up for a product.
pub(crate) fn shipped(product: &str) -> Cell {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/cells/s471.toml");
    Cell::load(&file, Some(product)).unwrap_or_else(|faults| panic!("{faults}"))
}

impl Rig {
    /// The shipped cell with the product its file names.
    pub(crate) fn new(boxes: u32, seed: u64) -> Self {
        Self::of("s471", boxes, seed)
    }

    pub(crate) fn of(product: &str, boxes: u32, seed: u64) -> Self {
        let cell = shipped(product);
        let folder = tempfile::tempdir().expect("a temporary folder");
        let url = format!("sqlite://{}", folder.path().join("cell.db").display());
        let store = Store::open(&url).expect("an empty folder takes a database");
        store.seed(&cell.strategies).expect("the shipped strategies are stored");
        let run = format!("test-{seed}");
        let record = RunRecord {
            id: run.clone(),
            cell: cell.name.clone(),
            product: cell.product.name.clone(),
            config_hash: cell.hash,
            seed,
            boxes,
            started_ns: 0,
        };
        store.begin(&record).expect("the run is recorded");
        let library = store.library().expect("the library is read");
        let options = RunOptions { boxes, seed, run_id: run.clone() };
        let sim = Box::new(SimCell::new(&cell, library, options).unwrap_or_else(|error| panic!("{error}")));
        Self { sim, store, run, events: Vec::new(), _folder: folder }
    }

    /// Runs until an event satisfies `until`; `Some` when the run ended before.
    pub(crate) fn run_until(&mut self, until: impl Fn(&EventKind) -> bool) -> Option<Outcome> {
        let Self { sim, store, events, .. } = self;
        loop {
            let told = events.len();
            let outcome = sim.step(store, &mut |event| events.push(event.clone())).expect("the roles run");
            if outcome.is_some() {
                return outcome;
            }
            if events[told..].iter().any(|event| until(&event.kind)) {
                return None;
            }
        }
    }

    /// Runs to the end.
    pub(crate) fn finish(&mut self) -> Outcome {
        self.run_until(|_| false).expect("only an outcome ends this")
    }

    pub(crate) fn summary(&self) -> Summary {
        self.sim.summary()
    }

    pub(crate) fn journal(&self) -> Vec<JournalEntry> {
        self.store.journal(&self.run).expect("the journal is read")
    }

    /// The run's last words, for the message of a failed assertion.
    pub(crate) fn tail(&self) -> String {
        let last = self.events.len().saturating_sub(12);
        self.events[last..].iter().map(|event| format!("\n{event:?}")).collect()
    }
}
