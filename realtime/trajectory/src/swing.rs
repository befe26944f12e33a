//! In which durations a joint can get from one velocity and acceleration to another.
//!
//! Write `alpha = 1 / jerk_max` (seconds per unit of acceleration when it rises), `beta =
//! 1 / |jerk_min|` (when it falls), `A` for the highest acceleration and `-B` for the lowest. In a
//! given duration `T` the velocity gained is largest when the acceleration first rises to some `x`
//! (waits there if `x = A`) and then falls to its final value; smallest when it first falls to some
//! `y` and then rises. Every gain between the two is reached by a mixture of both, because jerk and
//! acceleration limits are convex. So a duration is possible if and only if
//!
//! ```text
//! low(T) <= gain <= high(T)
//! high: T = alpha (x - a0) + beta (x - af)   2 high = alpha (x^2 - a0^2) + beta (x^2 - af^2)
//! low:  T = beta (a0 - y) + alpha (af - y)   2 low  = beta (a0^2 - y^2) + alpha (af^2 - y^2)
//! ```
//!
//! plus a wait at `A` or `-B`. Both curves leave the same point, the *tip*: one jerk straight from
//! `a0` to `af`. The slope of `high` is `x`, that of `low` is `y`, so `high` meets a gain above the
//! tip exactly once, and `low` lies above it at most once, for `y` in `(-r, r)`: that is the gap.
//! It is there when both accelerations are positive: a short transition gains little, a long one
//! must first get rid of the acceleration.

use crate::{extremal::Joint, motion::Phase, sqrt::sqrt};

/// Relative width within which a gain counts as the gain of the tip: some roundings of the inputs.
const TIE: f64 = 8.0 * f64::EPSILON;

/// The same where the alternative is to turn the acceleration round first: roundings of a motion
/// recomputed thousands of times from its own output.
const LOOSE_TIE: f64 = 512.0 * TIE;

/// Roundings that a motion recomputed from its own output collects, of the largest numbers on the way.
pub(crate) const COLLECTED: f64 = 1024.0 * f64::EPSILON;

/// The share of what one jerk does that its collected roundings may amount to.
pub(crate) const ARRIVAL_SHARE: f64 = 1.0 / 16.0;

/// A change of velocity: `gain` while the acceleration goes from `start` to `end`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Swing {
    /// Acceleration at the start (`a0`).
    pub(crate) start: f64,
    /// Acceleration at the end (`af`).
    pub(crate) end: f64,
    /// Velocity to gain.
    pub(crate) gain: f64,
    /// Highest acceleration (`A`).
    pub(crate) top: f64,
    /// Lowest acceleration, negated (`B`).
    pub(crate) bottom: f64,
    /// `1 / jerk_max` (`alpha`).
    pub(crate) rise: f64,
    /// `1 / |jerk_min|` (`beta`).
    pub(crate) fall: f64,
}

/// The possible durations: from `first` on, except the open interval `(gap_start, gap_end)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Durations {
    pub(crate) first: f64,
    /// Infinite without a gap.
    pub(crate) gap_start: f64,
    /// Infinite without a gap.
    pub(crate) gap_end: f64,
    /// The acceleration that is waited at, or turned at, in the motion that takes `first`; NaN where that is
    /// one jerk.
    plateau: f64,
}

impl Durations {
    /// The first possible duration not below `time`.
    pub(crate) fn next(&self, time: f64) -> f64 {
        let time = time.max(self.first);
        if time > self.gap_start && time < self.gap_end { self.gap_end } else { time }
    }

    /// The end of the connected part that holds `time`.
    pub(crate) fn end(&self, time: f64) -> f64 {
        if time <= self.gap_start { self.gap_start } else { f64::INFINITY }
    }
}

impl Swing {
    pub(crate) fn of(joint: &Joint) -> Self {
        let Joint { start: [v0, a0], end: [vf, af], top, bottom, rise, fall, .. } = *joint;
        Swing { start: a0, end: af, gain: vf - v0, top, bottom, rise, fall }
    }

