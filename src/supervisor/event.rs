//! What a run tells about itself: one event a line in `--json`, and the final summary.

use serde::Serialize;
use tandem_msg::{Coded as _, Planner, Subtask};

/// Something that happened, with the seconds since the run began on the cell's clock.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Event {
    /// What.
    #[serde(flatten)]
    pub kind: EventKind,
    /// When, s.
    pub time_s: f64,
}

/// What happened. Lengths, masses and times in the unit that ends the name.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum EventKind {
    /// All roles are up; the run begins.
    RunStarted {
        /// Cell.
        cell: String,
        /// Product.
        product: String,
        /// Boxes to assemble.
        boxes: u32,
        /// Steps a box takes.
        steps: usize,
        /// Seed.
        seed: u64,
    },
    /// An empty fixture stands ready.
    BoxStarted {
        /// Box, from 1.
        number: u32,
    },
    /// A part is called for.
    StepStarted {
        /// Box, from 1.
        number: u32,
        /// Step, from 1.
        step: usize,
        /// Part.
        part: String,
        /// Part, on the screen.
        label: String,
    },
    /// A feature was recognised, or a person said what it is.
    Recognised {
        /// Part.
        part: String,
        /// Class.
        class: &'static str,
        /// Probability of the class, 0 to 1.
        confidence: f64,
        /// `perception`, or `person` when it was their word.
        by: &'static str,
        /// Diameter, when the class has one.
        #[serde(skip_serializing_if = "Option::is_none")]
        diameter_mm: Option<f64>,
        /// Depth or height, when the class has one.
        #[serde(skip_serializing_if = "Option::is_none")]
        depth_mm: Option<f64>,
        /// Length, when the class has one.
        #[serde(skip_serializing_if = "Option::is_none")]
        length_mm: Option<f64>,
        /// Width, when the class has one.
        #[serde(skip_serializing_if = "Option::is_none")]
        width_mm: Option<f64>,
        /// Looks it took.
        looks: u32,
        /// How far the part lies from where it should.
        offset_mm: f64,
    },
    /// A look that was not good enough.
    Doubt {
        /// Part.
        part: String,
        /// Look, from 1.
        look: u32,
        /// What was wrong with it.
        reason: String,
    },
    /// The capability check, Eq. (1) and (2).
    Verdict {
        /// Part.
        part: String,
        /// Eq. (1).
        feasible_human: bool,
        /// Eq. (2).
        feasible_robot: bool,
        /// R_h − d, m.
        human_reach_margin_m: f64,
        /// L_h − W, kg.
        human_load_margin_kg: f64,
        /// R_r − d, m.
        robot_reach_margin_m: f64,
        /// L_r − W, kg.
        robot_load_margin_kg: f64,
        /// `robot`, `human` or `nobody`.
        assigned: &'static str,
        /// Why.
        reason: &'static str,
    },
    /// The strategy that was retrieved.
    Strategy {
        /// Part.
        part: String,
        /// Its id in the library.
        id: String,
        /// Assembly mode.
        mode: &'static str,
        /// Tool.
        tool: &'static str,
        /// Who does the final assembly.
        focus: &'static str,
        /// Form of cooperation.
        form: &'static str,
        /// How well it fits, 0 to 1.
        score: f64,
        /// Why this one.
        explanation: String,
    },
    /// An action of the sequence begins.
    ActionStarted {
        /// `robot` or `human`.
        subject: &'static str,
        /// Subtask or prompt.
        subtask: &'static str,
        /// Part.
        part: String,
    },
    /// An action of the sequence is done.
    ActionDone {
        /// `robot` or `human`.
        subject: &'static str,
        /// Subtask or prompt.
        subtask: &'static str,
        /// Part.
        part: String,
        /// How long it took.
        duration_s: f64,
        /// Smallest clearance of the motion.
        #[serde(skip_serializing_if = "Option::is_none")]
        clearance_min_m: Option<f64>,
        /// Who planned the motion.
        #[serde(skip_serializing_if = "Option::is_none")]
        planner: Option<&'static str>,
        /// The subtasks whose policies led the arm across.
        #[serde(skip_serializing_if = "Vec::is_empty")]
        policies: Vec<&'static str>,
    },
    /// A planner found no way, and the next one did.
    Fallback {
        /// Subtask.
        subtask: &'static str,
        /// Part.
        part: String,
        /// Whose candidates were all blocked.
        from: &'static str,
        /// Who planned the motion.
        planner: &'static str,
    },
    /// The arm went over to another way while it was moving.
    WayChanged {
        /// Subtask.
        subtask: &'static str,
        /// Part.
        part: String,
        /// What was wrong with the way it was on: blocked, or longer than the other one by far.
        reason: &'static str,
        /// Who planned the other one.
        planner: &'static str,
    },
    /// A person is asked for something.
    Prompt {
        /// What.
        kind: &'static str,
        /// Part.
        part: String,
        /// In words.
        text: String,
    },
    /// The person's answer, or `none` when it did not come in time.
    Answer {
        /// To what.
        kind: &'static str,
        /// Part.
        part: String,
        /// The answer.
        answer: &'static str,
        /// Class they named.
        #[serde(skip_serializing_if = "Option::is_none")]
        class: Option<&'static str>,
    },
    /// The arm is being stopped.
    Stop {
        /// Why.
        cause: &'static str,
        /// How, IEC 60204-1.
        category: &'static str,
        /// Distance to the nearest person, when somebody is in view.
        #[serde(skip_serializing_if = "Option::is_none")]
        separation_m: Option<f64>,
        /// Clearance at that moment.
        clearance_m: f64,
    },
    /// The arm is asked to go at another pace.
    Mode {
        /// Whose limits hold: normal or reduced.
        mode: &'static str,
        /// Why they are not the normal ones.
        #[serde(skip_serializing_if = "Option::is_none")]
        reason: Option<&'static str>,
    },
    /// The arm may move again.
    Resumed {
        /// Why it had been stopped.
        cause: &'static str,
        /// How long it stood.
        after_s: f64,
    },
    /// Something of the cell failed.
    Fault {
        /// `plant`, `perception`, `controller` or `journal`.
        role: &'static str,
        /// What happened to it.
        fault: String,
    },
    /// A lost role is back.
    Recovered {
        /// Which.
        role: &'static str,
        /// How long it was away.
        after_s: f64,
    },
    /// An attempt at a step failed.
    Retry {
        /// Part.
        part: String,
        /// The attempt that failed, from 1.
        attempt: u32,
        /// Why.
        reason: String,
    },
    /// A step is over.
    StepDone {
        /// Box, from 1.
        number: u32,
        /// Step, from 1.
        step: usize,
        /// Part.
        part: String,
        /// Part, on the screen.
        label: String,
        /// `done`, `taken_over` or `failed`.
        outcome: &'static str,
        /// Who did the final assembly: `robot`, `human` or `nobody`.
        who: &'static str,
        /// Recognised class; empty when it was not recognised.
        class: &'static str,
        /// Confidence of the recognition.
        confidence: f64,
        /// Assembly mode; empty when none was found.
        mode: &'static str,
        /// Tool; empty when none was found.
        tool: &'static str,
        /// Form of cooperation; empty when none was found.
        form: &'static str,
        /// Attempts it took.
        attempts: u32,
        /// How long it took, from call to end.
        duration_s: f64,
        /// Smallest clearance, when the arm moved.
        #[serde(skip_serializing_if = "Option::is_none")]
        clearance_min_m: Option<f64>,
    },
    /// A box is over.
    BoxDone {
        /// Box, from 1.
        number: u32,
        /// Whether every step of it is done.
        completed: bool,
        /// How long it took.
        duration_s: f64,
    },
}

