//! The state machine of the role: its states, its cycle, its beginning and its end.

mod acting;
mod deciding;
mod pacing;
mod seeing;
mod watching;

use super::event::{Event, EventKind, Outcome, Planned, Summary, rounded};
use super::look::Doubt;
use super::placing::Surveyed;
use super::step::{Line, Work};
use super::watch::{RoleNews, RoleWatch, StopWatch};
use super::{RunOptions, SupervisorInputs, SupervisorOutputs};
use crate::strategy::{JournalEntry, Library, StepState};
use pacing::Caution;
use std::time::Duration;
use tandem_config::{Cell, Part};
use tandem_msg::{
    Answer, CellRequest, Code, Coded, MotionTask, Pose, Prompt, PromptKind, RequestKind, RequestPhase, RunMode, Scene,
    Stamp, Tool,
};

/// Longest wait for the arm to come to rest at the end of a run.
const REST_MAX: Duration = Duration::from_secs(3);

/// Where the role stands; `since` of the role says since when.
#[derive(Clone, Debug, PartialEq)]
enum Phase {
    /// The other roles are not all up yet.
    Starting,
    /// An empty fixture is being brought.
    NewBox,
    /// The part is being brought to its station, or looked at again.
    Present,
    /// It stands there and has been scanned.
    Recognise,
    /// A person is asked about it.
    Ask(Question, Doubt),
    /// The journal of the step's beginning is being made durable.
    Opening,
    /// Operations are being carried out.
    Acting,
    /// The journal of the step's end is being made durable.
    Closing,
    /// The arm is coming to rest; then the run is over.
    Ending(Outcome),
    /// The run is over.
    Over,
}

/// What a person is asked about a presented part.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Question {
    /// Which feature has it?
    Identify,
    /// Is it all right as it lies?
    Inspect,
}

/// The supervisor role.
#[derive(Clone, Debug)]
pub struct Supervisor {
    cell: Cell,
    library: Library,
    options: RunOptions,

    now: Stamp,
    began: Stamp,
    phase: Phase,
    since: Stamp,
    box_index: u32,
    box_began: Stamp,
    box_failed: bool,
    work: Work,

    surveyed: Surveyed,
    scene_dirty: bool,
    task: MotionTask,
    prompt: Prompt,
    request: CellRequest,
    task_count: u32,
    journal_seq: u64,

    stop: StopWatch,
    /// The prompt that was set aside while a person looks after a stop, and since when they are asked.
    inspecting: Option<(Stamp, Prompt)>,
    roles: RoleWatch,
    /// Why the arm goes at reduced speed.
    caution: Option<Caution>,
    /// A person had to look at the motion under way after a stop.
    inspected: bool,
    /// Ways changed in motion, as the controller counted when last heard.
    changes: u32,
    summary: Summary,
}

impl Supervisor {
    /// A supervisor at the beginning of a run.
    pub fn new(cell: &Cell, library: Library, options: RunOptions) -> Self {
        let summary = Summary {
            product: cell.product.name.clone(),
            boxes_requested: options.boxes,
            boxes_completed: 0,
            steps_done: 0,
            steps_failed: 0,
            fallbacks: 0,
            ways_changed: 0,
            planned: Planned::default(),
            stops: 0,
            contacts: 0,
            min_clearance_m: None,
            sim_time_s: 0.0,
            seed: options.seed,
        };
        Self {
            surveyed: Surveyed::new(cell),
            scene_dirty: true,
            cell: cell.clone(),
            library,
            options,
            now: Stamp(0),
            began: Stamp(0),
            phase: Phase::Starting,
            since: Stamp(0),
            box_index: 0,
            box_began: Stamp(0),
            box_failed: false,
            work: Work::new(0, Stamp(0)),
            task: MotionTask::default(),
            prompt: Prompt::default(),
            request: CellRequest::default(),
            task_count: 0,
            journal_seq: 0,
            stop: StopWatch::default(),
            inspecting: None,
            roles: RoleWatch::default(),
            caution: None,
            inspected: false,
            changes: 0,
            summary,
        }
    }

    /// The numbers of the run so far.
    pub fn summary(&self) -> Summary {
        self.summary.clone()
    }

    /// One cycle: takes in what was heard and says what is to be done. The events and
    /// journal entries in `outputs` are those of this cycle.
    pub fn cycle(&mut self, now: Stamp, inputs: &SupervisorInputs<'_>, outputs: &mut SupervisorOutputs) {
        outputs.events.clear();
        outputs.journal.clear();
        outputs.finished = None;
        let passed = if self.now == Stamp(0) { Duration::ZERO } else { self.now.age_at(now) };
        if self.now == Stamp(0) {
            (self.began, self.since) = (now, now);
        }
        self.now = now;

        self.advance(inputs, passed, outputs);

        self.summary.contacts = inputs.cell.contacts;
        if self.phase != Phase::Over {
            self.summary.sim_time_s = rounded(self.began.age_at(now).as_secs_f64());
        }
        self.write(outputs);
    }

