//! Which running cell is meant.

use std::path::Path;

use tandem_config::Cell;

use crate::live::{RunningCell, running_cells};

/// Why no running cell is meant, or more than one.
#[derive(Debug, thiserror::Error)]
pub enum FindError {
    /// None that fits.
    #[error("{} is not running{}", wanted.as_deref().unwrap_or("a cell"), others(running))]
    NotRunning {
        /// What was asked for.
        wanted: Option<String>,
        /// Those that run.
        running: Vec<String>,
    },
    /// More than one fits.
    #[error("more than one cell is running; say which: {}", running.join(", "))]
    Ambiguous {
        /// Those that fit.
        running: Vec<String>,
    },
    /// The cell file is refused.
    #[error("{0}")]
    Config(tandem_config::Faults),
}

fn others(running: &[String]) -> String {
    if running.is_empty() {
        "; start one with `tandem run CELL.toml`".to_owned()
    } else {
        format!("; these are: {}", running.join(", "))
    }
}

/// The running cell of that name, instance or cell file; without any, the one that runs.
///
/// # Errors
/// There is none, there are several, or the cell file is refused.
pub fn find(wanted: Option<&str>) -> Result<RunningCell, FindError> {
    let name = match wanted {
        Some(file) if file.ends_with(".toml") => {
            Some(Cell::load(Path::new(file), None).map_err(FindError::Config)?.name)
        }
        other => other.map(str::to_owned),
    };
    let running = running_cells();
    let names = |cells: &[RunningCell]| cells.iter().map(|cell| cell.name().to_owned()).collect::<Vec<_>>();
    let all = names(&running);
    let mut fitting: Vec<RunningCell> =
        running.into_iter().filter(|cell| name.as_deref().is_none_or(|name| fits(cell.name(), name))).collect();
    match (fitting.pop(), fitting.as_slice()) {
        (None, _) => Err(FindError::NotRunning { wanted: wanted.map(str::to_owned), running: all }),
        (Some(only), []) => Ok(only),
        (Some(last), _) => {
            Err(FindError::Ambiguous { running: names(&fitting).into_iter().chain([last.name().to_owned()]).collect() })
        }
    }
}

/// Whether an instance is the one of that name, or of a cell of that name.
fn fits(instance: &str, name: &str) -> bool {
    // cell-process-time; the cell's name without what an instance cannot hold, and cut.
    let cell = instance.rsplitn(3, '-').last().unwrap_or_default();
    let plain: String = name.chars().filter(|c| c.is_ascii_lowercase() || c.is_ascii_digit()).collect();
    instance == name || (!cell.is_empty() && plain.starts_with(cell) && (plain == cell || cell.len() >= CELL_LENGTH))
}

/// As much of a cell's name as stands in its instance.
const CELL_LENGTH: usize = 12;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_is_known_by_its_name_or_its_instance() {
        assert!(fits("s471-12-ab", "s471") && fits("s471-12-ab", "s471-12-ab"));
        assert!(!fits("s471-12-ab", "s472") && !fits("s471-12-ab", "s4711") && !fits("s471-12-ab", ""));
        assert!(fits("alongcellnam-12-ab", "a long cell name"));
    }

    #[test]
    fn what_is_not_running_is_said_with_what_is() {
        let none = FindError::NotRunning { wanted: Some("s471".to_owned()), running: Vec::new() };
        assert_eq!(none.to_string(), "s471 is not running; start one with `tandem run CELL.toml`");
        let other = FindError::NotRunning { wanted: None, running: vec!["s472-1-a".to_owned()] };
        assert_eq!(other.to_string(), "a cell is not running; these are: s472-1-a");
    }
}
