//! The motion of one joint as it is stored and evaluated: constant-jerk segments.

use crate::{
    brake::STEPS_MAX,
    extremal::Phase,
    instant::Instant,
    state::{Limits, State},
};

/// Room for a prefix, a mixture of two extremal motions of 7 phases, and the end state.
///
/// Two motions of 7 phases have 12 switching times, hence 13 segments. A prefix of one step adds one.
/// A prefix of two ends waiting at an acceleration limit, so one of the motions lacks its first phase;
/// one of three ends at the velocity limit, where one of the motions begins with its cruise.
pub(crate) const SEGMENTS_MAX: usize = 15;

/// One constant-jerk segment of a joint's motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Time at which it starts, in seconds from the start of the trajectory.
    pub start_time: f64,
    /// How long it lasts, in seconds, to more digits than the difference of start times has; infinite
    /// for the end state.
    pub duration: f64,
    /// State at its start.
    pub start: State,
    /// Its jerk.
    pub jerk: f64,
}

/// The motion of one joint: at most 14 constant-jerk segments, and the end state, which continues
/// with constant acceleration.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    /// Start times, rising; infinite where unused.
    times: [f64; SEGMENTS_MAX],
    positions: [f64; SEGMENTS_MAX],
    velocities: [f64; SEGMENTS_MAX],
    accelerations: [f64; SEGMENTS_MAX],
    /// What the start times are short of.
    rests: [f32; SEGMENTS_MAX],
    /// Keeps the layout free of hidden padding.
    reserved: u32,
    /// Jerk of the two motions mixed here where they rise and where they fall.
    jerk_rise: f64,
    jerk_fall: f64,
    /// Weight of the first of the two motions.
    share: f64,
    /// Own minimum duration.
    minimum: f64,
    /// Four bits a segment: the slope code of the first motion, that of the second (two bits each, 0
    /// constant, 1 rising, 2 falling). The highest four bits count the segments, end state included.
    codes: u64,
}

impl Profile {
    /// A joint that goes on with constant acceleration from `state`.
    pub(crate) fn drifting(state: State) -> Self {
        let mut profile = Self::empty(&Limits::default());
        profile.finish(Instant::default(), state);
        profile
    }

    pub(crate) fn empty(limits: &Limits) -> Self {
        Profile {
            times: [f64::INFINITY; SEGMENTS_MAX],
            positions: [0.0; SEGMENTS_MAX],
            velocities: [0.0; SEGMENTS_MAX],
            accelerations: [0.0; SEGMENTS_MAX],
            rests: [0.0; SEGMENTS_MAX],
            reserved: 0,
            jerk_rise: limits.jerk_max,
            jerk_fall: limits.jerk_min,
            share: 1.0,
            minimum: 0.0,
            codes: 0,
        }
    }

    fn count(&self) -> usize {
        ((self.codes >> 60) as usize).min(SEGMENTS_MAX)
    }

    fn push(&mut self, start: Instant, state: State, slopes: Slopes) {
        let place = self.count();
        if place < SEGMENTS_MAX {
            self.times[place] = start.time;
            self.rests[place] = start.rest as f32;
            self.positions[place] = state.position;
            self.velocities[place] = state.velocity;
            self.accelerations[place] = state.acceleration;
            self.codes |= slopes.code() << (4 * place);
            self.codes += 1 << 60;
        }
    }

    /// Appends the steps of a prefix; returns its duration and the position it ends at.
    pub(crate) fn prefix(&mut self, steps: &[Phase; STEPS_MAX], position: f64) -> (f64, f64) {
        let (mut now, mut position) = (Instant::default(), position);
        for step in steps {
            if step.duration > 0.0 {
                let state = State { position, velocity: step.velocity, acceleration: step.acceleration };
                let slopes = Slopes { far: step.slope, near: step.slope };
                self.push(now, state, slopes);
                position = state.advanced(step.duration, self.jerk(slopes)).position;
                now = now.after(step.duration);
            }
        }
        (now.time, position)
    }

