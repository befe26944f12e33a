//! The plant as a whole, from its inputs to its outputs; the truth is peeked at to judge it.

use std::path::Path;
use std::time::Instant;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use tandem_config::{Cell, pose_of};
use tandem_msg::{
    Answer, EffectorAction, EffectorPhase, Header, JOINTS_MAX, PlantFault, PromptKind, RequestKind, RequestPhase, Tool,
};

use super::parts::Place;
use super::*;

mod assembly;
mod handling;
mod person;
mod watchdog;
mod whole;

/// A plant with somebody to press its buttons: a controller that follows a path in joint space.
struct Rig {
    cell: Cell,
    plant: Plant,
    out: PlantOutputs,
    command: JointCommand,
    request: CellRequest,
    prompt: Prompt,
    now: Stamp,
    /// Incarnation of the controller.
    epoch: u64,
    scans: u32,
}

impl Rig {
    fn new(seed: u64) -> Self {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/cells/s471.toml");
        let cell = Cell::load(&file, None).expect("the shipped cell loads");
        let plant = Plant::new(&cell, seed).expect("the shipped cell has a plant");
        let mut rig = Self {
            plant,
            out: PlantOutputs::default(),
            command: JointCommand::default(),
            request: CellRequest::default(),
            prompt: Prompt::default(),
            now: Stamp(0),
            epoch: 1,
            scans: 0,
            cell,
        };
        rig.silent_cycle();
        rig.command.joint_count = rig.out.arm.joint_count;
        rig.command.position = rig.out.arm.position;
        rig
    }

    /// One cycle in which the controller says nothing new.
    fn silent_cycle(&mut self) {
        self.now = self.now.after(self.plant.period);
        let inputs = PlantInputs { command: &self.command, request: &self.request, prompt: &self.prompt };
        self.plant.cycle(self.now, &inputs, &mut self.out);
        self.scans += u32::from(self.out.scan_due);
    }

    /// One cycle after the controller has said what is in `command`.
    fn cycle(&mut self) {
        let seq = self.command.header.seq + 1;
        self.command.header = Header { seq, stamp: self.now, epoch: self.epoch, config_hash: self.cell.hash };
        self.command.next_due = self.now.after(2 * self.plant.period);
        self.command.valid_until = self.now.after(Duration::from_millis(5));
        self.silent_cycle();
    }

    fn cycles(&mut self, count: u32) {
        for _ in 0..count {
            self.cycle();
        }
    }

    /// Follows a quintic to `goal` over `seconds`; returns the largest lag of the arm, rad.
    fn move_to(&mut self, goal: &[f64; JOINTS_MAX], seconds: f64) -> f64 {
        let start = self.command.position;
        let steps = (seconds * 1e3) as u32;
        let mut lag: f64 = 0.0;
        for step in 1..=steps {
            let s = f64::from(step) / f64::from(steps);
            let (p, v) = (s * s * s * (10.0 - 15.0 * s + 6.0 * s * s), 30.0 * s * s * (1.0 - s) * (1.0 - s) / seconds);
            for joint in 0..JOINTS_MAX {
                let way = goal[joint] - start[joint];
                self.command.position[joint] = start[joint] + p * way;
                self.command.velocity[joint] = v * way;
            }
            self.cycle();
            for joint in 0..JOINTS_MAX {
                lag = lag.max((self.plant.arm.measured().position[joint] - self.command.position[joint]).abs());
            }
        }
        self.command.velocity = [0.0; JOINTS_MAX];
        lag
    }

    /// Moves the tool centre point to a pose, in joint space, elbow up as at home, and stands there.
    fn tcp_to(&mut self, pose: &Isometry3<f64>) {
        let goal =
            self.cell.robot.chain.inverse(pose, &self.command.position).unwrap_or_else(|e| panic!("{e:?}: {pose}"));
        let farthest =
            (0..JOINTS_MAX).map(|joint| (goal[joint] - self.command.position[joint]).abs()).fold(0.0, f64::max);
        self.move_to(&goal, (1.875 * farthest / 1.6).max(0.5));
        self.cycles(200);
        assert!(self.out.arm.fault.is(PlantFault::None), "the drives follow");
    }

    /// To a place of the rack from straight above, by way of straight above where it is.
    fn tcp_to_rack(&mut self, tool: Tool) {
        let slot = self.cell.layout.rack_slot(tool).expect("four tools").base_from_tcp;
        let up = Translation3::new(0.0, 0.0, 0.25);
        self.tcp_to(&(up * self.plant.base_from_tcp));
        self.tcp_to(&(up * slot));
        self.tcp_to(&slot);
    }

