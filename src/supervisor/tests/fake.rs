//! A scripted cell: the other roles' messages, made up, faults included.

use super::super::*;
use crate::strategy::{Library, library_tests::shipped};
use nalgebra::Isometry3;
use std::time::Duration;
use tandem_config::{Cell, pose_of};
use tandem_msg::{
    Answer, Code, EffectorAction, FeatureClass, Header, Measured, MotionFailure, MotionPhase, Planner, PromptKind,
    Recognition, RequestKind, RequestPhase, Role, RunMode, Stamp, StopCause, StopState, Subtask, Tool,
};

const PERIOD: Duration = Duration::from_millis(10);

/// What goes wrong, and when.
#[derive(Clone, Default)]
pub(super) struct Script {
    /// Looks at this part that are unsure.
    pub(super) unsure: Option<(usize, u32)>,
    /// Looks at this part that show another class.
    pub(super) other_class: Option<(usize, FeatureClass)>,
    /// Offset of every look at this part, metres.
    pub(super) off_place: Option<(usize, f64)>,
    /// Perception never answers for this part.
    pub(super) blind: Option<usize>,
    /// What the person says when asked to identify; the true class without it.
    pub(super) says: Option<FeatureClass>,
    /// Prompts of this kind are declined, this many times.
    pub(super) declines: Option<(PromptKind, u32)>,
    /// Prompts of this kind are never answered.
    pub(super) mute: Option<PromptKind>,
    /// Motions of this kind fail, this many times.
    pub(super) motion_fails: Option<(Subtask, MotionFailure, u32)>,
    /// Motions of this kind never end.
    pub(super) motion_hangs: Option<Subtask>,
    /// The arm is stopped once in a motion of this kind.
    pub(super) stops: Option<(Subtask, StopCause)>,
    /// The subtask whose motions the controller cannot plan by hand.
    pub(super) sampled: Option<Subtask>,
    /// This role is lost once in a motion of this kind, and comes back if the flag says so.
    pub(super) loses: Option<(Role, Subtask, bool)>,
    /// The journal stops being durable past this entry.
    pub(super) journal_max: Option<u64>,
    /// Ctrl-C in the first motion of this kind.
    pub(super) halts: Option<Subtask>,
}

/// The rest of the cell.
pub(super) struct Fake {
    pub(super) cell: Cell,
    pub(super) script: Script,
    pub(super) supervisor: Supervisor,
    pub(super) outputs: SupervisorOutputs,
    pub(super) now: Stamp,
    pub(super) arm: JointState,
    pub(super) feature: Feature,
    pub(super) motion: MotionStatus,
    pub(super) operator: OperatorEvent,
    pub(super) state: CellState,
    pub(super) roles: [RoleHealth; 4],
    pub(super) committed: u64,
    pub(super) halt: bool,
    pub(super) motion_since: Stamp,
    pub(super) prompt_since: Stamp,
    pub(super) looks: u32,
    pub(super) lost_at: Option<Stamp>,
    pub(super) stopped_at: Option<Stamp>,
    pub(super) seen: Vec<Event>,
    pub(super) journal: Vec<crate::strategy::JournalEntry>,
    /// Scene as it was when each task was sent.
    pub(super) tasks: Vec<(MotionTask, Vec<u32>)>,
    pub(super) prompts: Vec<(PromptKind, usize)>,
}

fn heard(seq: u64) -> Header {
    Header { seq, ..Header::default() }
}

impl Fake {
    pub(super) fn new(script: Script, boxes: u32) -> Self {
        Self::with(script, boxes, |_| {})
    }

    pub(super) fn with(script: Script, boxes: u32, change: impl FnOnce(&mut Cell)) -> Self {
        let mut cell = shipped();
        change(&mut cell);
        let library = Library::new(cell.strategies.clone());
        let options = RunOptions { boxes, seed: 7, run_id: "test".into() };
        let mut arm = JointState { header: heard(1), ..JointState::default() };
        arm.effector.tool = Code::of(cell.layout.initial_tool);
        Self {
            supervisor: Supervisor::new(&cell, library, options),
            outputs: SupervisorOutputs::default(),
            now: Stamp(1_000_000),
            arm,
            feature: Feature::default(),
            motion: MotionStatus { header: heard(1), standstill: 1, separation: 2.0, ..MotionStatus::default() },
            operator: OperatorEvent::default(),
            state: CellState { header: heard(1), ..CellState::default() },
            roles: [RoleHealth::Up; 4],
            committed: 0,
            halt: false,
            motion_since: Stamp(0),
            prompt_since: Stamp(0),
            looks: 0,
            lost_at: None,
            stopped_at: None,
            seen: Vec::new(),
            journal: Vec::new(),
            tasks: Vec::new(),
            prompts: Vec::new(),
            cell,
            script,
        }
    }

