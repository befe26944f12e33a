//! The task in hand, where no motion is due: take, plan, settle, act, withdraw, end.

use tandem_msg::{MotionFailure, MotionTask, Stamp};

use super::{Controller, tools};
use crate::effector::Answer;
use crate::inputs::{Heard, task_is_valid};
use crate::job::Stage;
use crate::plan::{Goal, Leg, Progress};

impl Controller {
    /// Takes a new task once the arm is at rest.
    pub(super) fn take_task(&mut self, now: Stamp, task: &MotionTask, heard: &Heard) {
        let standing = self.motion.law().is_none_or(|law| law.finished());
        if heard.task.good && !self.job.is_of(task) && standing {
            if self.motion.law().is_some() {
                self.motion.rest();
            }
            self.job = self.job.next(task, now, task.id == 0 || task_is_valid(task));
            if task.id != 0 {
                self.guard.set_context(self.job.attached(), &self.job.touch_at_start());
            }
        }
    }

    /// Goes on with the task where no motion is due: plan, settle, act, end.
    pub(super) fn advance_task(&mut self, now: Stamp, go: bool, arm_good: bool) {
        let standing = self.motion.at_rest() || self.motion.law().is_some_and(|law| law.finished());
        if let Some(failure) = self.job.abandon
            && standing
        {
            self.job.abandon = None;
            if self.motion.law().is_some() {
                self.motion.rest();
            }
            self.job.end(failure, now);
        }
        if arm_good {
            self.watch_part(now);
        }
        match self.job.stage {
            Stage::Planning { begun } if go && self.motion.at_rest() => self.plan(now, begun),
            Stage::Leg(index) => self.finish_leg(now, index),
            Stage::Recovering if self.recovery_is_over() => {
                self.motion.rest();
                self.pace.recovered();
                self.plan_anew();
            }
            Stage::Settling { since } if go && since.age_at(now) >= self.params.settle => {
                if self.job.acts() {
                    self.effector.begin(&self.job.task, &self.arm.effector);
                    self.job.stage = Stage::Acting { since: now };
                } else {
                    self.withdraw(now);
                }
            }
            Stage::Acting { since } if arm_good => match self.effector.answer(&self.arm.effector) {
                Answer::Done => self.withdraw(now),
                Answer::Failed => self.job.end(MotionFailure::ActionFailed, now),
                Answer::Waiting if since.age_at(now) > self.params.action_timeout => {
                    self.job.end(MotionFailure::ActionTimeout, now);
                }
                Answer::Waiting => {}
            },
            _ => {}
        }
    }

    /// A carried part that the sensor no longer sees ends the task.
    fn watch_part(&mut self, now: Stamp) {
        let carrying = self.job.attached().present == 1
            && matches!(self.job.stage, Stage::Planning { .. } | Stage::Leg(_) | Stage::Settling { .. });
        if !carrying || self.arm.effector.holding != 0 {
            self.job.dark_since = None;
            return;
        }
        let since = *self.job.dark_since.get_or_insert(now);
        if since.age_at(now) >= self.params.part_lost_after {
            self.job.abandon = Some(MotionFailure::PartLost);
        }
    }

    /// Searches a path, a few steps a cycle.
    fn plan(&mut self, now: Stamp, begun: bool) {
        let Some((_, version)) = self.scene_key else { return };
        if !self.scene_valid || version < self.job.task.scene_version {
            return;
        }
        if !begun {
            let goal = self.job.goal(&self.params.home, self.params.config_hash);
            if !self.job.away && goal.joints.is_none() && goal.approach <= 0.0 && self.stands_at(&goal) {
                // Nothing but the tool is to act. After a stop the arm stands a little beside the goal, and a
                // person who holds the part would keep it from moving that little for ever.
                self.guard.set_context(self.job.attached(), &self.job.touch());
                self.job.stage = Stage::Settling { since: now };
                return;
            }
            if self.is_out_of_range() {
                if !self.recover() {
                    self.job.end(MotionFailure::Unreachable, now);
                }
                return;
            }
            self.search.begin(&self.motion.set().position, &goal);
            self.job.stage = Stage::Planning { begun: true };
            self.plan_is_current = true;
        }
        let mut tools = tools!(self, scene);
        match self.search.work(&mut tools) {
            Progress::Searching => {}
            Progress::Failed(failure) => {
                if !(self.is_hemmed_in() && self.recover()) {
                    self.job.end(failure, now);
                }
            }
            Progress::Found => {
                if !self.job.away {
                    self.job.expected = self.job.elapsed(now) + self.search.duration();
                }
                self.begin_leg(now, 0);
            }
        }
    }

    /// Whether the TCP stands at the goal, as near as brakes hold it.
    fn stands_at(&self, goal: &Goal) -> bool {
        /// Metres and radians.
        const NEAR: [f64; 2] = [0.002, 0.005];
        let here = self.chain.forward(&self.motion.set().position).base_from_tcp;
        (here.translation.vector - goal.base_from_tcp.translation.vector).norm() <= NEAR[0]
            && here.rotation.angle_to(&goal.base_from_tcp.rotation) <= NEAR[1]
    }

    /// Enters a stretch, or what comes after the last.
    fn begin_leg(&mut self, now: Stamp, from: usize) {
        let mut index = from;
        // Stretches of no length are left out.
        while self.search.legs().get(index).is_some_and(|leg| leg.path.length() <= 0.0) {
            index += 1;
        }
        let Some(leg) = self.search.legs().get(index) else {
            if self.motion.law().is_some() {
                self.motion.rest();
            }
            if self.job.away {
                self.job.end(MotionFailure::None, now);
            } else {
                self.guard.set_context(self.job.attached(), &self.job.touch());
                self.job.stage = Stage::Settling { since: now };
            }
            return;
        };
        let leg = *leg;
        let from_contact = index == 0 && self.guard.clearance().distance < 0.0;
        if leg.limits.are_usable() && self.enter(&leg, self.plan_is_current, from_contact) {
            self.job.stage = Stage::Leg(index);
        } else {
            self.refused = true;
            self.motion.rest();
            self.job.end(MotionFailure::Unreachable, now);
        }
    }

    /// Sets out on a stretch, `swept` when it was found clear with the scene in force.
    pub(super) fn enter(&mut self, leg: &Leg, swept: bool, recovering: bool) -> bool {
        let with_person = self.job.is_with_person();
        let prepared =
            self.motion.follow(&leg.path, &leg.limits).and_then(|()| self.governor.take(&leg.limits, with_person));
        self.guard.take(leg, self.job.attached(), swept);
        self.pace.take(&self.chain, leg, &self.job, &self.params, recovering);
        self.law_level = 0;
        prepared.is_ok()
    }

    /// Enters the next stretch where this one has ended, or plans anew where it is blocked.
    fn finish_leg(&mut self, now: Stamp, index: usize) {
        /// Rest within this of the end is the end.
        const END: f64 = 1e-9;
        let Some(law) = self.motion.law() else { return };
        if !law.finished() {
            return;
        }
        if law.state().position >= self.motion.path().length() - END {
            self.begin_leg(now, index + 1);
        } else if self.guard.blocked() {
            self.motion.rest();
            self.plan_anew();
        }
    }

    /// The action is done: withdraw, or end.
    fn withdraw(&mut self, now: Stamp) {
        self.job.away = true;
        self.guard.set_context(self.job.attached(), &self.job.touch());
        if self.job.retracts() {
            self.job.stage = Stage::Planning { begun: false };
        } else {
            self.job.end(MotionFailure::None, now);
        }
    }
}
