//! The drives' own watchdog: which command may move the arm, and what it does when none may.
//!
//! A real arm does not trust its controller: a command is followed only while it
//! is fresh, finite, inside the limits, from the newest controller heard, and near
//! where the arm already is. Otherwise the drives brake on their own and hold.
//!
//! ```text
//! Held --valid command that continues from here--> Following --no valid command--> Braking --standstill--> Held
//!                                                      ^------- brake = 1 -------------^
//! ```
//! Between the two lies patience: a command that is overdue (`next_due`) but still valid slows the arm along its path,
//! from nothing at `next_due` to the full brakes at `valid_until`. When commands come again within that time, the arm
//! joins them smoothly ([`Gap`]) and nobody has to begin anew; a busy computer costs it a little speed.
//!
//! **Invariant:** from the first cycle without a valid command the speed of every
//! joint falls; all joints reach zero together, so the arm brakes along its path.
//! **Invariant:** a command of a replaced controller never moves the arm again, and one of its successor only from a
//! standstill.

use tandem_msg::{JOINTS_MAX, JointCommand, PlantFault, Stamp};

use super::arm::JointModel;
use super::gap::Gap;

/// Brakes decelerate this many times harder than the arm may accelerate.
const BRAKE_FACTOR: f64 = 2.0;
/// A set-point may be this far from where the arm is, rad: some fifty times what the drives lag behind.
const FOLLOW_MAX: f64 = 0.1;
/// To open the brakes the first set-point must lie this near the standing arm, rad, ...
const RESUME_POSITION_MAX: f64 = 0.02;
/// ... and hardly move, rad/s.
const RESUME_VELOCITY_MAX: f64 = 0.05;
/// Speeds up to this share above the limit pass: rounding and blending, not a fault.
const VELOCITY_SLACK: f64 = 1.05;
/// Positions up to this far past the limit pass, rad.
const POSITION_SLACK: f64 = 1e-3;

/// What the motors are to strive for.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct SetPoint {
    pub(super) position: [f64; JOINTS_MAX],
    pub(super) velocity: [f64; JOINTS_MAX],
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Following,
    Braking,
    Held,
}

/// Limits of one joint.
#[derive(Clone, Copy, Debug, Default)]
struct Limit {
    position: [f64; 2],
    velocity_max: f64,
    brake: f64,
}

/// The drives: the last set-point, and whether commands are being followed.
pub(super) struct Drive {
    limits: [Limit; JOINTS_MAX],
    joint_count: usize,
    config_hash: u64,
    state: State,
    fault: PlantFault,
    set_point: SetPoint,
    epoch: u64,
    answered: (u64, Stamp),
    last_seq: u64,
    /// Share of the brakes in force.
    braking: f64,
    /// What the brakes do to the set-point, rad/s²; 0 when it has not coasted.
    deceleration: [f64; JOINTS_MAX],
    /// The set-point has gone on without commands since the last one.
    coasted: bool,
    /// By how much it is off the commands since then.
    gap: Gap,
}

/// Why a command is not followed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Refusal {
    Fault(PlantFault),
    BrakeAsked,
}

impl Drive {
    /// Drives that hold the arm at `home`.
    pub(super) fn new(joints: &[JointModel], home: &[f64; JOINTS_MAX], config_hash: u64) -> Self {
        let mut limits = [Limit::default(); JOINTS_MAX];
        for (limit, joint) in limits.iter_mut().zip(joints) {
            *limit = Limit {
                position: joint.position,
                velocity_max: joint.velocity_max,
                brake: joint.acceleration_max * BRAKE_FACTOR,
            };
        }
        Self {
            limits,
            joint_count: joints.len(),
            config_hash,
            state: State::Held,
            fault: PlantFault::NeverCommanded,
            set_point: SetPoint { position: *home, velocity: [0.0; JOINTS_MAX] },
            epoch: 0,
            answered: (0, Stamp(0)),
            last_seq: 0,
            braking: 0.0,
            deceleration: [0.0; JOINTS_MAX],
            coasted: false,
            gap: Gap::default(),
        }
    }

    /// Judges the command and moves the set-point by one cycle of `dt` seconds.
    /// `measured` is where the joints are, rad.
    pub(super) fn cycle(
        &mut self,
        now: Stamp,
        dt: f64,
        command: &JointCommand,
        measured: &[f64; JOINTS_MAX],
    ) -> SetPoint {
        let verdict = self.judge(now, command, measured);
        let known = command.header.epoch == self.epoch;
        if command.header.heard() && command.header.config_hash == self.config_hash {
            self.epoch = self.epoch.max(command.header.epoch);
        }
        match verdict {
            Ok(()) if self.state == State::Following && known || self.continues(command, measured) => {
                self.follow(now, dt, command);
            }
            Ok(()) => {
                self.brake(dt);
                // A valid command from elsewhere, or of a successor, keeps the brakes shut under its own name.
                self.refuse(PlantFault::CommandRefused);
            }
            Err(Refusal::BrakeAsked) => {
                self.brake(dt);
                self.fault = PlantFault::None;
                self.answered = (command.header.seq, command.header.stamp);
            }
            Err(Refusal::Fault(fault)) => {
                self.brake(dt);
                self.refuse(fault);
            }
        }
        self.set_point
    }

