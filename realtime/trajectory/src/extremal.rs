//! The farthest a joint can get in a given duration.
//!
//! Among all motions from (v0, a0) to (vf, af) that take exactly `T` and keep the limits, one is
//! above all others at every instant: it raises the velocity as early as it can and drops it as
//! late as it can. Its acceleration rises from a0 to `x`, waits there if `x = A`, falls to zero,
//! waits there (cruise) if the velocity has reached its limit `V`, falls on to `y`, waits there if
//! `y = -B`, and rises to af. Without a cruise the fall goes through and `x`, `y` may have the same
//! sign. The motion that gets least far is the same with every sign turned ([`Joint::mirrored`]).
//!
//! With `alpha = 1 / jerk_max`, `beta = 1 / |jerk_min|` and `m = (alpha + beta) / 2`, the velocity
//! is `K0 + alpha a^2 / 2` on the first rise, `w - beta a^2 / 2` on the fall and
//! `Kf + alpha a^2 / 2` on the last rise, where
//!
//! ```text
//! K0 = v0 - alpha a0^2 / 2      Kf = vf - alpha af^2 / 2      c = (Kf - K0) / m
//! w  = K0 + m x^2 + x hold(x)   = Kf + m y^2 + |y| hold(y)    (w: velocity at a = 0)
//! T  = alpha (af - a0) + 2 m s,  2 m s = 2 m (x - y) + hold(x) + hold(y) + cruise
//! ```
//!
//! so that for a given `T`, hence `s`, every case has a closed form:
//!
//! ```text
//! no hold         x - y = s, x + y = c / s            valid while x <= A and y >= -B
//! hold at A       x = A,  (A - y)^2 = 2 A s - c       hold = 2 m (s - (x - y))
//! hold at -B      y = -B, (x + B)^2 = 2 B s + c       hold = 2 m (s - (x - y))
//! both            w (1/A + 1/B) = 2 m (s - (A + B)/2) + K0/A + Kf/B
//! cruise          w = V, x and y from V - K0 = m x^2 + .., V - Kf = m y^2 + ..
//! ```
//!
//! The distance covered changes with the duration by
//!
//! ```text
//! dP/dT = w - beta x y / 2     before the cruise,      dP/dT = V     with it
//! ```
//!
//! and its second derivative follows from those of `w` and `x y` in each case ([`Extremal::bend`]).
//!
//! Once the fall reaches from a positive `x` to a negative `y`, this only grows, up to the cruise: the
//! curve P(T) is convex, and a distance not yet covered is first covered at one place, found by
//! Newton's iteration. Before that, where both have the same sign, the zeros of the slope, which are
//! roots of quadratics in each case, and the changes of case cut the curve into at most 16 pieces, on
//! each of which it is monotone and given by one formula.

use crate::{motion::Phases, sqrt::sqrt};

/// One joint's velocity problem and limits, seen in one direction.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Joint {
    /// Velocity and acceleration at the start.
    pub(crate) start: [f64; 2],
    /// Velocity and acceleration at the end.
    pub(crate) end: [f64; 2],
    /// Highest velocity (`V`).
    pub(crate) peak: f64,
    /// Highest acceleration (`A`).
    pub(crate) top: f64,
    /// Lowest acceleration, negated (`B`).
    pub(crate) bottom: f64,
    /// `1 / jerk_max` (`alpha`).
    pub(crate) rise: f64,
    /// `1 / |jerk_min|` (`beta`).
    pub(crate) fall: f64,
}

impl Joint {
    /// The joint as it moves backwards in time, positions mirrored, so that velocities and jerks keep
    /// their signs.
    pub(crate) fn reversed(&self) -> Self {
        let Joint { start, end, peak, top, bottom, rise, fall } = *self;
        Joint { start: [end[0], -end[1]], end: [start[0], -start[1]], peak, top: bottom, bottom: top, rise, fall }
    }

    /// The same joint with every sign turned; `peak` is its highest velocity then.
    pub(crate) fn mirrored(&self, peak: f64) -> Self {
        Joint {
            start: [-self.start[0], -self.start[1]],
            end: [-self.end[0], -self.end[1]],
            peak,
            top: self.bottom,
            bottom: self.top,
            rise: self.fall,
            fall: self.rise,
        }
    }
}

/// Switching values of the farthest motion for one duration.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shape {
    /// Acceleration after the first rise (`x`).
    pub(crate) high: f64,
    /// Acceleration after the fall (`y`).
    pub(crate) low: f64,
    /// Velocity at zero acceleration on the line of the fall (`w`).
    pub(crate) crest: f64,
    /// Time waited at `high`.
    pub(crate) hold_high: f64,
    /// Time at the velocity limit.
    pub(crate) cruise: f64,
    /// Time waited at `low`.
    pub(crate) hold_low: f64,
}

