//! Tables and CSV of the journal.

use comfy_table::{Cell, CellAlignment, Table, presets};

use crate::strategy::JournalEntry;

const COLUMNS: [&str; 14] = [
    "serial",
    "step",
    "attempt",
    "part",
    "state",
    "time_s",
    "duration_s",
    "subject",
    "class",
    "confidence",
    "mode",
    "tool",
    "form",
    "clearance_min_m",
];

fn fields(step: &JournalEntry) -> [String; 14] {
    [
        step.serial.clone(),
        (step.step + 1).to_string(),
        step.attempt.to_string(),
        step.part.clone(),
        step.state.name().to_owned(),
        format!("{:.2}", step.time_s),
        format!("{:.2}", step.duration_s),
        step.subject.clone(),
        step.class.clone(),
        format!("{:.3}", step.confidence),
        step.mode.clone(),
        step.tool.clone(),
        step.form.clone(),
        step.clearance_min_m.map(|clearance| format!("{clearance:.3}")).unwrap_or_default(),
    ]
}

/// The steps for the screen.
pub(super) fn steps(steps: &[JournalEntry]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_header(COLUMNS);
    for step in steps {
        table.add_row(fields(step).map(|field| {
            let numeric = field.parse::<f64>().is_ok();
            Cell::new(field).set_alignment(if numeric { CellAlignment::Right } else { CellAlignment::Left })
        }));
    }
    table
}

/// The steps as CSV with a header line, remarks last.
pub(super) fn csv(steps: &[JournalEntry]) -> String {
    let mut text = COLUMNS.join(",") + ",run,strategy,remark\n";
    for step in steps {
        let more = [step.run.clone(), step.strategy.clone(), step.remark.clone()];
        let line: Vec<String> = fields(step).into_iter().chain(more).map(|field| quoted(&field)).collect();
        text += &line.join(",");
        text.push('\n');
    }
    text
}

/// A CSV field, quoted when it holds a separator.
fn quoted(field: &str) -> String {
    if field.contains([',', '"', '\n']) { format!("\"{}\"", field.replace('"', "\"\"")) } else { field.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::quoted;

    #[test]
    fn a_field_with_separators_survives_csv() {
        assert_eq!(quoted("plain"), "plain");
        assert_eq!(quoted("a, \"b\""), "\"a, \"\"b\"\"\"");
    }
}
