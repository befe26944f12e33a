//! One joint's way from its start to its target, for any duration.

use crate::{
    brake,
    extremal::Joint,
    input::{Interface, JointInput},
    profile::Profile,
    reach::Reach,
    state::State,
    swing::{COLLECTED, Durations, Swing},
    writer::Writer,
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
    /// How long the prefix takes that brings the start inside the limits; 0 if it lies there.
    begin: f64,
    /// How long the suffix takes that leads to a target outside the limits; 0 if it lies inside.
    tail: f64,
    /// The motion without a prefix, if there may be one.
    direct: Option<Direct>,
}

/// A motion that needs no prefix although its start is bound to leave the limits: on the way to a target bound
/// to leave them, too, it never lets its acceleration change its sign.
#[derive(Clone, Copy, Debug)]
struct Direct {
    /// Velocity and acceleration of the start itself, and the distance from there.
    start: [f64; 2],
    distance: f64,
    /// The duration last found.
    found: f64,
}

// Boxing the larger variant would allocate in a cycle.
#[allow(clippy::large_enum_variant)]
#[derive(Clone, Copy, Debug)]
enum Goal {
    Position(Reach),
    Velocity(Swing, Durations),
}

impl Task {
    /// Puts the way of a checked `joint` into `slot`, each kind by itself, so that a small one is not moved as
    /// if it were a large one.
    #[inline(always)]
    pub(crate) fn begin<'a>(slot: &'a mut Option<Self>, mut joint: Joint, input: &JointInput) -> &'a mut Self {
        let Around { begin, tail, position, direct } = if prefix(&joint, input).is_some() || input.target_outside {
            Around::take_off(&mut joint, input)
        } else {
            Around { begin: 0.0, tail: 0.0, position: input.start.position, direct: None }
        };
        match input.interface {
            Interface::Position => {
                slot.insert(Task { goal: Goal::Position(reach(joint, input, position)), begin, tail, direct })
            }
            Interface::Velocity => {
                let swing = Swing::of(&joint);
                let durations = swing.durations(joint.start[0].abs() + joint.end[0].abs());
                slot.insert(Task { goal: Goal::Velocity(swing, durations), begin, tail, direct })
            }
        }
    }

    /// The first possible duration not below `time`; `time` itself unchanged if it is possible. `None` if
    /// there is none.
    pub(crate) fn next(&mut self, time: f64) -> Option<f64> {
        let direct = self.next_direct(time);
        let around = self.begin + self.tail;
        let passed = (time - around).max(0.0);
        let found = match &mut self.goal {
            Goal::Position(reach) => reach.next(passed),
            Goal::Velocity(_, durations) => Some(durations.next(passed)),
        };
        let found = found.map(|found| if found <= passed { time.max(around) } else { around + found });
        match (direct, found) {
            (Some(direct), Some(found)) => Some(direct.min(found)),
            (direct, found) => direct.or(found),
        }
    }

    /// The first duration of a motion without a prefix that is not below `time`.
    fn next_direct(&mut self, time: f64) -> Option<f64> {
        let (Some(direct), Goal::Position(reach)) = (&mut self.direct, &self.goal) else { return None };
        let mut reach = reach.started(direct.start, direct.distance);
        let found = reach.next(time).filter(|found| reach.keeps_sign(*found));
        direct.found = found.unwrap_or(f64::NAN);
        found
    }

    /// The problem from the start itself to the target itself.
    fn joint(&self, input: &JointInput) -> Joint {
        let ends = [input.start, input.target].map(|state| [state.velocity, state.acceleration]);
        let joint = match &self.goal {
            Goal::Position(reach) => *reach.joint(),
            Goal::Velocity(swing, _) => swing.joint(),
        };
        Joint { start: ends[0], end: ends[1], ..joint }
    }

    /// Writes the motion that takes `duration`, which must be possible, to `profile`;
    /// `false` if the numbers left the range of doubles on the way.
    pub(crate) fn write(&mut self, input: &JointInput, duration: f64, profile: &mut Profile) -> bool {
        let mut writer = Writer::new(profile, &input.limits, input.start.position, duration);
        if let Goal::Velocity(swing, durations) = &self.goal
            && self.begin == 0.0
            && self.tail == 0.0
        {
            writer.follow_here(&swing.waiting(duration, input.start.velocity, durations));
            let target = State { position: writer.position, ..input.target };
            return writer.finish(target, target.position.abs()).is_finite();
        }
        if let (Some(direct), Goal::Position(reach)) = (&self.direct, &self.goal)
            && (direct.found - duration).abs() <= duration * DIRECT_TIE
        {
            write_reach(&mut reach.started(direct.start, direct.distance), duration, &mut writer);
        } else {
            let mut velocity = input.start.velocity;
            if self.begin > 0.0
                && let Some(prefix) = prefix(&self.joint(input), input)
            {
                velocity = prefix.end[0];
                writer.prefix(&prefix.steps);
            }
            let time = duration - self.begin - self.tail;
            writer.end = duration - self.tail;
            match &mut self.goal {
                Goal::Position(reach) => write_reach(reach, time, &mut writer),
                Goal::Velocity(swing, durations) => writer.follow(&swing.waiting(time, velocity, durations)),
            }
            if self.tail > 0.0
                && let Some(prefix) = prefix(&self.joint(input).reversed(), input)
            {
                writer.end = duration;
                writer.follow(&prefix.reversed().0);
            }
        }
        // The positions are integrated forward, so this tells whether all that led here was sound.
        let reached = writer.position;
        let target = match input.interface {
            Interface::Position => input.target,
            Interface::Velocity => State { position: reached, ..input.target },
        };
        let extent = writer.finish(target, input.start.position.abs() + target.position.abs());
        let off = (reached - target.position).abs();
        let sound = off <= SOUND * extent
            || match &self.goal {
                Goal::Position(reach) => off <= reach.slack(duration),
                Goal::Velocity(..) => false,
            };
        extent.is_finite() && sound
    }
}

