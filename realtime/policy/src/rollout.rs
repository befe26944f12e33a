//! A policy rolled out ahead of time: joint positions one after another, none of which is ever commanded
//! before the whole way was found clear.
//!
//! Training steps the same code, so what a policy learned to expect is what it gets.

#![allow(clippy::neg_cmp_op_on_partial_ord, reason = "`!(a > b)` is meant: what is no number fails the check")]

use tandem_clearance::{Clearance, Monitor, MotionSweep, Swept};
use tandem_kinematics::{Chain, JOINTS_MAX, LinkPoses};

use crate::observe::{DOF, Destination, Observation, Surroundings, observe, slopes};

/// Largest increment of a joint in a step, rad.
pub const STEP: f32 = 0.12;
/// Steps of a rollout, after which it is given up.
pub const STEPS_MAX: usize = 60;
/// Within this of the goal in every joint the straight rest of the way is the controller's, rad.
pub const CAPTURE: f64 = 0.25;
/// Motions in a row that may be refused.
pub const REFUSED_MAX: u32 = 8;
/// Looks along one step, after which it is refused: a step moves the arm by a few hand's breadths at most.
const LOOKS: usize = 64;
/// What a motion that was refused is led off by, metres for each time.
const LED_OFF: f64 = 0.02;
/// A step that keeps this much more than the margin is not refused, metres.
const RESOLUTION: f64 = 0.002;

/// Where a rollout stands.
#[derive(Clone, Debug)]
pub struct Rollout {
    joints: [f64; JOINTS_MAX],
    poses: LinkPoses,
    /// Of the scene.
    clearance: Clearance,
    /// S_r.
    safety: f64,
    refused: u32,
    steps: usize,
}

impl Rollout {
    /// Begins at a joint position.
    pub fn begin(chain: &Chain, monitor: &Monitor, joints: &[f64; JOINTS_MAX]) -> Self {
        let poses = chain.forward(joints);
        let clearance = monitor.scene_clearance(&poses);
        Self { joints: *joints, poses, clearance, safety: 1.0, refused: 0, steps: 0 }
    }

    /// What the policy sees.
    pub fn observe(
        &self,
        chain: &Chain,
        monitor: &Monitor,
        surroundings: &Surroundings,
        destination: &Destination,
    ) -> Observation {
        observe(chain, monitor, surroundings, destination, &self.joints, &self.poses, &self.clearance, self.safety)
    }

    /// Moves by an action, rad; or refuses to, where the way is not clear by `margin`, and stays.
    ///
    /// Eq. (13) scores contact with 1 and freedom with -1, which in Eq. (15) rewards contact. Here S_r = 1 is
    /// free and -1 is contact; and contact is never made: the motion is refused, as a protective stop
    /// would, and the episode goes on; asked for again, the motion is shorter and led off what it met. (Episodes that end at
    /// contact were learned to be ended.)
    ///
    /// # Realtime
    /// A clearance query, at most [`LOOKS`] looks of a sweep and one forward solution each; no allocation.
    pub fn advance(&mut self, chain: &Chain, monitor: &Monitor, action: &[f32; DOF], margin: f64) -> bool {
        self.steps += 1;
        // Eq. (14): six joint angles, here as bounded increments that are added up: an absolute angle would
        // make a motion of one step.
        let mut to = self.joints;
        // Asked for again after a refusal, a motion is made shorter.
        let share = 1.0 / (1.0 + 0.5 * f64::from(self.refused));
        for ((to, by), joint) in to.iter_mut().zip(action).zip(chain.joints()) {
            *to = (*to + share * f64::from(*by)).clamp(joint.position_min, joint.position_max);
        }
        let mut poses = chain.forward(&to);
        let mut clearance = monitor.scene_clearance(&poses);
        if self.refused > 0 && clearance.distance.is_finite() {
            self.lead_off(chain, &poses, &clearance, margin, &mut to);
            poses = chain.forward(&to);
            clearance = monitor.scene_clearance(&poses);
        }
        if !(clearance.distance > margin) || !self.sweeps_clear(chain, monitor, &to, margin) {
            return self.refuse();
        }
        self.place(&to, poses, clearance);
        true
    }

    /// A motion that was refused and is asked for again is led off what it came too near to, the way the
    /// clearance grows fastest, and the farther the oftener it was refused.
    fn lead_off(
        &self,
        chain: &Chain,
        poses: &LinkPoses,
        clearance: &Clearance,
        margin: f64,
        to: &mut [f64; JOINTS_MAX],
    ) {
        let slopes = slopes(chain, poses, clearance);
        let steepness: f64 = slopes.iter().map(|slope| slope * slope).sum();
        let lacks = margin + LED_OFF * f64::from(self.refused) - clearance.distance;
        if !(steepness > 1e-3 && lacks > 0.0) {
            return;
        }
        let joints = chain.joints().iter().zip(&self.joints);
        for ((to, slope), (joint, from)) in to.iter_mut().zip(&slopes).zip(joints) {
            let most = f64::from(STEP);
            *to = (*to + slope * lacks / steepness).clamp(from - most, from + most);
            *to = to.clamp(joint.position_min, joint.position_max);
        }
    }

    /// Whether the straight motion to `to` keeps `margin`: between looks as well.
    fn sweeps_clear(&self, chain: &Chain, monitor: &Monitor, to: &[f64; JOINTS_MAX], margin: f64) -> bool {
        let mut sweep = MotionSweep::new();
        sweep.begin(monitor, &self.joints, to, margin, RESOLUTION);
        (0..LOOKS).map(|_| sweep.look(chain, monitor)).find(|swept| *swept != Swept::More) == Some(Swept::Clear)
    }

    /// Stands at a joint position, whatever is there.
    pub fn jump(&mut self, chain: &Chain, monitor: &Monitor, to: &[f64; JOINTS_MAX]) {
        let poses = chain.forward(to);
        let clearance = monitor.scene_clearance(&poses);
        self.place(to, poses, clearance);
    }

    fn place(&mut self, to: &[f64; JOINTS_MAX], poses: LinkPoses, clearance: Clearance) {
        (self.joints, self.poses, self.clearance) = (*to, poses, clearance);
        (self.safety, self.refused) = (1.0, 0);
    }

    fn refuse(&mut self) -> bool {
        self.safety = -1.0;
        self.refused += 1;
        false
    }

    /// Within [`CAPTURE`] of the goal in every joint.
    pub fn arrived(&self, destination: &Destination) -> bool {
        self.joints.iter().zip(&destination.joints).take(DOF).all(|(at, to)| (at - to).abs() <= CAPTURE)
    }

    /// Given up: too long, or refused too often in a row.
    pub fn stuck(&self) -> bool {
        self.steps >= STEPS_MAX || self.refused >= REFUSED_MAX
    }

    /// Where it stands, rad.
    pub fn joints(&self) -> &[f64; JOINTS_MAX] {
        &self.joints
    }

    /// The links there.
    pub fn poses(&self) -> &LinkPoses {
        &self.poses
    }

    /// S_r: 1, or -1 after a motion that was refused.
    pub fn safety(&self) -> f64 {
        self.safety
    }

    /// Steps made or refused.
    pub fn steps(&self) -> usize {
        self.steps
    }
}