    /// Runs until the role says it is over; never longer than half an hour of cell time.
    pub(super) fn run(mut self) -> Run {
        for _ in 0..180_000 {
            self.now = self.now.after(PERIOD);
            let human = HumanState::default();
            let inputs = SupervisorInputs {
                arm: &self.arm,
                human: &human,
                feature: &self.feature,
                motion: &self.motion,
                operator: &self.operator,
                cell: &self.state,
                roles: self.roles,
                journal_committed: self.committed,
                halt: self.halt,
            };
            self.supervisor.cycle(self.now, &inputs, &mut self.outputs);
            self.seen.append(&mut self.outputs.events);
            // Durable one cycle later.
            let limit = self.script.journal_max.unwrap_or(u64::MAX);
            self.committed = self.journal.last().map_or(0, |entry| entry.seq.min(limit));
            self.journal.append(&mut self.outputs.journal);
            if let Some(outcome) = self.outputs.finished.take() {
                return Run { outcome, fake: self };
            }
            self.shell();
            self.plant();
            self.perception();
            self.controller();
            self.person();
        }
        panic!("the role hangs; last events: {:#?}", &self.seen[self.seen.len().saturating_sub(8)..]);
    }

    fn in_motion(&self, subtask: Subtask) -> bool {
        let task = &self.outputs.task;
        task.subtask.is(subtask) && task.id == self.motion.task_id && self.motion_since.age_at(self.now) > PERIOD * 3
    }

    fn shell(&mut self) {
        if let Some((role, subtask, returns)) = self.script.loses {
            if self.lost_at.is_none() && self.in_motion(subtask) {
                self.lost_at = Some(self.now);
                self.roles[role as usize] = RoleHealth::Lost { fault: RoleFault::Killed };
            }
            let away = self.lost_at.map(|at| at.age_at(self.now));
            if returns && away.is_some_and(|away| away > Duration::from_secs(1)) {
                if role == Role::Controller && self.roles[role as usize] != RoleHealth::Up {
                    self.motion.task_id = 0;
                    self.motion.phase = Code::of(MotionPhase::Idle);
                }
                self.roles[role as usize] = RoleHealth::Up;
            }
        }
        if self.script.halts.is_some_and(|subtask| self.in_motion(subtask)) {
            self.halt = true;
        }
    }

    fn plant(&mut self) {
        let request = &self.outputs.request;
        if request.id != self.state.request {
            self.state.request = request.id;
            self.state.phase = Code::of(RequestPhase::Served);
            if request.kind.is(RequestKind::Present) {
                self.looks = 0;
            }
        }
    }

    fn perception(&mut self) {
        let request = self.outputs.request;
        let index = request.part_index as usize;
        let looking = matches!(request.kind.get(), Some(RequestKind::Present | RequestKind::Rescan));
        if !looking || self.feature.request == request.id || self.script.blind == Some(index) {
            return;
        }
        self.looks += 1;
        let part = &self.cell.product.parts[index];
        let mut class = part.feature.class;
        let mut recognition = Recognition::Sure;
        if self.script.unsure.is_some_and(|(of, looks)| of == index && self.looks <= looks) {
            recognition = Recognition::Unsure;
        }
        if let Some((_, other)) = self.script.other_class.filter(|(of, _)| *of == index) {
            class = other;
        }
        let off = self.script.off_place.filter(|(of, _)| *of == index).map_or(0.001, |(_, off)| off);
        let station = self.cell.layout.stations[part.station].base_from_station;
        let lies = Isometry3::translation(off, 0.0, 0.0) * station * part.station_from_part;
        let measured = |value: f64| Measured { value, sigma: 1e-4 };
        let mut feature = Feature { header: heard(1), request: request.id, ..Feature::default() };
        feature.recognition = Code::of(recognition);
        feature.class = Code::of(class);
        feature.probabilities[class as usize] = if recognition == Recognition::Sure { 0.98 } else { 0.55 };
        feature.dimensions.diameter = measured(part.feature.diameter);
        feature.dimensions.length = measured(part.feature.length);
        feature.base_from_feature = pose_of(&(lies * part.part_from_feature));
        self.feature = feature;
    }

