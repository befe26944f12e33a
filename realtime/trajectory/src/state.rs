//! What a joint is doing, and what it may do.

/// Position, velocity and acceleration of one joint.
///
/// Units are the caller's: radians or metres for the position, per second and second squared for
/// the others.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct State {
    /// Position.
    pub position: f64,
    /// Velocity.
    pub velocity: f64,
    /// Acceleration.
    pub acceleration: f64,
}

/// A multiplication takes a fraction of the time of a division.
const SIXTH: f64 = 1.0 / 6.0;

impl State {
    /// A joint standing still at `position`.
    #[must_use]
    pub const fn at_rest(position: f64) -> Self {
        Self { position, velocity: 0.0, acceleration: 0.0 }
    }

    pub(crate) fn is_finite(&self) -> bool {
        self.position.is_finite() && self.velocity.is_finite() && self.acceleration.is_finite()
    }

    /// The state after `time` seconds of constant `jerk`.
    #[must_use]
    #[inline]
    pub fn advanced(&self, time: f64, jerk: f64) -> Self {
        let State { position, velocity, acceleration } = *self;
        State {
            position: position + time * (velocity + time * (acceleration / 2.0 + time * jerk * SIXTH)),
            velocity: velocity + time * (acceleration + time * jerk / 2.0),
            acceleration: acceleration + time * jerk,
        }
    }
}

/// Limits of one joint. Lower limits are negative, upper limits positive.
///
/// An infinite jerk limit makes the joint acceleration-limited (second order: the acceleration
/// jumps, and the accelerations of start and target are not used); infinite acceleration and jerk
/// limits make it velocity-limited (first order).
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Lowest velocity, `<= 0`.
    pub velocity_min: f64,
    /// Highest velocity, `>= 0`.
    pub velocity_max: f64,
    /// Lowest acceleration, `< 0`.
    pub acceleration_min: f64,
    /// Highest acceleration, `> 0`.
    pub acceleration_max: f64,
    /// Lowest jerk, `< 0`.
    pub jerk_min: f64,
    /// Highest jerk, `> 0`.
    pub jerk_max: f64,
}

impl Limits {
    /// The same limit in both directions.
    #[must_use]
    pub const fn symmetric(velocity: f64, acceleration: f64, jerk: f64) -> Self {
        Self {
            velocity_min: -velocity,
            velocity_max: velocity,
            acceleration_min: -acceleration,
            acceleration_max: acceleration,
            jerk_min: -jerk,
            jerk_max: jerk,
        }
    }
}

impl Default for Limits {
    /// One unit of everything.
    fn default() -> Self {
        Self::symmetric(1.0, 1.0, 1.0)
    }
}
