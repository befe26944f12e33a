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

//!
//! **A motion recomputed every cycle from its own output** collects roundings. In its last phases it is at its
//! limits, with nothing left to correct them: a distance too far by `d` then costs a swing past the target and
//! back, of duration `cbrt(32 d / jerk)`, which for a rounding is microseconds, and near a moving target all
//! the way round once more. So a miss that such roundings explain is no miss ([`Reach::covering`]).

use crate::{
    covering::LOOSE,
    extremal::{Extremal, Joint, Shape},
    motion::Phases,
    sqrt::sqrt,
    swing::{ARRIVAL_SHARE, COLLECTED, Durations, Swing},
};

/// Durations this close, relatively, differ by rounding.
const ARRIVAL_TIE: f64 = 8.0 * f64::EPSILON;

/// Roundings of a position that a motion recomputed from its own output collects.
const ROUNDINGS: f64 = 64.0;

/// The way gone in the time that a correction takes may be so many times the miss.
const DISPROPORTIONATE: f64 = 4.0;

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
        let durations = swing.durations(velocities);
        let found = Mixture { time: f64::NAN, far: far.peak_shape, near: far.peak_shape, share: 1.0 };
        let (near, arrival) = (None, -1.0);
        let mut reach = Reach { far, near, velocity_min, durations, distance, rounding, allowed, arrival, found };
        if let Some(time) = swing.straight(velocities, joint.peak.max(-velocity_min)) {
            let off = (distance - swing.straight_distance(time, joint.start[0])).abs();
            let work = ((joint.end[1] - joint.start[1]).abs() * time * time).max(velocities * time);
            let rounding = rounding + reach.far.distance_known(time).1;
            if off <= allowed + ROUNDINGS * rounding + reach.collected(rounding, work) {
                reach.arrival = time;
            }
        }
        reach
    }

    /// What collected roundings may make of a position, of which a single one is `rounding`: those of the way
    /// on which the joint brakes from its highest velocity, so far as it explains them by its position or by
    /// the `work` of the motion.
    fn collected(&self, rounding: f64, work: f64) -> f64 {
        // Where there is no work, nothing has been collected on it.
        let explained = if work > 0.0 { LOOSE * rounding + ARRIVAL_SHARE * work } else { 0.0 };
        explained.min(2.0 * COLLECTED * self.braking())
    }

    /// The way on which the joint brakes from its highest velocity, or somewhat more.
    fn braking(&self) -> f64 {
        let Joint { peak, top, bottom, .. } = self.far.joint;
        let speed = peak.max(-self.velocity_min);
        speed * (speed / top.min(bottom) + 2.0 * sqrt(speed * self.far.mean))
    }

    /// How far off a motion of duration `time` may be found to end.
    pub(crate) fn slack(&self, time: f64) -> f64 {
        let known = self.far.distance_known(time).1;
        self.allowed + 2.0 * COLLECTED * self.braking() + LOOSE * (self.rounding + known)
    }

    /// The first duration in `[from, to]` at which `extremal` covers `distance`, when at `from` it is `shape` and
    /// covers less, `before`; one at which it misses, if to correct that is out of proportion.
    fn covering(
        &self,
        extremal: &Extremal,
        (distance, rounding): (f64, f64),
        (from, to): (f64, f64),
        (shape, before): (Shape, f64),
    ) -> Option<f64> {
        let first = |distance: f64| extremal.first_covering(distance, rounding, from, to, shape, before);
        let exact = first(distance);
        let off = distance - self.allowed - before;
        if off <= COLLECTED * self.braking() && self.takes_too_long(off, from, exact) {
            return Some(from);
        }
        if self.allowed > 0.0
            && let Some(sooner) = first(distance - self.allowed)
            && self.takes_too_long(self.allowed, sooner, exact)
        {
            return Some(sooner);
        }
        exact
    }

    /// Whether to correct a miss by `off` is out of proportion, if that takes from one time to another.
    fn takes_too_long(&self, off: f64, from: f64, to: Option<f64>) -> bool {
        let Joint { start: [v0, a0], end: [vf, af], .. } = self.far.joint;
        let longer = to.map_or(f64::INFINITY, |to| to - from);
        longer * (v0.abs() + vf.abs() + longer * (a0.abs() + af.abs())) > DISPROPORTIONATE * off
    }

    pub(crate) fn joint(&self) -> &Joint {
        &self.far.joint
    }

    /// The nearest motions.
    fn near(&mut self) -> &Extremal {
        let (joint, velocity_max) = (&self.far.joint, -self.velocity_min);
        self.near.get_or_insert_with(|| Extremal::new(joint.mirrored(velocity_max)))
    }

    /// Whether the acceleration keeps its sign in the motion that takes `time`, and with it the velocity the
    /// limits that it keeps at both ends.
    pub(crate) fn keeps_sign(&mut self, time: f64) -> bool {
        let Mixture { far, near, share, .. } = self.mixture(time);
        let before = self.far.joint.start[1];
        let keeps = |shape: &Shape, sign: f64| {
            shape.cruise == 0.0 && sign * shape.high * before >= 0.0 && sign * shape.low * before >= 0.0
        };
        (share == 0.0 || keeps(&far, 1.0)) && (share == 1.0 || keeps(&near, -1.0))
    }

    /// The same problem from another start.
    pub(crate) fn started(&self, start: [f64; 2], distance: f64) -> Self {
        let joint = Joint { start, ..self.far.joint };
        Reach::new(joint, self.velocity_min, distance, self.rounding, self.allowed)
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
        let distance = self.distance;
        let far = self.far.shape(from);
        let high = self.far.distance(&far);
        let rounding = self.rounding + self.far.tolerance(from, &far);
        if distance > high + self.allowed + rounding {
            let time = self.covering(&self.far, (distance, rounding), (from, to), (far, high))?;
            let far = self.far.shape(time);
            self.found = Mixture { time, far, near: far, share: 1.0 };
            return Some(time);
        }
        let near = self.near().shape(from);
        let low = -self.near().distance(&near);
        let rounding = self.rounding + self.near().tolerance(from, &near);
        if distance < low - self.allowed - rounding {
            let time = self.covering(self.near.as_ref()?, (-distance, rounding), (from, to), (near, -low))?;
            let near = self.near().shape(time);
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
