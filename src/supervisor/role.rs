//! The state machine of the role.

use super::actions::{Means, Operation, release};
use super::capability::{Demand, judge as judge_capability};
use super::event::{Event, EventKind, Outcome, Summary, rounded};
use super::look::{self, Doubt, Recognised};
use super::placing::{Surveyed, nominal_at_station};
use super::step::{Current, Line, Work};
use super::watch::{RoleNews, RoleWatch, StopNews, StopPolicy, StopWatch};
use super::{RunOptions, SupervisorInputs, SupervisorOutputs};
use crate::strategy::{JournalEntry, Library, Seen, Situation, StepState, join};
use std::time::Duration;
use tandem_config::{Cell, Form, Part, Verb, pose_of};
use tandem_msg::{
    Answer, CellRequest, Code, Coded, MotionFailure, MotionPhase, MotionTask, Pose, Prompt, PromptKind, RequestKind,
    RequestPhase, Role, RunMode, Scene, Stamp, StopState, Subtask, Tool,
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
        self.task.run = Code::of(RunMode::Run);
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

    // ---- small things ------------------------------------------------------------------

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

    // ---- beginning and end ---------------------------------------------------------------

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

    // ---- the watches ---------------------------------------------------------------------

    /// Whether everybody is there; otherwise the arm is held until they are.
    fn watch_roles(&mut self, inputs: &SupervisorInputs<'_>, out: &mut SupervisorOutputs) -> bool {
        let limit = Duration::from_secs_f64(self.cell.supervisor.timeouts.recovery_s);
        for news in self.roles.update(self.now, &inputs.roles, limit) {
            match news {
                RoleNews::Lost(role, fault) => {
                    let words = fault.name().to_owned();
                    self.say(out, EventKind::Fault { role: role.name(), fault: words.clone() });
                    // What stands for the hardware holds the state of box and parts: with it
                    // goes what this run knows of them.
                    if role == Role::Plant {
                        self.end(Outcome::Fault { role: role.name(), fault: words });
                        return false;
                    }
                }
                RoleNews::Overdue(role, fault) => {
                    self.end(Outcome::Fault { role: role.name(), fault: fault.name().to_owned() });
                    return false;
                }
                RoleNews::Back(role, after) => {
                    let after_s = rounded(after.as_secs_f64());
                    self.say(out, EventKind::Recovered { role: role.name(), after_s });
                    match role {
                        Role::Controller => self.resume_operation(inputs),
                        Role::Perception if self.phase == Phase::Recognise => self.look_again(),
                        _ => {}
                    }
                }
            }
        }
        let up = RoleWatch::all_up(&inputs.roles);
        if !up && !matches!(self.phase, Phase::Ending(_)) {
            self.task.run = Code::of(RunMode::Pause);
        }
        up
    }

    /// A controller that was started anew knows no task. What the tool shows says whether the
    /// interrupted motion's final action was done; if so only the withdrawal is left, else the
    /// motion is begun again.
    fn resume_operation(&mut self, inputs: &SupervisorInputs<'_>) {
        let Some(current) = self.work.current.take() else { return };
        if !matches!(current.operation, Operation::Motion(_)) {
            self.work.current = Some(current);
            return;
        }
        if current.operation.evident(inputs.arm, current.acted) {
            if let Some(withdrawal) = current.operation.withdrawal() {
                self.work.queue.push_front(withdrawal);
            }
        } else {
            self.work.queue.push_front(current.operation);
        }
    }

    /// Follows the protective stop; true while a person looks and everything else waits.
    fn watch_stop(&mut self, inputs: &SupervisorInputs<'_>, out: &mut SupervisorOutputs) -> bool {
        let policy = &self.cell.supervisor;
        let policy = StopPolicy {
            reset_after: Duration::from_secs_f64(policy.reset_after_s),
            resets_max: policy.resets_max,
            patience: Duration::from_secs_f64(policy.timeouts.answer_s),
        };
        match self.stop.update(self.now, inputs.motion, &policy) {
            StopNews::Quiet => {}
            StopNews::Began { cause, category } => {
                self.summary.stops += 1;
                let separation = inputs.motion.separation;
                self.say(
                    out,
                    EventKind::Stop {
                        cause: cause.name(),
                        category: category.name(),
                        separation_m: separation.is_finite().then(|| rounded(separation)),
                        clearance_m: rounded(inputs.motion.clearance),
                    },
                );
            }
            StopNews::Reset => self.task.reset_count += 1,
            StopNews::Ask => {
                let aside = self.prompt;
                self.ask_person(PromptKind::Inspect, Pose::IDENTITY, out);
                self.inspecting = Some((self.now, aside));
            }
            StopNews::Ended { cause, after } => {
                let after_s = rounded(after.as_secs_f64());
                self.say(out, EventKind::Resumed { cause: cause.name(), after_s });
            }
        }
        let Some((asked, aside)) = self.inspecting else { return false };
        match self.answer(inputs, out) {
            Some(Answer::Done) => {
                self.inspecting = None;
                self.stop.seen_by_person();
                self.task.reset_count += 1;
                // What they were at before is asked anew.
                if aside.id != 0 && matches!(self.phase, Phase::Ask(..) | Phase::Acting) {
                    let kind = aside.kind.get().unwrap_or(PromptKind::None);
                    self.ask_person(kind, aside.base_from_part, out);
                }
            }
            Some(_) => {
                let fault = "a person found the cell not fit to go on".to_owned();
                self.say(out, EventKind::Fault { role: "arm", fault: fault.clone() });
                self.end(Outcome::Fault { role: "arm", fault });
            }
            None if asked.age_at(self.now).as_secs_f64() > self.cell.supervisor.timeouts.answer_s => {
                self.no_answer(out);
                self.end(Outcome::TimedOut { waiting_for: "a person to look at the cell after a stop".into() });
            }
            None => {}
        }
        true
    }

    // ---- seeing --------------------------------------------------------------------------

    fn begin_step(&mut self, index: usize, out: &mut SupervisorOutputs) {
        self.work = Work::new(index, self.now);
        self.stop.new_step();
        let (part, label) = (self.part().name.clone(), self.part().label.clone());
        self.say(out, EventKind::StepStarted { number: self.number(), step: index + 1, part, label });
        self.call_part();
    }

    /// Has the part brought to its station, a fresh one if the last was lost.
    fn call_part(&mut self) {
        self.surveyed.taken();
        self.work.looks = 0;
        self.work.seen = None;
        self.ask_peripherals(RequestKind::Present);
        self.go(Phase::Present);
    }

    fn look_again(&mut self) {
        self.ask_peripherals(RequestKind::Rescan);
        self.go(Phase::Present);
    }

    fn present(&mut self, inputs: &SupervisorInputs<'_>, out: &mut SupervisorOutputs) {
        match self.served(inputs) {
            Some(true) => self.go(Phase::Recognise),
            Some(false) => self.doubt(Doubt::NoPart, out),
            None if self.waited(self.cell.supervisor.timeouts.present_s) => {
                let waiting_for = format!("{} to be presented", self.part().name);
                self.end(Outcome::TimedOut { waiting_for });
            }
            None => {}
        }
    }

    fn recognise(&mut self, inputs: &SupervisorInputs<'_>, out: &mut SupervisorOutputs) {
        let feature = inputs.feature;
        if feature.header.heard() && feature.request == self.request.id {
            match look::judge(&self.cell, self.part(), feature) {
                Ok(seen) => {
                    self.work.looks += 1;
                    self.decide(seen, out);
                }
                Err(doubt) => self.doubt(doubt, out),
            }
        } else if self.waited(self.cell.supervisor.timeouts.recognise_s) {
            self.doubt(Doubt::Silent, out);
        }
    }

    /// Another look, or a question.
    fn doubt(&mut self, doubt: Doubt, out: &mut SupervisorOutputs) {
        self.work.looks += 1;
        let (part, look) = (self.part().name.clone(), self.work.looks);
        self.say(out, EventKind::Doubt { part, look, reason: doubt.to_string() });
        if self.work.looks < self.cell.perception.looks_max {
            return self.look_again();
        }
        let question = match doubt {
            Doubt::Unsure { .. } | Doubt::OtherClass { .. } => Question::Identify,
            _ => Question::Inspect,
        };
        let kind = match question {
            Question::Identify => PromptKind::Identify,
            Question::Inspect => PromptKind::Inspect,
        };
        let lies = pose_of(&nominal_at_station(&self.cell, self.part()));
        self.ask_person(kind, lies, out);
        self.go(Phase::Ask(question, doubt));
    }

    fn hear_about_part(
        &mut self,
        question: Question,
        doubt: &Doubt,
        inputs: &SupervisorInputs<'_>,
        out: &mut SupervisorOutputs,
    ) {
        let expected = self.part().feature.class;
        match self.answer(inputs, out) {
            Some(Answer::Done) => {
                let class = match question {
                    Question::Identify => inputs.operator.class.get(),
                    Question::Inspect => Some(expected),
                };
                if class != Some(expected) {
                    let named = class.map_or("an unknown class", Coded::name);
                    return self.hand_to_person(format!("{doubt}; the person sees {named}"), out);
                }
                self.work.remark = format!("{doubt}; the person says it is {expected}");
                let feature = inputs.feature;
                let confidence = f64::from(feature.probabilities[expected as usize]);
                let confidence = if confidence.is_finite() { confidence } else { 0.0 };
                // With only the class in doubt the measured place and size still stand.
                let cleared = tandem_msg::Feature {
                    recognition: Code::of(tandem_msg::Recognition::Sure),
                    class: Code::of(expected),
                    ..*feature
                };
                let measured = match question {
                    Question::Identify if feature.request == self.request.id => {
                        look::judge(&self.cell, self.part(), &cleared).ok()
                    }
                    _ => None,
                };
                let seen = measured.map_or_else(
                    || look::by_word(&self.cell, self.part(), expected, confidence),
                    |seen| Recognised { by_person: true, ..seen },
                );
                self.decide(seen, out);
            }
            Some(_) => self.hand_to_person(format!("{doubt}; the person declined to look"), out),
            None if self.waited(self.cell.supervisor.timeouts.answer_s) => {
                self.no_answer(out);
                self.hand_to_person(format!("{doubt}; nobody answered"), out);
            }
            None => {}
        }
    }

    // ---- deciding ------------------------------------------------------------------------

    /// Capability, mode and tool, strategy; then the journal is opened.
    fn decide(&mut self, seen: Recognised, out: &mut SupervisorOutputs) {
        self.work.seen = Some(seen);
        self.surveyed.present(&seen.base_from_part, &self.cell.product.parts[self.work.index]);
        let part = &self.cell.product.parts[self.work.index];
        let millimetres = |value: f64| (value > 0.0).then(|| (value * 1e4).round() / 10.0);
        let [diameter, depth, length, width] = seen.dimensions;
        self.say(
            out,
            EventKind::Recognised {
                part: part.name.clone(),
                class: seen.class.name(),
                confidence: rounded(seen.confidence),
                by: if seen.by_person { "person" } else { "perception" },
                diameter_mm: millimetres(diameter),
                depth_mm: millimetres(depth),
                length_mm: millimetres(length),
                width_mm: millimetres(width),
                looks: self.work.looks,
                offset_mm: rounded(seen.offset * 1e3),
            },
        );

        let at = seen.base_from_part.translation.vector;
        let human_distance = (at - nalgebra::Vector3::from(self.cell.human.working_shoulder())).norm();
        let demand = Demand {
            human_distance,
            robot_distance: at.norm(),
            mass: part.mass,
            flexible: part.flexible,
            harmful: part.harmful,
        };
        let verdict = judge_capability(&self.cell.supervisor.capability, &demand);
        self.say(
            out,
            EventKind::Verdict {
                part: part.name.clone(),
                feasible_human: verdict.human,
                feasible_robot: verdict.robot,
                human_reach_margin_m: rounded(verdict.human_margins.reach),
                human_load_margin_kg: rounded(verdict.human_margins.load),
                robot_reach_margin_m: rounded(verdict.robot_margins.reach),
                robot_load_margin_kg: rounded(verdict.robot_margins.load),
                assigned: verdict.assigned.map_or("nobody", |focus| focus.name()),
                reason: verdict.reason.text(),
            },
        );
        self.work.verdict = Some(verdict);
        let Some(focus) = verdict.assigned else {
            return self.hand_to_person(format!("unassignable: {}", verdict.reason.text()), out);
        };

        let known = Seen { class: seen.class, diameter, length, oily: part.oily, flexible: part.flexible };
        let Some(joining) = join(&self.cell.reference, &known) else {
            let reason = format!("the reference table has no row for {} of {:.1} mm", seen.class, diameter * 1e3);
            return self.hand_to_person(reason, out);
        };
        self.work.joining = Some(joining);
        let situation = Situation {
            class: seen.class,
            diameter,
            length,
            mode: joining.mode,
            tool: joining.tool,
            focus,
            distance: human_distance,
            mass: part.mass,
            flexible: part.flexible,
        };
        match self.library.retrieve(&situation) {
            Ok(found) => {
                self.say(
                    out,
                    EventKind::Strategy {
                        part: part.name.clone(),
                        id: found.row.id.clone(),
                        mode: joining.mode.name(),
                        tool: joining.tool.name(),
                        focus: focus.name(),
                        form: found.row.form.name(),
                        score: rounded(found.score),
                        explanation: found.explanation.clone(),
                    },
                );
                self.work.found = Some(found);
                self.work.verb = 0;
                self.open(out);
            }
            Err(none) => self.hand_to_person(none.to_string(), out),
        }
    }

    /// A person does the step by hand; the reason is written down.
    fn hand_to_person(&mut self, reason: String, out: &mut SupervisorOutputs) {
        self.work.drop_operations();
        // Whatever the arm was at is no longer wanted.
        self.task = MotionTask { id: 0, run: self.task.run, reset_count: self.task.reset_count, ..Default::default() };
        self.work.remark.clone_from(&reason);
        self.work.take_over = Some(reason);
        let at = pose_of(&(self.cell.layout.base_from_fixture * self.part().fixture_from_part));
        self.work.queue.push_back(Operation::Ask {
            kind: PromptKind::TakeOver,
            base_from_part: at,
            until: Answer::Done,
        });
        self.open(out);
    }

    fn open(&mut self, out: &mut SupervisorOutputs) {
        self.write_down(StepState::Started, out);
        self.go(Phase::Opening);
    }

    fn opening(&mut self, inputs: &SupervisorInputs<'_>, out: &mut SupervisorOutputs) {
        if inputs.journal_committed >= self.journal_seq {
            self.go(Phase::Acting);
        } else if self.waited(self.cell.supervisor.timeouts.journal_s) {
            self.end_without_journal(out);
        }
    }

    // ---- acting --------------------------------------------------------------------------

    fn act(&mut self, inputs: &SupervisorInputs<'_>, passed: Duration, out: &mut SupervisorOutputs) {
        if self.work.current.is_none() && !self.next_operation(inputs, out) {
            return self.complete(StepState::Done, inputs, out);
        }
        let Some(mut current) = self.work.current.take() else { return };
        let result = match current.operation.clone() {
            Operation::Motion(task) => self.follow_motion(&task, &mut current, inputs, passed),
            Operation::Ask { until, .. } | Operation::Await { until, .. } => {
                self.follow_prompt(until, &current, inputs, out)
            }
        };
        match result {
            Progress::Going => self.work.current = Some(current),
            Progress::Done => self.operation_done(&current, out),
            Progress::Failed { reason, again } => self.failed(reason, again, inputs, out),
        }
    }

    /// Begins the next operation; false when there is none.
    fn next_operation(&mut self, inputs: &SupervisorInputs<'_>, out: &mut SupervisorOutputs) -> bool {
        while self.work.queue.is_empty() {
            if self.work.take_over.is_some() {
                // A part that is left in the tool after a take-over is let go where it is.
                if inputs.arm.effector.holding != 1 {
                    return false;
                }
                let tcp = inputs.motion.base_from_tcp;
                let letting_go = release(&self.cell, self.part(), Subtask::HandOver, &tcp);
                self.work.queue.push_back(letting_go);
                break;
            }
            let Some(verb) = self.work.verbs().get(self.work.verb).copied() else { return false };
            self.work.verb += 1;
            let operations = self.expand(verb, inputs);
            self.work.queue.extend(operations);
        }
        let Some(operation) = self.work.queue.pop_front() else { return false };
        match &operation {
            Operation::Motion(task) => {
                self.task = MotionTask {
                    header: self.task.header,
                    id: self.next_task_id(),
                    run: Code::of(RunMode::Run),
                    reset_count: self.task.reset_count,
                    ..**task
                };
            }
            Operation::Ask { kind, base_from_part, .. } => self.ask_person(*kind, *base_from_part, out),
            Operation::Await { .. } => {}
        }
        let (subject, subtask) = operation.names();
        self.say(out, EventKind::ActionStarted { subject, subtask, part: self.part().name.clone() });
        self.work.current = Some(Current::new(operation, self.now));
        true
    }

    fn next_task_id(&mut self) -> u32 {
        self.task_count += 1;
        self.task_count
    }

    fn expand(&self, verb: Verb, inputs: &SupervisorInputs<'_>) -> Vec<Operation> {
        let (Some(seen), Some(joining), Some(found)) = (self.work.seen, self.work.joining, &self.work.found) else {
            return Vec::new();
        };
        let means = Means {
            cell: &self.cell,
            part: self.part(),
            base_from_part: seen.base_from_part,
            joining,
            assembled: self.work.verbs().contains(&Verb::Assemble),
            scene: &self.surveyed,
            tool: inputs.arm.effector.tool.get().unwrap_or(Tool::None),
        };
        match (verb, found.row.form) {
            (Verb::Release, Form::Hold) => vec![means.release(Subtask::HoldStill, &self.cell.layout.base_from_hold)],
            (Verb::Release, _) => vec![means.release(Subtask::HandOver, &self.cell.layout.base_from_handover)],
            (verb, _) => means.expand(verb),
        }
    }

    fn follow_motion(
        &self,
        task: &MotionTask,
        current: &mut Current,
        inputs: &SupervisorInputs<'_>,
        passed: Duration,
    ) -> Progress {
        let motion = inputs.motion;
        if motion.stop.is(StopState::Running) {
            current.moving_s += passed.as_secs_f64();
        }
        if motion.task_id == self.task.id {
            current.follow(motion);
            match motion.phase.get() {
                Some(MotionPhase::Done) => {
                    let grasped = task.action.is(tandem_msg::EffectorAction::Grasp);
                    if grasped && inputs.arm.effector.holding != 1 {
                        return Progress::failed("the tool holds nothing after the grasp");
                    }
                    return Progress::Done;
                }
                Some(MotionPhase::Failed) => {
                    let failure = motion.failure.get().unwrap_or(MotionFailure::None);
                    let again = !matches!(failure, MotionFailure::InvalidTask | MotionFailure::Unreachable);
                    let subtask = task.subtask.get().unwrap_or(Subtask::None);
                    return Progress::Failed { reason: format!("{subtask}: {failure}"), again };
                }
                Some(MotionPhase::Acting | MotionPhase::Retract) => current.acted = true,
                _ => {}
            }
        }
        let limit = self.cell.supervisor.timeouts.motion_s;
        if current.moving_s > limit {
            let subtask = task.subtask.get().unwrap_or(Subtask::None);
            return Progress::Failed { reason: format!("{subtask}: no end within {limit} s"), again: true };
        }
        Progress::Going
    }

    fn follow_prompt(
        &self,
        until: Answer,
        current: &Current,
        inputs: &SupervisorInputs<'_>,
        out: &mut SupervisorOutputs,
    ) -> Progress {
        let heard = (inputs.operator.prompt_id == self.prompt.id).then(|| inputs.operator.answer.get()).flatten();
        match heard {
            // An answer in between may have been overtaken by the last one.
            Some(answer) if answer == until || answer == Answer::Done => {
                self.answer(inputs, out);
                Progress::Done
            }
            Some(Answer::Declined) => {
                self.answer(inputs, out);
                Progress::failed("the person declined")
            }
            _ if current.began.age_at(self.now).as_secs_f64() > self.cell.supervisor.timeouts.answer_s => {
                self.no_answer(out);
                Progress::failed(NO_ANSWER)
            }
            _ => Progress::Going,
        }
    }

    fn operation_done(&mut self, current: &Current, out: &mut SupervisorOutputs) {
        let (subject, subtask) = current.operation.names();
        let clearance = current.clearance_min.is_finite().then(|| rounded(current.clearance_min));
        if current.clearance_min.is_finite() {
            self.work.clearance_min = self.work.clearance_min.min(current.clearance_min);
            let least = self.summary.min_clearance_m.unwrap_or(f64::INFINITY).min(rounded(current.clearance_min));
            self.summary.min_clearance_m = Some(least);
        }
        let moved = matches!(current.operation, Operation::Motion(_));
        self.say(
            out,
            EventKind::ActionDone {
                subject,
                subtask,
                part: self.part().name.clone(),
                duration_s: rounded(current.began.age_at(self.now).as_secs_f64()),
                clearance_min_m: clearance,
                planner: moved.then(|| current.planner.name()),
            },
        );
        if let Operation::Motion(task) = &current.operation {
            if task.action.is(tandem_msg::EffectorAction::Grasp) {
                self.surveyed.taken();
            }
        }
    }

    /// An attempt failed: once more, or by hand, or not at all.
    fn failed(&mut self, reason: String, again: bool, inputs: &SupervisorInputs<'_>, out: &mut SupervisorOutputs) {
        self.summary.steps_failed += 1;
        let no_answer = reason == NO_ANSWER;
        let (part, attempt) = (self.part().name.clone(), self.work.attempt);
        self.say(out, EventKind::Retry { part, attempt, reason: reason.clone() });
        if !matches!(self.prompt.kind.get(), None | Some(PromptKind::None)) {
            // Whoever is still at it is told to leave it.
            self.ask_person(PromptKind::None, Pose::IDENTITY, out);
        }
        if self.work.take_over.is_some() {
            // The last resort has failed.
            self.work.remark = format!("{}; {reason}", self.work.remark);
            self.work.ended = Some(StepState::Failed);
            self.write_down(StepState::Failed, out);
            if no_answer {
                let waiting_for = format!("a person to finish {} by hand", self.part().name);
                return self.end(Outcome::TimedOut { waiting_for });
            }
            self.box_failed = true;
            return self.go(Phase::Closing);
        }
        self.work.remark.clone_from(&reason);
        self.write_down(StepState::Failed, out);
        self.work.attempt += 1;
        self.work.begun = self.now;
        self.work.drop_operations();
        if !again || self.work.attempt > self.cell.supervisor.attempts_max {
            return self.hand_to_person(reason, out);
        }
        let grasp = self.work.verbs().iter().position(|verb| *verb == Verb::Grasp);
        match grasp {
            // With the part still in the tool only what comes after the grasp is done again.
            Some(grasp) if inputs.arm.effector.holding == 1 => {
                self.work.verb = grasp + 1;
                self.open(out);
            }
            _ => self.call_part(),
        }
    }

    /// The step is over, one way or the other.
    fn complete(&mut self, state: StepState, _inputs: &SupervisorInputs<'_>, out: &mut SupervisorOutputs) {
        let state = if self.work.take_over.is_some() { StepState::TakenOver } else { state };
        self.work.ended = Some(state);
        let index = self.work.index;
        self.surveyed.place(index, &self.cell.product.parts[index], &self.cell);
        self.write_down(state, out);
        self.go(Phase::Closing);
    }

    fn closing(&mut self, inputs: &SupervisorInputs<'_>, out: &mut SupervisorOutputs) {
        if inputs.journal_committed < self.journal_seq {
            if self.waited(self.cell.supervisor.timeouts.journal_s) {
                self.end_without_journal(out);
            }
            return;
        }
        let done = self.work.done(self.part(), self.number(), self.now);
        self.say(out, done);
        if self.box_failed {
            return self.end_box(out);
        }
        self.summary.steps_done += 1;
        let next = self.work.index + 1;
        if next < self.cell.product.parts.len() {
            self.begin_step(next, out);
        } else {
            self.end_box(out);
        }
    }

    fn end_box(&mut self, out: &mut SupervisorOutputs) {
        let duration_s = rounded(self.box_began.age_at(self.now).as_secs_f64());
        self.say(out, EventKind::BoxDone { number: self.number(), completed: !self.box_failed, duration_s });
        self.summary.boxes_completed += u32::from(!self.box_failed);
        self.box_index += 1;
        self.begin_box();
    }
}

const NO_ANSWER: &str = "nobody answered";

/// How an operation stands.
enum Progress {
    Going,
    Done,
    Failed {
        /// Why.
        reason: String,
        /// Whether doing it again may help.
        again: bool,
    },
}

impl Progress {
    fn failed(reason: &str) -> Self {
        Self::Failed { reason: reason.to_owned(), again: true }
    }
}
