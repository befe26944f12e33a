//! What hangs at the flange: the tool changer and the four tools.
//!
//! An action takes its time and is judged at its end, by where things truly are:
//! a grasp closes on the part only when the tool stands where the part is; a part
//! goes home only within the reach of its chamfers. What was planned or seen is of
//! no account here, so an error made upstream fails here and nowhere earlier.

use nalgebra::{Isometry3, Vector3};
use rapier3d_f64::prelude::PhysicsWorld;
use tandem_msg::{Code, Coded, EffectorAction, EffectorCommand, EffectorPhase, EffectorState, Stamp, Tool};

use super::frames::apart;
use super::parts::{Parts, Place};

/// Opening of the parallel gripper, metres.
pub(super) const GRIPPER_OPENING: f64 = 0.14;
/// A tool acts only while its tip moves slower than this, m/s.
const STILL: f64 = 0.02;

/// How tools are judged.
#[derive(Clone, Copy, Debug)]
pub(super) struct EffectorModel {
    /// Farthest from the true grasp pose a grasp still closes: metres, radians.
    pub(super) grasp: (f64, f64),
    /// Farthest from the rack pose a tool still couples: metres, radians.
    pub(super) couple: (f64, f64),
    /// Where the tool centre point stands for each tool of the rack, by the tool's code.
    pub(super) rack: [Option<Isometry3<f64>>; Tool::ALL.len()],
    /// The tool that is coupled at the start.
    pub(super) initial_tool: Tool,
    /// Seconds each action takes, by its code.
    pub(super) duration: [f64; EffectorAction::ALL.len()],
}

/// What a tool needs to know of the world in one cycle.
pub(super) struct Reach<'a> {
    pub(super) base_from_tcp: &'a Isometry3<f64>,
    /// Velocity of the tool centre point, m/s.
    pub(super) tcp_velocity: Vector3<f64>,
    /// The part a person has hold of.
    pub(super) hand_on: Option<usize>,
}

struct Action {
    command: EffectorCommand,
    began: Stamp,
}

/// The changer and the tool coupled to it.
pub(super) struct Effector {
    model: EffectorModel,
    tool: Tool,
    last_id: u32,
    phase: EffectorPhase,
    action: Option<Action>,
    width: f64,
    force: f64,
}

impl Effector {
    /// The initial tool coupled, the others in the rack.
    pub(super) fn new(model: EffectorModel) -> Self {
        Self {
            tool: model.initial_tool,
            model,
            last_id: 0,
            phase: EffectorPhase::Idle,
            action: None,
            width: 0.0,
            force: 0.0,
        }
    }

    /// Takes up a new command, and carries on with the one under way. A part
    /// changes hands only in the cycle in which an action ends.
    pub(super) fn cycle(
        &mut self,
        now: Stamp,
        command: &EffectorCommand,
        reach: &Reach<'_>,
        parts: &mut Parts,
        world: &mut PhysicsWorld,
    ) {
        if command.id != 0 && command.id != self.last_id {
            self.last_id = command.id;
            self.phase = EffectorPhase::Busy;
            self.action = Some(Action { command: *command, began: now });
        }
        if let Some(Action { command, began }) = &self.action {
            let (command, elapsed) = (*command, began.age_at(now).as_secs_f64());
            let Some(action) = command.action.get() else {
                self.finish(false);
                return;
            };
            let duration = self.model.duration[action.code() as usize];
            self.show(action, command.value, if duration > 0.0 { (elapsed / duration).min(1.0) } else { 1.0 });
            if elapsed + 1e-9 >= duration {
                let done = self.act(action, command.tool, reach, parts, world);
                self.finish(done);
            }
        }
        if self.action.is_none() {
            self.width = match parts.held().and_then(|part| parts.model(part)) {
                Some(model) if self.tool == Tool::ParallelGripper => model.grasp_width,
                _ if self.tool == Tool::ParallelGripper => GRIPPER_OPENING,
                _ => 0.0,
            };
        }
    }

    fn finish(&mut self, done: bool) {
        self.phase = if done { EffectorPhase::Done } else { EffectorPhase::Failed };
        self.action = None;
        self.force = 0.0;
    }

