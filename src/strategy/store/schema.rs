//! Brings the tables up to date, one process at a time.
//!
//! sqlx's own lock guards nothing on either database, and MariaDB cannot roll a
//! definition back: so one statement a file, and a lock of ours around all of them.

use super::error::StoreError;
use super::url::{Target, shown};
use sqlx::AnyPool;
use sqlx::migrate::{MigrateError, Migrator};
use sqlx::pool::PoolConnection;
use sqlx::{Any, Row};
use std::fs::File;

static MIGRATIONS: Migrator = sqlx::migrate!("src/strategy/store/migrations");

const LOCK: &str = "SELECT GET_LOCK('tandem_migrate', 30)";
const UNLOCK: &str = "SELECT RELEASE_LOCK('tandem_migrate')";

/// Holds `<database>.lock` while it lives; nothing where there is no file.
pub(super) struct FileLock {
    _file: Option<File>,
}

impl FileLock {
    /// Waits until no other process has it.
    pub(super) fn take(target: &Target) -> Result<Self, StoreError> {
        let Some(database) = &target.file else {
            return Ok(Self { _file: None });
        };
        let mut path = database.clone().into_os_string();
        path.push(".lock");
        let fault = |error: std::io::Error| StoreError::Folder {
            path: path.to_string_lossy().into_owned(),
            why: error.to_string(),
        };
        let file = File::options().create(true).append(true).open(&path).map_err(fault)?;
        file.lock().map_err(fault)?;
        Ok(Self { _file: Some(file) })
    }
}

pub(super) async fn migrate(pool: &AnyPool, target: &Target) -> Result<(), StoreError> {
    let mut connection = pool.acquire().await?;
    if target.sqlite() {
        return run(&mut connection, target).await;
    }
    let locked: Option<i64> = sqlx::query(LOCK).fetch_one(&mut *connection).await?.try_get(0)?;
    if locked != Some(1) {
        return Err(StoreError::Locked);
    }
    let done = run(&mut connection, target).await;
    sqlx::query(UNLOCK).fetch_one(&mut *connection).await?;
    done
}

async fn run(connection: &mut PoolConnection<Any>, target: &Target) -> Result<(), StoreError> {
    let mut migrator = Migrator { migrations: MIGRATIONS.migrations.clone(), ..Migrator::DEFAULT };
    migrator.set_locking(false);
    migrator.run(&mut **connection).await.map_err(|error| match error {
        MigrateError::Dirty(version) => StoreError::Dirty { url: shown(&target.url), version },
        MigrateError::VersionMismatch(version)
        | MigrateError::VersionMissing(version)
        | MigrateError::VersionTooNew(version, _)
        | MigrateError::VersionTooOld(version, _) => StoreError::Version { url: shown(&target.url), version },
        MigrateError::Execute(source) | MigrateError::ExecuteMigration(source, _) => StoreError::Database(source),
        other => StoreError::Database(sqlx::Error::Migrate(Box::new(other))),
    })
}
