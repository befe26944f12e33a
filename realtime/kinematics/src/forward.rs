//! Where the links are, and how the TCP moves when the joints do.

use nalgebra::{Isometry3, SMatrix, Translation3, UnitQuaternion, Vector3};

use crate::chain::is_finite;
use crate::sin_cos::sin_cos;
use crate::{Chain, JOINTS_MAX, JointKind};

/// TCP twist per joint speed: rows 0–2 linear (m/s), rows 3–5 angular (rad/s), in base axes;
/// columns of joints that are not in use are 0.
pub type Jacobian = SMatrix<f64, 6, JOINTS_MAX>;

/// Poses of all links for one position of the joints.
#[derive(Clone, Copy, Debug)]
pub struct LinkPoses {
    /// `[0]` is the base, `[i]` the frame moved by joint i (counted from 1); past `count` identity.
    pub base_from_link: [Isometry3<f64>; JOINTS_MAX + 1],
    /// The tool centre point.
    pub base_from_tcp: Isometry3<f64>,
    /// Moving joints; the links in use are `0..=count`.
    pub count: usize,
}

impl LinkPoses {
    /// Whether every pose holds finite numbers only.
    pub fn is_finite(&self) -> bool {
        // Each pose is made from the one before it, so what is not finite stays so up to the TCP.
        is_finite(&self.base_from_tcp)
    }
}

impl Chain {
    /// Poses of all links; `position` in rad or m, entries past the joints in use are ignored.
    ///
    /// # Realtime
    /// Bounded by [`JOINTS_MAX`]; no allocation. Positions that are not finite give poses that are not.
    pub fn forward(&self, position: &[f64; JOINTS_MAX]) -> LinkPoses {
        let count = self.joint_count().min(JOINTS_MAX);
        let mut poses = LinkPoses {
            base_from_link: [Isometry3::identity(); JOINTS_MAX + 1],
            base_from_tcp: Isometry3::identity(),
            count,
        };
        let (sines, cosines) = sin_cos(&core::array::from_fn(|k| if k < count { 0.5 * position[k] } else { 0.0 }));
        let mut rotation = UnitQuaternion::identity();
        let mut origin = Vector3::zeros();
        for (index, (joint, link)) in self.joints().iter().zip(&self.links).enumerate() {
            match joint.kind {
                JointKind::Revolute => {
                    let (sin, cos) = (sines[index], cosines[index]);
                    origin += rotation * link.offset;
                    rotation *= UnitQuaternion::new_unchecked(link.at_rest * cos + link.turning * sin);
                }
                JointKind::Prismatic => {
                    origin += rotation * (link.offset + link.axis_in_parent * position[index]);
                    rotation *= UnitQuaternion::new_unchecked(link.at_rest);
                }
            }
            poses.base_from_link[index + 1] = Isometry3::from_parts(Translation3::from(origin), rotation);
        }
        poses.base_from_tcp = poses.base_from_link[count] * self.tool;
        poses
    }

    /// Poses of all links and the TCP's Jacobian.
    ///
    /// # Realtime
    /// Bounded by [`JOINTS_MAX`]; no allocation.
    pub fn jacobian(&self, position: &[f64; JOINTS_MAX]) -> (LinkPoses, Jacobian) {
        let poses = self.forward(position);
        (poses, self.jacobian_at(&poses, &poses.base_from_tcp.translation.vector))
    }

    /// The Jacobian of a point that moves with the link after the last joint up to
    /// `poses.count`, in base coordinates; `poses` must be this chain's.
    pub(crate) fn jacobian_at(&self, poses: &LinkPoses, point: &Vector3<f64>) -> Jacobian {
        let mut jacobian = Jacobian::zeros();
        for (index, (joint, link)) in self.joints().iter().zip(&self.links).enumerate() {
            let pose = &poses.base_from_link[index + 1];
            let axis = pose.rotation * link.axis;
            let mut column = jacobian.column_mut(index);
            match joint.kind {
                JointKind::Revolute => {
                    column.fixed_rows_mut::<3>(0).copy_from(&axis.cross(&(point - pose.translation.vector)));
                    column.fixed_rows_mut::<3>(3).copy_from(&axis);
                }
                JointKind::Prismatic => column.fixed_rows_mut::<3>(0).copy_from(&axis),
            }
        }
        jacobian
    }

    /// Velocity in base axes (m/s) of a point of the arm: `link` as in [`LinkPoses`], `point` in base
    /// coordinates, `velocity` of the joints. A point of the base stands still.
    ///
    /// # Realtime
    /// Bounded by [`JOINTS_MAX`]; no allocation.
    pub fn point_velocity(
        &self,
        poses: &LinkPoses,
        link: usize,
        point: &Vector3<f64>,
        velocity: &[f64; JOINTS_MAX],
    ) -> Vector3<f64> {
        let mut sum = Vector3::zeros();
        for (index, (joint, constants)) in self.joints().iter().zip(&self.links).take(link).enumerate() {
            let pose = &poses.base_from_link[index + 1];
            let axis = pose.rotation * constants.axis;
            sum += velocity[index]
                * match joint.kind {
                    JointKind::Revolute => axis.cross(&(point - pose.translation.vector)),
                    JointKind::Prismatic => axis,
                };
        }
        sum
    }
}

/// Yoshikawa's manipulability √det(J·Jᵀ): 0 where the TCP has lost a direction of motion.
/// Chains of fewer than six joints always answer 0.
pub fn manipulability(jacobian: &Jacobian) -> f64 {
    (jacobian * jacobian.transpose()).determinant().max(0.0).sqrt()
}
