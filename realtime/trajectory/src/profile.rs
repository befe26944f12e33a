//! The motion of one joint as it is stored and evaluated: constant-jerk segments.

use crate::{
    extremal::Phase,
    state::{Limits, State},
};

/// Room for a prefix of 2, a mixture of two extremal motions of 7 phases, and the end state.
pub(crate) const SEGMENTS_MAX: usize = 16;

/// One constant-jerk segment of a joint's motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Time at which it starts, in seconds from the start of the trajectory.
    pub start_time: f64,
    /// How long it lasts, in seconds; infinite for the end state. Taken from the change of the state
    /// where that is more exact than the difference of the start times, as in a long trajectory.
    pub duration: f64,
    /// State at its start.
    pub start: State,
    /// Its jerk.
    pub jerk: f64,
}

/// The motion of one joint: at most 15 constant-jerk segments, and the end state, which continues
/// with constant acceleration.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    /// Start times, rising: from the start of the motion in its first half, and negative, from its
    /// end, in the second, so that short segments at either end are as exact as their durations
    /// however long the motion is. Infinite where unused.
    times: [f64; SEGMENTS_MAX],
    positions: [f64; SEGMENTS_MAX],
    velocities: [f64; SEGMENTS_MAX],
    accelerations: [f64; SEGMENTS_MAX],
    /// Jerk of the two motions mixed here where they rise and where they fall.
    jerk_rise: f64,
    jerk_fall: f64,
    /// Weight of the first of the two motions.
    share: f64,
    /// Time of the end state.
    duration: f64,
    /// Own minimum duration.
    minimum: f64,
    /// 3 (slope of the first motion + 1) + (slope of the second + 1).
    slopes: [u8; SEGMENTS_MAX],
    count: u8,
    reserved: [u8; 7],
}

impl Profile {
    /// A joint that goes on with constant acceleration from `state`.
    pub(crate) fn drifting(state: State) -> Self {
        let mut profile = Self::empty(&Limits::default());
        profile.finish(0.0, state);
        profile
    }

    pub(crate) fn empty(limits: &Limits) -> Self {
        Profile {
            times: [f64::INFINITY; SEGMENTS_MAX],
            positions: [0.0; SEGMENTS_MAX],
            velocities: [0.0; SEGMENTS_MAX],
            accelerations: [0.0; SEGMENTS_MAX],
            jerk_rise: limits.jerk_max,
            jerk_fall: limits.jerk_min,
            share: 1.0,
            duration: 0.0,
            minimum: 0.0,
            slopes: [4; SEGMENTS_MAX],
            count: 0,
            reserved: [0; 7],
        }
    }

    fn push(&mut self, time: f64, state: State, far: i8, near: i8) {
        let place = usize::from(self.count);
        if place < SEGMENTS_MAX {
            self.times[place] = time;
            self.positions[place] = state.position;
            self.velocities[place] = state.velocity;
            self.accelerations[place] = state.acceleration;
            self.slopes[place] = (3 * (far + 1) + near + 1) as u8;
            self.count += 1;
        }
    }

    /// Appends the steps of a prefix; returns its duration and the position it ends at.
    pub(crate) fn prefix(&mut self, steps: &[Phase; 2], position: f64) -> (f64, f64) {
        let (mut time, mut position) = (0.0, position);
        for step in steps {
            if step.duration > 0.0 {
                let state = State {
                    position,
                    velocity: step.velocity,
                    acceleration: step.acceleration,
                };
                self.push(time, state, step.slope, step.slope);
                position = state
                    .advanced(step.duration, self.jerk_of(step.slope))
                    .position;
                time += step.duration;
            }
        }
        (time, position)
    }

