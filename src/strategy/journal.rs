//! The step journal: what was done to each serial number, by whom, and how it ended.

use serde::Serialize;

/// How an attempt at a step stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum StepState {
    /// Begun; after a crash: inspect before resuming.
    Started,
    /// Finished as the strategy says.
    Done,
    /// Finished by hand, because the planned way failed.
    TakenOver,
    /// Given up.
    Failed,
}

impl StepState {
    /// The word in the database.
    pub fn name(self) -> &'static str {
        match self {
            Self::Started => "started",
            Self::Done => "done",
            Self::TakenOver => "taken_over",
            Self::Failed => "failed",
        }
    }

    /// The state of that word.
    pub fn named(name: &str) -> Option<Self> {
        [Self::Started, Self::Done, Self::TakenOver, Self::Failed].into_iter().find(|state| state.name() == name)
    }
}

/// One line of the journal. `(serial, step, attempt)` is its key: writing the same key
/// again replaces the line, so a write in doubt is simply repeated.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JournalEntry {
    /// Counts the supervisor's entries from 1; the store reports the highest that is durable.
    pub seq: u64,
    /// Run this belongs to.
    pub run: String,
    /// Serial number of the box.
    pub serial: String,
    /// Step: index of the part in the product.
    pub step: u32,
    /// Attempt at it, from 1.
    pub attempt: u32,
    /// Name of the part.
    pub part: String,
    /// How it stands.
    pub state: StepState,
    /// Cell clock since the run began, s.
    pub time_s: f64,
    /// Duration of the attempt so far, s.
    pub duration_s: f64,
    /// Who: `robot` or `human`; empty before that is decided.
    pub subject: String,
    /// Recognised class; empty before that.
    pub class: String,
    /// Confidence of the recognition, 0 to 1; 0 before that.
    pub confidence: f64,
    /// Assembly mode; empty before that is decided.
    pub mode: String,
    /// Tool; empty before that is decided.
    pub tool: String,
    /// Form of cooperation; empty before that is decided.
    pub form: String,
    /// Strategy's id; empty before that is decided.
    pub strategy: String,
    /// Smallest clearance of the attempt, metres; `None` when the arm did not move.
    pub clearance_min_m: Option<f64>,
    /// The person's word, or why the attempt failed; empty when there is nothing to say.
    pub remark: String,
}
