//! From a strategy's actions to motions and prompts.
//!
//! A motion is the paper's (initial pose, end pose, obstacle, final action): the initial
//! pose is wherever the arm is, the obstacles are the scene, the end pose and the final
//! action are decided here.

use super::placing::{Surveyed, attached, back_from, part_at, tcp_at_place, touch};
use crate::strategy::Joining;
use nalgebra::Isometry3;
use tandem_config::{AssemblyMode, Cell, Part, Verb, id, pose_of};
use tandem_msg::{
    Answer, AttachedPart, Code, Coded, EffectorAction, JointState, MotionTask, Pose, PromptKind, Subtask, Tool,
};

/// One thing to be done and waited for.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Operation {
    /// A motion with its final action; its id is given when it is sent.
    Motion(Box<MotionTask>),
    /// A prompt, over when this answer is heard.
    Ask {
        /// What is asked.
        kind: PromptKind,
        /// Where the part is.
        base_from_part: Pose,
        /// The answer that ends it.
        until: Answer,
    },
    /// A further answer to the prompt that stands.
    Await {
        /// To what.
        kind: PromptKind,
        /// The answer that ends it.
        until: Answer,
    },
}

impl Operation {
    /// Who does it, and what it is called.
    pub(super) fn names(&self) -> (&'static str, &'static str) {
        match self {
            Self::Motion(task) => ("robot", task.subtask.get().unwrap_or(Subtask::None).name()),
            Self::Ask { kind, .. } | Self::Await { kind, .. } => ("human", kind.name()),
        }
    }

    /// Whether the tool shows that the final action of a motion has been done, although
    /// whoever did it is gone. `acted`: the motion had been seen at its final action.
    pub(super) fn evident(&self, arm: &JointState, acted: bool) -> bool {
        let Self::Motion(task) = self else { return false };
        let holding = arm.effector.holding == 1;
        match task.action.get() {
            Some(EffectorAction::Grasp) => holding,
            Some(EffectorAction::Release | EffectorAction::Seat | EffectorAction::Screw | EffectorAction::Press) => {
                acted && !holding
            }
            Some(EffectorAction::AttachTool) => arm.effector.tool == task.tool,
            Some(EffectorAction::DetachTool) => arm.effector.tool.is(Tool::None),
            Some(EffectorAction::Keep) | None => false,
        }
    }

    /// The withdrawal that a motion still owes when only its final action was done.
    pub(super) fn withdrawal(&self) -> Option<Self> {
        let Self::Motion(task) = self else { return None };
        let base_from_tcp = tandem_config::isometry_of(&task.base_from_tcp)?;
        Some(Self::Motion(Box::new(MotionTask {
            base_from_tcp: pose_of(&back_from(&base_from_tcp, task.retract.max(0.02))),
            approach: 0.0,
            retract: 0.0,
            action: Code::of(EffectorAction::Keep),
            value: 0.0,
            attached_before: task.attached_after,
            ..**task
        })))
    }
}

/// What the actions of a step are made from.
pub(super) struct Means<'a> {
    /// The cell.
    pub(super) cell: &'a Cell,
    /// The part.
    pub(super) part: &'a Part,
    /// Where it lies at its station.
    pub(super) base_from_part: Isometry3<f64>,
    /// Mode, tool and effort.
    pub(super) joining: Joining,
    /// Whether an action that joins it follows the placing.
    pub(super) assembled: bool,
    /// What is in the cell.
    pub(super) scene: &'a Surveyed,
    /// Tool at the flange.
    pub(super) tool: Tool,
}

