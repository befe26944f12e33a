//! The task in hand and how far it has come.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use tandem_msg::{AttachedPart, EffectorAction, MotionFailure, MotionPhase, MotionTask, Pose, Stamp, Subtask};

use crate::Joints;
use crate::plan::{Goal, Touch};

/// Where a task stands.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Stage {
    /// There is none.
    Idle,
    /// A path is being searched; `true` once it has begun.
    Planning { begun: bool },
    /// On a stretch of the plan.
    Leg(usize),
    /// On a step out of a contact, or back into the joints' range.
    Recovering,
    /// At the goal, coming to stillness.
    Settling { since: Stamp },
    /// The tool is at work.
    Acting { since: Stamp },
    /// Over: how, and when.
    Ended { failure: MotionFailure, at: Stamp },
}

/// A task, kept as it was when it was taken: later changes under the same number are not followed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Job {
    pub(crate) task: MotionTask,
    pub(crate) stage: Stage,
    /// The final action is done; what is left is to withdraw.
    pub(crate) away: bool,
    pub(crate) began: Stamp,
    pub(crate) clearance_min: f64,
    /// Seconds to the goal from the beginning, once known.
    pub(crate) expected: f64,
    /// What the task before this one could touch.
    touch_before: [u32; 8],
    /// Since when the sensor has not seen the carried part.
    pub(crate) dark_since: Option<Stamp>,
    /// Given up while moving: to be ended at rest.
    pub(crate) abandon: Option<MotionFailure>,
    /// Steps of recovery made.
    pub(crate) recoveries: u32,
}

impl Job {
    pub(crate) fn none() -> Self {
        Self {
            task: MotionTask::default(),
            stage: Stage::Idle,
            away: false,
            began: Stamp(0),
            clearance_min: f64::INFINITY,
            expected: 0.0,
            touch_before: [0; 8],
            dark_since: None,
            abandon: None,
            recoveries: 0,
        }
    }

    /// Whether this is that task: the same number from the same incarnation of the supervisor.
    pub(crate) fn is_of(&self, task: &MotionTask) -> bool {
        (self.task.id, self.task.header.epoch) == (task.id, task.header.epoch)
    }

    /// The task that follows this one.
    pub(crate) fn next(&self, task: &MotionTask, now: Stamp, valid: bool) -> Self {
        let stage = match (task.id, valid) {
            (0, _) => Stage::Idle,
            (_, true) => Stage::Planning { begun: false },
            (_, false) => Stage::Ended { failure: MotionFailure::InvalidTask, at: now },
        };
        // No task in between changes nothing about where the arm stands.
        let touch_before = if self.task.id == 0 { self.touch_before } else { self.task.touch };
        Self { task: *task, stage, began: now, touch_before, ..Self::none() }
    }

    /// What the tool carries at this stage.
    pub(crate) fn attached(&self) -> &AttachedPart {
        if self.away { &self.task.attached_after } else { &self.task.attached_before }
    }

    /// Whether a person takes from the tool, or works on, what it holds.
    pub(crate) fn is_with_person(&self) -> bool {
        self.task.subtask.is(Subtask::HandOver) || self.task.subtask.is(Subtask::HoldStill)
    }

    /// What may be touched at the goal.
    pub(crate) fn touch(&self) -> Touch {
        let mut touch = [0; 16];
        touch[..8].copy_from_slice(&self.task.touch);
        touch
    }

    /// What may be touched until the first stretch is done: the task before may have ended in contact.
    pub(crate) fn touch_at_start(&self) -> Touch {
        let mut touch = self.touch();
        let mut count = touch.iter().filter(|id| **id != 0).count();
        touch.sort_unstable_by(|a, b| b.cmp(a));
        for id in self.touch_before {
            if id != 0 && !touch.contains(&id) && count < touch.len() {
                touch[count] = id;
                count += 1;
            }
        }
        touch
    }

    /// What is to be planned at this stage.
    pub(crate) fn goal(&self, home: &Joints, config_hash: u64) -> Goal {
        let mut base_from_tcp = isometry(&self.task.base_from_tcp);
        if self.away {
            base_from_tcp *= Translation3::new(0.0, 0.0, -self.task.retract);
        }
        let to_rest = self.task.subtask.is(Subtask::Home);
        Goal {
            base_from_tcp,
            joints: to_rest.then_some(*home),
            approach: if self.away || to_rest { 0.0 } else { self.task.approach },
            straight_only: self.away,
            speed: self.task.speed,
            attached: *self.attached(),
            touch: self.touch(),
            touch_at_start: self.touch_at_start(),
            subtask: self.task.subtask.get().unwrap_or(Subtask::None),
            seed: config_hash ^ (u64::from(self.task.id) << 32),
        }
    }

    /// Whether the tool has to do something at the goal.
    pub(crate) fn acts(&self) -> bool {
        !self.task.action.is(EffectorAction::Keep)
    }

    /// Whether the arm withdraws after the action.
    pub(crate) fn retracts(&self) -> bool {
        self.task.retract > 0.0 && !self.task.subtask.is(Subtask::Home)
    }

    /// Ends the task.
    pub(crate) fn end(&mut self, failure: MotionFailure, now: Stamp) {
        self.stage = Stage::Ended { failure, at: now };
    }

    /// Phase as reported; `leg` is that of the stretch in hand.
    pub(crate) fn phase(&self, leg: MotionPhase) -> MotionPhase {
        match self.stage {
            Stage::Idle => MotionPhase::Idle,
            Stage::Planning { .. } if self.away => MotionPhase::Retract,
            Stage::Planning { .. } => MotionPhase::Planning,
            Stage::Leg(_) => leg,
            Stage::Recovering => MotionPhase::Depart,
            Stage::Settling { .. } | Stage::Acting { .. } => MotionPhase::Acting,
            Stage::Ended { failure: MotionFailure::None, .. } => MotionPhase::Done,
            Stage::Ended { .. } => MotionPhase::Failed,
        }
    }

    pub(crate) fn failure(&self) -> MotionFailure {
        match self.stage {
            Stage::Ended { failure, .. } => failure,
            _ => MotionFailure::None,
        }
    }

    /// Seconds since the task began, up to its end.
    pub(crate) fn elapsed(&self, now: Stamp) -> f64 {
        match self.stage {
            Stage::Idle => 0.0,
            Stage::Ended { at, .. } => self.began.age_at(at).as_secs_f64(),
            _ => self.began.age_at(now).as_secs_f64(),
        }
    }
}

/// The message's pose as nalgebra has it.
pub(crate) fn isometry(pose: &Pose) -> Isometry3<f64> {
    let [x, y, z, w] = pose.rotation;
    Isometry3::from_parts(Translation3::from(pose.position), UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z)))
}

/// The pose as the message has it.
pub(crate) fn pose(isometry: &Isometry3<f64>) -> Pose {
    let rotation = isometry.rotation.coords;
    Pose { position: isometry.translation.vector.into(), rotation: [rotation.x, rotation.y, rotation.z, rotation.w] }
}
