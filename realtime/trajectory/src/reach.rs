//! In which durations a joint can reach its target.
//!
//! The motions of duration `T` between two given states form a convex set: the dynamics are linear
//! and jerk, acceleration and velocity limits are intervals. So the distances they cover form an
//! interval `[P_low(T), P_high(T)]`, whose ends are the extremal motions of [`crate::extremal`], and
//! a duration is possible if and only if the velocity can be made in it ([`crate::swing`]) and the
//! distance lies in the interval. The shortest possible one is the minimum duration; the rest of
//! the line is cut by *blocked intervals* where the distance has left the interval again.
//!
//! **A motion for any possible duration** needs no further search: with
//! `share = (D - P_low) / (P_high - P_low)`, the mixture `share * high + (1 - share) * low` of the
//! two extremal motions starts and ends in the right states, covers `D`, and keeps every limit,
//! because each limit holds for both and is convex. Its jerk takes at most 13 constant values.

use crate::{
    extremal::{Extremal, Joint, Shape},
    swing::{Durations, Swing},
};

/// One joint's position problem: its velocity problem and the distance to cover.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reach {
    pub(crate) far: Extremal,
    /// Every sign turned, so that it, too, is a farthest motion.
    pub(crate) near: Extremal,
    durations: Durations,
    distance: f64,
    /// Rounding of the distance itself.
    tie: f64,
}

/// A motion of given duration as a mixture of the two extremal ones.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mixture {
    pub(crate) far: Shape,
    pub(crate) near: Shape,
    /// Weight of `far`, 0 to 1.
    pub(crate) share: f64,
}

impl Reach {
    /// `distance` is known to within `tie`; `velocity_min` is the lowest velocity of the joint.
    pub(crate) fn new(joint: Joint, velocity_min: f64, distance: f64, tie: f64) -> Self {
        let velocities = joint.start[0].abs() + joint.end[0].abs();
        let near = joint.mirrored(-velocity_min);
        Reach {
            far: Extremal::new(joint),
            near: Extremal::new(near),
            durations: Swing::of(&joint).durations(velocities),
            distance,
            tie,
        }
    }

    /// The first possible duration not below `time`, or `None` if the target is never reached.
    pub(crate) fn next(&self, time: f64) -> Option<f64> {
        let time = self.durations.next(time);
        let end = self.durations.end(time);
        let found = self.next_before(time, end);
        if found.is_some() || end == f64::INFINITY {
            found
        } else {
            self.next_before(self.durations.gap_end, f64::INFINITY)
        }
    }

    /// The first possible duration in `[from, to]`, a connected part of what the velocity allows.
    ///
    /// If the distance lies above the interval at `from`, it enters it by crossing the upper end, and
    /// the lower end is no obstacle there, being lower; and the other way round.
    fn next_before(&self, from: f64, to: f64) -> Option<f64> {
        let tie = self.tie + self.far.tolerance(from);
        if self.distance > self.far.distance_in(from) + tie {
            self.far.first_covering(self.distance, tie, from, to)
        } else if -self.distance > self.near.distance_in(from) + tie {
            self.near.first_covering(-self.distance, tie, from, to)
        } else {
            Some(from)
        }
    }

    /// The motion that takes `time`, which must be a possible duration.
    pub(crate) fn mixture(&self, time: f64) -> Mixture {
        let (far, near) = (self.far.shape(time), self.near.shape(time));
        let (high, low) = (self.far.distance(&far), -self.near.distance(&near));
        let share = if self.distance >= high || high <= low {
            1.0
        } else if self.distance <= low {
            0.0
        } else {
            (self.distance - low) / (high - low)
        };
        Mixture { far, near, share }
    }
}
