//! The chain itself: checked once, then plain constants.

use core::fmt;

use nalgebra::{Isometry3, Quaternion, Unit, Vector3};

use crate::JOINTS_MAX;
use crate::inverse::ClosedForm;
use crate::tcp::Recursion;

/// How a joint moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointKind {
    /// Turns about its axis; position in radians. A continuous joint is one with wide limits.
    Revolute,
    /// Slides along its axis; position in metres.
    Prismatic,
}

/// One moving joint. Positions in rad (m when prismatic), rates in that unit per second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    /// How it moves.
    pub kind: JointKind,
    /// Frame of the joint at position 0 in the frame the previous joint moves.
    pub parent_from_joint: Isometry3<f64>,
    /// Axis of motion in the joint's own frame.
    pub axis: Unit<Vector3<f64>>,
    /// Smallest position.
    pub position_min: f64,
    /// Largest position.
    pub position_max: f64,
    /// Largest speed.
    pub velocity_max: f64,
    /// Largest acceleration.
    pub acceleration_max: f64,
    /// Largest jerk.
    pub jerk_max: f64,
    /// Largest motor effort, Nm (N when prismatic).
    pub effort_max: f64,
}

impl Joint {
    /// What a slot that is not in use holds.
    const UNUSED: fn() -> Self = || Self {
        kind: JointKind::Revolute,
        parent_from_joint: Isometry3::identity(),
        axis: Vector3::z_axis(),
        position_min: 0.0,
        position_max: 0.0,
        velocity_max: 0.0,
        acceleration_max: 0.0,
        jerk_max: 0.0,
        effort_max: 0.0,
    };

    /// The position nearest to `near` that puts the joint in the same place as `position`
    /// (whole turns apart when it turns) and lies within its limits.
    pub(crate) fn equivalent(&self, position: f64, near: f64) -> Option<f64> {
        const TURN: f64 = core::f64::consts::TAU;
        // A solution on the limit may come out on its far side by rounding.
        const SLACK: f64 = 1e-9;
        let inside = |q: f64| q >= self.position_min - SLACK && q <= self.position_max + SLACK;
        let clamp = |q: f64| q.max(self.position_min).min(self.position_max);
        if self.kind == JointKind::Prismatic {
            return inside(position).then(|| clamp(position));
        }
        let nearest = position + TURN * ((near - position) / TURN).round();
        let side = if nearest > near { -TURN } else { TURN };
        let mut candidate = nearest;
        if !inside(candidate) {
            candidate = nearest + side;
        }
        if !inside(candidate) {
            // `near` may itself lie outside the limits: the turn that is nearest to their middle.
            let middle = 0.5 * (self.position_min + self.position_max);
            candidate = position + TURN * ((middle - position) / TURN).round();
        }
        inside(candidate).then(|| clamp(candidate))
    }
}

/// Why joints make no chain.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ChainError {
    /// No joint was given.
    Empty,
    /// More joints than [`JOINTS_MAX`].
    TooManyJoints {
        /// Joints given.
        count: usize,
    },
    /// A pose, axis or limit of this joint (counted from 0; the tool counts as the next) is not finite.
    NotFinite {
        /// Index of the joint.
        joint: usize,
    },
    /// The lower position limit lies above the upper one.
    InvertedLimits {
        /// Index of the joint.
        joint: usize,
        /// Lower limit.
        position_min: f64,
        /// Upper limit.
        position_max: f64,
    },
    /// A speed, acceleration, jerk or effort limit is not above 0.
    NotPositive {
        /// Index of the joint.
        joint: usize,
        /// Name of the limit.
        limit: &'static str,
        /// Its value.
        value: f64,
    },
}

impl fmt::Display for ChainError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Empty => write!(f, "the chain has no moving joint, allowed 1..={JOINTS_MAX}"),
            Self::TooManyJoints { count } => {
                write!(f, "the chain has {count} moving joints, allowed 1..={JOINTS_MAX}; fix some of them")
            }
            Self::NotFinite { joint } => write!(f, "joint {joint}: a pose, axis or limit is not a finite number"),
            Self::InvertedLimits { joint, position_min, position_max } => {
                write!(f, "joint {joint}: position_min = {position_min} is above position_max = {position_max}")
            }
            Self::NotPositive { joint, limit, value } => {
                write!(f, "joint {joint}: {limit} = {value}, allowed above 0")
            }
        }
    }
}

impl core::error::Error for ChainError {}

/// A serial chain of moving joints with a tool at its end.
#[derive(Clone, Copy, Debug)]
pub struct Chain {
    joints: [Joint; JOINTS_MAX],
    count: usize,
    /// Frame of the last joint to TCP.
    pub(crate) tool: Isometry3<f64>,
    /// Derived from `joints`, what forward kinematics needs of each.
    pub(crate) links: [LinkConstants; JOINTS_MAX],
    /// Derived from `joints` and `tool`: the short way to the TCP.
    pub(crate) recursion: Recursion,
    /// Present when the closed form applies.
    pub(crate) closed_form: Option<ClosedForm>,
}

/// Constants of one joint: the local rotation at position q is `at_rest·cos(q/2) + turning·sin(q/2)`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LinkConstants {
    pub(crate) at_rest: Quaternion<f64>,
    pub(crate) turning: Quaternion<f64>,
    pub(crate) offset: Vector3<f64>,
    /// Axis in the parent's frame, for sliding joints.
    pub(crate) axis_in_parent: Vector3<f64>,
    pub(crate) axis: Vector3<f64>,
}

