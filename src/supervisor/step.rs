//! The step in hand: one part, its attempts, and what has been decided about it.

use super::actions::Operation;
use super::capability::Verdict;
use super::event::{EventKind, rounded};
use super::look::Recognised;
use crate::strategy::{Joining, JournalEntry, Match, StepState};
use std::collections::VecDeque;
use tandem_config::{Part, Verb};
use tandem_msg::{Coded, MotionStatus, Planner, Stamp};

/// An operation under way.
#[derive(Clone, Debug)]
pub(super) struct Current {
    /// Which.
    pub(super) operation: Operation,
    /// Since when.
    pub(super) began: Stamp,
    /// Seconds it could have moved in.
    pub(super) moving_s: f64,
    /// Whether the final action had been reached.
    pub(super) acted: bool,
    /// Smallest clearance of the motion, metres.
    pub(super) clearance_min: f64,
    /// Who planned the motion.
    pub(super) planner: Planner,
    /// Policies that led the arm across, a bit for the number of each one's subtask.
    pub(super) led_by: u32,
}

impl Current {
    pub(super) fn new(operation: Operation, now: Stamp) -> Self {
        Self {
            operation,
            began: now,
            moving_s: 0.0,
            acted: false,
            clearance_min: f64::INFINITY,
            planner: Planner::None,
            led_by: 0,
        }
    }

    /// Takes up what the controller says of this motion. Who planned the way to the goal is kept: the way
    /// back after the action is always straight.
    pub(super) fn follow(&mut self, motion: &MotionStatus) {
        if motion.clearance_min.is_finite() {
            self.clearance_min = self.clearance_min.min(motion.clearance_min);
        }
        self.led_by |= motion.led_by;
        // A motion that is planned anew counts for the last planner that was needed.
        let rank = |planner: Planner| match planner {
            Planner::None => 0,
            Planner::Straight => 1,
            Planner::Policy => 2,
            Planner::Manual => 3,
            Planner::RrtConnect => 4,
        };
        if let Some(planner) = motion.planner.get().filter(|planner| rank(*planner) > rank(self.planner)) {
            self.planner = planner;
        }
    }
}

/// One part on its way into the box.
#[derive(Clone, Debug)]
pub(super) struct Work {
    /// Index of the part.
    pub(super) index: usize,
    /// Attempt, from 1.
    pub(super) attempt: u32,
    /// When the part was called for.
    pub(super) called: Stamp,
    /// When this attempt began.
    pub(super) begun: Stamp,
    /// Looks taken in this attempt.
    pub(super) looks: u32,
    /// What is known of the part.
    pub(super) seen: Option<Recognised>,
    /// Capability check.
    pub(super) verdict: Option<Verdict>,
    /// Mode, tool and effort.
    pub(super) joining: Option<Joining>,
    /// Strategy.
    pub(super) found: Option<Match>,
    /// Next action of the strategy.
    pub(super) verb: usize,
    /// Operations of the present action that are still to come.
    pub(super) queue: VecDeque<Operation>,
    /// Operation under way.
    pub(super) current: Option<Current>,
    /// Smallest clearance of the step, metres.
    pub(super) clearance_min: f64,
    /// Why a person takes over; `None` while the strategy holds.
    pub(super) take_over: Option<String>,
    /// Remark for the journal.
    pub(super) remark: String,
    /// How it ended.
    pub(super) ended: Option<StepState>,
}

impl Work {
    pub(super) fn new(index: usize, now: Stamp) -> Self {
        Self {
            index,
            attempt: 1,
            called: now,
            begun: now,
            looks: 0,
            seen: None,
            verdict: None,
            joining: None,
            found: None,
            verb: 0,
            queue: VecDeque::new(),
            current: None,
            clearance_min: f64::INFINITY,
            take_over: None,
            remark: String::new(),
            ended: None,
        }
    }

    /// The actions of the strategy.
    pub(super) fn verbs(&self) -> Vec<Verb> {
        self.found.as_ref().map(|found| found.row.steps.iter().map(|step| step.verb).collect()).unwrap_or_default()
    }

    /// Drops what was under way.
    pub(super) fn drop_operations(&mut self) {
        self.queue.clear();
        self.current = None;
    }

    fn who(&self) -> &'static str {
        match (self.ended, &self.take_over, &self.found) {
            (Some(StepState::Failed), Some(_), _) => "nobody",
            (_, Some(_), _) => "human",
            (_, None, Some(found)) => found.row.focus.name(),
            (_, None, None) => "",
        }
    }

    fn clearance(&self) -> Option<f64> {
        self.clearance_min.is_finite().then(|| rounded(self.clearance_min))
    }

    /// The journal's line for this attempt as it stands.
    pub(super) fn entry(&self, part: &Part, state: StepState, line: Line<'_>) -> JournalEntry {
        JournalEntry {
            seq: line.seq,
            run: line.run.to_owned(),
            serial: line.serial,
            step: self.index as u32,
            attempt: self.attempt,
            part: part.name.clone(),
            state,
            time_s: rounded(line.began.age_at(line.now).as_secs_f64()),
            duration_s: rounded(self.begun.age_at(line.now).as_secs_f64()),
            subject: self.who().to_owned(),
            class: self.seen.map(|seen| seen.class.name()).unwrap_or_default().to_owned(),
            confidence: rounded(self.seen.map_or(0.0, |seen| seen.confidence)),
            mode: self.joining.map(|joining| joining.mode.name()).unwrap_or_default().to_owned(),
            tool: self.joining.map(|joining| joining.tool.name()).unwrap_or_default().to_owned(),
            form: self.found.as_ref().map(|found| found.row.form.name()).unwrap_or_default().to_owned(),
            strategy: self.found.as_ref().map(|found| found.row.id.clone()).unwrap_or_default(),
            clearance_min_m: self.clearance(),
            remark: self.remark.clone(),
        }
    }

    /// The event that ends the step.
    pub(super) fn done(&self, part: &Part, number: u32, now: Stamp) -> EventKind {
        EventKind::StepDone {
            number,
            step: self.index + 1,
            part: part.name.clone(),
            label: part.label.clone(),
            outcome: self.ended.unwrap_or(StepState::Failed).name(),
            who: self.who(),
            class: self.seen.map(|seen| seen.class.name()).unwrap_or_default(),
            confidence: rounded(self.seen.map_or(0.0, |seen| seen.confidence)),
            mode: self.joining.map(|joining| joining.mode.name()).unwrap_or_default(),
            tool: self.joining.map(|joining| joining.tool.name()).unwrap_or_default(),
            form: self.found.as_ref().map(|found| found.row.form.name()).unwrap_or_default(),
            attempts: self.attempt,
            duration_s: rounded(self.called.age_at(now).as_secs_f64()),
            clearance_min_m: self.clearance(),
        }
    }
}

/// Where and when a journal line is written.
pub(super) struct Line<'a> {
    /// Its number.
    pub(super) seq: u64,
    /// The run.
    pub(super) run: &'a str,
    /// The box.
    pub(super) serial: String,
    /// When the run began.
    pub(super) began: Stamp,
    /// Now.
    pub(super) now: Stamp,
}
