//! What runs there were.

use sqlx::Row;

use super::{RunRecord, Store, StoreError};

/// A run and how it ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PastRun {
    /// As it was recorded at its beginning.
    pub record: RunRecord,
    /// How it ended; `running` while it has not, or when it never could say.
    pub outcome: String,
}

impl Store {
    /// Every run, the newest first.
    ///
    /// # Errors
    /// The database does not answer.
    pub fn runs(&self) -> Result<Vec<PastRun>, StoreError> {
        let select =
            "SELECT id, cell, product, config_hash, seed, boxes, started_ns, outcome FROM run ORDER BY started_ns DESC";
        let rows = self.run("list the runs", async { Ok(sqlx::query(select).fetch_all(&self.pool).await?) })?;
        let read = |row: &sqlx::any::AnyRow| -> Result<PastRun, sqlx::Error> {
            Ok(PastRun {
                record: RunRecord {
                    id: row.try_get(0)?,
                    cell: row.try_get(1)?,
                    product: row.try_get(2)?,
                    config_hash: u64::from_str_radix(&row.try_get::<String, _>(3)?, 16).unwrap_or_default(),
                    seed: row.try_get::<i64, _>(4)?.cast_unsigned(),
                    boxes: u32::try_from(row.try_get::<i64, _>(5)?).unwrap_or_default(),
                    started_ns: row.try_get(6)?,
                },
                outcome: row.try_get(7)?,
            })
        };
        rows.iter()
            .map(read)
            .collect::<Result<_, _>>()
            .map_err(|error| StoreError::failed(&self.target.given, "list the runs", &error))
    }
}