    /// A joint whose velocity problem this is; its velocity is not limited.
    pub(crate) fn joint(&self) -> Joint {
        let Swing { start, end, gain, top, bottom, rise, fall } = *self;
        Joint { start: [0.0, start], end: [gain, end], peak: f64::INFINITY, top, bottom, rise, fall }
    }

    /// The possible durations of this swing. `velocity_scale` is the size of the velocities whose
    /// difference `gain` is, for the width of a tie.
    pub(crate) fn durations(&self, velocity_scale: f64) -> Durations {
        let Swing { start, end, gain, top, bottom, rise, fall } = *self;
        let none = f64::INFINITY;
        if rise + fall == 0.0 {
            let plateau = if gain >= 0.0 { top } else { -bottom };
            return Durations { first: gain / plateau, gap_start: none, gap_end: none, plateau };
        }
        let (tip_time, tip_gain) = self.tip();
        let scale = velocity_scale + (rise + fall) * (start * start + end * end) / 2.0;
        let off = (gain - tip_gain).abs();
        let jumps = if gain < tip_gain { start.min(end) > 0.0 } else { start.max(end) < 0.0 };
        if off <= TIE * scale || (jumps && off <= LOOSE_TIE * scale) {
            let mut durations = Durations { first: tip_time, gap_start: none, gap_end: none, plateau: f64::NAN };
            if start.min(end) > 0.0 {
                (durations.gap_start, durations.gap_end) = self.gap();
            } else if start.max(end) < 0.0 {
                (durations.gap_start, durations.gap_end) = self.mirrored().gap();
            }
            durations.gap_start = durations.gap_start.max(tip_time);
            durations
        } else {
            let (side, sign) = if gain > tip_gain { (*self, 1.0) } else { (self.mirrored(), -1.0) };
            let durations = side.above();
            Durations { plateau: sign * durations.plateau, ..durations }
        }
    }

    /// How long one jerk from the first acceleration to the second takes, if the velocity it gains
    /// differs from the wanted one by no more than the roundings that a motion recomputed from its own
    /// output collects; `velocity_max` says how large its velocities have been.
    pub(crate) fn straight(&self, velocity_scale: f64, velocity_max: f64) -> Option<f64> {
        let Swing { start, end, gain, rise, fall, .. } = *self;
        let (time, tip_gain) = self.tip();
        let scale = velocity_scale + (rise + fall) * (start * start + end * end) / 2.0;
        let collected = (COLLECTED * velocity_max).min(ARRIVAL_SHARE * tip_gain.abs());
        ((gain - tip_gain).abs() <= LOOSE_TIE * scale + collected).then_some(time)
    }

    /// Distance covered by one jerk straight from `start` to `end` in `time`.
    pub(crate) fn straight_distance(&self, time: f64, velocity: f64) -> f64 {
        time * (velocity + time * (2.0 * self.start + self.end) / 6.0)
    }

    /// Duration and gain of one jerk straight from `start` to `end`.
    fn tip(&self) -> (f64, f64) {
        let Swing { start, end, rise, fall, .. } = *self;
        let change = if end >= start { rise } else { -fall };
        (change * (end - start), change * ((end - start) * (end + start)) / 2.0)
    }

    /// The motion that makes the gain in `time`, which must be possible: up or down to some acceleration
    /// `p`, a wait there, and on to the last. Its gain rises with `p`, and between the two extremal motions
    /// there is always time for its ramps, as they take least where the extremes take no more than `time`.
    ///
    /// ```text
    /// p above both:  gain = p (T + alpha a0 + beta af) - (alpha a0^2 + beta af^2 + (alpha + beta) p^2) / 2
    /// p below both:  the same in reverse
    /// p between:     gain = tip + p (T - ramp), one ramp straight from a0 to af
    /// ```
    #[inline(always)]
    pub(crate) fn waiting(&self, time: f64, velocity: f64, durations: &Durations) -> [Phase; 3] {
        let Swing { start, end, rise, fall, .. } = *self;
        let fastest = time == durations.first && !durations.plateau.is_nan();
        let plateau = if fastest { durations.plateau } else { self.plateau(time) };
        let ramp = |from: f64, to: f64| {
            let (change, slope) = if to >= from { (rise, 1) } else { (-fall, -1) };
            (change * (to - from), change, slope)
        };
        let (first, change, slope) = ramp(start, plateau);
        let (last, _, slope_last) = ramp(plateau, end);
        let wait = (time - first - last).max(0.0);
        let turned = velocity + change * (plateau - start) * (plateau + start) / 2.0;
        let phase = |duration, velocity, acceleration, slope| Phase { duration, velocity, acceleration, slope };
        [
            phase(first, velocity, start, slope),
            phase(wait, turned, plateau, 0),
            phase(last, turned + wait * plateau, plateau, slope_last),
        ]
    }