impl Means<'_> {
    /// The operations of one action.
    pub(super) fn expand(&self, verb: Verb) -> Vec<Operation> {
        let cell = self.cell;
        let policy = &cell.supervisor;
        let place = tcp_at_place(cell, self.part);
        let held = attached(self.part);
        let here = AttachedPart::default();
        let at_place = || self.scene.touch_at_place(cell, self.part, policy.hover);
        match verb {
            Verb::ChangeTool => self.change_tool(),
            Verb::Grasp => vec![self.motion(MotionTask {
                subtask: Code::of(Subtask::Grasp),
                base_from_tcp: pose_of(&(self.base_from_part * self.part.part_from_grasp)),
                approach: policy.approach,
                retract: policy.retract,
                speed: policy.speed_free,
                action: Code::of(EffectorAction::Grasp),
                value: self.part.grasp_width,
                attached_before: here,
                attached_after: held,
                touch: touch([id::PRESENTED, cell.layout.stations[self.part.station].carrier.id]),
                ..MotionTask::default()
            })],
            Verb::Transfer => {
                vec![self.carry(Subtask::Transfer, &back_from(&place, policy.hover))]
            }
            Verb::Place => vec![self.motion(MotionTask {
                subtask: Code::of(Subtask::Place),
                base_from_tcp: pose_of(&place),
                approach: policy.hover,
                retract: if self.assembled { 0.0 } else { policy.retract },
                speed: policy.speed_near,
                action: Code::of(if self.assembled { EffectorAction::Keep } else { EffectorAction::Seat }),
                attached_before: held,
                attached_after: if self.assembled { held } else { here },
                touch: at_place(),
                ..MotionTask::default()
            })],
            Verb::Assemble => vec![self.motion(MotionTask {
                subtask: Code::of(Subtask::Assemble),
                base_from_tcp: pose_of(&place),
                retract: policy.retract,
                speed: policy.speed_near,
                action: Code::of(final_action(self.joining.mode)),
                value: self.joining.effort,
                attached_before: held,
                attached_after: here,
                touch: at_place(),
                ..MotionTask::default()
            })],
            Verb::HandOver => vec![self.carry(Subtask::HandOver, &cell.layout.base_from_handover)],
            Verb::Hold => vec![self.carry(Subtask::HoldStill, &cell.layout.base_from_hold)],
            Verb::Receive => vec![Operation::Ask {
                kind: PromptKind::Receive,
                base_from_part: part_at(&cell.layout.base_from_handover, self.part),
                until: Answer::Holding,
            }],
            Verb::Finish => vec![Operation::Await { kind: PromptKind::Receive, until: Answer::Done }],
            Verb::AssembleHeld => vec![Operation::Ask {
                kind: PromptKind::AssembleHeld,
                base_from_part: part_at(&cell.layout.base_from_hold, self.part),
                until: Answer::Done,
            }],
            // Out of the way first: the person works where the arm would stand.
            Verb::FetchAndAssemble => vec![
                home(policy.speed_free),
                Operation::Ask {
                    kind: PromptKind::Assemble,
                    base_from_part: pose_of(&self.base_from_part),
                    until: Answer::Done,
                },
            ],
            Verb::Release => Vec::new(), // Where from depends on the form: see `release`.
        }
    }

    /// Letting go at `base_from_tcp`, and away from there.
    pub(super) fn release(&self, subtask: Subtask, base_from_tcp: &Isometry3<f64>) -> Operation {
        release(self.cell, self.part, subtask, &pose_of(base_from_tcp))
    }

    /// Carries the part there and keeps it.
    fn carry(&self, subtask: Subtask, base_from_tcp: &Isometry3<f64>) -> Operation {
        let held = attached(self.part);
        self.motion(MotionTask {
            subtask: Code::of(subtask),
            base_from_tcp: pose_of(base_from_tcp),
            speed: self.cell.supervisor.speed_carry,
            attached_before: held,
            attached_after: held,
            ..MotionTask::default()
        })
    }

    fn change_tool(&self) -> Vec<Operation> {
        let mut out = Vec::new();
        if self.tool == self.joining.tool {
            return out;
        }
        let mut visit = |tool: Tool, action: EffectorAction| {
            if let Some(slot) = self.cell.layout.rack_slot(tool) {
                out.push(self.motion(MotionTask {
                    subtask: Code::of(Subtask::ToolChange),
                    base_from_tcp: pose_of(&slot.base_from_tcp),
                    approach: self.cell.layout.rack_approach,
                    retract: self.cell.layout.rack_approach,
                    speed: self.cell.supervisor.speed_free,
                    action: Code::of(action),
                    tool: Code::of(tool),
                    touch: touch([id::RACK]),
                    ..MotionTask::default()
                }));
            }
        };
        if self.tool != Tool::None {
            visit(self.tool, EffectorAction::DetachTool);
        }
        visit(self.joining.tool, EffectorAction::AttachTool);
        out
    }

    fn motion(&self, task: MotionTask) -> Operation {
        Operation::Motion(Box::new(MotionTask {
            tool: if task.tool.is(Tool::None) { Code::of(self.joining.tool) } else { task.tool },
            ..task
        }))
    }
}

/// To the resting configuration, with nothing in the tool.
pub(super) fn home(speed: f64) -> Operation {
    Operation::Motion(Box::new(MotionTask { subtask: Code::of(Subtask::Home), speed, ..MotionTask::default() }))
}

/// Letting go of `part` where the TCP is.
pub(super) fn release(cell: &Cell, part: &Part, subtask: Subtask, base_from_tcp: &Pose) -> Operation {
    Operation::Motion(Box::new(MotionTask {
        subtask: Code::of(subtask),
        base_from_tcp: *base_from_tcp,
        retract: cell.supervisor.retract,
        speed: cell.supervisor.speed_near,
        action: Code::of(EffectorAction::Release),
        attached_before: attached(part),
        ..MotionTask::default()
    }))
}

/// What the tool does to join a part in this mode.
fn final_action(mode: AssemblyMode) -> EffectorAction {
    match mode {
        AssemblyMode::Thread => EffectorAction::Screw,
        AssemblyMode::Press | AssemblyMode::Taper | AssemblyMode::Snap => EffectorAction::Press,
        AssemblyMode::Insert | AssemblyMode::Slide | AssemblyMode::Lay | AssemblyMode::Stick => EffectorAction::Seat,
    }
}