    /// Share of the brakes in force, 0 to 1.
    pub(super) fn braking(&self) -> f64 {
        self.braking
    }

    /// Why the brakes are closed, if they are.
    pub(super) fn fault(&self) -> PlantFault {
        self.fault
    }

    /// Sequence number and stamp of the command in force; zero while braking on its own.
    pub(super) fn answered(&self) -> (u64, Stamp) {
        self.answered
    }

    fn refuse(&mut self, fault: PlantFault) {
        self.fault = fault;
        self.answered = (0, Stamp(0));
    }

    fn judge(&self, now: Stamp, command: &JointCommand, measured: &[f64; JOINTS_MAX]) -> Result<(), Refusal> {
        let header = &command.header;
        let refused = Err(Refusal::Fault(PlantFault::CommandRefused));
        if !header.heard() {
            return Err(Refusal::Fault(PlantFault::NeverCommanded));
        }
        if header.config_hash != self.config_hash || header.epoch < self.epoch {
            return refused;
        }
        if now > command.valid_until {
            return Err(Refusal::Fault(PlantFault::CommandExpired));
        }
        if command.brake != 0 {
            return Err(Refusal::BrakeAsked);
        }
        if command.joint_count as usize != self.joint_count {
            return refused;
        }
        for (index, limit) in self.limits.iter().enumerate().take(self.joint_count) {
            let (q, v, a) = (command.position[index], command.velocity[index], command.acceleration[index]);
            let inside = q >= limit.position[0] - POSITION_SLACK && q <= limit.position[1] + POSITION_SLACK;
            let near = self.state != State::Following || (q - measured[index]).abs() <= FOLLOW_MAX;
            // A comparison with NaN is false, so what is not finite is refused here too.
            if !(inside && near && v.abs() <= limit.velocity_max * VELOCITY_SLACK && a.is_finite()) {
                return refused;
            }
        }
        Ok(())
    }

    fn continues(&self, command: &JointCommand, measured: &[f64; JOINTS_MAX]) -> bool {
        self.state == State::Held
            && (0..self.joint_count).all(|index| {
                (command.position[index] - measured[index]).abs() <= RESUME_POSITION_MAX
                    && command.velocity[index].abs() <= RESUME_VELOCITY_MAX
            })
    }

    fn follow(&mut self, now: Stamp, dt: f64, command: &JointCommand) {
        self.fault = PlantFault::None;
        self.answered = (command.header.seq, command.header.stamp);
        let followed = self.state == State::Following;
        let repeated = followed && command.header.seq == self.last_seq;
        self.state = State::Following;
        self.last_seq = command.header.seq;
        if repeated {
            // No news: on along the path, and slower the longer there is none.
            self.coast(dt, overdue(now, command));
            self.coasted = true;
            return;
        }
        let coasted = core::mem::take(&mut self.coasted);
        if !followed {
            self.gap = Gap::default();
        } else if coasted {
            self.gap = Gap::between(&self.set_point, &self.deceleration, dt, command);
        } else {
            self.gap.close(dt);
        }
        self.braking = 0.0;
        self.deceleration = [0.0; JOINTS_MAX];
        for index in 0..self.joint_count {
            self.set_point.position[index] = command.position[index] + self.gap.position(index);
            self.set_point.velocity[index] = command.velocity[index] + self.gap.velocity(index);
        }
    }

    fn brake(&mut self, dt: f64) {
        self.state = if self.coast(dt, 1.0) { State::Held } else { State::Braking };
    }

    /// Lets the set-point go on along its path, slowed by that share of the brakes. Whether it stands.
    fn coast(&mut self, dt: f64, share: f64) -> bool {
        self.braking = share;
        // The joint that needs longest sets the pace; the others share its time to standstill.
        let longest = (0..self.joint_count)
            .map(|index| self.set_point.velocity[index].abs() / self.limits[index].brake)
            .fold(0.0, f64::max);
        if longest <= dt * share {
            self.set_point.velocity = [0.0; JOINTS_MAX];
            self.deceleration = [0.0; JOINTS_MAX];
            return true;
        }
        let keep = 1.0 - dt * share / longest;
        for (index, limit) in self.limits.iter().enumerate().take(self.joint_count) {
            let before = self.set_point.velocity[index];
            self.deceleration[index] = before * (keep - 1.0) / dt;
            self.set_point.velocity[index] = before * keep;
            let ahead = self.set_point.position[index] + before * (1.0 + keep) / 2.0 * dt;
            self.set_point.position[index] = ahead.clamp(limit.position[0], limit.position[1]);
        }
        false
    }
}

/// Share of the brakes for a command that is still valid: 0 until the next one is due, 1 when its validity ends.
fn overdue(now: Stamp, command: &JointCommand) -> f64 {
    let late = command.next_due.age_at(now).as_secs_f64();
    let patience = command.next_due.age_at(command.valid_until).as_secs_f64();
    if late > 0.0 { (late / patience).min(1.0) } else { 0.0 }
}
