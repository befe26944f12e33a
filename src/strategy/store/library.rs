//! Strategies in the database.

use super::error::StoreError;
use sqlx::any::AnyRow;
use sqlx::{Any, AnyPool, Row, Transaction};
use tandem_config::{Range, Step, StrategyRow};
use tandem_msg::Coded;

/// Rows that came from strategy files; they follow the files.
const FILE: &str = "file";
/// Rows the user brought in by hand; they stay.
const IMPORTED: &str = "imported";

/// Makes the rows of origin `file` equal to `seeds`.
pub(super) async fn sync(pool: &AnyPool, seeds: &[StrategyRow]) -> Result<(), StoreError> {
    seeds.iter().try_for_each(check)?;
    let mut stored = read_where(pool, "SELECT * FROM strategy WHERE origin = 'file' ORDER BY id").await?;
    let mut wanted = seeds.to_vec();
    wanted.sort_by(|a, b| a.id.cmp(&b.id));
    stored.sort_by(|a, b| a.id.cmp(&b.id));
    if stored == wanted {
        return Ok(());
    }
    let mut transaction = pool.begin().await?;
    for row in &stored {
        delete(&mut transaction, &row.id).await?;
    }
    for row in &wanted {
        // A row the user brought in under the same id keeps its place.
        let taken = sqlx::query("SELECT id FROM strategy WHERE id = ?").bind(&row.id);
        if taken.fetch_optional(&mut *transaction).await?.is_none() {
            insert(&mut transaction, row, FILE).await?;
        }
    }
    Ok(transaction.commit().await?)
}

/// Adds or replaces rows of the user's own.
pub(super) async fn import(pool: &AnyPool, rows: &[StrategyRow]) -> Result<(), StoreError> {
    rows.iter().try_for_each(check)?;
    let mut transaction = pool.begin().await?;
    for row in rows {
        delete(&mut transaction, &row.id).await?;
        insert(&mut transaction, row, IMPORTED).await?;
    }
    Ok(transaction.commit().await?)
}

/// Every row with its actions.
pub(super) async fn read(pool: &AnyPool) -> Result<Vec<StrategyRow>, StoreError> {
    read_where(pool, "SELECT * FROM strategy ORDER BY id").await
}

fn check(row: &StrategyRow) -> Result<(), StoreError> {
    for (field, range) in
        [("diameter", row.diameter), ("length", row.length), ("distance", row.distance), ("mass", row.mass)]
    {
        for value in [range.min, range.max] {
            if !value.is_finite() {
                return Err(StoreError::NotFinite { key: format!("strategy {}", row.id), field, value });
            }
        }
    }
    Ok(())
}

async fn delete(transaction: &mut Transaction<'_, Any>, id: &str) -> Result<(), StoreError> {
    sqlx::query("DELETE FROM strategy_action WHERE strategy_id = ?").bind(id).execute(&mut **transaction).await?;
    sqlx::query("DELETE FROM strategy WHERE id = ?").bind(id).execute(&mut **transaction).await?;
    Ok(())
}

async fn insert(transaction: &mut Transaction<'_, Any>, row: &StrategyRow, origin: &str) -> Result<(), StoreError> {
    sqlx::query("INSERT INTO strategy VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)")
        .bind(row.id.to_lowercase())
        .bind(origin)
        .bind(row.class.name())
        .bind(row.mode.name())
        .bind(row.tool.name())
        .bind(row.focus.name())
        .bind(row.form.name())
        .bind(row.diameter.min)
        .bind(row.diameter.max)
        .bind(row.length.min)
        .bind(row.length.max)
        .bind(row.distance.min)
        .bind(row.distance.max)
        .bind(row.mass.min)
        .bind(row.mass.max)
        .bind(row.flexible.map_or(-1, i64::from))
        .execute(&mut **transaction)
        .await?;
    for (place, step) in row.steps.iter().enumerate() {
        sqlx::query("INSERT INTO strategy_action VALUES (?, ?, ?, ?)")
            .bind(row.id.to_lowercase())
            .bind(place as i64)
            .bind(step.subject.name())
            .bind(step.verb.name())
            .execute(&mut **transaction)
            .await?;
    }
    Ok(())
}

async fn read_where(pool: &AnyPool, query: &'static str) -> Result<Vec<StrategyRow>, StoreError> {
    let mut actions: Vec<(String, Step)> = Vec::new();
    for row in sqlx::query("SELECT * FROM strategy_action ORDER BY strategy_id, place").fetch_all(pool).await? {
        let id: String = row.try_get("strategy_id")?;
        let step = Step { subject: word(&id, &row, "subject")?, verb: word(&id, &row, "verb")? };
        actions.push((id, step));
    }
    let mut rows = Vec::new();
    for row in sqlx::query(query).fetch_all(pool).await? {
        let id: String = row.try_get("id")?;
        let steps = actions.iter().filter(|(of, _)| *of == id).map(|(_, step)| *step).collect();
        let flexible: i64 = row.try_get("flexible")?;
        rows.push(StrategyRow {
            class: word(&id, &row, "class")?,
            mode: word(&id, &row, "mode")?,
            tool: word(&id, &row, "tool")?,
            focus: word(&id, &row, "focus")?,
            form: word(&id, &row, "form")?,
            diameter: Range { min: row.try_get("diameter_min_m")?, max: row.try_get("diameter_max_m")? },
            length: Range { min: row.try_get("length_min_m")?, max: row.try_get("length_max_m")? },
            distance: Range { min: row.try_get("distance_min_m")?, max: row.try_get("distance_max_m")? },
            mass: Range { min: row.try_get("mass_min_kg")?, max: row.try_get("mass_max_kg")? },
            flexible: (flexible >= 0).then_some(flexible == 1),
            id,
            steps,
        });
    }
    Ok(rows)
}

/// The variant a column names.
fn word<T: Coded>(id: &str, row: &AnyRow, field: &'static str) -> Result<T, StoreError> {
    let value: String = row.try_get(field)?;
    T::named(&value).ok_or_else(|| StoreError::UnknownWord {
        id: id.to_owned(),
        field,
        value,
        allowed: T::ALL.iter().map(|variant| variant.name()).collect::<Vec<_>>().join(", "),
    })
}
