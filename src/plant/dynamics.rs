//! Inverse dynamics: the efforts that make a chain move as it was seen to move.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use tandem_msg::JOINTS_MAX;

use super::arm::{GRAVITY, JointModel, LinkMass};

/// A motion of every joint at one instant: rad, rad/s, rad/s².
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Motion {
    pub(super) position: [f64; JOINTS_MAX],
    pub(super) velocity: [f64; JOINTS_MAX],
    pub(super) acceleration: [f64; JOINTS_MAX],
}

/// Frame, velocities and accelerations of one link, in its own axes.
#[derive(Clone, Copy)]
struct Link {
    parent_from_link: Isometry3<f64>,
    force: Vector3<f64>,
    torque: Vector3<f64>,
}

/// Efforts of the joints, Nm (N where a joint slides), by recursive Newton–Euler:
/// motion outwards from the base, forces inwards from the tool. `load` is carried
/// by the last link, in that link's frame. Gravity is an upward acceleration of
/// the base.
pub(super) fn effort(joints: &[JointModel], load: Option<&LinkMass>, motion: &Motion) -> [f64; JOINTS_MAX] {
    let still = Link { parent_from_link: Isometry3::identity(), force: Vector3::zeros(), torque: Vector3::zeros() };
    let mut links = [still; JOINTS_MAX];
    let mut turning = Vector3::zeros();
    let mut turning_rate = Vector3::zeros();
    let mut acceleration = Vector3::new(0.0, 0.0, GRAVITY);
    let last = joints.len().saturating_sub(1);

    for (index, joint) in joints.iter().enumerate().take(JOINTS_MAX) {
        let axis = joint.axis.into_inner();
        let (q, qd, qdd) = (motion.position[index], motion.velocity[index], motion.acceleration[index]);
        let moved = if joint.prismatic {
            Isometry3::from_parts((axis * q).into(), UnitQuaternion::identity())
        } else {
            Isometry3::from_parts(Vector3::zeros().into(), UnitQuaternion::from_axis_angle(&joint.axis, q))
        };
        let parent_from_link = joint.parent_from_joint * moved;
        let into = parent_from_link.rotation.inverse();
        let arm = parent_from_link.translation.vector;
        acceleration = into * (acceleration + turning_rate.cross(&arm) + turning.cross(&turning.cross(&arm)));
        turning = into * turning;
        turning_rate = into * turning_rate;
        if joint.prismatic {
            acceleration += axis * qdd + turning.cross(&axis) * (2.0 * qd);
        } else {
            turning_rate += axis * qdd + turning.cross(&axis) * qd;
            turning += axis * qd;
        }
        let mass = match load {
            Some(load) if index == last => joint.link.with(load),
            _ => joint.link,
        };
        let c = mass.centre;
        let force = (acceleration + turning_rate.cross(&c) + turning.cross(&turning.cross(&c))) * mass.mass;
        let torque = mass.inertia * turning_rate + turning.cross(&(mass.inertia * turning)) + c.cross(&force);
        links[index] = Link { parent_from_link, force, torque };
    }

    let mut efforts = [0.0; JOINTS_MAX];
    let mut force = Vector3::zeros();
    let mut torque = Vector3::zeros();
    for (index, joint) in joints.iter().enumerate().take(JOINTS_MAX).rev() {
        let link = &links[index];
        force += link.force;
        torque += link.torque;
        efforts[index] = joint.axis.dot(if joint.prismatic { &force } else { &torque });
        force = link.parent_from_link.rotation * force;
        torque = link.parent_from_link.rotation * torque + link.parent_from_link.translation.vector.cross(&force);
    }
    efforts
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix3;

    fn pendulum(length: f64) -> JointModel {
        JointModel {
            parent_from_joint: Isometry3::identity(),
            axis: Vector3::y_axis(),
            prismatic: false,
            position: [-3.0, 3.0],
            velocity_max: 1.0,
            acceleration_max: 1.0,
            effort_max: 100.0,
            link: LinkMass { mass: 2.0, centre: Vector3::new(length, 0.0, 0.0), inertia: Matrix3::zeros() },
        }
    }

    /// A level pendulum is held by -m g l about y, and sped up by m l².
    #[test]
    fn a_pendulum_weighs_what_it_should() {
        let joint = [pendulum(0.5)];
        let mut motion = Motion::default();
        assert!((effort(&joint, None, &motion)[0] + 2.0 * GRAVITY * 0.5).abs() < 1e-12);
        motion.acceleration[0] = 3.0;
        assert!((effort(&joint, None, &motion)[0] - (2.0 * 0.25 * 3.0 - 2.0 * GRAVITY * 0.5)).abs() < 1e-12);
    }

    /// A load at the end adds its own moment.
    #[test]
    fn a_load_adds_its_moment() {
        let load = LinkMass { mass: 1.0, centre: Vector3::new(1.0, 0.0, 0.0), inertia: Matrix3::zeros() };
        let held = effort(&[pendulum(0.5)], Some(&load), &Motion::default())[0];
        assert!((held + GRAVITY * (2.0 * 0.5 + 1.0)).abs() < 1e-12, "{held}");
    }
}
