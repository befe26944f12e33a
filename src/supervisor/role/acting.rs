//! Carrying out a strategy's actions, and what follows when one fails.

use super::super::actions::{Means, Operation, release};
use super::super::event::{EventKind, Outcome, led, rounded};
use super::super::step::Current;
use super::super::{SupervisorInputs, SupervisorOutputs};
use super::{Phase, Supervisor};
use crate::strategy::StepState;
use std::time::Duration;
use tandem_config::{Form, Verb};
use tandem_msg::{
    Answer, ChangeReason, Code, Coded, EffectorAction, MotionFailure, MotionPhase, MotionTask, Planner, Pose,
    PromptKind, RunMode, StopState, Subtask, Tool,
};

impl Supervisor {
    pub(super) fn act(&mut self, inputs: &SupervisorInputs<'_>, passed: Duration, out: &mut SupervisorOutputs) {
        if self.work.current.is_none() && !self.next_operation(inputs, out) {
            return self.complete(out);
        }
        let Some(mut current) = self.work.current.take() else { return };
        let planner = current.planner;
        let result = match current.operation.clone() {
            Operation::Motion(task) => self.follow_motion(&task, &mut current, inputs, passed),
            Operation::Ask { until, .. } | Operation::Await { until, .. } => {
                self.follow_prompt(until, &current, inputs, out)
            }
        };
        if current.planner != planner
            && let Some(from) = self.fell_back_from(&current)
        {
            self.summary.fallbacks += 1;
            let (_, subtask) = current.operation.names();
            let (part, planner) = (self.part().name.clone(), current.planner.name());
            self.say(out, EventKind::Fallback { subtask, part, from: from.name(), planner });
        }
        if inputs.motion.task_id == self.task.id && inputs.motion.changes > self.changes {
            self.way_changed(&current, inputs, out);
        }
        self.changes = inputs.motion.changes;
        match result {
            Progress::Going => self.work.current = Some(current),
            Progress::Done => self.operation_done(&current, out),
            Progress::Failed { reason, again } => self.failed(reason, again, inputs, out),
        }
    }

    fn way_changed(&mut self, current: &Current, inputs: &SupervisorInputs<'_>, out: &mut SupervisorOutputs) {
        let reason = inputs.motion.change_reason.get().unwrap_or(ChangeReason::None).name();
        let planner = inputs.motion.planner.get().unwrap_or(Planner::None).name();
        self.summary.ways_changed += 1;
        let (_, subtask) = current.operation.names();
        let part = self.part().name.clone();
        self.say(out, EventKind::WayChanged { subtask, part, reason, planner });
    }

    /// The planner that should have found the way of a motion, where the next one had to.
    fn fell_back_from(&self, current: &Current) -> Option<Planner> {
        let Operation::Motion(task) = &current.operation else { return None };
        match current.planner {
            Planner::RrtConnect => Some(Planner::Manual),
            Planner::Manual => {
                let subtask = task.subtask.get().unwrap_or(Subtask::None);
                tandem_controller::policy_for(&self.cell.policies, subtask).map(|_| Planner::Policy)
            }
            Planner::None | Planner::Policy | Planner::Straight => None,
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
                    let grasped = task.action.is(EffectorAction::Grasp);
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
        self.summary.planned.count(current.planner, current.led_by);
        self.inspected &= !moved;
        self.say(
            out,
            EventKind::ActionDone {
                subject,
                subtask,
                part: self.part().name.clone(),
                duration_s: rounded(current.began.age_at(self.now).as_secs_f64()),
                clearance_min_m: clearance,
                planner: moved.then(|| current.planner.name()),
                policies: Subtask::ALL
                    .iter()
                    .filter(|subtask| led(current.led_by, **subtask))
                    .map(|subtask| subtask.name())
                    .collect(),
            },
        );
        if matches!(&current.operation, Operation::Motion(task) if task.action.is(EffectorAction::Grasp)) {
            self.surveyed.taken();
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
    fn complete(&mut self, out: &mut SupervisorOutputs) {
        let state = if self.work.take_over.is_some() { StepState::TakenOver } else { StepState::Done };
        self.work.ended = Some(state);
        let index = self.work.index;
        self.surveyed.place(index, &self.cell.product.parts[index], &self.cell);
        self.write_down(state, out);
        self.go(Phase::Closing);
    }

    pub(super) fn closing(&mut self, inputs: &SupervisorInputs<'_>, out: &mut SupervisorOutputs) {
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
