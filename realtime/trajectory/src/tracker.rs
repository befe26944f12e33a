//! Following a target that moves.
//!
//! Every cycle the target's state is sampled, and the joint goes to where that sample was taken. A signal that
//! keeps the limits was itself a motion of one cycle from its last sample to this one, so that once the joint
//! is on it, it follows one cycle behind, exactly. Before that the joint needs longer, and meanwhile the target
//! moves on: the joint aims at where it will be by then, if it goes on with the jerk it has. The time to the
//! meeting found in one cycle, less that cycle, is the first tried in the next, so that the joint keeps to its
//! plan while the target keeps to its course.

use crate::{
    error::Error,
    input::Input,
    state::{Limits, State},
    trajectory::Trajectory,
};

/// Longer times to the meeting that are tried, each a quarter longer than the one before; the last is some
/// ten thousand cycles.
const LONGER: usize = 42;

/// Halvings between the last time that was too short and the first that was not.
const HALVINGS: usize = 4;

/// A target is taken to go on with its jerk for so many cycles, and then with its velocity.
const HORIZON: f64 = 64.0;

/// What the duration of a motion may exceed the time to the meeting by, relatively: by so little the joint
/// falls short in one cycle, and makes it good in the next.
const TIE: f64 = 1e-9;

/// Joints that follow a moving target, each by itself.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tracker<const N: usize> {
    states: [State; N],
    limits: [Limits; N],
    /// The acceleration of the last sample; NaN before the first.
    accelerations: [f64; N],
    /// How long it was to the meeting at the last cycle, in seconds.
    meetings: [f64; N],
    /// Seconds.
    cycle: f64,
}

impl<const N: usize> Tracker<N> {
    /// Joints in `states` that are commanded every `cycle` seconds.
    #[must_use]
    pub fn new(states: [State; N], limits: [Limits; N], cycle: f64) -> Self {
        Tracker { states, limits, accelerations: [f64::NAN; N], meetings: [cycle; N], cycle }
    }

    /// The states last commanded.
    #[must_use]
    pub fn states(&self) -> &[State; N] {
        &self.states
    }

    /// Goes on by one cycle towards `target`, as sampled now; returns the states to command at its end.
    ///
    /// # Errors
    /// As [`Trajectory::calculate`]; all joints then stay as they were.
    ///
    /// # Realtime
    /// No allocation; at most 48 calculations a joint, two or three as a rule.
    pub fn follow(&mut self, target: &[State; N]) -> Result<[State; N], Error> {
        let mut next = *self;
        for (joint, sample) in target.iter().enumerate() {
            let (state, meeting) = self.joint(joint, sample).map_err(|error| error.of(joint))?;
            (next.states[joint], next.meetings[joint], next.accelerations[joint]) =
                (state, meeting, sample.acceleration);
        }
        *self = next;
        Ok(self.states)
    }

    /// The next state of one joint, and how long it is to the meeting.
    fn joint(&self, joint: usize, target: &State) -> Result<(State, f64), Error> {
        let (limits, cycle) = (self.limits[joint], self.cycle);
        let jerk = (target.acceleration - self.accelerations[joint]) / cycle;
        let jerk = if jerk.is_nan() { 0.0 } else { jerk.max(limits.jerk_min).min(limits.jerk_max) };
        let course = Course { start: self.states[joint], limits, target: *target, jerk, cycle };
        if let Some(trajectory) = course.meet(cycle) {
            return Ok((trajectory.at(cycle)[0], cycle));
        }
        let (mut short, mut time) = (cycle, (self.meetings[joint] - cycle).max(1.25 * cycle));
        for round in 0..LONGER {
            if let Some(mut trajectory) = course.meet(time) {
                // A plan that holds is tried to be kept one cycle shorter; a new one is made shorter.
                for _ in 0..if round == 0 { 1 } else { HALVINGS } {
                    let earlier = if round == 0 { time - cycle } else { short + (time - short) / 2.0 };
                    match course.meet(earlier.max(cycle)) {
                        Some(found) => (trajectory, time) = (found, earlier.max(cycle)),
                        None => short = earlier,
                    }
                }
                return Ok((trajectory.at(cycle)[0], time));
            }
            (short, time) = (time, 1.25 * time);
        }
        // It runs away: after it.
        Ok((Trajectory::calculate(&course.input(cycle))?.at(cycle)[0], cycle))
    }
}

/// A joint, and a target that goes on as it does.
struct Course {
    start: State,
    limits: Limits,
    target: State,
    jerk: f64,
    cycle: f64,
}

impl Course {
    /// The motion that meets the target after `time`, if there is one.
    fn meet(&self, time: f64) -> Option<Trajectory<1>> {
        let trajectory = Trajectory::calculate(&self.input(time)).ok()?;
        (trajectory.duration() <= time * (1.0 + TIE)).then_some(trajectory)
    }

    /// To be where the target will be after `time`, less the cycle to be behind.
    fn input(&self, time: f64) -> Input<1> {
        let ahead = (time - self.cycle).max(0.0);
        let horizon = ahead.min(HORIZON * self.cycle);
        let mut target = self.target;
        if ahead > 0.0 {
            target = target.advanced(horizon, self.jerk);
            target.position += (ahead - horizon) * target.velocity;
        }
        // What breaks the limits is followed as well as they allow.
        let Limits { velocity_min, velocity_max, acceleration_min, acceleration_max, jerk_min, jerk_max } = self.limits;
        let (v, a) = (target.velocity, target.acceleration);
        let around = if a > 0.0 { v - a * a / (2.0 * jerk_max) } else { v - a * a / (2.0 * jerk_min) };
        let inside = |v: f64| v <= velocity_max && v >= velocity_min;
        if !(inside(v) && inside(around) && a <= acceleration_max && a >= acceleration_min) && target.is_finite() {
            target.velocity = v.max(velocity_min).min(velocity_max);
            target.acceleration = 0.0;
        }
        Input {
            start: [self.start],
            target: [target],
            limits: [self.limits],
            minimum_duration: time,
            ..Input::default()
        }
    }
}
