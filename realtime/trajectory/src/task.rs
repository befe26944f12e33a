//! One joint's way from its start to its target, for any duration.

use crate::{
    brake,
    error::Error,
    extremal::Joint,
    input::{self, Interface},
    profile::Profile,
    reach::Reach,
    state::{Limits, State},
    swing::{Durations, Swing},
};

/// How exactly a difference of two positions is known, in units of the positions.
const POSITION_TIE: f64 = 2.0 * f64::EPSILON;

/// A checked problem of one joint, or of several moving on a line.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Task {
    goal: Goal,
    brake: brake::Prefix,
    start: State,
    target: State,
    limits: Limits,
    /// Duration of the prefix.
    begin: f64,
    /// First possible duration of the whole, prefix included.
    pub(crate) minimum: f64,
}

// Boxing the larger variant would allocate in a cycle.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Copy, Debug)]
enum Goal {
    Position(Reach),
    Velocity(Swing, Durations),
}

impl Task {
    pub(crate) fn new(
        index: usize,
        interface: Interface,
        start: &State,
        target: &State,
        limits: &Limits,
    ) -> Result<Self, Error> {
        let joint = input::joint(index, interface, start, target, limits)?;
        let brake = match interface {
            Interface::Position => brake::prefix(&joint, limits.velocity_min),
            Interface::Velocity => brake::acceleration_prefix(&joint),
        };
        let (begin, position) = Profile::empty(limits).prefix(&brake.steps, start.position);
        let joint = Joint { start: brake.end, ..joint };
        let goal = match interface {
            Interface::Position => {
                let tie = POSITION_TIE * (start.position.abs() + target.position.abs());
                Goal::Position(Reach::new(joint, limits.velocity_min, target.position - position, tie))
            }
            Interface::Velocity => {
                let swing = Swing::of(&joint);
                Goal::Velocity(swing, swing.durations(joint.start[0].abs() + joint.end[0].abs()))
            }
        };
        let mut task = Task { goal, brake, start: *start, target: *target, limits: *limits, begin, minimum: 0.0 };
        task.minimum = task.next(0.0).ok_or(Error::Unreachable { joint: index })?;
        if task.minimum.is_finite() { Ok(task) } else { Err(Error::OutOfRange { joint: index }) }
    }

    /// The first possible duration not below `time`; `time` itself unchanged if it is possible.
    pub(crate) fn next(&self, time: f64) -> Option<f64> {
        let passed = (time - self.begin).max(0.0);
        let found = match &self.goal {
            Goal::Position(reach) => reach.next(passed)?,
            Goal::Velocity(_, durations) => durations.next(passed),
        };
        Some(if found <= passed { time.max(self.begin) } else { self.begin + found })
    }

    /// The motion that takes `duration`, which must be possible.
    pub(crate) fn profile(&self, duration: f64) -> Profile {
        let mut profile = Profile::empty(&self.limits);
        let (begin, position) = profile.prefix(&self.brake.steps, self.start.position);
        match &self.goal {
            Goal::Position(reach) => {
                let mixture = reach.mixture(duration - begin);
                let (far, near) = (reach.far.phases(&mixture.far), reach.near.phases(&mixture.near));
                let (end, _) = profile.mix(&far, &near, mixture.share, begin, duration - begin, position);
                profile.finish(end.read_as(duration), self.target);
            }
            Goal::Velocity(swing, _) => {
                let velocity = self.brake.end[0];
                let (far, high) = swing.highest(duration - begin, velocity);
                let (near, low) = swing.mirrored().highest(duration - begin, -velocity);
                let share = if high + low > 0.0 { ((swing.gain + low) / (high + low)).clamp(0.0, 1.0) } else { 1.0 };
                let (end, position) = profile.mix(&far, &near, share, begin, duration - begin, position);
                profile.finish(end.read_as(duration), State { position, ..self.target });
            }
        }
        profile.set_minimum(self.minimum);
        profile
    }
}
