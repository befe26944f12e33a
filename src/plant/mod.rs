//! The plant: stands for the hardware of a cell, one pure state machine at 1 kHz.
//!
//! Arm, tools, parts, feeder, camera and person, all simulated, all from one seed.
//! What it publishes is what real hardware would: measured joints, tracked body,
//! tool and feeder states, scans. The truth (which part lies where, what its
//! feature is) stays inside, and the rest of the cell has to find it out.
//!
//! ```text
//! command ─ Drive (watchdog) ─ Arm (rapier3d) ─┬─ Effector ─┐
//! request ─ Feeder ────────────────────────────┤            ├─ Parts ─ Referee
//! prompt ── Person ────────────────────────────┴────────────┘
//! ```
//!
//! **Invariant:** the same seed and the same inputs give the same outputs, bit for bit.
//! **Invariant:** without a valid command the arm brakes and holds ([`drive`]).

use core::time::Duration;

use nalgebra::Isometry3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rapier3d_f64::math::Vector;
use rapier3d_f64::prelude::{ColliderBuilder, PhysicsWorld};
use tandem_config::Cell;
use tandem_msg::{
    CellRequest, CellState, EffectorCommand, HumanState, JointCommand, JointState, OperatorEvent, PlantFault,
    PointCloud, Prompt, Stamp,
};

mod arm;
pub mod camera;
mod drive;
mod dynamics;
mod effector;
mod eye;
mod frames;
mod gap;
mod human;
mod model;
mod parts;
mod referee;
mod rest;
pub mod solid;
mod station;

#[cfg(test)]
mod tests;

use arm::{Arm, GRAVITY};
use drive::Drive;
use effector::{Effector, Reach};
pub use eye::Eye;
use human::{Person, Sight, Tracker};
use model::PlantModel;
use parts::Parts;
use referee::{Look, Referee};
use rest::Rest;
use station::Feeder;

/// What the plant hears in a cycle: the latest of each.
pub struct PlantInputs<'a> {
    /// From the controller.
    pub command: &'a JointCommand,
    /// From the supervisor, for the feeder.
    pub request: &'a CellRequest,
    /// From the supervisor, for the person.
    pub prompt: &'a Prompt,
}

/// What the plant says in a cycle. Headers are the shell's to fill in.
#[derive(Clone, Debug, Default)]
pub struct PlantOutputs {
    /// The arm, measured.
    pub arm: JointState,
    /// The person, tracked.
    pub human: HumanState,
    /// Feeder and referee.
    pub cell: CellState,
    /// The person's last answer.
    pub operator: OperatorEvent,
    /// The camera has a picture: call [`Plant::scan`] once, now.
    pub scan_due: bool,
}

/// What the camera has to know for one picture. The truth; for [`Eye::scan`] only.
#[derive(Clone, Copy, Debug)]
pub struct Shot {
    /// The presented part and where it truly lies.
    part: Option<(usize, Isometry3<f64>)>,
    /// The request that presented it.
    request: u32,
}

/// The simulated hardware of one cell.
pub struct Plant {
    world: PhysicsWorld,
    arm: Arm,
    drive: Drive,
    effector: Effector,
    parts: Parts,
    feeder: Feeder,
    person: Person,
    tracker: Tracker,
    /// In the plant until it is taken out.
    eye: Option<Eye>,
    referee: Referee,
    noise: ChaCha8Rng,
    luck: ChaCha8Rng,
    joint_noise: f64,
    period: Duration,
    loaded: Option<usize>,
    rest: Rest,
    base_from_tcp: Isometry3<f64>,
}

/// Random numbers of one organ of the plant; organs do not disturb each other's.
fn stream(seed: u64, organ: u64) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(organ);
    random
}

/// Why a plant cannot be built.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PlantError {
    /// Joints and masses do not match.
    #[error("arm {robot}: {joints} joints need masses of {} links, found {links}; correct the robot's file", joints + 1)]
    LinkCount {
        /// Name of the arm.
        robot: String,
        /// Moving joints.
        joints: usize,
        /// Links with a mass, the base included.
        links: usize,
    },
}

impl Plant {
    /// The hardware of a cell, standing still: arm at rest, tools in the rack, parts in the feeder.
    ///
    /// # Errors
    /// An arm whose joints and masses do not match.
    pub fn new(cell: &Cell, seed: u64) -> Result<Self, PlantError> {
        Ok(Self::of(PlantModel::of(cell)?, Eye::new(cell, stream(seed, 5)), seed))
    }

    fn of(model: PlantModel, eye: Eye, seed: u64) -> Self {
        let mut world = PhysicsWorld::new();
        world.gravity = Vector::new(0.0, 0.0, -GRAVITY);
        world.integration_parameters.dt = model.period.as_secs_f64();
        // One iteration tracks within 2 mrad and costs a third of the default four.
        world.integration_parameters.num_solver_iterations = 1;
        for object in &model.obstacles {
            let [x, y, z] = object.half_extents;
            let pose = frames::body_pose(&object.base_from_object);
            world.insert_collider(ColliderBuilder::cuboid(x, y, z).position(pose).friction(0.6), None);
        }
        let parts = Parts::new(model.parts, &mut world);
        let drive = Drive::new(&model.arm.joints, &model.arm.home, model.config_hash);
        let arm = Arm::new(model.arm, &mut world);
        Self {
            referee: Referee::new(&model.links, &model.obstacles, parts.count()),
            base_from_tcp: arm.base_from_tcp(),
            effector: Effector::new(model.effector),
            feeder: Feeder::new(model.feeder),
            person: Person::new(model.person, stream(seed, 1)),
            tracker: Tracker::new(model.tracking_sigma, stream(seed, 2)),
            eye: Some(eye),
            noise: stream(seed, 3),
            luck: stream(seed, 4),
            joint_noise: model.joint_noise,
            period: model.period,
            loaded: None,
            rest: Rest::default(),
            world,
            arm,
            drive,
            parts,
        }
    }

