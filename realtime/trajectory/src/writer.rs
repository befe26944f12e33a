//! How a motion gets into a profile.

use crate::{
    brake::STEPS_MAX,
    instant::Instant,
    motion::{Part, Phase, Phases, Walk, starts},
    profile::{Profile, SEGMENTS_MAX, WHOLE},
    state::{Limits, State},
};

/// Writes segments one after the other, each from where the last one ended.
pub(crate) struct Writer<'a> {
    profile: &'a mut Profile,
    place: usize,
    codes: u64,
    limits: Limits,
    now: Instant,
    /// Where the motion is now.
    pub(crate) position: f64,
    /// When the motion will end.
    duration: f64,
    /// When what is appended next will end.
    pub(crate) end: f64,
    /// The largest size of the positions that occur; not finite if some number is not.
    extent: f64,
}

impl<'a> Writer<'a> {
    /// At the beginning of a motion from `position` that takes `duration`.
    pub(crate) fn new(profile: &'a mut Profile, limits: &Limits, position: f64, duration: f64) -> Self {
        profile.set_jerks(limits, 1.0);
        let now = Instant::default();
        Writer { profile, place: 0, codes: 0, limits: *limits, now, position, duration, end: duration, extent: 0.0 }
    }

    pub(crate) fn now(&self) -> f64 {
        self.now.time
    }

    /// Appends a segment with `jerk`, for which `code` stands, unless it takes no time.
    #[inline(always)]
    fn push(&mut self, [velocity, acceleration]: [f64; 2], (jerk, code): (f64, u64), until: Instant) -> f64 {
        let passed = until.since(self.now);
        if passed > 0.0 && self.place < SEGMENTS_MAX - 1 {
            let state = State { position: self.position, velocity, acceleration };
            // A last sliver left by rounding does not start past the end.
            let start = if self.now.time > self.duration { self.now.read_as(self.duration) } else { self.now };
            self.profile.set(self.place, start, state);
            self.codes |= code << (4 * self.place);
            self.place += 1;
            let reach = self.position.abs() + self.duration * velocity.abs();
            self.extent = larger(self.extent, reach);
            self.position = state.advanced(passed, jerk).position;
            self.now = until;
            return passed;
        }
        0.0
    }

    /// Appends the steps of a prefix.
    pub(crate) fn prefix(&mut self, steps: &[Phase; STEPS_MAX]) {
        let alone = whole(&self.limits);
        for step in steps {
            let slope = (step.slope + 1).clamp(0, 2) as usize;
            let jerk = (alone.shares[slope], alone.codes[slope]);
            self.push([step.velocity, step.acceleration], jerk, self.now.after(step.duration));
        }
    }

    /// Appends a motion that lasts from now to `end`, or a rounding less or more.
    pub(crate) fn follow(&mut self, phases: &[Phase]) {
        self.follow_here(phases);
    }

    /// The same for phases whose number is known where this is called.
    #[inline(always)]
    pub(crate) fn follow_here(&mut self, phases: &[Phase]) {
        let alone = whole(&self.limits);
        let begin = self.now.time;
        let starts = starts(phases, begin, self.end - begin);
        for (phase, until) in phases.iter().zip(&starts[1..]) {
            let slope = (phase.slope + 1).clamp(0, 2) as usize;
            let jerk = (alone.shares[slope], alone.codes[slope]);
            self.push([phase.velocity, phase.acceleration], jerk, *until);
        }
    }

    /// Appends the mixture of two motions, `share` being the weight of the first; otherwise as
    /// [`Writer::follow`].
    pub(crate) fn mix(&mut self, [far, near]: [&Phases; 2], share: f64) {
        self.profile.set_jerks(&self.limits, share);
        let (begin, parts) = (self.now.time, self.profile.parts(&self.limits));
        let walk = |phases, part| Walk::new(phases, begin, self.end - begin, part);
        let (mut far, mut near) = (walk(far, parts[0]), walk(near, parts[1]));
        // Each pass ends a phase of one of the motions: 14 at most.
        while !(far.ended() && near.ended()) {
            let (first, second) = (far.end(), near.end());
            let far_is_next = near.ended() || (!far.ended() && first.since(second) <= 0.0);
            let until = if far_is_next { first } else { second };
            let ([v, a], [w, b]) = (far.state(), near.state());
            let state = [share * v + (1.0 - share) * w, share * a + (1.0 - share) * b];
            let (jerk, other) = (far.share(), near.share());
            let passed = self.push(state, (jerk.0 + other.0, jerk.1 | other.1), until);
            if far_is_next {
                far.next();
                near.advance(passed);
            } else {
                near.next();
                far.advance(passed);
            }
        }
    }

    /// Ends the motion in `state`; returns the size of the positions on the way, at least `least`, which is
    /// not finite if some number is not.
    pub(crate) fn finish(self, state: State, least: f64) -> f64 {
        let end = self.now.read_as(self.duration);
        self.profile.set(self.place, end, state);
        self.profile.set_codes(self.codes, self.place);
        if end.time.is_finite() && end.rest.is_finite() { larger(self.extent, least) } else { f64::NAN }
    }
}

/// The larger of two sizes; NaN if one is.
fn larger(size: f64, other: f64) -> f64 {
    if other <= size || size.is_nan() { size } else { other }
}

/// A motion by itself.
fn whole(limits: &Limits) -> Part {
    let jerks = [limits.jerk_min, 0.0, limits.jerk_max];
    Part { jerks, shares: jerks, codes: WHOLE }
}
