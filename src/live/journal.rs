//! The journal's thread: the only one that speaks to the database while a cell runs.
//!
//! The supervisor hands over its entries and goes on; it hears through a number
//! which of them are durable, and lets no step begin before the last one is. When
//! the database fails, the entries stay here and are offered again, until the
//! supervisor loses its patience and ends the run.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, mpsc};
use std::time::Duration;

use crate::strategy::JournalEntry;
use crate::strategy::store::Store;

/// Between two attempts at a database that does not answer.
const PAUSE: Duration = Duration::from_millis(200);
/// Attempts that are made after the supervisor has gone.
const LAST_ATTEMPTS: u32 = 3;

/// The supervisor's end.
pub(super) struct Journal {
    entries: mpsc::Sender<Vec<JournalEntry>>,
    durable: Arc<AtomicU64>,
    sent: u64,
}

/// The database's end.
pub(super) struct JournalThread<'a> {
    store: &'a mut Store,
    entries: mpsc::Receiver<Vec<JournalEntry>>,
    durable: Arc<AtomicU64>,
}

/// Both ends of a journal in that store.
pub(super) fn open(store: &mut Store) -> (Journal, JournalThread<'_>) {
    let (sender, receiver) = mpsc::channel();
    let durable = Arc::new(AtomicU64::new(0));
    let journal = Journal { entries: sender, durable: Arc::clone(&durable), sent: 0 };
    (journal, JournalThread { store, entries: receiver, durable })
}

impl Journal {
    /// Hands entries over.
    pub(super) fn write(&mut self, entries: Vec<JournalEntry>) {
        if let Some(last) = entries.iter().map(|entry| entry.seq).max() {
            self.sent = self.sent.max(last);
            // A thread that has panicked makes nothing durable, and that is seen.
            let _ = self.entries.send(entries);
        }
    }

    /// Highest sequence number that is durable; 0 before the first.
    pub(super) fn durable(&self) -> u64 {
        self.durable.load(Ordering::Acquire)
    }

    /// Whether everything handed over is durable.
    pub(super) fn is_settled(&self) -> bool {
        self.durable() >= self.sent
    }
}

impl JournalThread<'_> {
    /// Writes what comes until the supervisor's end is dropped.
    pub(super) fn run(self) {
        let mut waiting: Vec<JournalEntry> = Vec::new();
        let mut attempts_left = LAST_ATTEMPTS;
        loop {
            let next = if waiting.is_empty() {
                self.entries.recv().map_err(|_| mpsc::RecvTimeoutError::Disconnected)
            } else {
                self.entries.recv_timeout(PAUSE)
            };
            match next {
                Ok(entries) => waiting.extend(entries),
                Err(mpsc::RecvTimeoutError::Timeout) => {}
                Err(mpsc::RecvTimeoutError::Disconnected) if waiting.is_empty() || attempts_left == 0 => return,
                Err(mpsc::RecvTimeoutError::Disconnected) => attempts_left -= 1,
            }
            // What has queued up meanwhile goes into the same transaction.
            waiting.extend(self.entries.try_iter().flatten());
            match self.store.append(&waiting) {
                Ok(()) => {
                    let last = waiting.iter().map(|entry| entry.seq).max().unwrap_or(0);
                    self.durable.fetch_max(last, Ordering::Release);
                    waiting.clear();
                }
                Err(error) => {
                    use std::io::Write as _;
                    // Standard error may be closed; the supervisor sees that nothing becomes durable.
                    let _ = writeln!(std::io::stderr(), "journal: {error}");
                }
            }
        }
    }
}