impl LinkConstants {
    fn of(joint: &Joint) -> Self {
        let at_rest = joint.parent_from_joint.rotation.into_inner();
        Self {
            at_rest,
            turning: at_rest * Quaternion::from_imag(joint.axis.into_inner()),
            offset: joint.parent_from_joint.translation.vector,
            axis_in_parent: joint.parent_from_joint.rotation * joint.axis.into_inner(),
            axis: joint.axis.into_inner(),
        }
    }
}

impl Chain {
    /// A chain of `joints` from the base outwards; `tool` is the TCP in the frame the last one moves.
    ///
    /// # Errors
    /// What [`ChainError`] names: the first fault found, joints in order.
    pub fn new(joints: &[Joint], tool: Isometry3<f64>) -> Result<Self, ChainError> {
        if joints.is_empty() {
            return Err(ChainError::Empty);
        }
        if joints.len() > JOINTS_MAX {
            return Err(ChainError::TooManyJoints { count: joints.len() });
        }
        let mut slots = [Joint::UNUSED(); JOINTS_MAX];
        for (index, (slot, joint)) in slots.iter_mut().zip(joints).enumerate() {
            *slot = checked(index, joint)?;
        }
        if !is_finite(&tool) {
            return Err(ChainError::NotFinite { joint: joints.len() });
        }
        let mut chain = Self {
            joints: slots,
            count: joints.len(),
            tool,
            links: slots.map(|joint| LinkConstants::of(&joint)),
            recursion: Recursion::of(joints, &tool),
            closed_form: None,
        };
        chain.closed_form = ClosedForm::of(&chain);
        Ok(chain)
    }

    /// Moving joints.
    pub fn joint_count(&self) -> usize {
        self.count
    }

    /// The moving joints, from the base outwards.
    pub fn joints(&self) -> &[Joint] {
        &self.joints[..self.count.min(JOINTS_MAX)]
    }

    /// The TCP in the frame the last joint moves.
    pub fn tool(&self) -> &Isometry3<f64> {
        &self.tool
    }

    /// Whether every joint in use is within its position limits, by at least `margin` (rad or m).
    pub fn is_within_limits(&self, position: &[f64; JOINTS_MAX], margin: f64) -> bool {
        self.joints()
            .iter()
            .zip(position)
            .all(|(joint, &q)| q >= joint.position_min + margin && q <= joint.position_max - margin)
    }
}

fn checked(index: usize, joint: &Joint) -> Result<Joint, ChainError> {
    let numbers = [
        joint.position_min,
        joint.position_max,
        joint.velocity_max,
        joint.acceleration_max,
        joint.jerk_max,
        joint.effort_max,
    ];
    let axis_is_unit = (joint.axis.norm() - 1.0).abs() < 1e-6;
    if !numbers.iter().all(|x| x.is_finite()) || !is_finite(&joint.parent_from_joint) || !axis_is_unit {
        return Err(ChainError::NotFinite { joint: index });
    }
    if joint.position_min > joint.position_max {
        let Joint { position_min, position_max, .. } = *joint;
        return Err(ChainError::InvertedLimits { joint: index, position_min, position_max });
    }
    let limits = [
        ("velocity_max", joint.velocity_max),
        ("acceleration_max", joint.acceleration_max),
        ("jerk_max", joint.jerk_max),
        ("effort_max", joint.effort_max),
    ];
    for (limit, value) in limits {
        if value <= 0.0 {
            return Err(ChainError::NotPositive { joint: index, limit, value });
        }
    }
    Ok(*joint)
}

/// Whether a pose holds finite numbers only.
pub(crate) fn is_finite(pose: &Isometry3<f64>) -> bool {
    pose.translation.vector.iter().all(|x| x.is_finite()) && pose.rotation.coords.iter().all(|x| x.is_finite())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn joint() -> Joint {
        Joint {
            position_min: -3.0,
            position_max: 3.0,
            velocity_max: 1.0,
            acceleration_max: 1.0,
            jerk_max: 1.0,
            effort_max: 1.0,
            ..Joint::UNUSED()
        }
    }

    /// Each fault is named with the joint and the numbers.
    #[test]
    fn faults_are_named() {
        let of = |joints: &[Joint]| Chain::new(joints, Isometry3::identity()).unwrap_err().to_string();
        assert_eq!(of(&[]), "the chain has no moving joint, allowed 1..=8");
        assert_eq!(of(&[joint(); 9]), "the chain has 9 moving joints, allowed 1..=8; fix some of them");
        let nan = Joint { position_max: f64::NAN, ..joint() };
        assert_eq!(of(&[joint(), nan]), "joint 1: a pose, axis or limit is not a finite number");
        let inverted = Joint { position_min: 4.0, ..joint() };
        assert_eq!(of(&[inverted]), "joint 0: position_min = 4 is above position_max = 3");
        let still = Joint { velocity_max: 0.0, ..joint() };
        assert_eq!(of(&[still]), "joint 0: velocity_max = 0, allowed above 0");
    }

    /// Whole turns are used to come near, but never past a limit.
    #[test]
    fn the_nearest_turn_within_limits_is_taken() {
        let wide = Joint { position_min: -7.0, position_max: 7.0, ..joint() };
        let turn = core::f64::consts::TAU;
        assert_eq!(wide.equivalent(0.5, 6.0), Some(0.5 + turn));
        assert_eq!(wide.equivalent(1.0, 6.0), Some(1.0));
        assert_eq!(joint().equivalent(3.1, 0.0), None);
        assert_eq!(joint().equivalent(2.5 + turn, 100.0), Some(2.5));
    }
}
