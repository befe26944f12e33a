//! Integrates a profile exactly and compares it with what was asked. Shares nothing with the solver.

use crate::exact::Exact;
use tandem_trajectory::{Limits, Profile, State};

/// How far a profile is from what was asked.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Faults {
    /// Errors of the end state.
    pub(crate) position: f64,
    pub(crate) velocity: f64,
    pub(crate) acceleration: f64,
    /// Largest excess over a limit once inside the limits, relative to the limit, or to 1 if that is more.
    pub(crate) excess: f64,
    /// Largest relative excess over the jerk limits.
    pub(crate) jerk: f64,
    /// Largest distance of the evaluated position from the integrated one at a segment's end.
    pub(crate) drift: f64,
}

impl Faults {
    pub(crate) fn merge(&mut self, other: &Faults) {
        let largest = |a: &mut f64, b: f64| *a = if b.is_nan() { f64::INFINITY } else { a.max(b) };
        largest(&mut self.position, other.position);
        largest(&mut self.velocity, other.velocity);
        largest(&mut self.acceleration, other.acceleration);
        largest(&mut self.excess, other.excess);
        largest(&mut self.jerk, other.jerk);
        largest(&mut self.drift, other.drift);
    }
}

/// The three integrals of one constant-jerk segment.
fn advance([p, v, a]: [Exact; 3], time: f64, jerk: f64) -> [Exact; 3] {
    let (t, j) = (Exact::from(time), Exact::from(jerk));
    [p + t * (v + t * (a / 2.0 + t * j / 6.0)), v + t * (a + t * j / 2.0), a + t * j]
}

/// Checks `profile` from `start`. `target` is the end state; without a position if that is free, and
/// then the velocity limits do not count.
pub(crate) fn check(profile: &Profile, start: &State, target: &State, position: bool, limits: &Limits) -> Faults {
    let mut faults = Faults::default();
    let (second, first) =
        (limits.jerk_max.is_infinite(), limits.acceleration_max.is_infinite() && limits.jerk_max.is_infinite());
    let mut state = [start.position, start.velocity, start.acceleration].map(Exact::from);
    let mut inside = false;
    let mut end = *start;
    for segment in profile.segments() {
        end = segment.start;
        faults.drift = faults.drift.max((state[0].0 - segment.start.position).abs());
        if segment.duration == f64::INFINITY {
            break;
        }
        if second {
            state[2] = segment.start.acceleration.into();
        }
        if first {
            state[1] = segment.start.velocity.into();
        }
        faults.jerk = faults.jerk.max(segment.jerk / limits.jerk_max - 1.0).max(segment.jerk / limits.jerk_min - 1.0);
        let next = advance(state, segment.duration, segment.jerk);
        let (v, a) = (state[1].0, state[2].0);
        let lead = |jerk: f64| {
            if second { 0.0 } else { a * a / (2.0 * jerk.abs()) }
        };
        let crest = if a > 0.0 { v + lead(limits.jerk_min) } else { v };
        let trough = if a < 0.0 { v - lead(limits.jerk_max) } else { v };
        let over = |value: f64, limit: f64| (value - limit) / limit.abs().max(1.0);
        let accelerations = |a: f64| over(a, limits.acceleration_max).max(over(-a, -limits.acceleration_min));
        let velocities = |v: f64| {
            if position { over(v, limits.velocity_max).max(over(-v, -limits.velocity_min)) } else { f64::MIN }
        };
        inside = inside || velocities(crest).max(velocities(trough)).max(accelerations(a)) <= 1e-12;
        if inside {
            faults.excess = faults
                .excess
                .max(velocities(v))
                .max(velocities(next[1].0))
                .max(accelerations(a))
                .max(accelerations(next[2].0));
            if a * next[2].0 < 0.0 && segment.jerk != 0.0 {
                faults.excess = faults.excess.max(velocities(v - a * a / (2.0 * segment.jerk)));
            }
        }
        state = next;
    }
    let off = |value: Exact, wanted: f64| (value + Exact(-wanted, 0.0)).0.abs();
    faults.position = off(state[0], if position { target.position } else { end.position });
    if !first {
        faults.velocity = off(state[1], target.velocity);
    }
    if !second {
        faults.acceleration = off(state[2], target.acceleration);
    }
    faults
}
