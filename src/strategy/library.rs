//! The strategy library: which strategies are known, and which one fits.
//!
//! Class, mode, tool, focus and flexibility must agree; a quantity outside a row's
//! range lowers the row's score by how far it lies outside. The best row wins when it
//! reaches [`SCORE_MIN`]; among equals the narrower row, then the smaller id, so that
//! the answer depends on nothing but the rows and the question.

use std::fmt;
use tandem_config::{AssemblyMode, Focus, Range, StrategyRow};
use tandem_msg::{FeatureClass, Tool};

/// A row below this fits too badly to be used unasked.
pub(super) const SCORE_MIN: f64 = 0.6;

/// The question: what was recognised, how it is joined, and who is to do it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Situation {
    /// Class of the feature.
    pub class: FeatureClass,
    /// Its diameter, metres.
    pub diameter: f64,
    /// Its length, metres.
    pub length: f64,
    /// Mode, from the reference table.
    pub mode: AssemblyMode,
    /// Tool, from the reference table.
    pub tool: Tool,
    /// Who does the final assembly, from the capability check.
    pub focus: Focus,
    /// Distance between the part and the person at work, metres.
    pub distance: f64,
    /// Mass of the part, kg.
    pub mass: f64,
    /// Whether the part bends.
    pub flexible: bool,
}

/// The strategy that fits best.
#[derive(Clone, Debug, PartialEq)]
pub struct Match {
    /// The row.
    pub row: StrategyRow,
    /// 1 when every quantity lies in its range, less the farther it lies outside; above 0.
    pub score: f64,
    /// Why this one, in words.
    pub explanation: String,
}

/// No strategy fits; says what came nearest.
#[derive(Clone, Debug, PartialEq)]
pub struct NoMatch {
    /// The question.
    pub situation: Situation,
    /// Id and score of the best row of the right class, mode, tool and focus.
    pub nearest: Option<(String, f64)>,
}

impl fmt::Display for NoMatch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Situation { class, mode, tool, focus, .. } = self.situation;
        write!(f, "no {focus}-focused strategy for {class}, {mode}, {tool}")?;
        match &self.nearest {
            Some((id, score)) => write!(f, "; nearest is {id} with score {score:.2}, needed {SCORE_MIN:.2}"),
            None => f.write_str("; the library has no row of that kind"),
        }
    }
}

impl std::error::Error for NoMatch {}

/// The library in memory, as read from the store when the run began.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Library {
    rows: Vec<StrategyRow>,
}

impl Library {
    /// A library of these rows; their order does not matter.
    pub fn new(mut rows: Vec<StrategyRow>) -> Self {
        rows.sort_by(|a, b| a.id.cmp(&b.id));
        Self { rows }
    }

    /// The rows, in the order of their ids.
    pub fn rows(&self) -> &[StrategyRow] {
        &self.rows
    }

    /// How many rows there are.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The strategy that fits best.
    ///
    /// # Errors
    /// [`NoMatch`] when no row reaches [`SCORE_MIN`].
    pub fn retrieve(&self, situation: &Situation) -> Result<Match, NoMatch> {
        let mut best: Option<(f64, f64, &StrategyRow)> = None;
        for row in self.rows.iter().filter(|row| applies(row, situation)) {
            let score = score(row, situation);
            let width =
                row.distance.max - row.distance.min + row.mass.max - row.mass.min + row.diameter.max - row.diameter.min;
            let better = best.is_none_or(|(s, w, _)| score > s || (score == s && width < w));
            if score.is_finite() && better {
                best = Some((score, width, row));
            }
        }
        match best {
            Some((score, _, row)) if score >= SCORE_MIN => {
                Ok(Match { row: row.clone(), score, explanation: explain(row, situation) })
            }
            _ => Err(NoMatch { situation: *situation, nearest: best.map(|(score, _, row)| (row.id.clone(), score)) }),
        }
    }
}

fn applies(row: &StrategyRow, situation: &Situation) -> bool {
    row.class == situation.class
        && row.mode == situation.mode
        && row.tool == situation.tool
        && row.focus == situation.focus
        && row.flexible.is_none_or(|flexible| flexible == situation.flexible)
}