    /// Appends the mixture of two motions of the same duration `time`, `near` given with its signs
    /// turned, from `begin` and `position` on; returns when it ends and the
    /// position there.
    pub(crate) fn mix(
        &mut self,
        far: &[Phase; 7],
        near: &[Phase; 7],
        share: f64,
        begin: f64,
        time: f64,
        position: f64,
    ) -> (Instant, f64) {
        self.share = share;
        let far = |sign| Walk::new(far, sign, begin, time);
        let near = |sign| Walk::new(near, sign, begin, time);
        let mut motions = if share >= 1.0 {
            [far(1); 2]
        } else if share <= 0.0 {
            [near(-1); 2]
        } else {
            [far(1), near(-1)]
        };
        let (mut now, mut position) = (Instant::at(begin), position);
        // Each pass ends a phase of one of the motions: 14 at most.
        for _ in 0..14 {
            let [first, second] = &motions;
            let (a, b) = (first.end(), second.end());
            let until = if first.ended() || (!second.ended() && b.since(a) < 0.0) { b } else { a };
            if first.ended() && second.ended() {
                break;
            }
            let passed = until.since(now);
            if passed > 0.0 {
                let slopes = Slopes { far: first.slope(), near: second.slope() };
                let (a, b) =
                    (first.state(now, |slope| self.jerk_of(slope)), second.state(now, |slope| self.jerk_of(slope)));
                let state = State {
                    position,
                    velocity: share * a[0] + (1.0 - share) * b[0],
                    acceleration: share * a[1] + (1.0 - share) * b[1],
                };
                // A last sliver left by rounding does not start past the end.
                self.push(now.read_as(now.time.min(begin + time)), state, slopes);
                position = state.advanced(passed, self.jerk(slopes)).position;
                now = until;
            }
            for motion in &mut motions {
                motion.pass(until);
            }
        }
        (now, position)
    }

    /// The motion `start + direction * self`, which ends with the velocity and acceleration of
    /// `target`, and in its position if that is `held`.
    pub(crate) fn scaled(&self, direction: f64, start: f64, target: &State, held: bool, minimum: f64) -> Self {
        let mut scaled = *self;
        let count = self.count();
        for place in 0..count {
            scaled.positions[place] = start + direction * self.positions[place];
            scaled.velocities[place] = direction * self.velocities[place];
            scaled.accelerations[place] = direction * self.accelerations[place];
            if place + 1 == count {
                if held {
                    scaled.positions[place] = target.position;
                }
                scaled.velocities[place] = target.velocity;
                scaled.accelerations[place] = target.acceleration;
            }
        }
        scaled.jerk_rise = direction * self.jerk_rise;
        scaled.jerk_fall = direction * self.jerk_fall;
        scaled.minimum = minimum;
        scaled
    }

    /// The largest size of the positions that occur in `time`, and at least `least`; not finite if
    /// some number is not.
    pub(crate) fn extent(&self, time: f64, least: f64) -> f64 {
        (0..self.count()).fold(least, |extent, place| {
            let size = self.positions[place].abs() + time * self.velocities[place].abs();
            if size <= extent || extent.is_nan() { extent } else { size }
        })
    }

    /// Ends the motion at `end` in `state`.
    pub(crate) fn finish(&mut self, end: Instant, state: State) {
        self.push(end, state, Slopes { far: 0, near: 0 });
    }

    pub(crate) fn set_minimum(&mut self, minimum: f64) {
        self.minimum = minimum;
    }

    fn jerk_of(&self, slope: i8) -> f64 {
        [self.jerk_fall, 0.0, self.jerk_rise, 0.0][(slope + 1) as usize & 3]
    }

    /// The jerk of segment `index`.
    #[inline]
    fn jerk_at(&self, index: usize) -> f64 {
        let jerks = [0.0, self.jerk_rise, self.jerk_fall, 0.0];
        let code = (self.codes >> (4 * index)) as usize;
        let (far, near) = (jerks[code & 3], jerks[code >> 2 & 3]);
        if far == near { far } else { self.share * far + (1.0 - self.share) * near }
    }

    fn jerk(&self, slopes: Slopes) -> f64 {
        let (far, near) = (self.jerk_of(slopes.far), self.jerk_of(slopes.near));
        if slopes.far == slopes.near { far } else { self.share * far + (1.0 - self.share) * near }
    }

    fn state(&self, index: usize) -> State {
        State {
            position: self.positions[index],
            velocity: self.velocities[index],
            acceleration: self.accelerations[index],
        }
    }

    fn instant(&self, index: usize) -> Instant {
        Instant { time: self.times[index], rest: f64::from(self.rests[index]) }
    }

    /// Segment `index`, or `None` past the end state. The last one is the end state, with no jerk.
    #[must_use]
    pub fn segment(&self, index: usize) -> Option<Segment> {
        if index >= self.count() {
            return None;
        }
        let next = index + 1;
        let duration = if next < self.count() { self.instant(next).since(self.instant(index)) } else { f64::INFINITY };
        let jerk = self.jerk_at(index);
        Some(Segment { start_time: self.times[index], duration, start: self.state(index), jerk })
    }

