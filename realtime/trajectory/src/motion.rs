//! One extremal motion on the time axis.

use crate::instant::Instant;

/// A part of a motion with constant jerk: its state at the start, without the position.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Phase {
    pub(crate) duration: f64,
    pub(crate) velocity: f64,
    pub(crate) acceleration: f64,
    /// +1 rising, 0 constant, -1 falling.
    pub(crate) slope: i8,
}

/// Those phases of a motion, up to seven, that take time.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Phases {
    phases: [Phase; 7],
    count: usize,
}

impl Phases {
    pub(crate) fn new() -> Self {
        Phases { phases: [Phase::default(); 7], count: 0 }
    }

    /// Appends a phase if it takes time; `sign` turns the signs of all.
    #[inline]
    pub(crate) fn push(&mut self, sign: f64, duration: f64, velocity: f64, acceleration: f64, slope: i8) {
        let place = self.count;
        if duration > 0.0 && place < 7 {
            let slope = if sign < 0.0 { -slope } else { slope };
            self.phases[place] =
                Phase { duration, velocity: sign * velocity, acceleration: sign * acceleration, slope };
            self.count = place + 1;
        }
    }

    pub(crate) fn as_slice(&self) -> &[Phase] {
        &self.phases[..self.count.min(7)]
    }
}

/// When each of `phases` starts, and when the last one ends, if they take place one after the other from
/// `begin` to `begin + time`.
///
/// The durations add up to `time` but for rounding. That goes into the longest phase of constant
/// acceleration, where it does least harm: the phases before it are timed from the beginning, those
/// after it from the end. Without such a phase the motion ends a rounding early or late.
#[inline(always)]
pub(crate) fn starts(phases: &[Phase], begin: f64, time: f64) -> [Instant; 8] {
    let mut starts = [Instant::at(begin); 8];
    let phases = phases.get(..7).unwrap_or(phases);
    let (mut pivot, mut longest) = (phases.len(), 0.0);
    for (place, phase) in phases.iter().enumerate() {
        if phase.slope == 0 && phase.duration > longest {
            (pivot, longest) = (place, phase.duration);
        }
    }
    // Places are below eight; `& 7` shows it.
    for (place, phase) in phases.iter().enumerate().take(pivot) {
        starts[(place + 1) & 7] = starts[place & 7].after(phase.duration);
    }
    if pivot < phases.len() {
        starts[phases.len() & 7] = Instant::at(begin + time);
        for (place, phase) in phases.iter().enumerate().skip(pivot + 1).rev() {
            starts[place & 7] = starts[(place + 1) & 7].after(-phase.duration);
        }
    }
    starts
}

/// What a motion adds to a mixture while its acceleration falls, waits and rises.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Part {
    /// Its own jerk.
    pub(crate) jerks: [f64; 3],
    /// Its part of that of the mixture.
    pub(crate) shares: [f64; 3],
    /// What stands for that in a profile.
    pub(crate) codes: [u64; 3],
}

/// A place in a motion, and the state there.
pub(crate) struct Walk<'a> {
    phases: &'a [Phase],
    starts: [Instant; 8],
    part: Part,
    place: usize,
    /// -1 falling, 0 waiting, 1 rising, plus 1.
    slope: usize,
    velocity: f64,
    acceleration: f64,
    /// When the current phase ends.
    end: Instant,
}

impl<'a> Walk<'a> {
    pub(crate) fn new(phases: &'a Phases, begin: f64, time: f64, part: Part) -> Self {
        let starts = starts(phases.as_slice(), begin, time);
        let (phases, end) = (phases.as_slice(), Instant::at(begin));
        let mut walk = Walk { phases, starts, part, place: 0, slope: 1, velocity: 0.0, acceleration: 0.0, end };
        walk.enter();
        walk
    }

    /// Takes the state from the current phase, which begins here. Past the last one the state stays.
    #[inline]
    fn enter(&mut self) {
        match self.phases.get(self.place) {
            Some(phase) => {
                (self.velocity, self.acceleration) = (phase.velocity, phase.acceleration);
                self.slope = (phase.slope + 1).clamp(0, 2) as usize;
                self.end = self.starts[(self.place + 1).min(7)];
            }
            None => self.slope = 1,
        }
    }

    #[inline]
    pub(crate) fn ended(&self) -> bool {
        self.place >= self.phases.len()
    }

    /// When the current phase ends.
    #[inline]
    pub(crate) fn end(&self) -> Instant {
        self.end
    }

    /// Velocity and acceleration here.
    #[inline]
    pub(crate) fn state(&self) -> [f64; 2] {
        [self.velocity, self.acceleration]
    }

    /// Its part of the jerk of the mixture, and what stands for that in a profile.
    #[inline]
    pub(crate) fn share(&self) -> (f64, u64) {
        (self.part.shares[self.slope.min(2)], self.part.codes[self.slope.min(2)])
    }

    /// Goes on by `time` within the phase.
    #[inline]
    pub(crate) fn advance(&mut self, time: f64) {
        let jerk = self.part.jerks[self.slope.min(2)];
        self.velocity += time * (self.acceleration + time * jerk / 2.0);
        self.acceleration += time * jerk;
    }

    /// Goes on to the next phase, whose start this is.
    #[inline]
    pub(crate) fn next(&mut self) {
        self.place += 1;
        self.enter();
    }
}
