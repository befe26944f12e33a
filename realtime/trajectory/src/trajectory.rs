//! The trajectory of all joints, and how they share a duration.
//!
//! Each synchronised joint, or line of joints, has its possible durations ([`crate::reach`]). The
//! shared one is the first that is possible for all: ask each joint in turn for its first duration not
//! below the one that those before have agreed on, until all agree. A joint whose first duration is
//! shorter than that of another is thus only asked whether it can take as long, which needs no search. It
//! has at most three blocked intervals, so this ends.

use crate::{
    error::Error,
    input::{self, Input, Interface, Synchronization},
    profile::Profile,
    state::{Limits, State},
    straight::Line,
    task::Task,
};

/// Relative lengthening of the duration that a straight line may cost in
/// [`Synchronization::Phase`]: rounding.
const STRAIGHT_TIE: f64 = 1e-12;

/// Relative difference of two durations that is rounding.
const STEP_TIE: f64 = 4.0 * f64::EPSILON;

/// How often a joint by itself is asked at most: it has three blocked intervals.
const PASSES: usize = 5;

/// A motion of `N` joints.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trajectory<const N: usize> {
    profiles: [Profile; N],
    duration: f64,
}

impl<const N: usize> Default for Trajectory<N> {
    /// All joints at rest at zero: something to put a trajectory into.
    fn default() -> Self {
        Self::EMPTY
    }
}

impl<const N: usize> Trajectory<N> {
    /// Nothing written yet: every joint at rest at zero.
    pub(crate) const EMPTY: Self = Trajectory { profiles: [Profile::EMPTY; N], duration: 0.0 };

    /// The fastest motion from start to target in which the joints keep their limits and share
    /// their durations as asked.
    ///
    /// # Errors
    /// See [`Error`]; every input that passes the checks named there has a trajectory.
    ///
    /// # Realtime
    /// No allocation; at most `2 + 3 N` passes over the joints, each of bounded work.
    pub fn calculate(input: &Input<N>) -> Result<Self, Error> {
        let mut trajectory = Self::EMPTY;
        trajectory.fill(input).map(|()| trajectory)
    }

    /// As [`Trajectory::calculate`], into a trajectory that is there already, as a loop has one: a large thing is
    /// then not moved. After an error it is that of
    /// [`Trajectory::default`].
    ///
    /// # Errors
    /// As [`Trajectory::calculate`].
    ///
    /// # Realtime
    /// As [`Trajectory::calculate`].
    pub fn recalculate(&mut self, input: &Input<N>) -> Result<(), Error> {
        let filled = self.fill(input);
        if filled.is_err() {
            *self = Self::EMPTY;
        }
        filled
    }

    fn fill(&mut self, input: &Input<N>) -> Result<(), Error> {
        let tasks = core::array::from_fn(|_| None);
        let mut plan = Plan { tasks, line: None, on_line: [false; N], shared: [false; N], duration: 0.0 };
        plan.prepare(input)?;
        plan.write(input, self)?;
        for (index, profile) in self.profiles.iter().enumerate() {
            let (low, high) = (input.position_min[index], input.position_max[index]);
            if input.enabled[index] && (low > f64::NEG_INFINITY || high < f64::INFINITY) {
                let extrema = profile.extrema();
                if extrema.lowest.position < low || extrema.highest.position > high {
                    return Err(Error::PositionLimit { joint: index });
                }
            }
        }
        Ok(())
    }

    /// The fastest stop of each joint, whatever the others do. Velocity limits play no part: braking
    /// only lowers the speed, except for the time an acceleration needs to turn.
    ///
    /// # Errors
    /// [`Error::NotFinite`] and [`Error::Limits`].
    ///
    /// # Realtime
    /// No allocation, no iteration: closed forms only.
    pub fn stop(start: &[State; N], limits: &[Limits; N]) -> Result<Self, Error> {
        let input = Input {
            start: *start,
            limits: *limits,
            interface: [Interface::Velocity; N],
            synchronization: [Synchronization::None; N],
            ..Input::default()
        };
        Self::calculate(&input)
    }

    /// When all joints have arrived, in seconds.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.duration
    }

    /// State of every joint at `time`. Past the end the target goes on with its acceleration: a
    /// target at rest stays.
    #[must_use]
    #[inline]
    pub fn at(&self, time: f64) -> [State; N] {
        core::array::from_fn(|joint| self.profiles[joint].at(time))
    }

    /// The motion of each joint.
    #[must_use]
    pub fn profiles(&self) -> &[Profile; N] {
        &self.profiles
    }
}

// Fit for shared memory: a seven-joint trajectory takes no more than a page.
const _: () = assert!(size_of::<Trajectory<7>>() <= 4096);

/// What has been found about each joint before a duration is chosen.
struct Plan<const N: usize> {
    tasks: [Option<Task>; N],
    /// Joints on a line, if they move on one.
    line: Option<Line<N>>,
    on_line: [bool; N],
    /// Joints that share `duration`.
    shared: [bool; N],
    duration: f64,
}

