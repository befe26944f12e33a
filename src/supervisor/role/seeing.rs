//! Having a part presented, looked at, and asked about.

use super::super::event::EventKind;
use super::super::look::{self, Doubt, Recognised};
use super::super::placing::nominal_at_station;
use super::super::step::Work;
use super::super::{Outcome, SupervisorInputs, SupervisorOutputs};
use super::{Phase, Question, Supervisor};
use tandem_config::pose_of;
use tandem_msg::{Answer, Code, Coded, PromptKind, RequestKind};

impl Supervisor {
    pub(super) fn begin_step(&mut self, index: usize, out: &mut SupervisorOutputs) {
        self.work = Work::new(index, self.now);
        self.stop.new_step();
        let (part, label) = (self.part().name.clone(), self.part().label.clone());
        self.say(out, EventKind::StepStarted { number: self.number(), step: index + 1, part, label });
        self.call_part();
    }

    /// Has the part brought to its station, a fresh one if the last was lost.
    pub(super) fn call_part(&mut self) {
        self.surveyed.taken();
        self.work.looks = 0;
        self.work.seen = None;
        self.ask_peripherals(RequestKind::Present);
        self.go(Phase::Present);
    }

    pub(super) fn look_again(&mut self) {
        self.ask_peripherals(RequestKind::Rescan);
        self.go(Phase::Present);
    }

    pub(super) fn present(&mut self, inputs: &SupervisorInputs<'_>, out: &mut SupervisorOutputs) {
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

    pub(super) fn recognise(&mut self, inputs: &SupervisorInputs<'_>, out: &mut SupervisorOutputs) {
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

    pub(super) fn hear_about_part(
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
}
