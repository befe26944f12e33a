//! A small cell for tests: a UR10 class arm that follows its commands one cycle late, a bench with a
//! box on it, a tool that takes its time, a person who walks where the test says, and a referee who
//! looks at every command.
#![allow(
    dead_code,
    unreachable_pub,
    clippy::disallowed_types,
    clippy::disallowed_macros,
    reason = "each test uses its part; tests may allocate"
)]

use std::f64::consts::{FRAC_PI_2, PI};
use std::time::Duration;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use tandem_clearance::{ArmBody, LinkCapsule, Monitor};
use tandem_controller::{Controller, ControllerInputs, ControllerOutputs, Params};
use tandem_kinematics::{Chain, Joint, JointKind};
use tandem_msg::*;

pub const PERIOD: f64 = 1e-3;
pub const BENCH: u32 = 1;
pub const BOX_WALL: u32 = 10;

/// Joints as the public DH table has them; x points at the person.
pub fn ur10() -> Chain {
    let d = [0.1273, 0.0, 0.0, 0.163_941, 0.1157, 0.0922];
    let a = [0.0, -0.612, -0.5723, 0.0, 0.0, 0.0];
    let alpha = [FRAC_PI_2, 0.0, 0.0, FRAC_PI_2, -FRAC_PI_2, 0.0];
    let velocity = [2.16, 2.16, 3.15, 3.2, 3.2, 3.2];
    let next =
        |i: usize| Translation3::new(a[i], 0.0, d[i]) * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), alpha[i]);
    let mut joints = Vec::new();
    let mut parent_from_joint: Isometry3<f64> =
        Isometry3::from_parts(Translation3::identity(), UnitQuaternion::from_axis_angle(&Vector3::z_axis(), PI));
    for (i, velocity_max) in velocity.into_iter().enumerate() {
        joints.push(Joint {
            kind: JointKind::Revolute,
            parent_from_joint,
            axis: Vector3::z_axis(),
            position_min: -2.0 * PI,
            position_max: 2.0 * PI,
            velocity_max,
            acceleration_max: 8.0,
            jerk_max: 80.0,
            effort_max: 100.0,
        });
        parent_from_joint = next(i);
    }
    Chain::new(&joints, next(5) * Translation3::new(0.0, 0.0, 0.2)).expect("the table is a chain")
}

pub fn body() -> ArmBody {
    let capsule = |link, from, to, radius, tool| LinkCapsule { link, ends: [from, to], radius, tool };
    ArmBody::new(
        &[
            capsule(1, [0.0, 0.0, 0.12], [0.0, 0.0, 0.14], 0.08, false),
            capsule(2, [0.0, 0.0, 0.17], [-0.612, 0.0, 0.17], 0.07, false),
            capsule(3, [0.0, 0.0, 0.04], [-0.5723, 0.0, 0.04], 0.055, false),
            capsule(4, [0.0, 0.0, 0.05], [0.0, 0.0, 0.14], 0.05, false),
            capsule(5, [0.0, 0.0, 0.0], [0.0, 0.0, 0.09], 0.05, false),
            capsule(6, [0.0, 0.0, 0.05], [0.0, 0.0, 0.25], 0.035, true),
        ],
        &[[1, 4], [1, 5], [1, 6], [2, 5], [2, 6], [3, 6]],
    )
    .expect("the capsules make an arm")
}

pub const HOME: [f64; 8] = [0.0, -1.57, 1.57, -1.57, -1.57, 0.0, 0.0, 0.0];

pub fn params() -> Params {
    Params { home: HOME, config_hash: 7, ..Params::default() }
}

fn object(id: u32, centre: [f64; 3], half: [f64; 3]) -> SceneObject {
    SceneObject {
        id,
        shape: Code::of(ShapeKind::Box),
        size: half,
        base_from_object: Pose { position: centre, ..Pose::IDENTITY },
    }
}

