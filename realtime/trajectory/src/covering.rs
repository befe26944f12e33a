//! The first duration in which an extremal motion covers a distance.
//!
//! See [`crate::extremal`] for the shape of the curve P(T) and the slope whose zeros cut it.

use crate::{
    extremal::{Extremal, Joint, Shape},
    root::root_between,
    sqrt::sqrt,
};

/// How many times the rounding of the inputs is forgiven where the alternative is a jump: at the top of the
/// curve, from where it would be a long way round.
pub(crate) const LOOSE: f64 = 32768.0;

impl Extremal {
    /// The first duration in `[from, to]` at which `distance` is covered, up to `rounding`, when at `from` the
    /// motion is `shape` and covers less, `before`.
    pub(crate) fn first_covering(
        &self,
        distance: f64,
        rounding: f64,
        from: f64,
        to: f64,
        mut shape: Shape,
        mut before: f64,
    ) -> Option<f64> {
        let exact = |time: f64| {
            let shape = self.shape(time);
            let off = self.distance(&shape) - distance;
            let known = off.abs() <= self.tolerance(time, &shape) / 16.0;
            [if known { 0.0 } else { off }, self.slope(&shape), self.bend(&shape)]
        };
        let mut begin = from;
        // The fall reaching from positive to negative accelerations, P(T) is convex from here on.
        let straddles = shape.high >= 0.0 && shape.low <= 0.0;
        let convex = if straddles { from } else { self.convex_from() };
        if from < convex {
            let end = to.min(convex);
            let mut marks = Marks::between(from, end);
            self.mark_pieces(&mut marks);
            marks.push(end);
            for &mark in marks.sorted() {
                let covered = self.distance_in(mark);
                if covered >= distance - rounding {
                    let middle = begin + (mark - begin) / 2.0;
                    return Some(if covered <= distance { mark } else { root_between(exact, begin, mark, middle) });
                }
                if covered < before && before >= distance - LOOSE * rounding {
                    return Some(begin);
                }
                (begin, before) = (mark, covered);
            }
            shape = self.shape(begin);
        }
        let end = to.min(self.peak_time);
        if begin < end {
            let slope = self.slope(&shape);
            if before >= distance - LOOSE * rounding && slope < 0.0 {
                return Some(begin);
            }
            let covered = self.distance_in(end);
            if covered > distance {
                return Some(root_between(
                    exact,
                    begin,
                    end,
                    begin + parabola(slope, end - begin, covered - before, distance - before),
                ));
            }
            if covered >= distance - rounding {
                return Some(end);
            }
            if covered > before {
                (begin, before) = (end, covered);
            }
        }
        if to > self.peak_time && self.joint.peak > 0.0 {
            let cruise = from.max(self.peak_time);
            let time = cruise + (distance - self.distance_in(cruise)).max(0.0) / self.joint.peak;
            if time <= to {
                return Some(time);
            }
        }
        (before >= distance - LOOSE * rounding).then_some(begin)
    }

    /// The duration from which on P(T) is convex until the cruise begins: that at which the fall first
    /// reaches from positive to negative accelerations. From there on `w` and `-x y` only grow.
    fn convex_from(&self) -> f64 {
        let (limit, c) = if self.c >= 0.0 { (self.joint.top, self.c) } else { (self.joint.bottom, -self.c) };
        let s = if c <= limit * limit { sqrt(c) } else { (limit * limit + c) / (2.0 * limit) };
        self.offset + 2.0 * self.mean * s
    }

    /// Marks every duration at which the formula or the sign of the slope of P changes.
    fn mark_pieces(&self, marks: &mut Marks) {
        let Joint { start: [v0, _], end: [vf, _], top, bottom, rise, fall, .. } = self.joint;
        let (mean, c, k_start, k_end) = (self.mean, self.c, self.k_start, self.k_end);
        if mean == 0.0 {
            marks.push(-v0 / top - vf / bottom);
            return;
        }
        let mut mark = |s: f64| marks.push(self.offset + 2.0 * mean * s);
        // Changes of case.
        if top.is_finite() && top * top >= c {
            let half = sqrt(top * top - c);
            mark(top - half);
            mark(top + half);
        }
        if bottom.is_finite() && bottom * bottom >= -c {
            let half = sqrt(bottom * bottom + c);
            mark(bottom - half);
            mark(bottom + half);
        }
        if top.is_finite() && bottom.is_finite() {
            let both = (top + bottom) * (top + bottom);
            mark((both + c) / (2.0 * top));
            mark((both - c) / (2.0 * bottom));
            // Slope with both held: w = -beta A B / 2.
            let crest = -fall * top * bottom / 2.0;
            mark(((crest - k_start) / top + (crest - k_end) / bottom) / (2.0 * mean) + (top + bottom) / 2.0);
        }
        // Slope without hold: (alpha + 2 beta) s^4 + 4 (K0 + Kf) s^2 + alpha c^2 = 0.
        for square in quadratic(rise + 2.0 * fall, 2.0 * (k_start + k_end), rise * c * c) {
            if square > 0.0 {
                mark(sqrt(square));
            }
        }
        // Slope while held at A: m y^2 - beta A y / 2 + Kf = 0, and the same in reverse at -B.
        if top.is_finite() {
            for low in quadratic(mean, -fall * top / 4.0, k_end) {
                mark(((top - low) * (top - low) + c) / (2.0 * top));
            }
        }
        if bottom.is_finite() {
            for high in quadratic(mean, fall * bottom / 4.0, k_start) {
                mark(((bottom + high) * (bottom + high) - c) / (2.0 * bottom));
            }
        }
    }
}

/// Where the parabola that starts with `slope` and has risen by `rise` after `width` has risen by `part`.
fn parabola(slope: f64, width: f64, rise: f64, part: f64) -> f64 {
    let bend = (rise - slope * width) / (width * width);
    let root = sqrt((slope * slope + 4.0 * bend * part).max(0.0));
    let place = if slope > 0.0 { 2.0 * part / (slope + root) } else { (root - slope) / (2.0 * bend) };
    if place > 0.0 && place < width { place } else { width / 2.0 }
}

/// Real roots of `a z^2 + 2 b z + c` with `a > 0`, without cancellation; empty is NaN.
fn quadratic(a: f64, b: f64, c: f64) -> [f64; 2] {
    let discriminant = b * b - a * c;
    if discriminant < 0.0 {
        return [f64::NAN; 2];
    }
    let root = sqrt(discriminant);
    let q = if b > 0.0 { -b - root } else { root - b };
    [q / a, if q == 0.0 { 0.0 } else { c / q }]
}

/// Durations inside an open interval, sorted; at most 16.
struct Marks {
    times: [f64; 16],
    count: usize,
    from: f64,
    to: f64,
}

impl Marks {
    fn between(from: f64, to: f64) -> Self {
        Marks { times: [0.0; 16], count: 0, from, to }
    }

    /// Keeps `time` if it lies inside; NaN does not.
    fn push(&mut self, time: f64) {
        if time > self.from && time <= self.to && self.count < self.times.len() {
            let mut place = self.count;
            while place > 0 && self.times[place - 1] > time {
                self.times[place] = self.times[place - 1];
                place -= 1;
            }
            self.times[place] = time;
            self.count += 1;
        }
    }

    fn sorted(&self) -> &[f64] {
        &self.times[..self.count.min(self.times.len())]
    }
}