    fn controller(&mut self) {
        if self.roles[Role::Controller as usize] != RoleHealth::Up {
            return;
        }
        let task = self.outputs.task;
        if let Some((subtask, cause)) = self.script.stops
            && self.stopped_at.is_none()
            && self.in_motion(subtask)
        {
            self.stopped_at = Some(self.now);
            self.motion.stop = Code::of(StopState::Stopped);
            self.motion.cause = Code::of(cause);
            self.motion.stop_count += 1;
        }
        if self.motion.stop.is(StopState::Stopped) && task.reset_count > self.motion.reset_seen {
            self.motion.reset_seen = task.reset_count;
            self.motion.stop = Code::of(StopState::Running);
            self.motion.cause = Code::of(StopCause::None);
        }
        let runs = task.run.is(RunMode::Run) || task.run.is(RunMode::Reduced);
        self.motion.standstill = u32::from(!runs);
        if !runs || !self.motion.stop.is(StopState::Running) {
            self.motion_since = self.motion_since.after(PERIOD);
            return;
        }
        if task.id != self.motion.task_id {
            self.motion.task_id = task.id;
            self.motion.phase = Code::of(if task.id == 0 { MotionPhase::Idle } else { MotionPhase::Transfer });
            let sampled = self.script.sampled.is_some_and(|subtask| task.subtask.is(subtask));
            self.motion.planner = Code::of(if sampled { Planner::RrtConnect } else { Planner::Policy });
            self.motion.clearance_min = 0.02;
            self.motion_since = self.now;
            let objects = self.outputs.scene.objects().iter().map(|object| object.id).collect();
            self.tasks.push((task, objects));
            return;
        }
        let age = self.motion_since.age_at(self.now);
        let moving =
            !matches!(self.motion.phase.get(), Some(MotionPhase::Done | MotionPhase::Failed | MotionPhase::Idle));
        let hangs = self.script.motion_hangs.is_some_and(|subtask| task.subtask.is(subtask));
        if !moving || hangs || age < Duration::from_millis(500) {
            return;
        }
        if let Some((subtask, failure, times)) = &mut self.script.motion_fails
            && task.subtask.is(*subtask)
            && *times > 0
        {
            *times -= 1;
            self.motion.phase = Code::of(MotionPhase::Failed);
            self.motion.failure = Code::of(*failure);
            if *failure == MotionFailure::PartLost {
                self.arm.effector.holding = 0;
            }
            return;
        }
        let effector = &mut self.arm.effector;
        match task.action.get() {
            Some(EffectorAction::Grasp) => effector.holding = 1,
            Some(EffectorAction::Keep) | None => {}
            Some(EffectorAction::AttachTool) => effector.tool = task.tool,
            Some(EffectorAction::DetachTool) => effector.tool = Code::of(Tool::None),
            Some(_) => effector.holding = 0,
        }
        self.motion.phase = Code::of(MotionPhase::Done);
        self.motion.base_from_tcp = task.base_from_tcp;
    }

    fn person(&mut self) {
        let prompt = self.outputs.prompt;
        let kind = prompt.kind.get().unwrap_or(PromptKind::None);
        if prompt.id != self.operator.prompt_id {
            self.operator = OperatorEvent { header: heard(1), prompt_id: prompt.id, ..OperatorEvent::default() };
            self.prompt_since = self.now;
            self.prompts.push((kind, prompt.part_index as usize));
            return;
        }
        if kind == PromptKind::None || self.script.mute == Some(kind) {
            return;
        }
        let age = self.prompt_since.age_at(self.now);
        let over = self.operator.answer.is(Answer::Declined) || self.operator.answer.is(Answer::Done);
        if age < Duration::from_secs(1) || over {
            return;
        }
        if let Some((declined, times)) = &mut self.script.declines
            && *declined == kind
            && *times > 0
            && self.operator.answer.is(Answer::None)
        {
            *times -= 1;
            self.operator.answer = Code::of(Answer::Declined);
            return;
        }
        let part = &self.cell.product.parts[prompt.part_index as usize];
        self.operator.class = Code::of(self.script.says.unwrap_or(part.feature.class));
        let offered = kind == PromptKind::Receive && self.arm.effector.holding == 1;
        self.operator.answer = Code::of(if offered { Answer::Holding } else { Answer::Done });
        if kind == PromptKind::TakeOver {
            self.arm.effector.holding = 0;
        }
    }
}

/// A run that is over.
pub(super) struct Run {
    pub(super) outcome: Outcome,
    pub(super) fake: Fake,
}

impl Run {
    pub(super) fn events(&self, pick: impl Fn(&EventKind) -> bool) -> usize {
        self.fake.seen.iter().filter(|event| pick(&event.kind)).count()
    }

    pub(super) fn outcomes(&self) -> Vec<&'static str> {
        let pick = |event: &Event| match &event.kind {
            EventKind::StepDone { outcome, .. } => Some(*outcome),
            _ => None,
        };
        self.fake.seen.iter().filter_map(pick).collect()
    }

    pub(super) fn forms(&self) -> Vec<&'static str> {
        let pick = |event: &Event| match &event.kind {
            EventKind::StepDone { form, .. } => Some(*form),
            _ => None,
        };
        self.fake.seen.iter().filter_map(pick).collect()
    }

    pub(super) fn summary(&self) -> Summary {
        self.fake.supervisor.summary()
    }
}
