//! How far a motion reaches, and when it passes a position.
//!
//! Within a segment the velocity `v + a t + j t^2 / 2` has at most two zeros. Between them the
//! position is monotone, so extremes lie at zeros and segment ends, and a position is passed at most
//! once between two of those.

use crate::{profile::Profile, profile::Segment, root::root_between, sqrt::sqrt};

/// A position, and when it is reached.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reached {
    /// The position.
    pub position: f64,
    /// Seconds from the start of the trajectory.
    pub time: f64,
}

/// The extreme positions of a motion, from its start to its end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extrema {
    /// The lowest, at the first time it is reached.
    pub lowest: Reached,
    /// The highest, at the first time it is reached.
    pub highest: Reached,
}

/// The times inside a segment at which its velocity is zero, rising; the segment's ends around them.
fn turns(segment: &Segment) -> [f64; 4] {
    let (v, a, j, end) = (segment.start.velocity, segment.start.acceleration, segment.jerk, segment.duration);
    let inside = |time: f64| if time > 0.0 && time < end { time } else { end };
    let roots = if j == 0.0 {
        [-v / a, end]
    } else {
        // j t^2 / 2 + a t + v = 0, by the form without cancellation.
        let root = sqrt(a * a - 2.0 * v * j);
        let q = if a > 0.0 { -a - root } else { root - a };
        [q / j, 2.0 * v / q]
    };
    let [first, second] = roots.map(inside);
    [0.0, first.min(second), first.max(second), end]
}

impl Profile {
    /// The lowest and highest positions between start and end.
    ///
    /// # Realtime
    /// No allocation; at most 14 segments of three pieces.
    #[must_use]
    pub fn extrema(&self) -> Extrema {
        let start = Reached { position: self.at(0.0).position, time: 0.0 };
        let mut extrema = Extrema { lowest: start, highest: start };
        let mut note = |position: f64, time: f64| {
            if position < extrema.lowest.position {
                extrema.lowest = Reached { position, time };
            }
            if position > extrema.highest.position {
                extrema.highest = Reached { position, time };
            }
        };
        for segment in self.segments() {
            note(segment.start.position, segment.start_time);
            if segment.duration.is_finite() {
                for time in &turns(&segment)[1..3] {
                    note(segment.start.advanced(*time, segment.jerk).position, segment.start_time + time);
                }
            }
        }
        extrema
    }

    /// The first time at which the motion is at `position`, up to its end.
    ///
    /// # Realtime
    /// No allocation; one root search, bounded by that of [`crate::Trajectory::calculate`].
    #[must_use]
    pub fn first_time_at(&self, position: f64) -> Option<f64> {
        for segment in self.segments() {
            let off = |time: f64| segment.start.advanced(time, segment.jerk).position - position;
            if segment.start.position == position {
                return Some(segment.start_time);
            }
            if segment.duration == f64::INFINITY {
                break;
            }
            let turns = turns(&segment);
            for pair in turns.windows(2) {
                let &[from, to] = pair else { continue };
                let (low, high) = (off(from), off(to));
                if to > from && low * high <= 0.0 {
                    let sign = if high >= low { 1.0 } else { -1.0 };
                    let value = |time: f64| {
                        let state = segment.start.advanced(time, segment.jerk);
                        [state.position - position, state.velocity, state.acceleration].map(|value| sign * value)
                    };
                    let time = if high == 0.0 { to } else { root_between(value, from, to, from + (to - from) / 2.0) };
                    return Some(segment.start_time + time);
                }
            }
        }
        None
    }
}
