//! The trajectory of all joints, and how they share a duration.
//!
//! Each synchronised joint, or line of joints, has its possible durations ([`crate::reach`]). The
//! shared one is the first that is possible for all: start with the longest minimum, and while it
//! lies inside a blocked interval of some joint, move on to the end of that interval. A joint has
//! at most three blocked intervals, so this ends.

use crate::{
    error::Error,
    input::{Input, Interface, Synchronization},
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

/// A motion of `N` joints.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trajectory<const N: usize> {
    profiles: [Profile; N],
    duration: f64,
}

impl<const N: usize> Trajectory<N> {
    /// The fastest motion from start to target in which the joints keep their limits and share
    /// their durations as asked.
    ///
    /// # Errors
    /// See [`Error`]; every input that passes the checks named there has a trajectory.
    ///
    /// # Realtime
    /// No allocation; at most `2 + 3 N` passes over the joints, each of bounded work.
    pub fn calculate(input: &Input<N>) -> Result<Self, Error> {
        let trajectory = Plan::new(input)?.trajectory(input)?;
        for (index, profile) in trajectory.profiles.iter().enumerate() {
            let (low, high) = (input.position_min[index], input.position_max[index]);
            if input.enabled[index] && (low > f64::NEG_INFINITY || high < f64::INFINITY) {
                let extrema = profile.extrema();
                if extrema.lowest.position < low || extrema.highest.position > high {
                    return Err(Error::PositionLimit { joint: index });
                }
            }
        }
        Ok(trajectory)
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
    fn new(input: &Input<N>) -> Result<Self, Error> {
        let mut plan = Plan { tasks: [None; N], line: None, on_line: [false; N], shared: [false; N], duration: 0.0 };
        let (mut phase, mut strict) = (false, false);
        for index in 0..N {
            if !input.enabled[index] {
                continue;
            }
            let target = &input.target[index];
            plan.tasks[index] = Some(Task::new(index, &input.joint(index))?);
            let rests = target.velocity == 0.0 && target.acceleration == 0.0;
            plan.shared[index] = match input.synchronization[index] {
                Synchronization::None => false,
                Synchronization::TimeIfNecessary => !rests,
                Synchronization::Time => true,
                Synchronization::Phase => {
                    (phase, plan.on_line[index]) = (true, true);
                    true
                }
                Synchronization::StrictPhase => {
                    (strict, plan.on_line[index]) = (true, true);
                    true
                }
            };
        }
        if strict {
            plan.line = Some(Line::new(input, &plan.on_line)?);
        }
        plan.duration = plan.shared_duration(input)?;
        if !plan.duration.is_finite() {
            return Err(Error::OutOfRange { joint: plan.last() });
        }
        if phase && !strict {
            // Worth it only if it takes no longer.
            if let Ok(line) = Line::new(input, &plan.on_line) {
                let apart = plan.duration;
                plan.line = Some(line);
                match plan.shared_duration(input) {
                    Ok(straight) if straight <= apart * (1.0 + STRAIGHT_TIE) => plan.duration = straight,
                    _ => plan.line = None,
                }
            }
        }
        Ok(plan)
    }

    /// The joint with the longest minimum duration.
    fn last(&self) -> usize {
        let minimum = |index: usize| self.tasks[index].as_ref().map_or(0.0, |task| task.minimum);
        (0..N).fold(0, |last, index| if minimum(index) > minimum(last) { index } else { last })
    }

    /// The tasks that share a duration: the line, and the joints not on it.
    fn sharing(&self) -> impl Iterator<Item = (usize, &Task)> {
        let line = self.line.as_ref().map(|line| (0, &line.task));
        let alone = self.tasks.iter().enumerate().filter_map(|(index, task)| {
            let apart = self.shared[index] && !(self.line.is_some() && self.on_line[index]);
            if apart { task.as_ref().map(|task| (index, task)) } else { None }
        });
        line.into_iter().chain(alone)
    }

    fn shared_duration(&self, input: &Input<N>) -> Result<f64, Error> {
        let first = self.sharing().fold(0.0_f64, |longest, (_, task)| longest.max(task.minimum));
        if self.sharing().next().is_none() {
            return Ok(0.0);
        }
        let next = |time: f64| {
            let mut duration = time;
            for (index, task) in self.sharing() {
                duration = task.next(duration).ok_or(Error::Unreachable { joint: index })?;
            }
            Ok(duration)
        };
        possible(first.max(input.minimum_duration), input.duration_step, 2 + 3 * N, next)
    }

    fn trajectory(&self, input: &Input<N>) -> Result<Trajectory<N>, Error> {
        let mut trajectory = Trajectory { profiles: [Profile::drifting(State::default()); N], duration: self.duration };
        let line = match &self.line {
            Some(line) => {
                Some((line, line.task.profile(self.duration).ok_or(Error::OutOfRange { joint: line.leader })?))
            }
            None => None,
        };
        for (index, profile) in trajectory.profiles.iter_mut().enumerate() {
            *profile = match (&self.tasks[index], &line) {
                (None, _) => Profile::drifting(input.start[index]),
                (Some(task), Some((line, along))) if self.on_line[index] => {
                    line.profile(index, along, input, task.minimum).ok_or(Error::OutOfRange { joint: index })?
                }
                (Some(task), _) => {
                    let duration = if self.shared[index] { self.duration } else { own_duration(task, input, index)? };
                    trajectory.duration = trajectory.duration.max(duration);
                    task.profile(duration).ok_or(Error::OutOfRange { joint: index })?
                }
            };
        }
        Ok(trajectory)
    }
}

/// The first possible duration of a joint that shares none.
fn own_duration<const N: usize>(task: &Task, input: &Input<N>, index: usize) -> Result<f64, Error> {
    let next = |time: f64| task.next(time).ok_or(Error::Unreachable { joint: index });
    possible(task.minimum.max(input.minimum_duration), input.duration_step, 5, next)
}

/// The first duration not below `time`, a multiple of `step` unless that is 0, that `next` leaves
/// as it is; `next` moves a duration to the first one some joint can take.
fn possible(time: f64, step: f64, passes: usize, next: impl Fn(f64) -> Result<f64, Error>) -> Result<f64, Error> {
    let mut duration = next(time)?;
    if step <= 0.0 && duration <= time {
        return Ok(time);
    }
    for _ in 0..passes {
        let candidate = if step > 0.0 { multiple(duration, step) } else { duration };
        let found = next(candidate)?;
        if found <= candidate * (1.0 + STEP_TIE) {
            return Ok(candidate);
        }
        duration = found;
    }
    Ok(duration)
}

/// The smallest multiple of `step` that is not below `time`, up to rounding.
fn multiple(time: f64, step: f64) -> f64 {
    let ratio = time / step;
    if ratio >= 9.0e15 {
        return time;
    }
    let whole = ratio as u64;
    let count = if ratio - whole as f64 > STEP_TIE * ratio { whole + 1 } else { whole };
    count as f64 * step
}
