//! One joint's way from its start to its target, for any duration.

use crate::{
    brake,
    error::Error,
    extremal::Joint,
    input::{self, Interface, JointInput},
    profile::Profile,
    reach::Reach,
    state::State,
    swing::{Durations, Swing},
};

/// How exactly a difference of two positions is known, in units of the positions.
const POSITION_TIE: f64 = 2.0 * f64::EPSILON;

/// Largest error of the end position, in units of the largest positions and velocities on the way,
/// that rounding explains.
const SOUND: f64 = 1e-9;

/// Durations this close, relatively, differ by rounding.
const DIRECT_TIE: f64 = 8.0 * f64::EPSILON;

/// A checked problem of one joint, or of several moving on a line.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Task {
    goal: Goal,
    /// The motion without a prefix, and its duration, if that is just one jerk: on the way to a target
    /// about to leave the limits, the start is about to, too.
    direct: Option<(Reach, f64)>,
    brake: brake::Prefix,
    input: JointInput,
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
    pub(crate) fn new(index: usize, input: &JointInput) -> Result<Self, Error> {
        let joint = input::check(index, input)?;
        let JointInput { interface, start, target, limits, tolerance, .. } = input;
        let rounding = POSITION_TIE * (start.position.abs() + target.position.abs());
        let reach = |joint: Joint, position: f64| {
            Reach::new(joint, limits.velocity_min, target.position - position, rounding, *tolerance)
        };
        let brake = match interface {
            Interface::Position => brake::prefix(&joint, limits.velocity_min, input.soft),
            Interface::Velocity => brake::acceleration_prefix(&joint),
        };
        let mut direct = None;
        if *interface == Interface::Position && brake.steps[0].duration > 0.0 {
            let reach = reach(joint, start.position);
            direct = reach.arrival().map(|duration| (reach, duration));
        }
        let (begin, position) = Profile::empty(limits).prefix(&brake.steps, start.position);
        let joint = Joint { start: brake.end, ..joint };
        let goal = match interface {
            Interface::Position => Goal::Position(reach(joint, position)),
            Interface::Velocity => {
                let swing = Swing::of(&joint);
                Goal::Velocity(swing, swing.durations(joint.start[0].abs() + joint.end[0].abs()))
            }
        };
        let mut task = Task { goal, direct, brake, input: *input, begin, minimum: 0.0 };
        task.minimum = task.next(0.0).ok_or(Error::Unreachable { joint: index })?;
        if task.minimum.is_finite() { Ok(task) } else { Err(Error::OutOfRange { joint: index }) }
    }

    /// The first possible duration not below `time`; `time` itself unchanged if it is possible.
    pub(crate) fn next(&self, time: f64) -> Option<f64> {
        if let Some((_, duration)) = self.direct(time) {
            return Some(time.max(*duration));
        }
        let passed = (time - self.begin).max(0.0);
        let found = match &self.goal {
            Goal::Position(reach) => reach.next(passed)?,
            Goal::Velocity(_, durations) => durations.next(passed),
        };
        Some(if found <= passed { time.max(self.begin) } else { self.begin + found })
    }

    /// The motion without a prefix, if it takes no less than `time`.
    fn direct(&self, time: f64) -> Option<&(Reach, f64)> {
        self.direct.as_ref().filter(|(_, duration)| time <= duration * (1.0 + DIRECT_TIE))
    }

    /// The motion that takes `duration`, which must be possible, or `None` if the numbers left the
    /// range of doubles on the way.
    pub(crate) fn profile(&self, duration: f64) -> Option<Profile> {
        let mut profile = Profile::empty(&self.input.limits);
        let (mut begin, mut position) = (0.0, self.input.start.position);
        let direct = self.direct(duration);
        if direct.is_none() {
            (begin, position) = profile.prefix(&self.brake.steps, position);
        }
        let time = duration - begin;
        let (far, near, share) = match (&self.goal, direct) {
            (_, Some((reach, _))) | (Goal::Position(reach), None) => reach.mixture(time).phases(reach),
            (Goal::Velocity(swing, _), None) => {
                let velocity = self.brake.end[0];
                let (far, high) = swing.highest(time, velocity);
                let (near, low) = swing.mirrored().highest(time, -velocity);
                let share = if high + low > 0.0 { ((swing.gain + low) / (high + low)).clamp(0.0, 1.0) } else { 1.0 };
                (far, near, share)
            }
        };
        let (end, position) = profile.mix(&far, &near, share, begin, time, position);
        // The positions are integrated forward, so this tells whether all that led here was sound.
        let target = match self.goal {
            Goal::Position(_) => self.input.target,
            Goal::Velocity(..) => State { position, ..self.input.target },
        };
        let extent = profile.extent(duration, self.input.start.position.abs() + target.position.abs());
        let sound = extent.is_finite() && (position - target.position).abs() <= SOUND * extent + self.input.tolerance;
        profile.finish(end.read_as(duration), target);
        profile.set_minimum(self.minimum);
        sound.then_some(profile)
    }
}
