//! The motion of one joint as it is stored and evaluated: constant-jerk segments.

use crate::{
    instant::Instant,
    motion::Part,
    state::{Limits, State},
};

/// Room for a prefix, a mixture of two extremal motions of 7 phases, and the end state.
///
/// Two motions of 7 phases have 12 switching times, hence 13 segments. A prefix of one step adds one.
/// A prefix of two ends waiting at an acceleration limit, so one of the motions lacks its first phase;
/// one of three ends at the velocity limit, where one of the motions begins with its cruise.
pub(crate) const SEGMENTS_MAX: usize = 15;

/// What stands for the jerk of a fall, a wait and a rise in which both motions have part.
pub(crate) const WHOLE: [u64; 3] = [3 << 2, 2 | 1 << 2, 1 | 2 << 2];

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
    /// What the start times are short of; that of the first, 0, is not.
    rests: [f32; SEGMENTS_MAX - 1],
    /// A jerk is the sum of one of the first three, falling, rising and constant, and one of the last
    /// three, constant, rising and falling: the parts of the two motions mixed here.
    jerks: [f64; 5],
    /// Four bits a segment: the places of its two jerks ([`Profile::jerk_of`]). The highest four bits count
    /// the segments, end state included.
    codes: u64,
}

impl Profile {
    /// A joint that goes on with constant acceleration from `state`.
    pub(crate) fn drifting(state: State) -> Self {
        let mut profile = Self::EMPTY;
        profile.set(0, Instant::default(), state);
        profile
    }

    /// Nothing written yet: at rest at zero.
    pub(crate) const EMPTY: Self = {
        let mut times = [f64::INFINITY; SEGMENTS_MAX];
        times[0] = 0.0;
        Profile {
            times,
            positions: [0.0; SEGMENTS_MAX],
            velocities: [0.0; SEGMENTS_MAX],
            accelerations: [0.0; SEGMENTS_MAX],
            rests: [0.0; SEGMENTS_MAX - 1],
            jerks: [0.0; 5],
            codes: WHOLE[1] | 1 << 60,
        }
    };

    fn count(&self) -> usize {
        ((self.codes >> 60) as usize).min(SEGMENTS_MAX)
    }

    /// Sets the start of segment `place`.
    #[inline]
    pub(crate) fn set(&mut self, place: usize, start: Instant, state: State) {
        let place = place.min(SEGMENTS_MAX - 1);
        self.times[place] = start.time;
        if place > 0 {
            self.rests[place - 1] = start.rest as f32;
        }
        self.positions[place] = state.position;
        self.velocities[place] = state.velocity;
        self.accelerations[place] = state.acceleration;
    }

    /// Sets what stands for the jerks of the segments before the end state, which is number `last`, and leaves
    /// nothing behind that.
    pub(crate) fn set_codes(&mut self, codes: u64, last: usize) {
        let last = last.min(SEGMENTS_MAX - 1);
        self.times[last + 1..].fill(f64::INFINITY);
        self.positions[last + 1..].fill(0.0);
        self.velocities[last + 1..].fill(0.0);
        self.accelerations[last + 1..].fill(0.0);
        self.rests[last..].fill(0.0);
        self.codes = codes | WHOLE[1] << (4 * last) | (last as u64 + 1) << 60;
    }

    /// Sets the jerks of two motions mixed with the weight `share` of the first, so that those of equal
    /// slopes add up to the limit itself.
    pub(crate) fn set_jerks(&mut self, limits: &Limits, share: f64) {
        let split = |limit: f64| {
            if limit.is_infinite() {
                return (0.0, 0.0);
            }
            // The larger part is at least half, so the difference is exact.
            let large = limit * share.max(1.0 - share);
            if share >= 0.5 { (large, limit - large) } else { (limit - large, large) }
        };
        let (rises, falls) = (split(limits.jerk_max), split(limits.jerk_min));
        self.jerks = [falls.0, rises.0, 0.0, rises.1, falls.1];
    }

    /// What each of the two motions mixed here adds, as set with [`Profile::set_jerks`].
    pub(crate) fn parts(&self, limits: &Limits) -> [Part; 2] {
        let jerks = [limits.jerk_min, 0.0, limits.jerk_max];
        let [far_fall, far_rise, none, near_rise, near_fall] = self.jerks;
        [
            Part { jerks, shares: [far_fall, none, far_rise], codes: [0, 2, 1] },
            Part { jerks, shares: [near_fall, none, near_rise], codes: [3 << 2, 1 << 2, 2 << 2] },
        ]
    }

    /// The motion `start + direction * self`, which ends with the velocity and acceleration of
    /// `target`, and in its position if that is `held`.
    pub(crate) fn scaled(&self, direction: f64, start: f64, target: &State, held: bool) -> Self {
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
        scaled.jerks = self.jerks.map(|jerk| direction * jerk);
        scaled
    }

    /// Whether all positions are finite.
    pub(crate) fn is_finite(&self) -> bool {
        self.positions[..self.count()].iter().chain(&self.velocities[..self.count()]).all(|value| value.is_finite())
    }

    fn jerk_of(&self, code: u64) -> f64 {
        self.jerks[(code & 3) as usize] + self.jerks[1 + (code >> 2 & 3) as usize]
    }

    /// The jerk of segment `index`.
    #[inline]
    fn jerk_at(&self, index: usize) -> f64 {
        self.jerk_of(self.codes >> (4 * index))
    }

    fn state(&self, index: usize) -> State {
        State {
            position: self.positions[index],
            velocity: self.velocities[index],
            acceleration: self.accelerations[index],
        }
    }

    fn instant(&self, index: usize) -> Instant {
        let rest = if index == 0 { 0.0 } else { f64::from(self.rests[index - 1]) };
        Instant { time: self.times[index], rest }
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

    /// The state at `time` in segment `index`.
    #[inline]
    fn state_in(&self, index: usize, time: f64) -> State {
        self.state(index).advanced(time - self.times[index], self.jerk_at(index))
    }

    /// The segment in which `time` lies: halvings without a branch, so that none is mispredicted.
    #[inline]
    fn search(&self, time: f64) -> usize {
        let mut index = 0;
        for step in [7, 4, 2, 1] {
            index += step * usize::from(self.times[index + step] <= time);
        }
        index
    }

    /// The state at `time`, which is looked for first in `segment` and the next one; the one found is left there.
    #[inline]
    pub(crate) fn at_from(&self, time: f64, segment: &mut u8) -> State {
        let time = within_range(time);
        let last = usize::from(*segment).min(SEGMENTS_MAX - 2);
        let mut index = last + usize::from(self.times[last + 1] <= time);
        let ended = self.times.get(index + 1).is_some_and(|next| *next <= time);
        if ended || self.times[last] > time {
            index = self.search(time);
        }
        *segment = index as u8;
        self.state_in(index, time)
    }

    /// The state at `time`; before the start, the start.
    #[must_use]
    #[inline]
    pub fn at(&self, time: f64) -> State {
        let time = within_range(time);
        self.state_in(self.search(time), time)
    }
}

/// `time` as a finite one that is not negative, so that it lies in a segment in use; 0 for NaN.
#[inline]
#[allow(clippy::manual_clamp, reason = "`clamp` keeps NaN")]
fn within_range(time: f64) -> f64 {
    time.max(0.0).min(f64::MAX)
}
