//! What a trajectory is asked for.

use crate::{
    error::Error,
    extremal::Joint,
    state::{Limits, State},
};

/// Relative excess of a target over a limit that counts as being on it: roundings of the inputs.
const TIE: f64 = 4.0 * f64::EPSILON;

/// What a joint's target is.
#[repr(u8)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interface {
    /// Position, velocity and acceleration.
    #[default]
    Position,
    /// Velocity and acceleration; where the joint ends is free, and the velocity limits are not
    /// used: the fastest change of velocity is wanted.
    Velocity,
}

/// How a joint shares its duration with the others.
#[repr(u8)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Synchronization {
    /// All such joints arrive together.
    #[default]
    Time,
    /// As [`Synchronization::Time`] if the target moves; a target at rest is reached as early as
    /// the joint can.
    TimeIfNecessary,
    /// On a straight line through joint space if the states lie on one and that takes no longer
    /// than arriving together; otherwise as [`Synchronization::Time`].
    Phase,
    /// On a straight line, slower if it must be; [`Error::NotStraight`] if the states lie on none.
    StrictPhase,
    /// As early as the joint can.
    None,
}

/// A motion to calculate: where each of `N` joints is, where it shall go, and its limits.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Input<const N: usize> {
    /// State at the start. It may lie outside the limits; the trajectory then begins by braking.
    pub start: [State; N],
    /// State at the end, within the limits unless `target_outside`.
    pub target: [State; N],
    /// Limits of each joint.
    pub limits: [Limits; N],
    /// How far from its target position a joint may end where more exactness would cost time out of proportion,
    /// as when the start is measured with noise. A joint that brakes at its limits has nothing left to correct a
    /// miss `d` with, and swings past the target and back, for `cbrt(32 d / jerk)` seconds. Noise of size `e` in
    /// every cycle of `h` seconds comes to about `4 e (1 + t) sqrt(1 + t / h)` in `t` seconds of braking. 0 asks
    /// for the target to within roundings, and what a motion recomputed from its own output collects of them.
    pub tolerance: [f64; N],
    /// Lowest and highest position each joint may take on the way. There is no way round them: a motion
    /// that would pass one is [`Error::PositionLimit`]. Infinite for none.
    pub position_min: [f64; N],
    /// See `position_min`.
    pub position_max: [f64; N],
    /// Return to a velocity limit that the start exceeds without dipping below it: slower than the
    /// fastest return, and what one wants after lowering a limit in motion.
    pub soft_limits: [bool; N],
    /// Take a target outside the limits, which is an error otherwise: the trajectory then ends by leaving
    /// them, as late and as fast as a start outside them would have come back.
    pub target_outside: [bool; N],
    /// The shortest duration wanted, in seconds; 0 for none.
    pub minimum_duration: f64,
    /// If above 0, durations are whole multiples of it, in seconds.
    pub duration_step: f64,
    /// A joint that is not enabled goes on with constant acceleration from its start.
    pub enabled: [bool; N],
    /// What each joint's target is.
    pub interface: [Interface; N],
    /// How each joint shares its duration with the others.
    pub synchronization: [Synchronization; N],
}

impl<const N: usize> Default for Input<N> {
    /// All joints enabled, at rest at zero, with unit limits, arriving together.
    fn default() -> Self {
        Input {
            start: [State::default(); N],
            target: [State::default(); N],
            limits: [Limits::default(); N],
            tolerance: [0.0; N],
            position_min: [f64::NEG_INFINITY; N],
            position_max: [f64::INFINITY; N],
            soft_limits: [false; N],
            target_outside: [false; N],
            minimum_duration: 0.0,
            duration_step: 0.0,
            enabled: [true; N],
            interface: [Interface::Position; N],
            synchronization: [Synchronization::Time; N],
        }
    }
}

/// The part of an input that concerns one joint.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JointInput {
    pub(crate) interface: Interface,
    pub(crate) start: State,
    pub(crate) target: State,
    pub(crate) limits: Limits,
    pub(crate) tolerance: f64,
    pub(crate) soft: bool,
    pub(crate) target_outside: bool,
}

impl<const N: usize> Input<N> {
    pub(crate) fn joint(&self, index: usize) -> JointInput {
        JointInput {
            interface: self.interface[index],
            start: self.start[index],
            target: self.target[index],
            limits: self.limits[index],
            tolerance: self.tolerance[index].max(0.0),
            soft: self.soft_limits[index],
            target_outside: self.target_outside[index],
        }
    }
}

/// The limits of one joint as the solver wants them, after a check.
#[inline(always)]
pub(crate) fn check(index: usize, input: &JointInput) -> Result<Joint, Error> {
    let JointInput { interface, start, target, limits, .. } = input;
    let interface = *interface;
    if !start.is_finite() || !target.is_finite() || !input.tolerance.is_finite() {
        return Err(Error::NotFinite { joint: index });
    }
    let Limits { velocity_min, velocity_max, acceleration_min, acceleration_max, jerk_min, jerk_max } = *limits;
    let velocities = velocity_min <= 0.0 && velocity_max >= 0.0 && velocity_min.is_finite() && velocity_max.is_finite();
    let signs = acceleration_min < 0.0 && acceleration_max > 0.0 && jerk_min < 0.0 && jerk_max > 0.0;
    if !signs || (interface == Interface::Position && !velocities) {
        return Err(Error::Limits { joint: index });
    }
    let joint = Joint {
        start: [start.velocity, start.acceleration],
        end: [target.velocity, target.acceleration],
        peak: velocity_max,
        top: acceleration_max,
        bottom: -acceleration_min,
        rise: 1.0 / jerk_max,
        fall: -1.0 / jerk_min,
    };
    if !joint.rise.is_finite() || !joint.fall.is_finite() {
        return Err(Error::OutOfRange { joint: index });
    }
    if input.target_outside {
        return Ok(joint);
    }
    let (v, a) = (target.velocity, target.acceleration);
    let over = |value: f64, limit: f64| value - limit > TIE * (value.abs() + limit.abs());
    if interface == Interface::Position && (over(v, velocity_max) || over(-v, -velocity_min)) {
        return Err(Error::TargetVelocity { joint: index });
    }
    if joint.rise + joint.fall == 0.0 {
        return Ok(joint);
    }
    if over(a, acceleration_max) || over(-a, -acceleration_min) {
        return Err(Error::TargetAcceleration { joint: index });
    }
    let before = if a < 0.0 { v + joint.fall * a * a / 2.0 } else { v };
    let after = if a > 0.0 { v - joint.rise * a * a / 2.0 } else { v };
    if interface == Interface::Position && (over(before, velocity_max) || over(-after, -velocity_min)) {
        return Err(Error::TargetAcceleration { joint: index });
    }
    Ok(joint)
}