fn score(row: &StrategyRow, situation: &Situation) -> f64 {
    membership(&row.diameter, situation.diameter)
        * membership(&row.length, situation.length)
        * membership(&row.distance, situation.distance)
        * membership(&row.mass, situation.mass)
}

/// 1 inside the range; outside, e to the minus twice the excess in units of the nearer bound.
fn membership(range: &Range, value: f64) -> f64 {
    if range.contains(value) {
        return 1.0;
    }
    let (excess, bound) =
        if value > range.max { (value - range.max, range.max) } else { (range.min - value, range.min) };
    (-2.0 * excess / bound.abs().max(1e-3)).exp()
}

fn explain(row: &StrategyRow, situation: &Situation) -> String {
    let mut out = format!("{} {} with {}", row.class, row.mode, row.tool);
    for (name, range, value, unit, scale) in [
        ("diameter", &row.diameter, situation.diameter, "mm", 1e3),
        ("length", &row.length, situation.length, "mm", 1e3),
        ("distance", &row.distance, situation.distance, "m", 1.0),
        ("mass", &row.mass, situation.mass, "kg", 1.0),
    ] {
        if *range != Range::ALL {
            let (min, max, value) = (range.min * scale, range.max * scale, value * scale);
            let verb = if range.contains(value / scale) { "in" } else { "outside" };
            out.push_str(&format!(", {name} {value:.2} {unit} {verb} {min}..={max}"));
        }
    }
    out
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use proptest::prelude::*;
    use tandem_config::{Cell, Form};

    /// The shipped cell.
    pub(crate) fn shipped() -> Cell {
        let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("config/cells/s471.toml");
        Cell::load(&file, None).unwrap_or_else(|faults| panic!("{faults}"))
    }

    fn cable() -> Situation {
        Situation {
            class: FeatureClass::Cone,
            diameter: 0.03,
            length: 0.0,
            mode: AssemblyMode::Taper,
            tool: Tool::ParallelGripper,
            focus: Focus::Human,
            distance: 1.36,
            mass: 2.4,
            flexible: true,
        }
    }

    #[test]
    fn mass_and_distance_choose_the_form() {
        let library = Library::new(shipped().strategies);
        let form = |situation| library.retrieve(&situation).map(|found| (found.row.form, found.score));
        assert_eq!(form(cable()), Ok((Form::Hold, 1.0)));
        assert_eq!(form(Situation { mass: 0.4, ..cable() }), Ok((Form::HandOver, 1.0)));
        assert_eq!(form(Situation { mass: 0.4, distance: 0.7, ..cable() }), Ok((Form::Alone, 1.0)));
    }

    #[test]
    fn an_answer_explains_itself() {
        let library = Library::new(shipped().strategies);
        let found = library.retrieve(&cable()).map(|found| found.explanation);
        assert_eq!(found.as_deref(), Ok("cone taper with parallel_gripper, mass 2.40 kg in 2..=8"));
    }

    #[test]
    fn what_is_not_known_is_said() {
        let library = Library::new(shipped().strategies);
        let question = Situation { focus: Focus::Robot, ..cable() };
        let message = library.retrieve(&question).map_err(|error| error.to_string());
        assert_eq!(
            message.map(|found| found.row.id),
            Err("no robot-focused strategy for cone, taper, parallel_gripper; the library has no row of that kind"
                .into())
        );
        let question = Situation { mass: f64::NAN, ..cable() };
        assert!(library.retrieve(&question).is_err(), "a mass that is not finite matches nothing");
    }

    proptest! {
        /// The answer does not depend on the order of the rows.
        #[test]
        fn retrieval_ignores_row_order(distance in 0.0..3.0f64, mass in 0.0..12.0f64, turn in 0usize..200) {
            let mut rows = shipped().strategies;
            let question = Situation { distance, mass, ..cable() };
            let first = Library::new(rows.clone()).retrieve(&question);
            let count = rows.len();
            rows.rotate_left(turn % count);
            prop_assert_eq!(Library::new(rows).retrieve(&question), first);
        }
    }
}