    fn write(&mut self, outputs: &mut SupervisorOutputs) {
        self.task.scene_version = self.surveyed.version();
        outputs.task = MotionTask { header: outputs.task.header, ..self.task };
        outputs.prompt = Prompt { header: outputs.prompt.header, ..self.prompt };
        outputs.request = CellRequest { header: outputs.request.header, ..self.request };
        if self.scene_dirty || outputs.scene.version != self.surveyed.version() {
            let header = outputs.scene.header;
            outputs.scene = Scene { header, ..Scene::default() };
            self.surveyed.write(&mut outputs.scene);
            self.scene_dirty = false;
        }
    }

    fn advance(&mut self, inputs: &SupervisorInputs<'_>, passed: Duration, out: &mut SupervisorOutputs) {
        match &self.phase {
            Phase::Over => return,
            Phase::Ending(_) => return self.come_to_rest(inputs, out),
            _ if inputs.halt => return self.end(Outcome::Interrupted),
            Phase::Starting => return self.start(inputs, out),
            _ => {}
        }
        if !self.watch_roles(inputs, out) {
            // Time that a role was away counts against no other limit.
            self.since = self.since.after(passed);
            if let Some(current) = &mut self.work.current {
                current.began = current.began.after(passed);
            }
            return;
        }
        self.task.run = Code::of(self.pace(inputs, out));
        if self.watch_stop(inputs, out) {
            self.since = self.since.after(passed);
            return;
        }
        match self.phase.clone() {
            Phase::NewBox => self.new_box(inputs, out),
            Phase::Present => self.present(inputs, out),
            Phase::Recognise => self.recognise(inputs, out),
            Phase::Ask(question, doubt) => self.hear_about_part(question, &doubt, inputs, out),
            Phase::Opening => self.opening(inputs, out),
            Phase::Acting => self.act(inputs, passed, out),
            Phase::Closing => self.closing(inputs, out),
            Phase::Starting | Phase::Ending(_) | Phase::Over => {}
        }
    }

    fn say(&self, out: &mut SupervisorOutputs, kind: EventKind) {
        out.events.push(Event { kind, time_s: rounded(self.began.age_at(self.now).as_secs_f64()) });
    }

    fn go(&mut self, phase: Phase) {
        self.phase = phase;
        self.since = self.now;
    }

    fn waited(&self, limit_s: f64) -> bool {
        self.since.age_at(self.now).as_secs_f64() > limit_s
    }

    fn part(&self) -> &Part {
        &self.cell.product.parts[self.work.index]
    }

    fn number(&self) -> u32 {
        self.box_index + 1
    }

    /// Serial number of the box: product, run and count.
    fn serial(&self) -> String {
        format!("{}-{}-{:04}", self.cell.product.name, self.options.run_id, self.number())
    }

    fn ask_peripherals(&mut self, kind: RequestKind) {
        self.request = CellRequest {
            id: self.request.id + 1,
            kind: Code::of(kind),
            box_index: self.box_index,
            part_index: self.work.index as u32,
            ..CellRequest::default()
        };
    }

    fn ask_person(&mut self, kind: PromptKind, base_from_part: Pose, out: &mut SupervisorOutputs) {
        let tool = self.work.joining.map_or(Tool::None, |joining| joining.tool);
        self.prompt = Prompt {
            id: self.prompt.id + 1,
            kind: Code::of(kind),
            box_index: self.box_index,
            part_index: self.work.index as u32,
            tool: Code::of(tool),
            base_from_part,
            ..Prompt::default()
        };
        if kind != PromptKind::None {
            let (part, text) = (self.part().name.clone(), self.words(kind));
            self.say(out, EventKind::Prompt { kind: kind.name(), part, text });
        }
    }

    fn words(&self, kind: PromptKind) -> String {
        let part = &self.part().label;
        match kind {
            PromptKind::None => String::new(),
            PromptKind::Assemble => format!("{part}: take it from its station and assemble it"),
            PromptKind::Receive => format!("{part}: take it from the robot and assemble it"),
            PromptKind::AssembleHeld => format!("{part}: assemble it while the robot holds it"),
            PromptKind::Identify => format!("{part}: which feature do you see?"),
            PromptKind::Inspect => format!("{part}: look at the cell; may it go on?"),
            PromptKind::TakeOver => format!("{part}: finish this step by hand"),
        }
    }

    /// The answer to the standing prompt that decides something, told as an event.
    fn answer(&self, inputs: &SupervisorInputs<'_>, out: &mut SupervisorOutputs) -> Option<Answer> {
        if inputs.operator.prompt_id != self.prompt.id {
            return None;
        }
        let answer = inputs.operator.answer.get().filter(|a| !matches!(a, Answer::None | Answer::Started))?;
        let kind = self.prompt.kind.get().unwrap_or(PromptKind::None);
        let class = (kind == PromptKind::Identify && answer == Answer::Done)
            .then(|| inputs.operator.class.get().map(Coded::name))
            .flatten();
        let part = self.part().name.clone();
        self.say(out, EventKind::Answer { kind: kind.name(), part, answer: answer.name(), class });
        Some(answer)
    }