    /// The segments in order, the end state last.
    pub fn segments(&self) -> impl Iterator<Item = Segment> + '_ {
        (0..SEGMENTS_MAX).map_while(|index| self.segment(index))
    }

    /// When this joint reaches its target.
    #[must_use]
    pub fn duration(&self) -> f64 {
        match self.count() {
            count @ 1..=SEGMENTS_MAX => self.times[count - 1],
            _ => 0.0,
        }
    }

    /// The shortest time in which this joint alone could reach its target, in seconds.
    #[must_use]
    pub fn minimum_duration(&self) -> f64 {
        self.minimum
    }

    /// The state at `time`, searched from segment `segment` on, which is moved to the one found.
    #[inline]
    pub(crate) fn at_from(&self, time: f64, segment: &mut u8) -> State {
        let time = time.max(0.0);
        let mut index = usize::from(*segment).min(SEGMENTS_MAX - 1);
        if self.times[index] > time {
            index = 0;
        }
        while index + 1 < SEGMENTS_MAX && self.times[index + 1] <= time {
            index += 1;
        }
        *segment = index as u8;
        self.state(index).advanced(time - self.times[index], self.jerk_at(index))
    }

    /// The state at `time`; before the start, the start.
    #[must_use]
    #[inline]
    pub fn at(&self, time: f64) -> State {
        let time = time.max(0.0);
        let passed = self.times.iter().map(|&start| usize::from(start <= time)).sum::<usize>();
        let index = (passed.max(1) - 1).min(SEGMENTS_MAX - 1);
        self.state(index).advanced(time - self.times[index], self.jerk_at(index))
    }
}

/// How the accelerations of the two mixed motions change: +1 rising, 0 constant, -1 falling.
#[derive(Clone, Copy)]
struct Slopes {
    far: i8,
    near: i8,
}

impl Slopes {
    fn code(self) -> u64 {
        let code = |slope: i8| match slope {
            1 => 1,
            -1 => 2,
            _ => 0,
        };
        code(self.far) | code(self.near) << 2
    }
}

/// A place on a list of phases.
#[derive(Clone, Copy)]
struct Walk<'a> {
    phases: &'a [Phase; 7],
    index: usize,
    /// When each phase starts.
    starts: [Instant; 8],
    /// The last phase that has a duration.
    last: usize,
    sign: i8,
}

impl<'a> Walk<'a> {
    /// The phases one after the other, from `begin` to `begin + time`.
    ///
    /// The durations add up to `time` but for rounding. That goes into the longest phase of constant
    /// acceleration, where it does least harm: the phases before it are timed from the beginning, those
    /// after it from the end. Without such a phase the motion ends a rounding early or late.
    fn new(phases: &'a [Phase; 7], sign: i8, begin: f64, time: f64) -> Self {
        let (mut pivot, mut longest, mut last) = (7, 0.0, 0);
        for (index, phase) in phases.iter().enumerate() {
            if phase.slope == 0 && phase.duration > longest {
                (pivot, longest) = (index, phase.duration);
            }
            if phase.duration > 0.0 {
                last = index;
            }
        }
        let mut starts = [Instant::at(begin); 8];
        for index in 0..pivot {
            starts[index + 1] = starts[index].after(phases[index].duration.max(0.0));
        }
        if pivot < 7 {
            starts[7] = Instant::at(begin + time);
            for index in (pivot + 1..7).rev() {
                starts[index] = starts[index + 1].after(-phases[index].duration.max(0.0));
            }
        }
        let mut walk = Walk { phases, index: 0, starts, last, sign };
        walk.pass(Instant::at(begin));
        walk
    }

    fn ended(&self) -> bool {
        self.index >= 7
    }

    /// When the current phase ends.
    fn end(&self) -> Instant {
        self.starts[(self.index + 1).min(7)]
    }

    /// How the acceleration changes, as seen with the signs of the joint.
    fn slope(&self) -> i8 {
        self.phases.get(self.index).map_or(0, |phase| self.sign * phase.slope)
    }

    /// Moves on past every phase that has ended at `time`.
    fn pass(&mut self, time: Instant) {
        while self.index < 7 && self.end().since(time) <= 0.0 {
            self.index += 1;
        }
    }

    /// Velocity and acceleration at `now`, given the jerk of a slope; past the last phase, those at its
    /// end.
    fn state(&self, now: Instant, jerk: impl Fn(i8) -> f64) -> [f64; 2] {
        let (index, now) = if self.ended() { (self.last, self.starts[7]) } else { (self.index.min(6), now) };
        let (phase, sign) = (&self.phases[index], f64::from(self.sign));
        let (velocity, acceleration) = (sign * phase.velocity, sign * phase.acceleration);
        let passed = now.since(self.starts[index]);
        if passed <= 0.0 {
            return [velocity, acceleration];
        }
        let jerk = jerk(self.sign * phase.slope);
        [velocity + passed * (acceleration + passed * jerk / 2.0), acceleration + passed * jerk]
    }
}