    /// The acceleration to wait at so that the gain is made in `time`.
    fn plateau(&self, time: f64) -> f64 {
        let Swing { start, end, gain, top, bottom, rise, fall } = *self;
        let (tip_time, tip_gain) = self.tip();
        let rest = (time - tip_time).max(0.0);
        let (high, low) = (start.max(end), start.min(end));
        // What is to gain beyond waiting at the higher acceleration, or at the lower.
        let (more, less) = (gain - tip_gain - high * rest, tip_gain + low * rest - gain);
        if rise + fall == 0.0 {
            if time > 0.0 { (gain / time).max(-bottom).min(top) } else { 0.0 }
        } else if more > 0.0 || less > 0.0 {
            let (sign, edge, more, limit) =
                if more > 0.0 { (1.0, high, more, top) } else { (-1.0, -low, less, bottom) };
            sign * above(edge, more, rest, (rise + fall) / 2.0).min(limit)
        } else if rest > 0.0 {
            ((gain - tip_gain) / rest).max(low).min(high)
        } else {
            start
        }
    }

    /// The same swing with every sign turned.
    pub(crate) fn mirrored(&self) -> Self {
        let Swing { start, end, gain, top, bottom, rise, fall } = *self;
        Swing { start: -start, end: -end, gain: -gain, top: bottom, bottom: top, rise: fall, fall: rise }
    }

    /// Durations when the gain lies above that of the tip: `high` gives the first, `low` the gap.
    #[inline]
    fn above(&self) -> Durations {
        let Swing { start, end, gain, top, rise, fall, .. } = *self;
        let turn = sqrt((2.0 * gain + rise * start * start + fall * end * end) / (rise + fall));
        let first = if turn <= top {
            rise * (turn - start) + fall * (turn - end)
        } else {
            let ramps = (rise * (top * top - start * start) + fall * (top * top - end * end)) / 2.0;
            rise * (top - start) + fall * (top - end) + (gain - ramps) / top
        };
        let (gap_start, gap_end) = if start > 0.0 && end > 0.0 { self.gap() } else { (f64::INFINITY, f64::INFINITY) };
        Durations { first: first.max(0.0), gap_start: gap_start.max(first), gap_end, plateau: turn.min(top) }
    }

    /// Where `low` exceeds the gain, for positive accelerations at both ends.
    fn gap(&self) -> (f64, f64) {
        let Swing { start, end, gain, bottom, rise, fall, .. } = *self;
        let squared = (fall * start * start + rise * end * end - 2.0 * gain) / (rise + fall);
        if squared <= 0.0 || squared.is_nan() {
            return (f64::INFINITY, f64::INFINITY);
        }
        let turn = sqrt(squared);
        let middle = fall * start + rise * end;
        let gap_end = if turn <= bottom {
            middle + (rise + fall) * turn
        } else {
            let ramps = (fall * (start * start - bottom * bottom) + rise * (end * end - bottom * bottom)) / 2.0;
            middle + (rise + fall) * bottom + (ramps - gain) / bottom
        };
        (middle - (rise + fall) * turn, gap_end)
    }
}

/// The acceleration `p` above `high` at which a motion gains `more` than if it waited at `high` for `rest`,
/// of which the further ramps take `2 m (p - high)`:  `(p - high) rest - m (p - high)^2 = more`.
fn above(high: f64, more: f64, rest: f64, mean: f64) -> f64 {
    let root = sqrt((rest * rest - 4.0 * mean * more).max(0.0));
    high + (2.0 * more / (rest + root)).min(rest / (2.0 * mean))
}
