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
    covering::Tie,
    extremal::{Extremal, Joint, Shape},
    motion::Phases,
    state::State,
    swing::{ARRIVAL_SHARE, Durations, Swing},
};

/// Durations this close, relatively, differ by rounding.
const ARRIVAL_TIE: f64 = 8.0 * f64::EPSILON;

/// The same share of the distance that is run without the jerk.
const ARRIVAL_RUN: f64 = 1e-6;

/// Roundings that a motion recomputed from its own output collects in its last moments.
const ROUNDINGS: f64 = 64.0;

/// One joint's position problem: its velocity problem and the distance to cover.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reach {
    far: Extremal,
    /// Every sign turned, so that it, too, is a farthest motion; made when first needed.
    near: Option<Extremal>,
    /// Lowest velocity.
    velocity_min: f64,
    durations: Durations,
    distance: f64,
    /// Rounding of the distance itself.
    rounding: f64,
    /// How far from the distance is near enough.
    allowed: f64,
    /// How long the rest takes if one jerk does it up to roundings, else negative. A motion recomputed
    /// every cycle from its own output ends like that, with nothing left to correct its roundings.
    arrival: f64,
    /// The motion of the duration last found.
    found: Mixture,
}

/// A motion of given duration as a mixture of the two extremal ones.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mixture {
    /// The duration; NaN for no motion.
    time: f64,
    far: Shape,
    near: Shape,
    /// Weight of `far`, 0 to 1.
    share: f64,
}

impl Reach {
    /// `distance` is known to within `rounding`, and `allowed` off it is near enough; `velocity_min` is
    /// the lowest velocity of the joint.
    #[inline(always)]
    pub(crate) fn new(joint: Joint, velocity_min: f64, distance: f64, rounding: f64, allowed: f64) -> Self {
        let velocities = joint.start[0].abs() + joint.end[0].abs();
        let far = Extremal::new(joint);
        let swing = Swing::of(&joint);
        let arrival = swing.straight(velocities, joint.peak.max(-velocity_min)).filter(|time| {
            let off = distance - swing.straight_distance(*time, joint.start[0]);
            let rounding = rounding + far.distance_known(*time).1;
            let tie = Tie::new(rounding, allowed);
            let bend = (joint.end[1] - joint.start[1]).abs() * time * time;
            let run = (joint.start[0].abs() + joint.end[0].abs()) * time;
            let work = (ARRIVAL_SHARE * bend).max(ARRIVAL_RUN * run);
            off.abs() <= tie.tight + ROUNDINGS * rounding + (tie.loose - allowed).min(work)
        });
        let durations = swing.durations(velocities);
        let arrival = arrival.unwrap_or(-1.0);
        let found = Mixture { time: f64::NAN, far: far.peak_shape, near: far.peak_shape, share: 1.0 };
        Reach { far, near: None, velocity_min, durations, distance, rounding, allowed, arrival, found }
    }

    pub(crate) fn joint(&self) -> &Joint {
        &self.far.joint
    }

    /// The nearest motions.
    fn near(&mut self) -> &Extremal {
        let (joint, velocity_max) = (&self.far.joint, -self.velocity_min);
        self.near.get_or_insert_with(|| Extremal::new(joint.mirrored(velocity_max)))
    }

    /// How long the rest takes if one jerk does it up to roundings, or else the fastest change of velocity,
    /// on which the acceleration keeps its sign and so the velocity its limits; else negative.
    pub(crate) fn arrival(&self) -> f64 {
        if self.arrival >= 0.0 {
            return self.arrival;
        }
        let Joint { start: [velocity, before], end: [_, after], rise, fall, .. } = self.far.joint;
        let jerks = [-1.0 / fall, 0.0, 1.0 / rise];
        let time = self.durations.first;
        let mut state = State { position: 0.0, velocity, acceleration: before };
        for phase in Swing::of(&self.far.joint).waiting(time, velocity) {
            if phase.acceleration * (before + after) < 0.0 {
                return -1.0;
            }
            let jerk = jerks[(phase.slope + 1).clamp(0, 2) as usize];
            state = State { velocity: phase.velocity, acceleration: phase.acceleration, ..state };
            state = state.advanced(phase.duration, jerk);
        }
        let off = (self.distance - state.position).abs();
        let run = (velocity.abs() + state.velocity.abs()) * time;
        let rounding = self.rounding + self.far.distance_known(time).1;
        let tie = ROUNDINGS * rounding + (Tie::new(rounding, 0.0).loose).min(ARRIVAL_RUN * run);
        if before * after >= 0.0 && off <= tie + self.allowed { time } else { -1.0 }
    }

    /// Whether one jerk does the rest in no less than `time`.
    fn arrives_by(&self, time: f64) -> bool {
        time <= self.arrival * (1.0 + ARRIVAL_TIE)
    }

    /// The first possible duration not below `time`, or `None` if the target is never reached.
    pub(crate) fn next(&mut self, time: f64) -> Option<f64> {
        if self.arrives_by(time) {
            return Some(time.max(self.arrival));
        }
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
    fn next_before(&mut self, from: f64, to: f64) -> Option<f64> {
        let (distance, rounding, allowed) = (self.distance, self.rounding, self.allowed);
        let far = self.far.shape(from);
        let high = self.far.distance(&far);
        let tie = Tie::new(rounding + self.far.tolerance(from, &far), allowed);
        if distance > high + tie.tight {
            let time = self.far.first_covering(distance, tie, from, to, far, high)?;
            let far = self.far.shape(time);
            self.found = Mixture { time, far, near: far, share: 1.0 };
            return Some(time);
        }
        let extremal = self.near();
        let near = extremal.shape(from);
        let low = -extremal.distance(&near);
        let tie = Tie::new(rounding + extremal.tolerance(from, &near), allowed);
        if distance < low - tie.tight {
            let time = extremal.first_covering(-distance, tie, from, to, near, -low)?;
            let near = extremal.shape(time);
            self.found = Mixture { time, far, near, share: 0.0 };
            return Some(time);
        }
        self.found = Mixture { time: from, far, near, share: self.share(low, high) };
        Some(from)
    }

    /// The motion that takes `time`, which must be a possible duration.
    fn mixture(&mut self, time: f64) -> Mixture {
        if self.found.time == time {
            return self.found;
        }
        let far = self.far.shape(time);
        let high = self.far.distance(&far);
        if self.distance >= high {
            return Mixture { time, far, near: far, share: 1.0 };
        }
        let extremal = self.near();
        let near = extremal.shape(time);
        let low = -extremal.distance(&near);
        Mixture { time, far, near, share: self.share(low, high) }
    }

    /// The weight with which the distance lies between `low` and `high`.
    fn share(&self, low: f64, high: f64) -> f64 {
        if self.distance >= high || high <= low {
            1.0
        } else if self.distance <= low {
            0.0
        } else {
            (self.distance - low) / (high - low)
        }
    }

    /// The farthest motion of duration `time` and the nearest, each if it has a part in the one wanted, and
    /// the weight of the first.
    #[inline(always)]
    pub(crate) fn motions(&mut self, time: f64) -> (Option<Phases>, Option<Phases>, f64) {
        let Mixture { far, near, share, .. } = self.mixture(time);
        let far = (share > 0.0).then(|| self.far.phases(&far, 1.0));
        let near = (share < 1.0).then(|| self.near().phases(&near, -1.0));
        (far, near, share)
    }
}
