//! The store: strategy library, runs and step journal in SQLite or MySQL/MariaDB.
//!
//! One code path on sqlx's `Any`: which database it is follows from the URL alone.
//! Statements keep to what both understand: BIGINT, DOUBLE, VARCHAR, TEXT, UPDATE then
//! INSERT in one transaction. Every call blocks and is bounded by [`OPERATION_MAX`].
//!
//! **Invariant:** when [`Store::append`] has returned, its entries survive `kill -9`; with
//! SQLite (WAL, `synchronous=FULL`) also a power cut, as far as the disk keeps its word.
//! **Invariant:** no number that is not finite reaches a database.
//! **Invariant:** no password appears in a message.

mod error;
mod history;
mod journal;
mod library;
mod schema;
mod url;

pub use error::StoreError;
pub use history::PastRun;
pub use journal::RunRecord;
pub use url::{default_url, shown, state_folder};

use super::{JournalEntry, Library};
use sqlx::any::AnyPoolOptions;
use sqlx::{AnyPool, Connection};
use std::future::Future;
use std::time::Duration;
use tandem_config::StrategyRow;
use tokio::runtime::Runtime;

/// Longest wait for a connection.
const ACQUIRE_MAX: Duration = Duration::from_secs(5);
/// Longest wait for any one call; a hung server has no time-out of its own.
pub const OPERATION_MAX: Duration = Duration::from_secs(40);

/// An open store. Dropping it closes it.
#[derive(Debug)]
pub struct Store {
    runtime: Runtime,
    pool: AnyPool,
    target: url::Target,
}

impl Store {
    /// Opens the database at `url`, makes it if it is SQLite and not there yet, and
    /// brings its tables up to date.
    ///
    /// # Errors
    /// The database cannot be reached or created, or its tables cannot be brought up to date.
    pub fn open(url: &str) -> Result<Self, StoreError> {
        sqlx::any::install_default_drivers();
        let target = url::Target::parse(url)?;
        let runtime =
            tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(StoreError::Runtime)?;
        let pool = Self::within(&runtime, url, "open the database", connect(&target))?;
        let store = Self { runtime, pool, target };
        let migrate = schema::migrate(&store.pool, &store.target);
        store.run("bring the tables up to date", schema::alone(&store.pool, &store.target, migrate))?;
        Ok(store)
    }

    /// Makes the library hold `rows`: rows that came from strategy files before are
    /// replaced by these, rows of other origin stay.
    ///
    /// # Errors
    /// The database does not answer, or a number is not finite.
    pub fn seed(&self, rows: &[StrategyRow]) -> Result<(), StoreError> {
        let sync = library::sync(&self.pool, rows);
        self.run("store the strategy files", schema::alone(&self.pool, &self.target, sync))
    }

    /// The whole strategy library.
    ///
    /// # Errors
    /// The database does not answer, or a row holds a word this program does not know.
    pub fn library(&self) -> Result<Library, StoreError> {
        self.run("read the strategy library", library::read(&self.pool)).map(Library::new)
    }

    /// Adds rows of the user's own; a row of the same id is replaced.
    ///
    /// # Errors
    /// The database does not answer, or a number is not finite.
    pub fn import(&self, rows: &[StrategyRow]) -> Result<(), StoreError> {
        self.run("store strategies", library::import(&self.pool, rows))
    }

    /// Records that a run begins; repeating it changes nothing.
    ///
    /// # Errors
    /// The database does not answer.
    pub fn begin(&self, run: &RunRecord) -> Result<(), StoreError> {
        self.run("record the run", journal::begin(&self.pool, run))
    }

    /// Records how a run ended.
    ///
    /// # Errors
    /// The database does not answer.
    pub fn end(&self, run: &str, outcome: &str) -> Result<(), StoreError> {
        self.run("record the run's end", journal::end(&self.pool, run, outcome))
    }

    /// Writes journal entries in one transaction; durable on return. An entry with a key
    /// that is already there replaces it, so a write in doubt is simply repeated.
    ///
    /// # Errors
    /// The database does not answer (then whether it was written is in doubt: repeat it),
    /// or a number is not finite (then nothing was written).
    pub fn append(&self, entries: &[JournalEntry]) -> Result<(), StoreError> {
        self.run("write the journal", journal::append(&self.pool, entries))
    }

    /// The journal of one run, in the order in which it was written.
    ///
    /// # Errors
    /// The database does not answer.
    pub fn journal(&self, run: &str) -> Result<Vec<JournalEntry>, StoreError> {
        self.run("read the journal", journal::read(&self.pool, run))
    }

    /// The URL without its password.
    pub fn shown_url(&self) -> String {
        shown(&self.target.given)
    }

    fn run<T>(&self, what: &'static str, work: impl Future<Output = Result<T, StoreError>>) -> Result<T, StoreError> {
        Self::within(&self.runtime, &self.target.given, what, work)
    }

    /// Runs `work` to its end or to [`OPERATION_MAX`], and says in a fault where and what it was.
    fn within<T>(
        runtime: &Runtime,
        url: &str,
        what: &'static str,
        work: impl Future<Output = Result<T, StoreError>>,
    ) -> Result<T, StoreError> {
        match runtime.block_on(async { tokio::time::timeout(OPERATION_MAX, work).await }) {
            Ok(Ok(value)) => Ok(value),
            Ok(Err(StoreError::Database(source))) => Err(StoreError::failed(url, what, &source)),
            Ok(Err(other)) => Err(other),
            Err(_) => Err(StoreError::Timeout { url: shown(url), what, limit_s: OPERATION_MAX.as_secs() }),
        }
    }
}

impl Drop for Store {
    fn drop(&mut self) {
        let close = self.pool.close();
        // A server that hangs must not hang us as well.
        let _ = self.runtime.block_on(async { tokio::time::timeout(Duration::from_secs(2), close).await });
    }
}

async fn connect(target: &url::Target) -> Result<AnyPool, StoreError> {
    let sqlite = target.sqlite();
    // A pool keeps trying and then says only that it took too long: one plain connection
    // first tells what is wrong.
    if target.file.is_some() || !sqlite {
        let mut probe = sqlx::AnyConnection::connect(&target.url).await?;
        if sqlite {
            sqlx::query("PRAGMA schema_version").fetch_one(&mut probe).await?;
        }
        probe.close().await?;
    }
    Ok(AnyPoolOptions::new()
        .max_connections(2)
        .acquire_timeout(ACQUIRE_MAX)
        .after_connect(move |connection, _| {
            Box::pin(async move {
                if sqlite {
                    // busy_timeout first: switching to WAL may have to wait for another process.
                    for pragma in [
                        "PRAGMA busy_timeout = 5000",
                        "PRAGMA journal_mode = WAL",
                        "PRAGMA synchronous = FULL",
                        "PRAGMA foreign_keys = ON",
                    ] {
                        sqlx::query(pragma).execute(&mut *connection).await?;
                    }
                }
                Ok(())
            })
        })
        .connect(&target.url)
        .await?)
}
