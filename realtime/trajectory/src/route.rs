//! A motion through waypoints.
//!
//! The joints pass every waypoint together, without stopping unless that is quicker. The motion between two
//! neighbours is time-optimal for the velocities there ([`Trajectory`]), and accelerations at waypoints are
//! zero, so what is left to choose is the velocity at each waypoint. Resting at each is always possible and
//! is the start of a descent: velocities, of one joint or of all, are changed by a step if the two sections
//! beside the waypoint then take less, and the steps are halved when none helps. That finds a local optimum; the work is
//! bounded by a number of calculations and not by a clock, so that the same input gives the same motion.
//! A motion found before, moved to a new start, is a better one to begin from ([`Waypoints::velocities`]).

use crate::{
    error::Error,
    input::{Input, Interface, Synchronization},
    state::State,
    trajectory::Trajectory,
};

/// The share of the velocity limit by which velocities are first changed, and the smallest.
const STEP_FIRST: f64 = 0.5;
const STEP_LAST: f64 = 1.0 / 256.0;

/// Positions to pass on the way, at most `W`, and the velocities to try there.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Waypoints<const N: usize, const W: usize> {
    positions: [[f64; N]; W],
    velocities: [[f64; N]; W],
    count: usize,
}

impl<const N: usize, const W: usize> Default for Waypoints<N, W> {
    fn default() -> Self {
        Waypoints { positions: [[0.0; N]; W], velocities: [[0.0; N]; W], count: 0 }
    }
}

impl<const N: usize, const W: usize> Waypoints<N, W> {
    /// The first `W` of `positions`, to be passed at any velocity.
    #[must_use]
    pub fn new(positions: &[[f64; N]]) -> Self {
        let mut waypoints = Self::default();
        for position in positions {
            waypoints.push(*position);
        }
        waypoints
    }

    /// Adds a waypoint; `false` if there are `W` already.
    pub fn push(&mut self, positions: [f64; N]) -> bool {
        let free = self.count < W;
        if free {
            self.positions[self.count] = positions;
            self.count += 1;
        }
        free
    }

    /// Removes the first waypoint, which has been passed.
    pub fn pass(&mut self) {
        if self.count > 0 {
            self.positions.rotate_left(1);
            self.velocities.rotate_left(1);
            self.count -= 1;
        }
    }

    /// The positions to pass.
    #[must_use]
    pub fn positions(&self) -> &[[f64; N]] {
        &self.positions[..self.count.min(W)]
    }

    /// The velocities at the waypoints of the last motion found, from which the next search begins: a warm
    /// start when little has changed.
    #[must_use]
    pub fn velocities(&self) -> &[[f64; N]] {
        &self.velocities[..self.count.min(W)]
    }
}

/// A motion through waypoints: one trajectory to each, and one to the target.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Route<const N: usize, const W: usize> {
    /// To the waypoints.
    before: [Trajectory<N>; W],
    /// To the target.
    last: Trajectory<N>,
    count: usize,
    calculations: u32,
}

impl<const N: usize, const W: usize> Route<N, W> {
    /// The motion of `input` through `waypoints`, found with about `budget` calculations of a trajectory;
    /// at least two for each section are made. Position limits and the shortest duration hold for every
    /// section; joints arrive together. The velocities found are left in `waypoints`.
    ///
    /// # Errors
    /// As [`Trajectory::calculate`].
    ///
    /// # Realtime
    /// No allocation; at most `budget + 2 (W + 1)` calculations.
    pub fn calculate(input: &Input<N>, waypoints: &mut Waypoints<N, W>, budget: u32) -> Result<Self, Error> {
        let mut search = Search { input, waypoints, durations: [0.0; W], last: 0.0, calculations: 0 };
        search.begin()?;
        search.descend(budget);
        let mut route = Route {
            before: [Trajectory::EMPTY; W],
            last: Trajectory::EMPTY,
            count: search.waypoints.count.min(W),
            calculations: 0,
        };
        for place in 0..route.count {
            route.before[place] = search.section(place)?;
        }
        route.last = search.section(route.count)?;
        route.calculations = search.calculations;
        Ok(route)
    }

    /// The trajectories, in order; each begins where the one before ends.
    pub fn sections(&self) -> impl Iterator<Item = &Trajectory<N>> {
        self.before[..self.count.min(W)].iter().chain([&self.last])
    }

    /// When the target is reached, in seconds.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.sections().map(Trajectory::duration).sum()
    }

    /// How many trajectories were calculated to find this.
    #[must_use]
    pub fn calculations(&self) -> u32 {
        self.calculations
    }

    /// State of every joint at `time`; past the end as [`Trajectory::at`].
    #[must_use]
    pub fn at(&self, time: f64) -> [State; N] {
        let mut begin = 0.0;
        for section in &self.before[..self.count.min(W)] {
            if time < begin + section.duration() {
                return section.at(time - begin);
            }
            begin += section.duration();
        }
        self.last.at(time - begin)
    }
}

/// A change of the velocities of all joints at a waypoint.
#[derive(Clone, Copy)]
enum Together {
    /// Towards the direction from the waypoint before to the one after.
    Chord,
    /// The same for joints that go on in their direction; towards rest for those that turn round.
    Onward,
    Faster,
    Slower,
}

/// A descent over the velocities at the waypoints.
struct Search<'a, const N: usize, const W: usize> {
    input: &'a Input<N>,
    waypoints: &'a mut Waypoints<N, W>,
    /// Duration of the section to each waypoint, and of the last one.
    durations: [f64; W],
    last: f64,
    calculations: u32,
}