/// How a run ended.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(tag = "outcome", rename_all = "snake_case")]
pub enum Outcome {
    /// Every box was assembled.
    Completed,
    /// A box could not be assembled.
    Failed {
        /// Which part, and why.
        reason: String,
    },
    /// The user ended it.
    Interrupted,
    /// A fault ended it.
    Fault {
        /// `plant`, `perception`, `controller`, `arm` or `journal`.
        role: &'static str,
        /// What happened.
        fault: String,
    },
    /// Somebody or something did not answer.
    TimedOut {
        /// What was waited for.
        waiting_for: String,
    },
}

impl std::fmt::Display for Outcome {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Completed => f.write_str("completed"),
            Self::Failed { reason } => write!(f, "failed: {reason}"),
            Self::Interrupted => f.write_str("interrupted: the arm was stopped first"),
            Self::Fault { role, fault } => write!(f, "stopped by a fault of {role}: {fault}"),
            Self::TimedOut { waiting_for } => write!(f, "gave up waiting for {waiting_for}"),
        }
    }
}

impl Outcome {
    /// One word for it, as the store keeps it.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Completed => "completed",
            Self::Failed { .. } => "failed",
            Self::Interrupted => "interrupted",
            Self::Fault { .. } => "fault",
            Self::TimedOut { .. } => "timed_out",
        }
    }

    /// Exit code of `tandem run`.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Completed => 0,
            Self::Failed { .. } | Self::Interrupted => 1,
            Self::Fault { .. } => 5,
            Self::TimedOut { .. } => 6,
        }
    }
}

