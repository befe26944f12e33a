//! What can go wrong with a store, and what to do about it.

use super::url::shown;
use thiserror::Error;

/// A fault of the store. No message holds a password.
#[derive(Debug, Error)]
pub enum StoreError {
    /// The URL names no database this program speaks to.
    #[error("store.url = \"{url}\", allowed sqlite://FILE or mysql://USER@HOST/DATABASE; write it so")]
    Url {
        /// The URL, password hidden.
        url: String,
    },
    /// There is no folder for the default database.
    #[error(
        "no folder for the store: neither XDG_STATE_HOME nor HOME is set; set one of them, or `[store] url` in the cell file"
    )]
    NoStateFolder,
    /// The folder of the database cannot be made or locked.
    #[error("{path}: {why}; make the folder writable, or set `[store] url` in the cell file")]
    Folder {
        /// The folder or lock file.
        path: String,
        /// The operating system's words.
        why: String,
    },
    /// The runtime that speaks to the database cannot start.
    #[error("the store's runtime cannot start: {0}; see the process's limits")]
    Runtime(std::io::Error),
    /// The database did not answer in time.
    #[error("{url}: could not {what} within {limit_s} s; see whether the server runs and its disk is not full")]
    Timeout {
        /// The URL, password hidden.
        url: String,
        /// What was attempted.
        what: &'static str,
        /// The limit, seconds.
        limit_s: u64,
    },
    /// Another process holds the migration lock.
    #[error("another process has been changing the store's tables for 30 s; wait for it, or end it, and start again")]
    Locked,
    /// An earlier migration was interrupted.
    #[error(
        "{url}: migration {version} was left half done; restore the database from a copy, or drop what it made and its row in _sqlx_migrations"
    )]
    Dirty {
        /// The URL, password hidden.
        url: String,
        /// Number of the migration.
        version: i64,
    },
    /// The tables were made by another version of this program.
    #[error(
        "{url}: the tables do not fit this program (migration {version}); use the program that made them, or another database"
    )]
    Version {
        /// The URL, password hidden.
        url: String,
        /// Number of the migration.
        version: i64,
    },
    /// A number that no database may see.
    #[error("{key}: {field} = {value}, allowed finite numbers; nothing was written")]
    NotFinite {
        /// Row it belongs to.
        key: String,
        /// Column.
        field: &'static str,
        /// The value.
        value: f64,
    },
    /// A row holds a word this program does not know.
    #[error("strategy {id}: {field} = \"{value}\", allowed {allowed}; mend or delete the row")]
    UnknownWord {
        /// Row.
        id: String,
        /// Column.
        field: &'static str,
        /// What it holds.
        value: String,
        /// What it may hold.
        allowed: String,
    },
    /// The database refused.
    #[error("{url}: could not {what}: {why}; {advice}")]
    Failed {
        /// The URL, password hidden.
        url: String,
        /// What was attempted.
        what: &'static str,
        /// The database's words.
        why: String,
        /// What to do.
        advice: &'static str,
    },
    /// The database's own error, before the place is known; never leaves the store.
    #[error(transparent)]
    Database(#[from] sqlx::Error),
}

impl StoreError {
    /// An error of the database with its place and a remedy.
    pub(super) fn failed(url: &str, what: &'static str, source: &sqlx::Error) -> Self {
        let why = match source {
            sqlx::Error::PoolTimedOut => "no connection within 5 s".to_owned(),
            other => other.to_string(),
        };
        let low = why.to_lowercase();
        let advice = if low.contains("unable to open database file") || low.contains("(code: 14)") {
            "name a file in a folder that exists and is writable"
        } else if low.contains("not a database") || low.contains("malformed") {
            "the file is damaged or something else: restore it from a copy, or name another file"
        } else if low.contains("readonly") || low.contains("permission") {
            "make the file writable"
        } else if low.contains("access denied") {
            "see user name, password and grants in the URL"
        } else if low.contains("unknown database") {
            "create the database first"
        } else if low.contains("full") {
            "free some disk space"
        } else {
            "see whether the database runs and the URL is right"
        };
        Self::Failed { url: shown(url), what, why, advice }
    }
}