impl<const N: usize, const W: usize> Search<'_, N, W> {
    /// The state at waypoint `place`; the target after the last one.
    fn state(&self, place: usize) -> [State; N] {
        let (positions, velocities) = (self.waypoints.positions(), self.waypoints.velocities());
        match (positions.get(place), velocities.get(place)) {
            (Some(positions), Some(velocities)) => core::array::from_fn(|joint| State {
                position: positions[joint],
                velocity: velocities[joint],
                acceleration: 0.0,
            }),
            _ => self.input.target,
        }
    }

    /// The trajectory to waypoint `place`, or to the target.
    fn section(&mut self, place: usize) -> Result<Trajectory<N>, Error> {
        let mut input = *self.input;
        if let Some(before) = place.checked_sub(1) {
            input.start = self.state(before);
        }
        if place < self.waypoints.count {
            input.target = self.state(place);
            input.target_outside = [false; N];
            input.interface = [Interface::Position; N];
        }
        input.synchronization = [Synchronization::Time; N];
        self.calculations += 1;
        Trajectory::calculate(&input)
    }

    /// How long the section takes; infinite if there is no motion.
    fn time(&mut self, place: usize) -> f64 {
        self.section(place).map_or(f64::INFINITY, |trajectory| trajectory.duration())
    }

    fn duration(&mut self, place: usize) -> &mut f64 {
        self.durations.get_mut(place).unwrap_or(&mut self.last)
    }

    /// Measures the sections as they are, or with rest at each waypoint if that is no motion.
    fn begin(&mut self) -> Result<(), Error> {
        let sections = self.waypoints.count.min(W) + 1;
        let possible = (0..sections).all(|place| {
            *self.duration(place) = f64::INFINITY;
            let time = self.time(place);
            *self.duration(place) = time;
            time.is_finite()
        });
        if !possible {
            self.waypoints.velocities = [[0.0; N]; W];
            for place in 0..sections {
                *self.duration(place) = self.section(place)?.duration();
            }
        }
        Ok(())
    }

    /// Changes velocities while that helps and calculations are left.
    fn descend(&mut self, budget: u32) {
        let mut step = STEP_FIRST;
        while step >= STEP_LAST {
            let mut helped = false;
            for place in 0..self.waypoints.count.min(W) {
                for joint in 0..N {
                    for sign in [1.0, -1.0] {
                        if self.calculations + 2 > budget {
                            return;
                        }
                        if self.attempt(place, joint, sign * step) {
                            helped = true;
                            break;
                        }
                    }
                }
                // All joints together, as all wait for the last: one alone may gain nothing.
                for kind in [Together::Chord, Together::Onward, Together::Faster, Together::Slower] {
                    if self.calculations + 2 > budget {
                        return;
                    }
                    let before = self.waypoints.velocities[place];
                    self.waypoints.velocities[place] = self.together(place, kind, step);
                    helped |= self.keep(place, before);
                }
            }
            if !helped {
                step /= 2.0;
            }
        }
    }

    /// The velocities at a waypoint after a change of all.
    fn together(&self, place: usize, kind: Together, step: f64) -> [f64; N] {
        let before = self.waypoints.velocities[place];
        let from = place.checked_sub(1).map_or(self.input.start, |place| self.state(place));
        let (here, to) = (self.state(place), self.state(place + 1));
        let chord: [f64; N] = core::array::from_fn(|joint| to[joint].position - from[joint].position);
        // The speed at which the first joint to reach its limit does.
        let slowest = (0..N).fold(f64::INFINITY, |slowest, joint| {
            let limits = &self.input.limits[joint];
            let limit = if chord[joint] > 0.0 { limits.velocity_max } else { -limits.velocity_min };
            if chord[joint] == 0.0 { slowest } else { slowest.min(limit / chord[joint].abs()) }
        });
        core::array::from_fn(|joint| {
            let onward =
                (here[joint].position - from[joint].position) * (to[joint].position - here[joint].position) > 0.0;
            let velocity = match kind {
                Together::Faster => before[joint] * (1.0 + step),
                Together::Slower => before[joint] * (1.0 - step),
                Together::Onward if !onward => before[joint] * (1.0 - step),
                Together::Chord | Together::Onward if chord[joint] == 0.0 => before[joint] * (1.0 - step),
                Together::Chord | Together::Onward => before[joint] + step * (slowest * chord[joint] - before[joint]),
            };
            self.limited(joint, velocity)
        })
    }

    /// `velocity` within the limits of the joint.
    fn limited(&self, joint: usize, velocity: f64) -> f64 {
        let limits = &self.input.limits[joint];
        velocity.max(limits.velocity_min).min(limits.velocity_max)
    }

    /// Changes the velocity of one joint at a waypoint by a share of its limit; `false` if that does not help.
    fn attempt(&mut self, place: usize, joint: usize, share: f64) -> bool {
        let before = self.waypoints.velocities[place];
        let limits = &self.input.limits[joint];
        let limit = if share > 0.0 { limits.velocity_max } else { -limits.velocity_min };
        let velocity = self.limited(joint, before[joint] + share * limit);
        if velocity == before[joint] {
            return false;
        }
        self.waypoints.velocities[place][joint] = velocity;
        self.keep(place, before)
    }

    /// Keeps the velocities at a waypoint if the sections beside it take less, else takes those `before`.
    fn keep(&mut self, place: usize, before: [f64; N]) -> bool {
        let (to, from) = (self.time(place), self.time(place + 1));
        let known = *self.duration(place) + *self.duration(place + 1);
        let better = to + from < known * (1.0 - 1e-9);
        if better {
            (*self.duration(place), *self.duration(place + 1)) = (to, from);
        } else {
            self.waypoints.velocities[place] = before;
        }
        better
    }
}
