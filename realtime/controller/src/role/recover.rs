//! Recovery: an arm that is found in contact or outside its joints' range gets out of it by itself.
//!
//! One small step at a time, each planned from where the arm stands and checked as
//! every other motion: a joint outside its range moves towards it, and otherwise
//! all joints move the way that clearance grows fastest. No step brings the arm
//! nearer to anything or a joint farther out; where none helps the task has failed.

use tandem_msg::{JOINTS_MAX, MotionPhase};

use super::Controller;
use crate::Joints;
use crate::job::Stage;
use crate::path::Path;
use crate::plan::Leg;

/// Steps tried, rad (or m) of the joint that moves most, longest first.
const STEPS: [f64; 4] = [0.02, 0.01, 0.005, 0.002];
/// Steps of one task; what needs more is not found in contact but buried.
const STEPS_MAX: u32 = 500;
/// Change of a joint by which the growth of clearance is measured, rad or m.
const PROBE: f64 = 1e-4;
/// A step must gain as much as this, metres, to be one.
const GAIN: f64 = 2e-5;
/// Share of the joints' speeds.
const SPEED: f64 = 0.1;
/// Comes to rest so far inside a limit, rad or m.
const INSIDE: f64 = 1e-3;

impl Controller {
    /// Whether a joint stands outside its range.
    pub(super) fn is_out_of_range(&self) -> bool {
        !self.chain.is_within_limits(&self.motion.set().position, 0.0)
    }

    /// Whether the arm stands nearer to something than a path across may come.
    pub(super) fn is_hemmed_in(&self) -> bool {
        !(self.guard.clearance().distance >= self.params.path_margin)
    }

    /// Begins a step that makes it better; says whether there is one.
    pub(super) fn recover(&mut self) -> bool {
        let from = self.motion.set().position;
        let Some(to) = self.better(&from) else { return false };
        if self.job.recoveries >= STEPS_MAX {
            return false;
        }
        self.job.recoveries += 1;
        let path = Path::line(&from, &to);
        let attached = *self.job.attached();
        let leg = Leg {
            phase: MotionPhase::Depart,
            touch: self.job.touch_at_start(),
            margin: self.guard.clearance().distance.min(self.params.approach_margin),
            rate: path.sweep_rate(&self.reach.with(&attached)),
            limits: path.limits(&self.chain, SPEED, self.params.recovery_speed_max / SPEED),
            path,
        };
        if !leg.limits.are_usable() || !self.enter(&leg, false, true) {
            return false;
        }
        self.job.stage = Stage::Recovering;
        true
    }

    /// Whether the step under way has come to its end, or to something that was not there.
    pub(super) fn recovery_is_over(&self) -> bool {
        let Some(law) = self.motion.law() else { return true };
        law.finished() && (law.state().position > 0.0 || self.guard.blocked())
    }

    /// A position near `from` where less is wrong.
    fn better(&self, from: &Joints) -> Option<Joints> {
        let clearance = |at: &Joints| self.guard.clearance_at(&self.chain, at);
        let now = clearance(from);
        if !now.is_finite() && now < 0.0 {
            return None;
        }
        let mut way = [0.0; JOINTS_MAX];
        let mut out = false;
        for (index, joint) in self.chain.joints().iter().enumerate() {
            if from[index] > joint.position_max {
                (way[index], out) = (joint.position_max - INSIDE - from[index], true);
            } else if from[index] < joint.position_min {
                (way[index], out) = (joint.position_min + INSIDE - from[index], true);
            }
        }
        if !out {
            for (index, way) in way.iter_mut().enumerate().take(self.chain.joint_count()) {
                let mut probe = *from;
                probe[index] += PROBE;
                *way = clearance(&probe) - now;
            }
        }
        let longest = way.iter().fold(0.0_f64, |longest, way| longest.max(way.abs()));
        if !(longest > 0.0 && longest.is_finite()) {
            return None;
        }
        let needed = if out { now.min(self.params.approach_margin) } else { now + GAIN };
        STEPS.into_iter().find_map(|step| {
            let step = if out { step.min(longest) } else { step };
            let at = |share: f64| core::array::from_fn(|joint| from[joint] + share * step * way[joint] / longest);
            let end = at(1.0);
            let in_range = out || self.chain.is_within_limits(&end, 0.0);
            // In between the sweep looks before the arm goes there.
            let helps = clearance(&at(0.5)) >= now.min(self.params.approach_margin) && clearance(&end) >= needed;
            (in_range && helps).then_some(end)
        })
    }
}