    fn no_answer(&self, out: &mut SupervisorOutputs) {
        let kind = self.prompt.kind.get().unwrap_or(PromptKind::None).name();
        self.say(out, EventKind::Answer { kind, part: self.part().name.clone(), answer: "none", class: None });
    }

    fn write_down(&mut self, state: StepState, out: &mut SupervisorOutputs) {
        self.journal_seq += 1;
        let serial = self.serial();
        let line = Line { seq: self.journal_seq, run: &self.options.run_id, serial, began: self.began, now: self.now };
        let entry: JournalEntry = self.work.entry(&self.cell.product.parts[self.work.index], state, line);
        out.journal.push(entry);
    }

    fn end(&mut self, outcome: Outcome) {
        self.task.run = Code::of(RunMode::Halt);
        self.go(Phase::Ending(outcome));
    }

    /// Ends the run for want of the journal.
    fn end_without_journal(&mut self, out: &mut SupervisorOutputs) {
        let fault = format!("an entry was not durable within {} s", self.cell.supervisor.timeouts.journal_s);
        self.say(out, EventKind::Fault { role: "journal", fault: fault.clone() });
        self.end(Outcome::Fault { role: "journal", fault });
    }

    fn start(&mut self, inputs: &SupervisorInputs<'_>, out: &mut SupervisorOutputs) {
        for news in self.roles.update(self.now, &inputs.roles, Duration::MAX) {
            if let RoleNews::Lost(role, fault) = news {
                let fault = fault.name().to_owned();
                self.say(out, EventKind::Fault { role: role.name(), fault: fault.clone() });
                return self.end(Outcome::Fault { role: role.name(), fault });
            }
        }
        let heard = inputs.arm.header.heard() && inputs.motion.header.heard() && inputs.cell.header.heard();
        if RoleWatch::all_up(&inputs.roles) && heard {
            self.began = self.now;
            self.say(
                out,
                EventKind::RunStarted {
                    cell: self.cell.name.clone(),
                    product: self.cell.product.name.clone(),
                    boxes: self.options.boxes,
                    steps: self.cell.product.parts.len(),
                    seed: self.options.seed,
                },
            );
            self.task.run = Code::of(RunMode::Run);
            self.begin_box();
        } else if self.waited(self.cell.supervisor.timeouts.start_s) {
            self.end(Outcome::TimedOut { waiting_for: "the roles to start".into() });
        }
    }

    fn come_to_rest(&mut self, inputs: &SupervisorInputs<'_>, out: &mut SupervisorOutputs) {
        let Phase::Ending(outcome) = &self.phase else { return };
        let heard = inputs.motion.header.heard() && RoleWatch::all_up(&inputs.roles);
        if !heard || inputs.motion.standstill == 1 || self.since.age_at(self.now) > REST_MAX {
            out.finished = Some(outcome.clone());
            self.phase = Phase::Over;
        }
    }

    fn begin_box(&mut self) {
        if self.box_index >= self.options.boxes {
            let failed = self.options.boxes - self.summary.boxes_completed;
            return self.end(match failed {
                0 => Outcome::Completed,
                _ => Outcome::Failed { reason: format!("{failed} of {} boxes not completed", self.options.boxes) },
            });
        }
        self.box_began = self.now;
        self.box_failed = false;
        self.surveyed.clear_box();
        self.work = Work::new(0, self.now);
        self.ask_peripherals(RequestKind::NewBox);
        self.go(Phase::NewBox);
    }

    fn new_box(&mut self, inputs: &SupervisorInputs<'_>, out: &mut SupervisorOutputs) {
        match self.served(inputs) {
            Some(true) => {
                self.say(out, EventKind::BoxStarted { number: self.number() });
                self.begin_step(0, out);
            }
            Some(false) => {
                let fault = "no empty fixture can be brought".to_owned();
                self.say(out, EventKind::Fault { role: "plant", fault: fault.clone() });
                self.end(Outcome::Fault { role: "plant", fault });
            }
            None if self.waited(self.cell.supervisor.timeouts.present_s) => {
                self.end(Outcome::TimedOut { waiting_for: "an empty fixture".into() });
            }
            None => {}
        }
    }

    /// Whether the standing request has been served; `None` while it is under way.
    fn served(&self, inputs: &SupervisorInputs<'_>) -> Option<bool> {
        if inputs.cell.request != self.request.id {
            return None;
        }
        match inputs.cell.phase.get() {
            Some(RequestPhase::Served) => Some(true),
            Some(RequestPhase::Failed) => Some(false),
            _ => None,
        }
    }
}