/// The farthest motions of one joint, one for each duration.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extremal {
    pub(crate) joint: Joint,
    pub(crate) k_start: f64,
    pub(crate) k_end: f64,
    pub(crate) c: f64,
    /// `m`.
    pub(crate) mean: f64,
    /// `alpha (af - a0)`: the duration at `s = 0`.
    pub(crate) offset: f64,
    /// The shape that just reaches the velocity limit, and its duration.
    pub(crate) peak_shape: Shape,
    pub(crate) peak_time: f64,
}

/// Relative error of an evaluated distance, in units of its largest term.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

impl Extremal {
    pub(crate) fn new(joint: Joint) -> Self {
        let Joint { start: [v0, a0], end: [vf, af], peak, top, bottom, rise, fall } = joint;
        let mean = (rise + fall) / 2.0;
        let k_start = v0 - rise * a0 * a0 / 2.0;
        let k_end = vf - rise * af * af / 2.0;
        // The difference of the K without their rounding where both squares are large.
        let k_gain = (vf - v0) - rise * (af - a0) * (af + a0) / 2.0;
        let (high, hold_high) = climb(peak - k_start, top, mean);
        let (low, hold_low) = climb(peak - k_end, bottom, mean);
        let peak_shape = Shape { high, low: -low, crest: peak, hold_high, cruise: 0.0, hold_low };
        let offset = rise * (af - a0);
        let ramps = if mean == 0.0 { 0.0 } else { 2.0 * mean * (high + low) };
        let peak_time = (offset + ramps + hold_high + hold_low).max(0.0);
        let c = if mean == 0.0 { 0.0 } else { k_gain / mean };
        Extremal { joint, k_start, k_end, c, mean, offset, peak_shape, peak_time }
    }

    /// The farthest motion of duration `time`, which must be a possible one ([`crate::swing`]).
    pub(crate) fn shape(&self, time: f64) -> Shape {
        if time >= self.peak_time {
            return Shape { cruise: time - self.peak_time, ..self.peak_shape };
        }
        let Joint { start: [_, a0], end: [_, af], top, bottom, .. } = self.joint;
        let (mean, c) = (self.mean, self.c);
        if mean == 0.0 {
            return self.both_held(time);
        }
        let s = (time - self.offset) / (2.0 * mean);
        let u = if s > 0.0 { c / s } else { 0.0 };
        let (above, below) = (s + u > 2.0 * top, s - u > 2.0 * bottom);
        if above {
            let low = top - sqrt((2.0 * top * s - c).max(0.0));
            if low > af && top - af > s {
                return self.turning(af + s, af);
            }
            if low >= -bottom {
                return self.held_high(low.min(af), s);
            }
        }
        if below {
            let high = sqrt((2.0 * bottom * s + c).max(0.0)) - bottom;
            if high < a0 && a0 + bottom > s {
                return self.turning(a0, a0 - s);
            }
            if high <= top {
                return self.held_low(high.max(a0), s);
            }
        }
        if above || below {
            return self.both_held(time);
        }
        // The first rise and the last one cannot be shorter than nothing. They come out so by rounding
        // where the whole is little more than one rise, and c / s means nothing.
        if s + u < 2.0 * a0 {
            self.turning(a0, (a0 - s).min(af))
        } else if u - s > 2.0 * af {
            self.turning((af + s).max(a0), af)
        } else {
            self.turning((s + u) / 2.0, (u - s) / 2.0)
        }
    }

    /// The shape without holds.
    fn turning(&self, high: f64, low: f64) -> Shape {
        let crest = (self.k_start + self.k_end + self.mean * (high * high + low * low)) / 2.0;
        Shape { high, low, crest, hold_high: 0.0, cruise: 0.0, hold_low: 0.0 }
    }

    fn held_high(&self, low: f64, s: f64) -> Shape {
        let (high, crest) = (self.joint.top, self.k_end + self.mean * low * low);
        let hold_high = (2.0 * self.mean * (s - (high - low))).max(0.0);
        Shape { high, low, crest, hold_high, cruise: 0.0, hold_low: 0.0 }
    }

    fn held_low(&self, high: f64, s: f64) -> Shape {
        let (low, crest) = (-self.joint.bottom, self.k_start + self.mean * high * high);
        let hold_low = (2.0 * self.mean * (s - (high - low))).max(0.0);
        Shape { high, low, crest, hold_high: 0.0, cruise: 0.0, hold_low }
    }

    fn both_held(&self, time: f64) -> Shape {
        let Joint { top, bottom, .. } = self.joint;
        let free = time - self.offset - self.mean * (top + bottom);
        let crest = (free + self.k_start / top + self.k_end / bottom) / (1.0 / top + 1.0 / bottom);
        let hold_high = ((crest - self.k_start) / top - self.mean * top).max(0.0);
        let hold_low = ((crest - self.k_end) / bottom - self.mean * bottom).max(0.0);
        Shape { high: top, low: -bottom, crest, hold_high, cruise: 0.0, hold_low }
    }

