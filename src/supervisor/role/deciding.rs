//! Who does a step, in which mode, with which tool and by which strategy; then the journal is opened.

use super::super::actions::Operation;
use super::super::capability::{Demand, judge as judge_capability};
use super::super::event::{EventKind, rounded};
use super::super::look::Recognised;
use super::super::{SupervisorInputs, SupervisorOutputs};
use super::{Phase, Supervisor};
use crate::strategy::{Seen, Situation, StepState, join};
use tandem_config::pose_of;
use tandem_msg::{Answer, Coded, MotionTask, PromptKind};

impl Supervisor {
    /// Capability, mode and tool, strategy; then the journal is opened.
    pub(super) fn decide(&mut self, seen: Recognised, out: &mut SupervisorOutputs) {
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
    pub(super) fn hand_to_person(&mut self, reason: String, out: &mut SupervisorOutputs) {
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

    pub(super) fn open(&mut self, out: &mut SupervisorOutputs) {
        self.write_down(StepState::Started, out);
        self.go(Phase::Opening);
    }

    pub(super) fn opening(&mut self, inputs: &SupervisorInputs<'_>, out: &mut SupervisorOutputs) {
        if inputs.journal_committed >= self.journal_seq {
            self.go(Phase::Acting);
        } else if self.waited(self.cell.supervisor.timeouts.journal_s) {
            self.end_without_journal(out);
        }
    }
}
