//! A policy rolled out ahead of time: joint positions one after another, none of which is ever commanded
//! before the whole way was found clear.
//!
//! Training steps the same code, so what a policy learned to expect is what it gets.

#![allow(clippy::neg_cmp_op_on_partial_ord, reason = "`!(a > b)` is meant: what is no number fails the check")]

use tandem_clearance::{Clearance, Monitor};
use tandem_kinematics::{Chain, JOINTS_MAX, LinkPoses};

use crate::observe::{DOF, Destination, Observation, Surroundings, observe};

/// Largest increment of a joint in a step, rad.
pub const STEP: f32 = 0.12;
/// Steps of a rollout, after which it is given up.
pub const STEPS_MAX: usize = 60;
/// Within this of the goal in every joint the straight rest of the way is the controller's, rad.
pub const CAPTURE: f64 = 0.25;
/// Motions in a row that may be refused.
pub const REFUSED_MAX: u32 = 4;
/// Looks along one step: a step moves the arm by a few hand's breadths at most.
const LOOKS: usize = 3;

/// Where a rollout stands.
#[derive(Clone, Debug)]
pub struct Rollout {
    joints: [f64; JOINTS_MAX],
    poses: LinkPoses,
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
        let clearance = monitor.clearance(&poses);
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
    /// would, and the episode goes on. (Episodes that end at contact were learned to be ended.)
    ///
    /// # Realtime
    /// At most [`LOOKS`] clearance queries and one forward solution each; no allocation.
    pub fn advance(&mut self, chain: &Chain, monitor: &Monitor, action: &[f32; DOF], margin: f64) -> bool {
        self.steps += 1;
        // Eq. (14): six joint angles, here as bounded increments that are added up: an absolute angle would
        // make a motion of one step.
        let mut to = self.joints;
        for ((to, by), joint) in to.iter_mut().zip(action).zip(chain.joints()) {
            *to = (*to + f64::from(*by)).clamp(joint.position_min, joint.position_max);
        }
        for look in 1..LOOKS {
            let share = look as f64 / LOOKS as f64;
            let between = core::array::from_fn(|k| self.joints[k] + share * (to[k] - self.joints[k]));
            if !monitor.is_clear(&chain.forward(&between), margin) {
                return self.refuse();
            }
        }
        let poses = chain.forward(&to);
        let clearance = monitor.clearance(&poses);
        if !(clearance.distance > margin) {
            return self.refuse();
        }
        self.place(&to, poses, clearance);
        true
    }

    /// Stands at a joint position, whatever is there.
    pub fn jump(&mut self, chain: &Chain, monitor: &Monitor, to: &[f64; JOINTS_MAX]) {
        let poses = chain.forward(to);
        let clearance = monitor.clearance(&poses);
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

    /// Clearance there.
    pub fn clearance(&self) -> &Clearance {
        &self.clearance
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