    fn act(&mut self, action: EffectorAction, tool: Tool) -> Option<EffectorPhase> {
        self.command.effector.id += 1;
        self.command.effector.action = action.into();
        self.command.effector.tool = tool.into();
        self.cycle();
        for _ in 0..4_000 {
            if !self.out.arm.effector.phase.is(EffectorPhase::Busy) {
                break;
            }
            self.cycle();
        }
        assert_eq!(self.out.arm.effector.command_id, self.command.effector.id);
        self.out.arm.effector.phase.get()
    }

    fn ask(&mut self, kind: RequestKind, part: usize) -> Option<RequestPhase> {
        self.request.header.seq += 1;
        self.request.id += 1;
        self.request.kind = kind.into();
        self.request.part_index = part as u32;
        self.cycle();
        for _ in 0..4_000 {
            if !self.out.cell.phase.is(RequestPhase::Busy) {
                break;
            }
            self.cycle();
        }
        assert_eq!(self.out.cell.request, self.request.id);
        self.out.cell.phase.get()
    }

    fn tell(&mut self, kind: PromptKind, part: usize, at: &Isometry3<f64>) {
        self.prompt.header.seq += 1;
        self.prompt.id += 1;
        self.prompt.kind = kind.into();
        self.prompt.part_index = part as u32;
        self.prompt.base_from_part = pose_of(at);
    }

    /// Runs until the person gives this answer; the answers on the way.
    fn until(&mut self, answer: Answer, seconds: u32) -> Vec<Answer> {
        let mut answers = Vec::new();
        for _ in 0..seconds * 1_000 {
            self.cycle();
            if self.out.operator.prompt_id == self.prompt.id {
                let said = self.out.operator.answer.get().unwrap_or(Answer::None);
                if answers.last() != Some(&said) {
                    answers.push(said);
                }
                if said == answer {
                    break;
                }
            }
        }
        answers
    }

    fn part(&self, name: &str) -> usize {
        self.cell.product.part(name).expect("a part of the shipped product")
    }

    /// Puts the parts named, and everything they stand on, into the product: as the boxes before did.
    fn seat_all_before(&mut self, part: usize) {
        for before in 0..part {
            self.plant.parts.seat(&mut self.plant.world, before);
        }
    }

    fn true_grasp(&self, part: usize) -> Isometry3<f64> {
        let model = self.plant.parts.model(part).expect("known");
        self.plant.parts.base_from_part(part) * model.part_from_grasp
    }

    /// The part into the tool, whatever the way there.
    fn take(&mut self, name: &str, tool: Tool) -> usize {
        let part = self.part(name);
        self.seat_all_before(part);
        self.couple(tool);
        assert_eq!(self.ask(RequestKind::Present, part), Some(RequestPhase::Served), "{name}");
        self.tcp_to(&self.true_grasp(part));
        assert_eq!(self.act(EffectorAction::Grasp, Tool::None), Some(EffectorPhase::Done), "{name}");
        assert_eq!(self.out.arm.effector.holding, 1);
        part
    }

    fn couple(&mut self, tool: Tool) {
        let present = self.out.arm.effector.tool.get().expect("a tool");
        if present == tool {
            return;
        }
        if present != Tool::None {
            self.tcp_to_rack(present);
            assert_eq!(self.act(EffectorAction::DetachTool, present), Some(EffectorPhase::Done));
        }
        self.tcp_to_rack(tool);
        assert_eq!(self.act(EffectorAction::AttachTool, tool), Some(EffectorPhase::Done));
        assert!(self.out.arm.effector.tool.is(tool));
    }

    fn home_of(&self, part: usize) -> Isometry3<f64> {
        self.plant.parts.model(part).expect("known").base_from_place
    }

    /// Where the tool has to go for the held part to stand at `goal`.
    fn tcp_for(&self, part: usize, goal: &Isometry3<f64>) -> Isometry3<f64> {
        goal * self.plant.parts.base_from_part(part).inverse() * self.plant.base_from_tcp
    }
}

fn shifted(pose: &Isometry3<f64>, metres: f64, radians: f64) -> Isometry3<f64> {
    pose * Isometry3::from_parts(
        Translation3::new(metres, 0.0, 0.0),
        UnitQuaternion::from_axis_angle(&Vector3::z_axis(), radians),
    )
}