    /// Appends the mixture of two motions of the same duration `time`, `near` given with its signs
    /// turned, from `begin` and `position` on; returns the position it ends at.
    pub(crate) fn mix(
        &mut self,
        far: &[Phase; 7],
        near: &[Phase; 7],
        share: f64,
        begin: f64,
        time: f64,
        position: f64,
    ) -> f64 {
        self.share = share;
        self.duration = begin + time;
        let mut motions = [Walk::new(far, 1.0, time), Walk::new(near, -1.0, time)];
        if share >= 1.0 {
            motions[1] = motions[0];
        } else if share <= 0.0 {
            motions[0] = motions[1];
        }
        let half = time / 2.0;
        let (mut now, mut left, mut position) = (0.0, time, position);
        // Each pass ends a phase of one of the motions: 14 at most.
        for _ in 0..14 {
            let [first, second] = &motions;
            let (Some(a), Some(b)) = (first.phase(), second.phase()) else {
                break;
            };
            let (a_slope, b_slope) = (a.slope * first.sign(), b.slope * second.sign());
            let (until, until_left) = if first.end() <= second.end() {
                (first.end(), first.left())
            } else {
                (second.end(), second.left())
            };
            if until > now {
                let (a_state, b_state) = (
                    first.state(a, now, self.jerk_of(a_slope)),
                    second.state(b, now, self.jerk_of(b_slope)),
                );
                let state = State {
                    position,
                    velocity: share * a_state[0] + (1.0 - share) * b_state[0],
                    acceleration: share * a_state[1] + (1.0 - share) * b_state[1],
                };
                let late = now > half && left > 0.0;
                self.push(
                    if late { -left } else { begin + now },
                    state,
                    a_slope,
                    b_slope,
                );
                let passed = if now > half {
                    left - until_left
                } else if until > half {
                    (time - until_left) - now
                } else {
                    until - now
                };
                position = state
                    .advanced(passed, self.jerk_mixed(a_slope, b_slope))
                    .position;
                (now, left) = (until, until_left);
            }
            for motion in &mut motions {
                motion.pass(now);
            }
        }
        position
    }

    /// The motion `start + direction * self`, which ends with the velocity and acceleration of
    /// `target`, and in its position if that is `held`.
    pub(crate) fn scaled(
        &self,
        direction: f64,
        start: f64,
        target: &State,
        held: bool,
        minimum: f64,
    ) -> Self {
        let mut scaled = *self;
        for place in 0..usize::from(self.count).min(SEGMENTS_MAX) {
            scaled.positions[place] = start + direction * self.positions[place];
            scaled.velocities[place] = direction * self.velocities[place];
            scaled.accelerations[place] = direction * self.accelerations[place];
            if self.times[place] >= self.duration {
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

    /// Ends the motion at `time` in `state`.
    pub(crate) fn finish(&mut self, time: f64, state: State) {
        self.duration = time;
        self.push(time, state, 0, 0);
    }

    pub(crate) fn set_minimum(&mut self, minimum: f64) {
        self.minimum = minimum;
    }

    fn jerk_of(&self, slope: i8) -> f64 {
        match slope {
            1 => self.jerk_rise,
            -1 => self.jerk_fall,
            _ => 0.0,
        }
    }

    fn jerk_mixed(&self, far: i8, near: i8) -> f64 {
        let (far, near) = (self.jerk_of(far), self.jerk_of(near));
        if far == near {
            far
        } else {
            self.share * far + (1.0 - self.share) * near
        }
    }

    /// Segment `index`, or `None` past the end state. The last one is the end state, with no jerk.
    #[must_use]
    pub fn segment(&self, index: usize) -> Option<Segment> {
        if index >= usize::from(self.count) || index >= SEGMENTS_MAX {
            return None;
        }
        let (time, next) = (self.times[index], index + 1);
        let duration = if next < usize::from(self.count).min(SEGMENTS_MAX) {
            match (time, self.times[next]) {
                (time, end) if time >= 0.0 && end < 0.0 => (self.duration + end) - time,
                (time, end) if time < 0.0 && end >= 0.0 => -time,
                (time, end) => end - time,
            }
        } else {
            f64::INFINITY
        };
        let code = self.slopes[index] as i8;
        Some(Segment {
            start_time: if time < 0.0 {
                self.duration + time
            } else {
                time
            },
            duration,
            start: self.state(index),
            jerk: self.jerk_mixed(code / 3 - 1, code % 3 - 1),
        })
    }

    fn state(&self, index: usize) -> State {
        State {
            position: self.positions[index],
            velocity: self.velocities[index],
            acceleration: self.accelerations[index],
        }
    }

    /// The segments in order, the end state last.
    pub fn segments(&self) -> impl Iterator<Item = Segment> + '_ {
        (0..SEGMENTS_MAX).map_while(|index| self.segment(index))
    }

    /// When this joint reaches its target.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.duration
    }

    /// The shortest time in which this joint alone could reach its target, in seconds.
    #[must_use]
    pub fn minimum_duration(&self) -> f64 {
        self.minimum
    }

    /// The state at `time`; before the start, the start.
    #[must_use]
    #[inline]
    pub fn at(&self, time: f64) -> State {
        let early = time.max(0.0);
        let late = early - self.duration;
        let passed = self
            .times
            .iter()
            .map(|&start| usize::from(start <= if start < 0.0 { late } else { early }))
            .sum::<usize>();
        let index = (passed.max(1) - 1).min(SEGMENTS_MAX - 1);
        let code = self.slopes[index] as i8;
        let start = self.times[index];
        let since = if start < 0.0 { late } else { early } - start;
        self.state(index)
            .advanced(since, self.jerk_mixed(code / 3 - 1, code % 3 - 1))
    }
}

/// A place on a list of phases.
#[derive(Clone, Copy)]
struct Walk<'a> {
    phases: &'a [Phase; 7],
    index: usize,
    /// When each phase starts, and how much time is left then.
    starts: [f64; 8],
    lefts: [f64; 8],
    direction: f64,
}

