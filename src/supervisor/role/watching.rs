//! What is watched in every cycle, whatever the role is at: the other roles and the stop.

use super::super::actions::Operation;
use super::super::event::{EventKind, Outcome, rounded};
use super::super::watch::{RoleNews, RoleWatch, StopNews, StopPolicy};
use super::super::{SupervisorInputs, SupervisorOutputs};
use super::{Phase, Supervisor};
use std::time::Duration;
use tandem_msg::{Answer, Code, Coded, Pose, PromptKind, Role, RunMode};

impl Supervisor {
    /// Whether everybody is there; otherwise the arm is held until they are.
    pub(super) fn watch_roles(&mut self, inputs: &SupervisorInputs<'_>, out: &mut SupervisorOutputs) -> bool {
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
    pub(super) fn watch_stop(&mut self, inputs: &SupervisorInputs<'_>, out: &mut SupervisorOutputs) -> bool {
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
                self.inspected = true;
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
}