    /// Lets one period pass and says what the sensors see at its end, `now`.
    pub fn cycle(&mut self, now: Stamp, inputs: &PlantInputs<'_>, outputs: &mut PlantOutputs) {
        let dt = self.period.as_secs_f64();
        self.move_arm(now, dt, inputs.command, outputs);

        let before = self.base_from_tcp;
        self.base_from_tcp = self.arm.base_from_tcp();
        let tcp_velocity = (self.base_from_tcp.translation.vector - before.translation.vector) / dt;
        self.parts.follow(&self.world, &self.base_from_tcp, &self.person.carries_at());
        self.feeder.cycle(now, inputs.request, &mut self.parts, &mut self.world, &mut self.luck);
        let sight = Sight {
            tool_speed: tcp_velocity.norm(),
            presented: self.feeder.presented(),
            presentations: self.feeder.presentations(),
        };
        self.person.cycle(now, dt, inputs.prompt, &sight, &mut self.parts, &mut self.world);
        let reach = Reach { base_from_tcp: &self.base_from_tcp, tcp_velocity, hand_on: self.person.hand_on() };
        // A tool obeys nobody whom the drives do not obey; what it has begun, it finishes.
        let heeded = self.drive.fault() == PlantFault::None;
        let command = if heeded { inputs.command.effector } else { EffectorCommand::default() };
        self.effector.cycle(now, &command, &reach, &mut self.parts, &mut self.world);
        self.load_arm();
        self.referee.cycle(
            now,
            &Look {
                base_from_link: self.arm.base_from_link(),
                base_from_tcp: &self.base_from_tcp,
                joint_speed: self.arm.measured().velocity.iter().fold(0.0, |fastest, v| f64::max(fastest, v.abs())),
                person: self.person.body().0,
                hand_on: self.person.hand_on(),
            },
            &self.parts,
        );
        self.tell(now, outputs);
    }

    /// The picture that was due: the presented part as the camera sees it. Leaves the header alone.
    pub fn scan(&mut self, cloud: &mut PointCloud) {
        let shot = self.shot();
        if let Some(eye) = &mut self.eye {
            eye.scan(&shot, cloud);
        }
    }

    /// What the camera has to know for the picture that is due.
    pub fn shot(&self) -> Shot {
        let part = self.feeder.presented().map(|part| (part, self.parts.base_from_part(part)));
        Shot { part, request: self.feeder.scan_request() }
    }

    /// Takes the camera out of the plant. A picture takes it several cycles of the
    /// plant; on a thread of its own it holds none of them up, as a real one would not.
    /// From then on [`Plant::scan`] does nothing.
    pub fn take_camera(&mut self) -> Option<Eye> {
        self.eye.take()
    }

    fn move_arm(&mut self, now: Stamp, dt: f64, command: &JointCommand, outputs: &mut PlantOutputs) {
        let set_point = self.drive.cycle(now, dt, command, &self.arm.measured().position);
        let disturbed = self.arm.drive(&mut self.world, &set_point.position, &set_point.velocity);
        if self.rest.asleep(disturbed || self.parts.falling(&self.world), self.arm.measured()) {
            self.arm.stand();
        } else {
            self.world.step();
            self.arm.read(&self.world, dt);
        }

        let measured = self.arm.measured();
        let count = self.arm.joint_count();
        let (command_seq, command_stamp) = self.drive.answered();
        let state = &mut outputs.arm;
        state.joint_count = count as u32;
        state.fault = self.drive.fault().into();
        state.position = measured.position;
        state.velocity = measured.velocity;
        state.effort = measured.effort;
        state.command_seq = command_seq;
        state.command_stamp = command_stamp;
        state.braking = self.drive.braking();
        for position in &mut state.position[..count] {
            let drawn: f64 = StandardNormal.sample(&mut self.noise);
            *position += drawn * self.joint_noise;
        }
    }

    /// Tells the arm what it carries when that has changed.
    fn load_arm(&mut self) {
        if self.parts.held() != self.loaded {
            self.loaded = self.parts.held();
            let load = self.parts.load(self.arm.flange_from_tcp());
            self.arm.set_load(&mut self.world, load);
            self.rest.wake();
        }
    }

    fn tell(&mut self, now: Stamp, outputs: &mut PlantOutputs) {
        outputs.arm.effector = self.effector.state(&self.parts);

        let (body, velocity, stand) = self.person.body();
        self.tracker.track(now, body, velocity, stand, &mut outputs.human);

        let (request, phase, base_from_station) = self.feeder.answer();
        let cell = &mut outputs.cell;
        cell.request = request;
        cell.phase = phase.into();
        cell.base_from_station = base_from_station;
        cell.contacts = self.referee.contacts();
        cell.parts_seated = self.parts.seated();

        outputs.operator = OperatorEvent { header: outputs.operator.header, ..*self.person.event() };
        outputs.scan_due = self.feeder.scan_due(now, self.period);
    }
}