impl<'a> Walk<'a> {
    fn new(phases: &'a [Phase; 7], direction: f64, time: f64) -> Self {
        let mut walk = Walk {
            phases,
            index: 0,
            starts: [0.0; 8],
            lefts: [0.0; 8],
            direction,
        };
        for index in 0..7 {
            walk.starts[index + 1] = walk.starts[index] + phases[index].duration.max(0.0);
            walk.lefts[6 - index] = walk.lefts[7 - index] + phases[6 - index].duration.max(0.0);
        }
        // The two ways of adding up differ by roundings; each motion ends at `time` exactly.
        for index in 0..8 {
            if walk.lefts[index] == 0.0 || walk.starts[index] > time {
                walk.starts[index] = time;
            }
        }
        walk.pass(0.0);
        walk
    }

    fn phase(&self) -> Option<&'a Phase> {
        self.phases.get(self.index)
    }

    /// When the current phase ends, and how much time is left then.
    fn end(&self) -> f64 {
        self.starts[(self.index + 1).min(7)]
    }

    fn left(&self) -> f64 {
        self.lefts[(self.index + 1).min(7)]
    }

    fn sign(&self) -> i8 {
        if self.direction > 0.0 { 1 } else { -1 }
    }

    /// Moves on past every phase that has ended at `time`.
    fn pass(&mut self, time: f64) {
        while self.index < 7 && self.end() <= time {
            self.index += 1;
        }
    }

    /// Velocity and acceleration at `time` within `phase`, whose jerk with sign is `jerk`.
    fn state(&self, phase: &Phase, time: f64, jerk: f64) -> [f64; 2] {
        let passed = time - self.starts[self.index.min(7)];
        let (velocity, acceleration) = (
            self.direction * phase.velocity,
            self.direction * phase.acceleration,
        );
        if passed <= 0.0 {
            return [velocity, acceleration];
        }
        [
            velocity + passed * (acceleration + passed * jerk / 2.0),
            acceleration + passed * jerk,
        ]
    }
}
