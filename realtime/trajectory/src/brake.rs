//! The prefix that brings a start outside the limits back inside.
//!
//! It is part of the definition of the trajectory, because "within the limits" says nothing about
//! a state outside them. First the acceleration returns to its band as fast as the jerk allows.
//! Then a velocity that is above its limit `V`, or bound to pass it, is brought down as fast as
//! possible: the acceleration falls (to `-B` at most, waiting there) until the velocity has come
//! down to `V`, or until falling any longer would carry it below the opposite limit `W`:
//!
//! ```text
//! a^2 = a0^2 + 2 (v0 - V) / beta                          the velocity is V at acceleration -|a|
//! a^2 = (beta a0^2 + 2 (v0 - W)) / (alpha + beta)         zeroing -|a| by the jerk just leaves W
//! ```
//!
//! The time-optimal motion proper starts there. A velocity below `W` is the same, mirrored.
//!
//! That is the fastest way back, but it arrives at `V` still slowing down, so the velocity dips below
//! the limit before it can stay there: by `alpha a^2 / 2`, which after a limit has been lowered on the
//! fly may be all of it. A *soft* return gives the acceleration back in time and comes to `V` with none:
//!
//! ```text
//! a^2 = (beta a0^2 + 2 (v0 - V)) / (alpha + beta)         zeroing -|a| by the jerk arrives at V
//! ```
//!
//! A target outside the limits gets a *suffix*: such a prefix, seen backwards in time.

use crate::{extremal::Joint, motion::Phase, sqrt::sqrt};

/// Relative excess over a velocity limit that counts as being on it: roundings of the inputs.
const TIE: f64 = 16.0 * f64::EPSILON;

/// A soft return falls, waits and rises; others do with two.
pub(crate) const STEPS_MAX: usize = 3;

/// The steps before the motion proper, and the velocity and acceleration they end with.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Prefix {
    /// Unused steps have no duration.
    pub(crate) steps: [Phase; STEPS_MAX],
    pub(crate) end: [f64; 2],
}

/// The prefix of a joint starting at `joint.start`; `velocity_min` is its lowest velocity. `soft` asks
/// for a return to the velocity limit that does not dip below it. `None` for a start within the limits.
#[inline]
pub(crate) fn prefix(joint: &Joint, velocity_min: f64, soft: bool) -> Option<Prefix> {
    let [velocity, acceleration] = joint.start;
    // Whatever a start does that is within the limits and can stay there, nothing is to do.
    let square = acceleration * acceleration;
    let rising = if acceleration > 0.0 { joint.fall * square / 2.0 } else { 0.0 };
    let falling = if acceleration < 0.0 { joint.rise * square / 2.0 } else { 0.0 };
    let contained = acceleration <= joint.top && acceleration >= -joint.bottom;
    if contained && velocity + rising <= joint.peak && velocity - falling >= velocity_min {
        return None;
    }
    back(joint, velocity_min, soft)
}

/// The prefix of a start that is not within the limits; `None` if it is up to rounding.
#[cold]
fn back(joint: &Joint, velocity_min: f64, soft: bool) -> Option<Prefix> {
    let [velocity, _] = joint.start;
    let mut prefix = Prefix::none(joint);
    if joint.rise + joint.fall == 0.0 {
        let (limit, braking) = if velocity > joint.peak {
            (joint.peak, -joint.bottom)
        } else if velocity < velocity_min {
            (velocity_min, joint.top)
        } else {
            return None;
        };
        prefix.steps[0] = Phase { duration: (limit - velocity) / braking, velocity, acceleration: braking, slope: 0 };
        prefix.end = [limit, 0.0];
        return Some(prefix);
    }
    prefix.contain(joint);
    let below = joint.mirrored(-velocity_min);
    if !(soft && (prefix.settle(joint, 1.0) || prefix.settle(&below, -1.0))) && !prefix.lower(joint, velocity_min, 1.0)
    {
        prefix.lower(&below, -joint.peak, -1.0);
    }
    prefix.used()
}

/// The prefix of a joint whose velocity is not limited.
#[inline]
pub(crate) fn acceleration_prefix(joint: &Joint) -> Option<Prefix> {
    let acceleration = joint.start[1];
    if joint.rise + joint.fall == 0.0 || (acceleration <= joint.top && acceleration >= -joint.bottom) {
        return None;
    }
    let mut prefix = Prefix::none(joint);
    prefix.contain(joint);
    prefix.used()
}

