//! Runs and the step journal in the database.

use super::error::StoreError;
use crate::strategy::{JournalEntry, StepState};
use sqlx::AnyPool;
use sqlx::Row;

/// A run as it is recorded when it begins.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunRecord {
    /// Identity, lower case.
    pub id: String,
    /// Cell.
    pub cell: String,
    /// Product.
    pub product: String,
    /// Hash of the configuration.
    pub config_hash: u64,
    /// Seed.
    pub seed: u64,
    /// Boxes asked for.
    pub boxes: u32,
    /// Wall clock at the start, nanoseconds since the epoch.
    pub started_ns: i64,
}

pub(super) async fn begin(pool: &AnyPool, run: &RunRecord) -> Result<(), StoreError> {
    // One statement, so that two cells that start on one file wait for each other: SQLite
    // refuses at once what first reads and then writes while another writes.
    let written = sqlx::query("INSERT INTO run VALUES (?, ?, ?, ?, ?, ?, ?, ?)")
        .bind(run.id.to_lowercase())
        .bind(run.cell.to_lowercase())
        .bind(run.product.to_lowercase())
        .bind(format!("{:016x}", run.config_hash))
        // Seeds use all 64 bits; the database's integers are signed.
        .bind(run.seed.cast_signed())
        .bind(i64::from(run.boxes))
        .bind(run.started_ns)
        .bind("running")
        .execute(pool)
        .await;
    match written {
        Err(sqlx::Error::Database(error)) if error.is_unique_violation() => Ok(()),
        other => Ok(other.map(|_| ())?),
    }
}

pub(super) async fn end(pool: &AnyPool, run: &str, outcome: &str) -> Result<(), StoreError> {
    let update = sqlx::query("UPDATE run SET outcome = ? WHERE id = ?").bind(outcome).bind(run.to_lowercase());
    update.execute(pool).await?;
    Ok(())
}

pub(super) async fn append(pool: &AnyPool, entries: &[JournalEntry]) -> Result<(), StoreError> {
    entries.iter().try_for_each(check)?;
    if entries.is_empty() {
        return Ok(());
    }
    let mut transaction = pool.begin().await?;
    for entry in entries {
        let serial = entry.serial.to_lowercase();
        let updated = bind_values(sqlx::query(UPDATE), entry)
            .bind(&serial)
            .bind(i64::from(entry.step))
            .bind(i64::from(entry.attempt))
            .execute(&mut *transaction)
            .await?
            .rows_affected();
        if updated == 0 {
            bind_values(sqlx::query(INSERT), entry)
                .bind(&serial)
                .bind(i64::from(entry.step))
                .bind(i64::from(entry.attempt))
                .execute(&mut *transaction)
                .await?;
        }
    }
    Ok(transaction.commit().await?)
}

const UPDATE: &str = "UPDATE step_journal SET run = ?, seq = ?, part = ?, state = ?, time_s = ?, duration_s = ?, \
    subject = ?, class = ?, confidence = ?, mode = ?, tool = ?, form = ?, strategy = ?, clearance_min_m = ?, \
    remark = ? WHERE serial = ? AND step = ? AND attempt = ?";
const INSERT: &str = "INSERT INTO step_journal (run, seq, part, state, time_s, duration_s, subject, class, \
    confidence, mode, tool, form, strategy, clearance_min_m, remark, serial, step, attempt) \
    VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)";

type AnyQuery<'q> = sqlx::query::Query<'q, sqlx::Any, sqlx::any::AnyArguments>;

/// Binds everything but the key, in the order both statements share.
fn bind_values<'q>(query: AnyQuery<'q>, entry: &JournalEntry) -> AnyQuery<'q> {
    query
        .bind(entry.run.to_lowercase())
        .bind(entry.seq.cast_signed())
        .bind(entry.part.clone())
        .bind(entry.state.name())
        .bind(entry.time_s)
        .bind(entry.duration_s)
        .bind(entry.subject.clone())
        .bind(entry.class.clone())
        .bind(entry.confidence)
        .bind(entry.mode.clone())
        .bind(entry.tool.clone())
        .bind(entry.form.clone())
        .bind(entry.strategy.clone())
        .bind(entry.clearance_min_m)
        .bind(entry.remark.clone())
}

fn check(entry: &JournalEntry) -> Result<(), StoreError> {
    for (field, value) in [
        ("time_s", entry.time_s),
        ("duration_s", entry.duration_s),
        ("confidence", entry.confidence),
        ("clearance_min_m", entry.clearance_min_m.unwrap_or(0.0)),
    ] {
        if !value.is_finite() {
            let key = format!("journal {}/{}/{}", entry.serial, entry.step, entry.attempt);
            return Err(StoreError::NotFinite { key, field, value });
        }
    }
    Ok(())
}

pub(super) async fn read(pool: &AnyPool, run: &str) -> Result<Vec<JournalEntry>, StoreError> {
    let query = sqlx::query("SELECT * FROM step_journal WHERE run = ? ORDER BY seq").bind(run.to_lowercase());
    let mut entries = Vec::new();
    for row in query.fetch_all(pool).await? {
        let serial: String = row.try_get("serial")?;
        let state: String = row.try_get("state")?;
        entries.push(JournalEntry {
            seq: row.try_get::<i64, _>("seq")?.cast_unsigned(),
            run: row.try_get("run")?,
            step: u32::try_from(row.try_get::<i64, _>("step")?).unwrap_or(u32::MAX),
            attempt: u32::try_from(row.try_get::<i64, _>("attempt")?).unwrap_or(u32::MAX),
            part: row.try_get("part")?,
            state: StepState::named(&state).ok_or_else(|| StoreError::UnknownWord {
                id: serial.clone(),
                field: "state",
                value: state.clone(),
                allowed: "started, done, taken_over, failed".into(),
            })?,
            serial,
            time_s: row.try_get("time_s")?,
            duration_s: row.try_get("duration_s")?,
            subject: row.try_get("subject")?,
            class: row.try_get("class")?,
            confidence: row.try_get("confidence")?,
            mode: row.try_get("mode")?,
            tool: row.try_get("tool")?,
            form: row.try_get("form")?,
            strategy: row.try_get("strategy")?,
            clearance_min_m: row.try_get("clearance_min_m")?,
            remark: row.try_get("remark")?,
        });
    }
    Ok(entries)
}