/// Bench, an open box in the middle of it, two carriers, a tool rack.
pub fn scene() -> Scene {
    let mut scene = Scene { version: 1, ..Scene::default() };
    let mut add = |object| {
        scene.objects[scene.object_count as usize] = object;
        scene.object_count += 1;
    };
    add(object(BENCH, [0.475, 0.0, -0.03], [0.775, 0.8, 0.025]));
    for (k, (x, y, hx, hy)) in
        [(0.475, 0.0, 0.005, 0.2), (0.765, 0.0, 0.005, 0.2), (0.62, 0.195, 0.15, 0.005), (0.62, -0.195, 0.15, 0.005)]
            .into_iter()
            .enumerate()
    {
        add(object(BOX_WALL + k as u32, [x, y, 0.07], [hx, hy, 0.07]));
    }
    add(object(20, [0.35, -0.55, 0.02], [0.1, 0.1, 0.02]));
    add(object(21, [0.95, 0.50, 0.02], [0.1, 0.1, 0.02]));
    add(object(30, [0.0, 0.70, 0.10], [0.25, 0.03, 0.12]));
    scene
}

/// Puts a box into the scene of a cell, which is another version then.
pub fn put(cell: &mut Cell, id: u32, centre: [f64; 3], half: [f64; 3]) {
    cell.scene.objects[cell.scene.object_count as usize] = object(id, centre, half);
    cell.scene.object_count += 1;
    cell.scene.version += 1;
    cell.referee.set_scene(cell.scene.objects()).expect("the scene is sound");
}

/// Tool pointing down at a place, turned about the vertical.
pub fn down(x: f64, y: f64, z: f64, turn: f64) -> Pose {
    let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn)
        * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), PI);
    let c = rotation.coords;
    Pose { position: [x, y, z], rotation: [c.x, c.y, c.z, c.w] }
}

pub fn task(id: u32, goal: Pose) -> MotionTask {
    MotionTask {
        id,
        subtask: Code::of(Subtask::Transfer),
        run: Code::of(RunMode::Run),
        base_from_tcp: goal,
        approach: 0.10,
        speed: 1.0,
        scene_version: 1,
        ..MotionTask::default()
    }
}

/// What the test does to the messages before the controller reads them.
pub type Tamper = fn(&mut JointState, &mut HumanState, &mut Scene, &mut MotionTask, u64);

/// The referee's findings.
#[derive(Clone, Copy, Debug, Default)]
pub struct Findings {
    pub velocity_excess: f64,
    pub acceleration_excess: f64,
    pub jerk_excess: f64,
    /// Smallest clearance of a commanded position to what the arm may not touch, while moving.
    pub clearance_min: f64,
    /// Smallest distance to the person while the arm moves.
    pub separation_moving_min: f64,
    /// Largest jump of a commanded position beside what the velocities explain.
    pub jump: f64,
}

pub struct Cell {
    pub now: Stamp,
    pub chain: Chain,
    pub controller: Controller,
    pub outputs: ControllerOutputs,
    pub arm: JointState,
    pub human: HumanState,
    pub scene: Scene,
    pub task: MotionTask,
    pub findings: Findings,
    referee: Monitor,
    effector_busy: u64,
    pub effector_fails: bool,
    last: [[f64; 8]; 3],
    commands: u64,
    /// Publish flags: a frozen role stops stamping.
    pub arm_alive: bool,
    pub human_alive: bool,
    pub supervisor_alive: bool,
    pub cycle: u64,
    pub tamper: Option<Tamper>,
    /// Offset the arm keeps from its command, rad: a brake that drags.
    pub drag: f64,
    /// Periods by which the tracked person is behind the real one.
    pub late: u64,
    /// The controller is shown nobody.
    pub blind: bool,
    past: Vec<HumanState>,
}

impl Cell {
    pub fn new() -> Self {
        Self::with(params())
    }

    pub fn with(params: Params) -> Self {
        let chain = ur10();
        let header = |epoch| Header { seq: 0, stamp: Stamp(0), epoch, config_hash: 7 };
        let mut referee = Monitor::new(body());
        referee.set_scene(scene().objects()).expect("the scene is sound");
        Self {
            now: Stamp(1_000_000_000),
            chain,
            controller: Controller::new(chain, body(), params).expect("the parameters pass"),
            outputs: ControllerOutputs::default(),
            arm: JointState {
                header: header(1),
                joint_count: 6,
                fault: Code::of(PlantFault::NeverCommanded),
                position: HOME,
                ..JointState::default()
            },
            human: HumanState { header: header(1), ..HumanState::default() },
            scene: Scene { header: header(1), ..scene() },
            task: MotionTask { header: header(1), ..MotionTask::default() },
            findings: Findings {
                velocity_excess: -1.0,
                acceleration_excess: -1.0,
                jerk_excess: -1.0,
                clearance_min: f64::INFINITY,
                separation_moving_min: f64::INFINITY,
                ..Findings::default()
            },
            referee,
            effector_busy: 0,
            effector_fails: false,
            last: [[0.0; 8]; 3],
            commands: 0,
            arm_alive: true,
            human_alive: true,
            supervisor_alive: true,
            cycle: 0,
            tamper: None,
            drag: 0.0,
            late: 0,
            blind: false,
            past: Vec::with_capacity(20_000),
        }
    }