impl Prefix {
    /// What this does seen backwards in time ([`Joint::reversed`]): a suffix, and the velocity and
    /// acceleration with which it begins.
    pub(crate) fn reversed(&self) -> ([Phase; STEPS_MAX], [f64; 2]) {
        let mut suffix = [Phase::default(); STEPS_MAX];
        let [mut velocity, mut acceleration] = self.end;
        let begin = [velocity, -acceleration];
        for (step, phase) in self.steps.iter().rev().filter(|step| step.duration > 0.0).zip(&mut suffix) {
            // Without a jerk limit the acceleration jumps: it is that of the step.
            let held = if step.slope == 0 { step.acceleration } else { acceleration };
            *phase = Phase { duration: step.duration, velocity, acceleration: -held, slope: step.slope };
            (velocity, acceleration) = (step.velocity, step.acceleration);
        }
        (suffix, begin)
    }

    fn none(joint: &Joint) -> Self {
        Prefix { steps: [Phase::default(); STEPS_MAX], end: joint.start }
    }

    /// Itself if it takes time.
    fn used(self) -> Option<Self> {
        (self.steps[0].duration > 0.0).then_some(self)
    }

    /// Brings the acceleration into its band.
    fn contain(&mut self, joint: &Joint) {
        let acceleration = self.end[1];
        if acceleration > joint.top {
            self.push((acceleration - joint.top) * joint.fall, joint.fall, -1, joint.top);
        } else if acceleration < -joint.bottom {
            self.push((-joint.bottom - acceleration) * joint.rise, joint.rise, 1, -joint.bottom);
        }
    }

    /// Appends a step that changes the acceleration to `to`; one over the jerk is `inverse`.
    fn push(&mut self, duration: f64, inverse: f64, slope: i8, to: f64) {
        let [velocity, acceleration] = self.end;
        let step = Phase { duration, velocity, acceleration, slope };
        let gain = if slope == 0 {
            acceleration * duration
        } else {
            f64::from(slope) * inverse * (to - acceleration) * (to + acceleration) / 2.0
        };
        self.end = [velocity + gain, to];
        let used = self.steps.iter().take_while(|step| step.duration > 0.0).count();
        match self.steps[..used].last_mut() {
            Some(last) if last.slope == slope && slope != 0 => last.duration += duration,
            _ if used < STEPS_MAX => self.steps[used] = step,
            _ => {}
        }
    }

    /// Brings the velocity to the limit `joint.peak` and the acceleration to zero, if the velocity is
    /// above or bound to pass it and need not fall below. `joint` is seen with signs turned by `sign`;
    /// says whether anything was to do.
    fn settle(&mut self, joint: &Joint, sign: f64) -> bool {
        let Joint { peak, bottom, rise, fall, .. } = *joint;
        let (v, a) = (sign * self.end[0], sign * self.end[1]);
        let bound = if a > 0.0 { v + fall * a * a / 2.0 } else { v - rise * a * a / 2.0 };
        if bound <= peak + TIE * (peak.abs() + v.abs() + (rise + fall) * a * a) {
            return false;
        }
        let turn = sqrt((fall * a * a + 2.0 * (v - peak)) / (rise + fall)).min(bottom).max(-a);
        let (down, up) = if sign > 0.0 { (-1, 1) } else { (1, -1) };
        self.push(fall * (a + turn), fall, down, -sign * turn);
        let wait = (sign * self.end[0] - rise * turn * turn / 2.0 - peak) / turn;
        if turn == bottom && wait > 0.0 {
            self.push(wait, 0.0, 0, -sign * turn);
        }
        self.push(rise * turn, rise, up, 0.0);
        self.end = [sign * peak, 0.0];
        true
    }

    /// Brings the velocity down to the limit `joint.peak` if it is above or bound to pass it.
    /// `joint` is seen with signs turned by `sign`; says whether anything was to do.
    fn lower(&mut self, joint: &Joint, velocity_min: f64, sign: f64) -> bool {
        let Joint { peak, bottom, rise, fall, .. } = *joint;
        let (v, a) = (sign * self.end[0], sign * self.end[1]);
        let bound = if a > 0.0 { v + fall * a * a / 2.0 } else { v };
        let scale = peak.abs() + v.abs() + fall * a * a;
        if bound <= peak + TIE * scale || (a <= 0.0 && v - rise * a * a / 2.0 <= velocity_min) {
            return false;
        }
        let at_peak = if fall > 0.0 { a * a + 2.0 * (v - peak) / fall } else { f64::INFINITY };
        let at_floor = (fall * a * a + 2.0 * (v - velocity_min)) / (rise + fall);
        let to = -sqrt(at_peak.min(at_floor).max(0.0)).min(bottom);
        let slope = if sign > 0.0 { -1 } else { 1 };
        self.push((fall * (a - to)).max(0.0), fall, slope, sign * to);
        if to == -bottom {
            let v = sign * self.end[0];
            let wait = ((v - peak) / bottom).min((v - velocity_min) / bottom - rise * bottom / 2.0);
            if wait > 0.0 {
                self.push(wait, 0.0, 0, sign * to);
            }
        }
        true
    }
}