/// What lies before and behind the motion within the limits.
struct Around {
    /// See [`Task`].
    begin: f64,
    tail: f64,
    direct: Option<Direct>,
    /// Where the motion within the limits would start if what lies behind it lay before.
    position: f64,
}

impl Around {
    /// Makes `joint` that of the motion within the limits.
    #[cold]
    fn take_off(joint: &mut Joint, input: &JointInput) -> Self {
        let mut around = Around { begin: 0.0, tail: 0.0, direct: None, position: input.start.position };
        if let Some(prefix) = prefix(joint, input) {
            if input.interface == Interface::Position && begins_inside(joint, input.limits.velocity_min) {
                let distance = input.target.position - around.position;
                around.direct = Some(Direct { start: joint.start, distance, found: f64::NAN });
            }
            let mut scratch = Profile::EMPTY;
            let mut writer = Writer::new(&mut scratch, &input.limits, around.position, f64::INFINITY);
            writer.prefix(&prefix.steps);
            (around.begin, around.position) = (writer.now(), writer.position);
            joint.start = prefix.end;
        }
        if input.target_outside
            && let Some(prefix) = prefix(&joint.reversed(), input)
        {
            let (suffix, end) = prefix.reversed();
            let mut scratch = Profile::EMPTY;
            let mut writer = Writer::new(&mut scratch, &input.limits, 0.0, f64::INFINITY);
            writer.prefix(&suffix);
            (around.tail, joint.end) = (writer.now(), end);
            around.position += writer.position;
            around.direct = None;
        }
        around
    }
}

/// Whether a start bound to leave the limits has not yet left them, up to collected roundings.
fn begins_inside(joint: &Joint, velocity_min: f64) -> bool {
    let ([velocity, acceleration], [_, last]) = (joint.start, joint.end);
    let within = |value: f64, limit: f64| value <= limit * (1.0 + COLLECTED);
    within(velocity, joint.peak)
        && within(-velocity, -velocity_min)
        && within(acceleration, joint.top)
        && within(-acceleration, joint.bottom)
        && acceleration * last > 0.0
}

/// What brings a start outside the limits back.
fn prefix(joint: &Joint, input: &JointInput) -> Option<brake::Prefix> {
    match input.interface {
        Interface::Position => brake::prefix(joint, input.limits.velocity_min, input.soft),
        Interface::Velocity => brake::acceleration_prefix(joint),
    }
}

/// The position problem of `joint`, from `position` on.
#[inline(always)]
fn reach(joint: Joint, input: &JointInput, position: f64) -> Reach {
    let rounding = POSITION_TIE * (input.start.position.abs() + input.target.position.abs());
    let distance = input.target.position - position;
    Reach::new(joint, input.limits.velocity_min, distance, rounding, input.tolerance)
}

/// Appends the motion that takes `time`.
fn write_reach(reach: &mut Reach, time: f64, writer: &mut Writer<'_>) {
    match reach.motions(time) {
        (Some(far), Some(near), share) => writer.mix([&far, &near], share),
        (Some(motion), ..) | (_, Some(motion), _) => writer.follow(motion.as_slice()),
        (None, None, _) => {}
    }
}