    /// Fingers and force while an action runs; `share` of its time has passed.
    fn show(&mut self, action: EffectorAction, value: f64, share: f64) {
        if self.tool == Tool::ParallelGripper {
            match action {
                EffectorAction::Grasp => {
                    self.width = GRIPPER_OPENING + (value.clamp(0.0, GRIPPER_OPENING) - GRIPPER_OPENING) * share;
                }
                EffectorAction::Release | EffectorAction::Seat => {
                    self.width += (GRIPPER_OPENING - self.width) * share;
                }
                _ => {}
            }
        }
        self.force = match action {
            EffectorAction::Screw | EffectorAction::Press if value.is_finite() => value * share,
            _ => 0.0,
        };
    }

    fn act(
        &mut self,
        action: EffectorAction,
        tool: Code<Tool>,
        reach: &Reach<'_>,
        parts: &mut Parts,
        world: &mut PhysicsWorld,
    ) -> bool {
        let still = reach.tcp_velocity.norm() <= STILL;
        match action {
            EffectorAction::Keep => true,
            EffectorAction::Grasp => still && self.grasp(reach, parts, world),
            EffectorAction::Release => {
                Self::release(reach, parts, world);
                true
            }
            EffectorAction::Seat => still && Self::join(action, parts, world),
            EffectorAction::Screw => still && self.tool == Tool::Screwdriver && Self::join(action, parts, world),
            EffectorAction::Press => still && self.tool == Tool::PressTool && Self::join(action, parts, world),
            EffectorAction::AttachTool => still && self.attach(tool, reach),
            EffectorAction::DetachTool => still && parts.held().is_none() && self.detach(tool, reach),
        }
    }

    fn grasp(&mut self, reach: &Reach<'_>, parts: &mut Parts, world: &mut PhysicsWorld) -> bool {
        let free = self.tool != Tool::None && parts.held().is_none();
        let Some(part) = parts.within_grasp(reach.base_from_tcp, self.model.grasp).filter(|_| free) else {
            return false;
        };
        let fits = parts.model(part).is_some_and(|model| model.held_by[self.tool.code() as usize]);
        if fits {
            parts.take_with_tool(world, part, reach.base_from_tcp);
        }
        fits
    }

    fn release(reach: &Reach<'_>, parts: &mut Parts, world: &mut PhysicsWorld) {
        let Some(part) = parts.held() else { return };
        if parts.secured(part) {
            parts.seat(world, part);
        } else if reach.hand_on == Some(part) {
            parts.take_by_hand(world, part);
        } else {
            parts.fall(world, part, &reach.tcp_velocity);
        }
    }

    /// Whether the held part goes home from where it is: near enough, all parts
    /// below it there, and by an action that joins what its feature truly is.
    fn join(action: EffectorAction, parts: &mut Parts, world: &mut PhysicsWorld) -> bool {
        let Some(part) = parts.held() else { return false };
        let Some(model) = parts.model(part) else { return false };
        let (metres, radians) = apart(&parts.base_from_part(part), &model.base_from_place);
        let near = metres <= model.capture.0 && radians <= model.capture.1;
        let home = near && model.joined_by.contains(&action) && parts.ready_for(part);
        if home {
            parts.seat(world, part);
        }
        home
    }

    fn at_rack(&self, tool: Tool, reach: &Reach<'_>) -> bool {
        self.model.rack[tool.code() as usize].is_some_and(|pose| {
            let (metres, radians) = apart(reach.base_from_tcp, &pose);
            metres <= self.model.couple.0 && radians <= self.model.couple.1
        })
    }

    fn attach(&mut self, tool: Code<Tool>, reach: &Reach<'_>) -> bool {
        match tool.get() {
            Some(tool) if tool != Tool::None && self.tool == Tool::None && self.at_rack(tool, reach) => {
                self.tool = tool;
                true
            }
            _ => false,
        }
    }

    fn detach(&mut self, tool: Code<Tool>, reach: &Reach<'_>) -> bool {
        let coupled = self.tool != Tool::None && (tool.is(self.tool) || tool.is(Tool::None));
        if coupled && self.at_rack(self.tool, reach) {
            self.tool = Tool::None;
            return true;
        }
        false
    }

    /// What the tool reports.
    pub(super) fn state(&self, parts: &Parts) -> EffectorState {
        let held = parts.held().is_some_and(|part| parts.place(part) == Place::Tool);
        EffectorState {
            command_id: self.last_id,
            phase: self.phase.into(),
            tool: self.tool.into(),
            holding: u32::from(held),
            width: self.width,
            force: self.force,
        }
    }
}
