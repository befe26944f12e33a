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
use std::fs::{File, TryLockError};
use std::path::Path;
use std::time::{Duration, Instant};

static MIGRATIONS: Migrator = sqlx::migrate!("src/strategy/store/migrations");

const LOCK: &str = "SELECT GET_LOCK('tandem_migrate', 30)";
const UNLOCK: &str = "SELECT RELEASE_LOCK('tandem_migrate')";

/// Longest wait for another process that changes tables or library.
const LOCK_MAX: Duration = Duration::from_secs(30);

/// Does `work` while no other process changes tables or library.
pub(super) async fn alone<T>(
    pool: &AnyPool,
    target: &Target,
    work: impl Future<Output = Result<T, StoreError>>,
) -> Result<T, StoreError> {
    if let Some(database) = &target.file {
        let _lock = lock_beside(database).await?;
        return work.await;
    }
    if target.sqlite() {
        return work.await;
    }
    let mut connection = pool.acquire().await?;
    let locked: Option<i64> = sqlx::query(LOCK).fetch_one(&mut *connection).await?.try_get(0)?;
    if locked != Some(1) {
        return Err(StoreError::Locked);
    }
    let done = work.await;
    sqlx::query(UNLOCK).fetch_one(&mut *connection).await?;
    done
}

/// Locks `<database>.lock` until the file is dropped.
async fn lock_beside(database: &Path) -> Result<File, StoreError> {
    let mut path = database.as_os_str().to_owned();
    path.push(".lock");
    let fault = |error: std::io::Error| StoreError::Folder {
        path: path.to_string_lossy().into_owned(),
        why: error.to_string(),
    };
    let file = File::options().create(true).append(true).open(&path).map_err(fault)?;
    let began = Instant::now();
    loop {
        match file.try_lock() {
            Ok(()) => return Ok(file),
            Err(TryLockError::Error(error)) => return Err(fault(error)),
            Err(TryLockError::WouldBlock) if began.elapsed() > LOCK_MAX => return Err(StoreError::Locked),
            Err(TryLockError::WouldBlock) => tokio::time::sleep(Duration::from_millis(5)).await,
        }
    }
}

pub(super) async fn migrate(pool: &AnyPool, target: &Target) -> Result<(), StoreError> {
    let mut connection = pool.acquire().await?;
    run(&mut connection, target).await
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