/// The numbers of a run; the shell adds how long it took by the wall clock.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Product.
    pub product: String,
    /// Boxes asked for.
    pub boxes_requested: u32,
    /// Boxes with every step done.
    pub boxes_completed: u32,
    /// Steps done, by whomever.
    pub steps_done: u32,
    /// Attempts at a step that failed.
    pub steps_failed: u32,
    /// Motions that had to be planned by the next planner.
    pub fallbacks: u32,
    /// Ways that were changed for another one in motion.
    pub ways_changed: u32,
    /// Finished motions, by who planned the way across.
    pub planned: Planned,
    /// Protective stops.
    pub stops: u32,
    /// Referee: contacts with what must not be touched.
    pub contacts: u32,
    /// Smallest clearance of the run; `None` when the arm did not move.
    pub min_clearance_m: Option<f64>,
    /// Time on the cell's clock.
    pub sim_time_s: f64,
    /// Seed.
    pub seed: u64,
}

/// Motions by their planner.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Planned {
    /// By a learned policy.
    pub policy: u32,
    /// By a hand-designed route.
    pub manual: u32,
    /// By the sampling planner.
    pub rrt_connect: u32,
    /// By nobody: straight on, or straight back.
    pub straight: u32,
    /// Motions in which the policy of each subtask had a part.
    pub led_by: LedBy,
}

/// Motions by the policies that led the arm across; two may share one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct LedBy {
    /// To a part or a tool.
    pub grasp: u32,
    /// With a part across the cell.
    pub transfer: u32,
    /// With a part around the box to its place.
    pub place: u32,
    /// With a part or a tool to where it is joined.
    pub assemble: u32,
}

impl Planned {
    /// Counts one, and the policies that led it.
    pub(super) fn count(&mut self, planner: Planner, led_by: u32) {
        let LedBy { grasp, transfer, place, assemble } = &mut self.led_by;
        for (subtask, count) in [
            (Subtask::Grasp, grasp),
            (Subtask::Transfer, transfer),
            (Subtask::Place, place),
            (Subtask::Assemble, assemble),
        ] {
            *count += u32::from(led(led_by, subtask));
        }
        match planner {
            Planner::Policy => self.policy += 1,
            Planner::Manual => self.manual += 1,
            Planner::RrtConnect => self.rrt_connect += 1,
            Planner::Straight => self.straight += 1,
            Planner::None => {}
        }
    }

    /// Of the motions that had a way across, the share that a policy found; `None` when there were none.
    pub fn policy_share(&self) -> Option<f64> {
        let across = self.policy + self.manual + self.rrt_connect;
        (across > 0).then(|| f64::from(self.policy) / f64::from(across))
    }
}

/// Whether the policy of a subtask is among those of a motion.
pub(super) fn led(led_by: u32, subtask: Subtask) -> bool {
    led_by >> subtask.code() & 1 == 1
}

/// Seconds or metres with the digits a reader can use.
pub(super) fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_event_is_one_flat_object() {
        let event = Event {
            kind: EventKind::ActionDone {
                subject: "robot",
                subtask: "grasp",
                part: "fuse".into(),
                duration_s: 3.25,
                clearance_min_m: Some(0.031),
                planner: Some("policy"),
                policies: vec!["grasp"],
            },
            time_s: 12.5,
        };
        assert_eq!(
            serde_json::to_string(&event).ok().as_deref(),
            Some(
                r#"{"event":"action_done","subject":"robot","subtask":"grasp","part":"fuse","duration_s":3.25,"clearance_min_m":0.031,"planner":"policy","policies":["grasp"],"time_s":12.5}"#
            )
        );
    }

    #[test]
    fn outcomes_have_the_documented_exit_codes() {
        let fault = Outcome::Fault { role: "plant", fault: "killed".into() };
        let late = Outcome::TimedOut { waiting_for: "an answer".into() };
        let failed = Outcome::Failed { reason: String::new() };
        let codes = [Outcome::Completed, failed, Outcome::Interrupted, fault, late].map(|outcome| outcome.exit_code());
        assert_eq!(codes, [0, 1, 1, 5, 6]);
    }
}