impl<const N: usize> Plan<N> {
    /// Finds the shared duration.
    fn prepare(&mut self, input: &Input<N>) -> Result<(), Error> {
        let (mut phase, mut strict) = (false, false);
        for index in 0..N {
            if !input.enabled[index] {
                continue;
            }
            let own = input.joint(index);
            let joint = input::check(index, &own)?;
            Task::begin(&mut self.tasks[index], joint, &own);
            let target = &input.target[index];
            let rests = target.velocity == 0.0 && target.acceleration == 0.0;
            self.shared[index] = match input.synchronization[index] {
                Synchronization::None => false,
                Synchronization::TimeIfNecessary => !rests,
                Synchronization::Time => true,
                Synchronization::Phase => {
                    (phase, self.on_line[index]) = (true, true);
                    true
                }
                Synchronization::StrictPhase => {
                    (strict, self.on_line[index]) = (true, true);
                    true
                }
            };
        }
        if strict {
            self.line = Some(Line::new(input, &self.on_line)?);
        }
        self.duration = self.shared_duration(input)?;
        if phase && !strict {
            // Worth it only if it takes no longer.
            if let Ok(line) = Line::new(input, &self.on_line) {
                let apart = self.duration;
                self.line = Some(line);
                match self.shared_duration(input) {
                    Ok(straight) if straight <= apart * (1.0 + STRAIGHT_TIE) => self.duration = straight,
                    _ => self.line = None,
                }
            }
        }
        Ok(())
    }

    /// The tasks that share a duration, in `N + 1` places: the line, then the joints not on it.
    fn sharing(&mut self, place: usize) -> Option<(usize, &mut Task)> {
        let Some(index) = place.checked_sub(1) else {
            return self.line.as_mut().map(|line| (line.leader, &mut line.task));
        };
        if self.shared[index] && !(self.line.is_some() && self.on_line[index]) {
            self.tasks[index].as_mut().map(|task| (index, task))
        } else {
            None
        }
    }

    fn shared_duration(&mut self, input: &Input<N>) -> Result<f64, Error> {
        let (mut duration, step) = (input.minimum_duration.max(0.0), input.duration_step);
        // How many tasks in a row have found the duration possible.
        let (mut agreed, mut any) = (0, false);
        for round in 0..(2 + 3 * N) * (N + 1) {
            let place = round % (N + 1);
            if place == 0 && step > 0.0 {
                let whole = multiple(duration, step);
                if whole > duration {
                    (duration, agreed) = (whole, 0);
                }
            }
            agreed += 1;
            if let Some((joint, task)) = self.sharing(place) {
                any = true;
                let found = first_possible(task, duration, joint)?;
                if found > duration * (1.0 + STEP_TIE) {
                    (duration, agreed) = (found, 1);
                    if step > 0.0 {
                        (duration, agreed) = (multiple(found, step), 0);
                    }
                }
            }
            if agreed > N {
                break;
            }
        }
        Ok(if any { duration } else { 0.0 })
    }

    /// Writes the motion of each joint.
    fn write(&mut self, input: &Input<N>, trajectory: &mut Trajectory<N>) -> Result<(), Error> {
        trajectory.duration = self.duration;
        let along = match &mut self.line {
            Some(line) => Some(line.along(self.duration).ok_or(Error::OutOfRange { joint: line.leader })?),
            None => None,
        };
        for (index, profile) in trajectory.profiles.iter_mut().enumerate() {
            let sound = match (&mut self.tasks[index], &self.line, &along) {
                (None, ..) => {
                    *profile = Profile::drifting(input.start[index]);
                    true
                }
                (Some(_), Some(line), Some(along)) if self.on_line[index] => {
                    *profile = line.profile(index, along, input);
                    profile.is_finite()
                }
                (Some(task), ..) => {
                    let duration = if self.shared[index] { self.duration } else { own_duration(task, input, index)? };
                    trajectory.duration = trajectory.duration.max(duration);
                    task.write(&input.joint(index), duration, profile)
                }
            };
            if !sound {
                return Err(Error::OutOfRange { joint: index });
            }
        }
        Ok(())
    }
}

/// The first possible duration of `task` not below `time`.
fn first_possible(task: &mut Task, time: f64, joint: usize) -> Result<f64, Error> {
    let found = task.next(time).ok_or(Error::Unreachable { joint })?;
    if found.is_finite() { Ok(found) } else { Err(Error::OutOfRange { joint }) }
}

/// The first possible duration of a joint that shares none.
fn own_duration<const N: usize>(task: &mut Task, input: &Input<N>, joint: usize) -> Result<f64, Error> {
    let (mut duration, step) = (first_possible(task, input.minimum_duration.max(0.0), joint)?, input.duration_step);
    if step > 0.0 {
        for _ in 0..PASSES {
            let whole = multiple(duration, step);
            duration = first_possible(task, whole, joint)?;
            if duration <= whole * (1.0 + STEP_TIE) {
                return Ok(whole);
            }
        }
    }
    Ok(duration)
}

impl<const N: usize> Input<N> {
    /// The shortest time in which each joint alone could reach its target, in seconds; 0 for one that is not
    /// enabled.
    ///
    /// # Errors
    /// As [`Trajectory::calculate`].
    ///
    /// # Realtime
    /// No allocation; at most as long as a calculation.
    pub fn minimum_durations(&self) -> Result<[f64; N], Error> {
        let mut durations = [0.0; N];
        for (index, duration) in durations.iter_mut().enumerate() {
            if self.enabled[index] {
                *duration = {
                    let own = self.joint(index);
                    let joint = input::check(index, &own)?;
                    first_possible(Task::begin(&mut None, joint, &own), 0.0, index)?
                };
            }
        }
        Ok(durations)
    }
}

/// The smallest multiple of `step` that is not below `time`, up to rounding.
fn multiple(time: f64, step: f64) -> f64 {
    let ratio = time / step;
    if ratio >= 9.0e15 || step == f64::INFINITY {
        return time;
    }
    let whole = ratio as u64;
    let count = if ratio - whole as f64 > STEP_TIE * ratio { whole + 1 } else { whole };
    count as f64 * step
}
