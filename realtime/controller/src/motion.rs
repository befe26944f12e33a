//! The set-points, whatever they serve: without power, coming to rest, at rest, on a path.
//!
//! ```text
//! Slack --the arm answers--> Slowing --standstill--> Rest <--> Following
//!   ^--------- brakes closed, from anywhere ---------------------'
//! ```
//!
//! *Slack*: the arm does not follow (not yet, or its brakes are closed); the
//! set-points follow the measured arm, so that whenever it engages the first
//! command continues what it does. *Slowing*: it was moving when it engaged, and
//! every joint is brought to rest in the least time. Every other transition
//! starts and ends at the last set-point.

use tandem_kinematics::Chain;
use tandem_msg::{JOINTS_MAX, JointState, Stamp};
use tandem_trajectory::{Limits, State, Trajectory};

use crate::Joints;
use crate::law::{Law, LawLimits, Refused};
use crate::path::Path;

/// One command's worth of motion.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct SetPoint {
    pub(crate) position: Joints,
    pub(crate) velocity: Joints,
    pub(crate) acceleration: Joints,
}

#[derive(Clone, Copy, Debug)]
#[allow(clippy::large_enum_variant, reason = "there is one of it, in place; a box would be heap")]
enum Mode {
    Slack { since: Stamp },
    Slowing { trajectory: Trajectory<JOINTS_MAX>, time: f64 },
    Rest,
    Following { law: Law },
}

/// Generator of set-points.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Motion {
    mode: Mode,
    set: SetPoint,
    path: Path,
    limits: LawLimits,
    brake_limits: [Limits; JOINTS_MAX],
}

impl Motion {
    pub(crate) fn new(chain: &Chain) -> Self {
        let mut brake_limits = [Limits::symmetric(1.0, 1.0, 1.0); JOINTS_MAX];
        for (limits, joint) in brake_limits.iter_mut().zip(chain.joints()) {
            *limits = Limits::symmetric(joint.velocity_max, joint.acceleration_max, joint.jerk_max);
        }
        Self {
            mode: Mode::Slack { since: Stamp(0) },
            set: SetPoint::default(),
            path: Path::point(&[0.0; JOINTS_MAX]),
            limits: LawLimits { velocity: 1.0, acceleration: 1.0, jerk: 1.0 },
            brake_limits,
        }
    }

    /// The set-point in force.
    pub(crate) fn set(&self) -> &SetPoint {
        &self.set
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    pub(crate) fn limits(&self) -> &LawLimits {
        &self.limits
    }

    /// The law, while on a path.
    pub(crate) fn law(&self) -> Option<Law> {
        match self.mode {
            Mode::Following { law } => Some(law),
            _ => None,
        }
    }

    /// Since when the arm is not asked to follow.
    pub(crate) fn slack_since(&self) -> Option<Stamp> {
        match self.mode {
            Mode::Slack { since } => Some(since),
            _ => None,
        }
    }

    /// Whether the arm is asked to stand, and stands by its own set-points.
    pub(crate) fn at_rest(&self) -> bool {
        matches!(self.mode, Mode::Rest)
    }

    /// Whether every commanded velocity is 0.
    pub(crate) fn standstill(&self) -> bool {
        self.set.velocity.iter().all(|velocity| *velocity == 0.0)
    }

    /// Gives up following, from anywhere.
    pub(crate) fn slacken(&mut self, now: Stamp) {
        if self.slack_since().is_none() {
            self.mode = Mode::Slack { since: now };
            self.set.velocity = [0.0; JOINTS_MAX];
            self.set.acceleration = [0.0; JOINTS_MAX];
        }
    }

    /// The brakes are closed: whatever the arm answers to begins later than now.
    pub(crate) fn slack_anew(&mut self, now: Stamp) {
        self.mode = Mode::Slack { since: now };
    }

    /// While slack: takes the measured position for the set-point.
    pub(crate) fn mirror(&mut self, arm: &JointState) {
        self.set = SetPoint { position: arm.position, ..SetPoint::default() };
    }

    /// The arm follows: from its measured state to rest.
    pub(crate) fn engage(&mut self, arm: &JointState) -> Result<(), Refused> {
        let mut start = [State::at_rest(0.0); JOINTS_MAX];
        for ((start, position), velocity) in start.iter_mut().zip(&arm.position).zip(&arm.velocity) {
            *start = State { position: *position, velocity: *velocity, acceleration: 0.0 };
        }
        let trajectory = Trajectory::stop(&start, &self.brake_limits).map_err(|_| Refused)?;
        self.mode = Mode::Slowing { trajectory, time: 0.0 };
        Ok(())
    }

    /// While slowing: one period on.
    pub(crate) fn slow(&mut self, period: f64) {
        let Mode::Slowing { trajectory, time } = &mut self.mode else { return };
        *time += period;
        let states = trajectory.at(*time);
        let done = *time >= trajectory.duration();
        for (joint, state) in states.iter().enumerate() {
            self.set.position[joint] = state.position;
            self.set.velocity[joint] = if done { 0.0 } else { state.velocity };
            self.set.acceleration[joint] = if done { 0.0 } else { state.acceleration };
        }
        if done {
            self.mode = Mode::Rest;
        }
    }

    /// From rest onto a path that begins at the set-point. The law starts as a stop: it stands.
    pub(crate) fn follow(&mut self, path: &Path, limits: &LawLimits) -> Result<(), Refused> {
        self.path = *path;
        self.limits = *limits;
        let law = Law::stop(State::at_rest(0.0), limits)?;
        self.mode = Mode::Following { law };
        Ok(())
    }

    /// Goes over to another path that goes on from the present one, from a state of the law on it.
    pub(crate) fn change_over(&mut self, path: &Path, limits: &LawLimits, state: State) -> Result<(), Refused> {
        let law = Law::to(path.length(), state, limits)?;
        (self.path, self.limits) = (*path, *limits);
        self.mode = Mode::Following { law };
        Ok(())
    }

    /// Leaves the path; only at standstill.
    pub(crate) fn rest(&mut self) {
        self.set.velocity = [0.0; JOINTS_MAX];
        self.set.acceleration = [0.0; JOINTS_MAX];
        self.mode = Mode::Rest;
    }

    /// The set-point a state of the law means.
    pub(crate) fn set_point(&self, state: &State) -> SetPoint {
        let point = self.path.at(state.position);
        let mut set = SetPoint { position: point.position, ..SetPoint::default() };
        for joint in 0..JOINTS_MAX {
            set.velocity[joint] = point.first[joint] * state.velocity;
            set.acceleration[joint] =
                point.second[joint] * state.velocity * state.velocity + point.first[joint] * state.acceleration;
        }
        set
    }

    /// Takes a law that has been advanced and checked.
    pub(crate) fn commit(&mut self, law: Law, set: &SetPoint) {
        self.set = *set;
        if law.finished() {
            self.set.velocity = [0.0; JOINTS_MAX];
            self.set.acceleration = [0.0; JOINTS_MAX];
        }
        self.mode = Mode::Following { law };
    }
}