    /// A torso of 0.25 m radius and a hand, at a place on the floor, walking.
    pub fn person_at(&mut self, x: f64, y: f64, velocity: [f64; 3]) {
        self.human.capsule_count = 2;
        self.human.position_sigma = 0.005;
        self.human.body[0] = Code::of(BodyPart::Torso);
        self.human.capsules[0] = Capsule { ends: [[x, y, -0.9], [x, y, 0.7]], radius: 0.25, velocity };
        self.human.body[1] = Code::of(BodyPart::Hand);
        self.human.capsules[1] = Capsule { ends: [[x, y + 0.2, 0.2], [x, y + 0.2, 0.3]], radius: 0.06, velocity };
    }

    pub fn give(&mut self, task: MotionTask) {
        let header = self.task.header;
        let reset_count = self.task.reset_count;
        self.task = MotionTask { header, reset_count, ..task };
    }

    pub fn status(&self) -> &MotionStatus {
        &self.outputs.status
    }

    pub fn phase(&self) -> MotionPhase {
        self.status().phase.get().expect("a phase")
    }

    pub fn stop(&self) -> StopState {
        self.status().stop.get().expect("a stop state")
    }

    pub fn cause(&self) -> StopCause {
        self.status().cause.get().expect("a cause")
    }

    pub fn moving(&self) -> bool {
        self.outputs.command.velocity.iter().any(|v| *v != 0.0)
    }

    fn stamp(header: &mut Header, now: Stamp) {
        header.seq += 1;
        header.stamp = now;
    }

    /// A millisecond passes and everyone publishes.
    pub fn prepare(&mut self) {
        self.cycle += 1;
        self.now = self.now.after(Duration::from_millis(1));
        if self.arm_alive {
            Self::stamp(&mut self.arm.header, self.now);
        }
        if self.human_alive {
            for capsule in self.human.capsules.iter_mut().take(self.human.capsule_count as usize) {
                // A tracker is never still.
                let shiver = if self.cycle.is_multiple_of(2) { 1e-9 } else { -1e-9 };
                for end in &mut capsule.ends {
                    end[2] += shiver;
                    for (x, v) in end.iter_mut().zip(&capsule.velocity) {
                        *x += v * PERIOD;
                    }
                }
            }
            Self::stamp(&mut self.human.header, self.now);
        }
        if self.supervisor_alive && self.cycle % 10 == 1 {
            Self::stamp(&mut self.task.header, self.now);
            Self::stamp(&mut self.scene.header, self.now);
        }
    }

    /// One millisecond: everyone publishes, the controller runs, the arm follows, the referee looks.
    pub fn step(&mut self) {
        self.prepare();
        let (mut arm, mut human, mut scene, mut task) = (self.arm, self.human, self.scene, self.task);
        if self.late > 0 {
            self.past.push(human);
            human = self.past[self.past.len().saturating_sub(1 + self.late as usize)];
        }
        if self.blind {
            human.capsule_count = 0;
        }
        if let Some(tamper) = self.tamper {
            tamper(&mut arm, &mut human, &mut scene, &mut task, self.cycle);
        }
        let inputs = ControllerInputs { arm: &arm, human: &human, scene: &scene, task: &task };
        self.controller.cycle(self.now, &inputs, &mut self.outputs);
        self.judge();
        self.follow();
    }

