//! A bare cell: the controller, an arm that does what it is told, whatever scene and tasks are given.

use std::time::Duration;

use nalgebra::{Isometry3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use tandem_clearance::{ArmBody, Monitor};
use tandem_controller::{Controller, ControllerInputs, ControllerOutputs, Params};
use tandem_kinematics::Chain;
use tandem_msg::{
    Code, Header, HumanState, JOINTS_MAX, JointState, MotionPhase, MotionStatus, MotionTask, PlantFault, Pose, RunMode,
    Scene, SceneObject, ShapeKind, Stamp, StopCause, StopState, Subtask,
};

/// The arm, its controller and the messages between them.
pub(super) struct World {
    pub(super) now: Stamp,
    pub(super) chain: Chain,
    period: Duration,
    controller: Controller,
    outputs: ControllerOutputs,
    arm: JointState,
    scene: Scene,
    pub(super) task: MotionTask,
    commands: u64,
}

impl World {
    /// An arm at rest at `start` in a scene.
    pub(super) fn new(chain: Chain, body: ArmBody, params: Params, start: [f64; JOINTS_MAX], scene: Scene) -> Self {
        let header = Header { seq: 1, stamp: Stamp(0), epoch: 1, config_hash: params.config_hash };
        let controller = Controller::new(chain, body, params).unwrap_or_else(|error| panic!("{error}"));
        Self {
            now: Stamp(1_000_000_000),
            period: params.period,
            controller,
            outputs: ControllerOutputs::default(),
            arm: JointState {
                header,
                joint_count: chain.joint_count() as u32,
                fault: Code::of(PlantFault::NeverCommanded),
                position: start,
                ..JointState::default()
            },
            scene: Scene { header, version: 1, ..scene },
            task: MotionTask { header, ..MotionTask::default() },
            chain,
            commands: 0,
        }
    }

    /// Gives the next task.
    pub(super) fn give(&mut self, task: MotionTask) {
        let (header, id, reset_count) = (self.task.header, self.task.id + 1, self.task.reset_count);
        self.task = MotionTask { header, id, reset_count, ..task };
    }

    /// One period: the controller hears of the person what it is told, the arm does as commanded.
    pub(super) fn step(&mut self, human: &HumanState) {
        self.now = self.now.after(self.period);
        for header in [&mut self.arm.header, &mut self.scene.header, &mut self.task.header] {
            header.seq += 1;
            header.stamp = self.now;
        }
        let inputs = ControllerInputs { arm: &self.arm, human, scene: &self.scene, task: &self.task };
        self.controller.cycle(self.now, &inputs, &mut self.outputs);
        self.commands += 1;
        let command = &self.outputs.command;
        if command.brake == 1 {
            self.arm.velocity = [0.0; JOINTS_MAX];
            self.arm.command_seq = 0;
        } else {
            (self.arm.position, self.arm.velocity) = (command.position, command.velocity);
            self.arm.command_seq = self.commands;
            self.arm.command_stamp = self.now;
        }
        if self.arm.fault.is(PlantFault::NeverCommanded) {
            self.arm.fault = Code::of(PlantFault::None);
        }
    }

    pub(super) fn status(&self) -> &MotionStatus {
        &self.outputs.status
    }

    pub(super) fn position(&self) -> &[f64; JOINTS_MAX] {
        &self.arm.position
    }

    pub(super) fn velocity(&self) -> &[f64; JOINTS_MAX] {
        &self.arm.velocity
    }

    pub(super) fn moving(&self) -> bool {
        self.arm.velocity.iter().any(|velocity| *velocity != 0.0)
    }

    /// Whether the task given last is over.
    pub(super) fn idle(&self) -> bool {
        let over = matches!(self.status().phase.get(), Some(MotionPhase::Done | MotionPhase::Failed));
        self.task.id == 0 || over && self.status().task_id == self.task.id
    }

    /// Whether the arm is kept from moving by a person, by a stop or by waiting; it may still be braking.
    pub(super) fn waits(&self) -> bool {
        let status = self.status();
        let under_way = matches!(
            status.phase.get(),
            Some(MotionPhase::Depart | MotionPhase::Transfer | MotionPhase::Approach | MotionPhase::Retract)
        );
        let stopped = !self.running() && status.cause.is(StopCause::Separation);
        (stopped || under_way && status.speed == 0.0) && status.separation.is_finite()
    }

    /// Whether it stands for one.
    pub(super) fn kept(&self) -> bool {
        !self.moving() && self.waits()
    }

    /// Whether the arm may move.
    pub(super) fn running(&self) -> bool {
        self.status().stop.is(StopState::Running)
    }
}

/// Evenly spread over a range.
pub(super) fn between(random: &mut ChaCha8Rng, from: f64, to: f64) -> f64 {
    from + (to - from) * random.random::<f64>()
}

/// A joint position about the resting one, free of scene and self.
pub(super) fn free_position(
    random: &mut ChaCha8Rng,
    chain: &Chain,
    monitor: &Monitor,
    home: &[f64; JOINTS_MAX],
) -> [f64; JOINTS_MAX] {
    /// Where nothing is found the resting position has to do.
    const TRIES: u32 = 50;
    for _ in 0..TRIES {
        let mut position = *home;
        for (index, (position, joint)) in position.iter_mut().zip(chain.joints()).enumerate() {
            let spread = if index == 0 { 2.5 } else { 0.9 };
            let offset = between(random, -spread, spread);
            *position = (*position + offset).clamp(joint.position_min, joint.position_max);
        }
        if monitor.is_clear(&chain.forward(&position), 0.04) {
            return position;
        }
    }
    *home
}

/// A transfer to where the TCP is at a joint position.
pub(super) fn transfer(random: &mut ChaCha8Rng, chain: &Chain, to: &[f64; JOINTS_MAX]) -> MotionTask {
    MotionTask {
        subtask: Code::of(Subtask::Transfer),
        run: Code::of(RunMode::Run),
        base_from_tcp: pose(&chain.forward(to).base_from_tcp),
        speed: between(random, 0.3, 1.0),
        scene_version: 1,
        ..MotionTask::default()
    }
}

/// The message's form of a pose.
pub(super) fn pose(isometry: &Isometry3<f64>) -> Pose {
    let rotation = isometry.rotation.coords;
    Pose { position: isometry.translation.vector.into(), rotation: [rotation.x, rotation.y, rotation.z, rotation.w] }
}

/// A bench and up to `objects_max` solids of every kind around the arm, none at the arm as it rests.
pub(super) fn scene(
    random: &mut ChaCha8Rng,
    chain: &Chain,
    body: &ArmBody,
    home: &[f64; JOINTS_MAX],
    objects_max: u32,
) -> Scene {
    let mut scene = Scene::default();
    let mut monitor = Monitor::new(*body);
    let poses = chain.forward(home);
    let mut add = |scene: &mut Scene, object: SceneObject| {
        let index = scene.object_count as usize;
        scene.objects[index] = object;
        scene.object_count += 1;
        if monitor.set_scene(scene.objects()).is_err() || !monitor.is_clear(&poses, 0.05) {
            scene.object_count -= 1;
        }
    };
    let bench = Pose { position: [0.475, 0.0, -0.06], ..Pose::IDENTITY };
    add(
        &mut scene,
        SceneObject { id: 1, shape: Code::of(ShapeKind::Box), size: [0.8, 0.8, 0.025], base_from_object: bench },
    );
    let count = (random.random::<f64>() * f64::from(objects_max + 1)) as u32;
    for id in 2..2 + count {
        let shapes = [ShapeKind::Box, ShapeKind::Cylinder, ShapeKind::Sphere, ShapeKind::Capsule];
        let shape = shapes[(random.random::<f64>() * 4.0) as usize % 4];
        let axis = Vector3::new(between(random, -1.0, 1.0), between(random, -1.0, 1.0), between(random, -1.0, 1.0));
        let turn = nalgebra::UnitQuaternion::from_scaled_axis(axis * 3.0);
        let (angle, radius) = (between(random, -3.2, 3.2), between(random, 0.35, 1.3));
        let place = nalgebra::Translation3::new(radius * angle.cos(), radius * angle.sin(), between(random, 0.0, 1.0));
        let size = [0; 3].map(|_| between(random, 0.02, 0.12));
        let base_from_object = pose(&Isometry3::from_parts(place, turn));
        add(&mut scene, SceneObject { id, shape: Code::of(shape), size, base_from_object });
    }
    scene
}