    /// Distance covered by a shape.
    pub(crate) fn distance(&self, shape: &Shape) -> f64 {
        let Joint { start: [_, a0], end: [_, af], rise, fall, .. } = self.joint;
        let Shape { high: x, low: y, crest, hold_high, cruise, hold_low } = *shape;
        let (xx, yy) = (x * x, y * y);
        let mut distance = cruise * crest;
        if self.mean > 0.0 {
            distance += rise * (x - a0) * (self.k_start + rise * (xx + x * a0 + a0 * a0) / 6.0);
            distance += fall * (x - y) * (crest - fall * (xx + x * y + yy) / 6.0);
            distance += rise * (af - y) * (self.k_end + rise * (af * af + af * y + yy) / 6.0);
        }
        if hold_high > 0.0 {
            distance += hold_high * (self.k_start + crest + (rise - fall) * xx / 2.0) / 2.0;
        }
        if hold_low > 0.0 {
            distance += hold_low * (self.k_end + crest + (rise - fall) * yy / 2.0) / 2.0;
        }
        distance
    }

    /// Distance covered in `time`.
    pub(crate) fn distance_in(&self, time: f64) -> f64 {
        self.distance(&self.shape(time))
    }

    /// dP/dT.
    pub(crate) fn slope(&self, shape: &Shape) -> f64 {
        if shape.cruise > 0.0 || self.mean == 0.0 {
            shape.crest
        } else {
            shape.crest - self.joint.fall * shape.high * shape.low / 2.0
        }
    }

    /// d²P/dT²: the derivatives of `w` and of `x y` in each case.
    pub(crate) fn bend(&self, shape: &Shape) -> f64 {
        let Joint { top, bottom, fall, .. } = self.joint;
        let (x, y) = (shape.high, shape.low);
        if shape.cruise > 0.0 || self.mean == 0.0 {
            return 0.0;
        }
        let ratio = fall / (4.0 * self.mean);
        match (shape.hold_high > 0.0, shape.hold_low > 0.0) {
            (true, true) => top * bottom / (top + bottom),
            (true, false) => x * (ratio * x - y) / (x - y),
            (false, true) => -y * (x - ratio * y) / (x - y),
            (false, false) => {
                let (s, square) = (x - y, (x + y) * (x + y) / (x - y));
                (s - square) / 4.0 + ratio * (s + square) / 2.0
            }
        }
    }

    /// How exactly the distance covered by a shape of duration `time` is known.
    pub(crate) fn tolerance(&self, time: f64, shape: &Shape) -> f64 {
        ROUNDING * time * (self.k_start.abs() + self.k_end.abs() + shape.crest.abs())
    }

    /// Distance covered in `time`, and how exactly it is known.
    pub(crate) fn distance_known(&self, time: f64) -> (f64, f64) {
        let shape = self.shape(time);
        (self.distance(&shape), self.tolerance(time, &shape))
    }

    /// The constant-jerk parts of a shape, in order, with their signs turned by `sign`.
    #[inline(always)]
    pub(crate) fn phases(&self, shape: &Shape, sign: f64) -> Phases {
        let Joint { start: [v0, a0], end: [_, af], rise, fall, .. } = self.joint;
        let Shape { high: x, low: y, crest, hold_high, cruise, hold_low } = *shape;
        let mut phases = Phases::new();
        if self.mean == 0.0 {
            phases.push(sign, hold_high, self.k_start, x, 0);
            phases.push(sign, cruise, crest, 0.0, 0);
            phases.push(sign, hold_low, crest, y, 0);
            return phases;
        }
        phases.push(sign, rise * (x - a0), v0, a0, 1);
        phases.push(sign, hold_high, self.k_start + rise * x * x / 2.0, x, 0);
        let down = if cruise > 0.0 { x } else { x - y };
        phases.push(sign, fall * down, crest - fall * x * x / 2.0, x, -1);
        if cruise > 0.0 {
            phases.push(sign, cruise, crest, 0.0, 0);
            phases.push(sign, fall * -y, crest, 0.0, -1);
        }
        phases.push(sign, hold_low, crest - fall * y * y / 2.0, y, 0);
        phases.push(sign, rise * (af - y), self.k_end + rise * y * y / 2.0, y, 1);
        phases
    }
}

/// The acceleration and the wait at it with which a velocity `gain` is made from rest to rest.
fn climb(gain: f64, limit: f64, mean: f64) -> (f64, f64) {
    let gain = gain.max(0.0);
    if mean == 0.0 {
        (limit, gain / limit)
    } else if gain > mean * limit * limit {
        (limit, gain / limit - mean * limit)
    } else {
        (sqrt(gain / mean), 0.0)
    }
}