    /// The arm and its tool do as they are told.
    pub fn follow(&mut self) {
        self.commands += 1;
        let command = &self.outputs.command;
        if command.brake == 1 {
            self.arm.velocity = [0.0; 8];
            self.arm.command_seq = 0;
        } else {
            for joint in 0..6 {
                self.arm.position[joint] = command.position[joint] + self.drag;
                self.arm.velocity[joint] = command.velocity[joint];
            }
            self.arm.command_seq = self.commands;
            self.arm.command_stamp = self.now;
        }
        if self.arm.fault.is(PlantFault::NeverCommanded) {
            self.arm.fault = Code::of(PlantFault::None);
        }
        let effector = command.effector;
        let state = &mut self.arm.effector;
        if effector.id != state.command_id {
            state.command_id = effector.id;
            state.phase = Code::of(EffectorPhase::Busy);
            self.effector_busy = 50;
        } else if self.effector_busy > 0 {
            self.effector_busy -= 1;
            if self.effector_busy == 0 {
                let phase = if self.effector_fails { EffectorPhase::Failed } else { EffectorPhase::Done };
                state.phase = Code::of(phase);
                match effector.action.get() {
                    Some(EffectorAction::Grasp) => state.holding = u32::from(!self.effector_fails),
                    Some(EffectorAction::Release | EffectorAction::Seat) => state.holding = 0,
                    _ => {}
                }
            }
        }
    }

    fn judge(&mut self) {
        let command = self.outputs.command;
        if command.brake == 1 || self.cycle < 10 {
            self.last = [command.position; 3];
            return;
        }
        let [p3, p2, p1] = self.last;
        for (joint, limits) in self.chain.joints().iter().enumerate() {
            let p = command.position[joint];
            let velocity = (p - p1[joint]) / PERIOD;
            let acceleration = (p - 2.0 * p1[joint] + p2[joint]) / (PERIOD * PERIOD);
            let jerk = (p - 3.0 * p1[joint] + 3.0 * p2[joint] - p3[joint]) / (PERIOD * PERIOD * PERIOD);
            let over = |value: f64, limit: f64| value.abs() / limit - 1.0;
            let found = &mut self.findings;
            found.velocity_excess = found.velocity_excess.max(over(velocity, limits.velocity_max));
            found.acceleration_excess = found.acceleration_excess.max(over(acceleration, limits.acceleration_max));
            found.jerk_excess = found.jerk_excess.max(over(jerk, limits.jerk_max));
            found.jump = found.jump.max((p - p1[joint] - command.velocity[joint] * PERIOD).abs());
        }
        self.last = [p2, p1, command.position];
        if self.moving() {
            let poses = self.chain.forward(&command.position);
            let people = &self.human.capsules[..(self.human.capsule_count as usize).min(16)];
            self.referee.set_human(people);
            let found = &mut self.findings;
            found.separation_moving_min = found.separation_moving_min.min(self.referee.separation(&poses).distance);
            found.clearance_min = found.clearance_min.min(self.referee.clearance(&poses).distance);
        }
    }

    /// Steps until the condition holds; panics after `limit` cycles with what was seen.
    pub fn until(&mut self, what: &str, limit: u64, condition: impl Fn(&Self) -> bool) -> u64 {
        for k in 0..limit {
            self.step();
            if condition(self) {
                return k + 1;
            }
        }
        panic!("not in {limit} cycles: {what}; status {:#?}", self.status());
    }

    pub fn run(&mut self, cycles: u64) {
        for _ in 0..cycles {
            self.step();
        }
    }

    /// Gives the task and runs until it is over.
    pub fn perform(&mut self, task: MotionTask) -> MotionPhase {
        let id = task.id;
        self.give(task);
        self.until("the task is over", 30_000, |cell| {
            cell.status().task_id == id && matches!(cell.phase(), MotionPhase::Done | MotionPhase::Failed)
        });
        self.phase()
    }

    /// Every joint kept its limits in every command so far.
    pub fn assert_limits(&self) {
        let found = &self.findings;
        assert!(found.velocity_excess < 0.01, "{found:?}");
        assert!(found.acceleration_excess < 0.02, "{found:?}");
        assert!(found.jerk_excess < 0.05, "{found:?}");
    }

    /// Where the TCP is commanded to be.
    pub fn tcp(&self) -> Isometry3<f64> {
        self.chain.forward(&self.outputs.command.position).base_from_tcp
    }
}
