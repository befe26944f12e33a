//! Straight motions of the joints, swept.

use tandem_kinematics::{Chain, JOINTS_MAX, JointKind};

use crate::Monitor;

/// Looks along one motion; a motion that needs more is called not clear.
const LOOKS_MAX: u32 = 4_096;

impl Monitor {
    /// Whether the motion from `from` to `to`, straight in joint positions, keeps more than `margin`
    /// metres to scene and arm itself all the way, within `resolution` metres.
    ///
    /// True means it does, between looks as well: no point of the arm moves farther per unit of a joint
    /// than its reach, so from a clearance `d` the arm may go on until it could have used up `d − margin`.
    /// Where less than `resolution` is left the motion is called not clear, so a motion that
    /// keeps `margin + resolution` is always found clear.
    pub fn path_is_clear(
        &self,
        chain: &Chain,
        from: &[f64; JOINTS_MAX],
        to: &[f64; JOINTS_MAX],
        margin: f64,
        resolution: f64,
    ) -> bool {
        let count = chain.joint_count();
        let mut offsets = [0.0; JOINTS_MAX];
        for (index, joint) in chain.joints().iter().enumerate() {
            let slide = match joint.kind {
                JointKind::Revolute => 0.0,
                JointKind::Prismatic => joint.position_min.abs().max(joint.position_max.abs()),
            };
            offsets[index] = joint.parent_from_joint.translation.vector.norm() + slide;
        }
        let reaches = self.reaches(&offsets, chain.tool(), count);
        let mut travel = 0.0;
        for (index, joint) in chain.joints().iter().enumerate() {
            let lever = if joint.kind == JointKind::Revolute { reaches[index] } else { 1.0 };
            travel += lever * (to[index] - from[index]).abs();
        }
        if !travel.is_finite() || resolution <= 0.0 || resolution.is_nan() {
            return false;
        }
        let mut done = 0.0;
        for _ in 0..LOOKS_MAX {
            let share = done;
            let position = core::array::from_fn(|k| from[k] + share * (to[k] - from[k]));
            let left = self.clearance(&chain.forward(&position)).distance - margin;
            if left.is_nan() || left < resolution {
                return false;
            }
            if done >= 1.0 {
                return true;
            }
            done = if left.is_infinite() || travel <= 0.0 { 1.0 } else { (done + left / travel).min(1.0) };
        }
        false
    }
}
