//! When the arm is asked to go at reduced speed: beside a person who takes a part from it, and where a person had to
//! look whether it may go on.
//!
//! The controller keeps the separation by itself, whatever is asked. This is for the steps in which the two
//! meet on purpose: the person shall see the arm come slowly, and the arm shall have little to brake.

use super::super::SupervisorInputs;
use super::super::actions::Operation;
use super::super::event::EventKind;
use super::{Supervisor, SupervisorOutputs};
use nalgebra::{Isometry3, Vector3};
use tandem_msg::{Coded, HumanState, RunMode, SafetyMode, Subtask};

/// Who stands this near to where the arm offers or holds a part is in the zone both work in, metres on the level; and
/// has left it when this much farther off.
const ZONE: f64 = 0.9;
const BAND: f64 = 0.1;

/// Why the arm goes at reduced speed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Caution {
    /// A person stands where it hands a part over or holds one for them.
    Beside,
    /// After a stop that a person had to look at, until the motion is done.
    Inspected,
}

impl Caution {
    fn name(self) -> &'static str {
        match self {
            Self::Beside => "a person is beside the arm",
            Self::Inspected => "first motion after an inspection",
        }
    }
}

impl Supervisor {
    /// How the arm may go in this cycle; says so when that changes.
    pub(super) fn pace(&mut self, inputs: &SupervisorInputs<'_>, out: &mut SupervisorOutputs) -> RunMode {
        let caution = self.caution_due(inputs);
        if caution != self.caution {
            let mode = if caution.is_some() { SafetyMode::Reduced } else { SafetyMode::Normal };
            self.say(out, EventKind::Mode { mode: mode.name(), reason: caution.map(Caution::name) });
            self.caution = caution;
        }
        if caution.is_some() { RunMode::Reduced } else { RunMode::Run }
    }

    fn caution_due(&self, inputs: &SupervisorInputs<'_>) -> Option<Caution> {
        let Operation::Motion(task) = &self.work.current.as_ref()?.operation else { return None };
        if self.inspected {
            return Some(Caution::Inspected);
        }
        let place = match task.subtask.get()? {
            Subtask::HandOver => &self.cell.layout.base_from_handover,
            Subtask::HoldStill => &self.cell.layout.base_from_hold,
            _ => return None,
        };
        let within = if self.caution == Some(Caution::Beside) { ZONE + BAND } else { ZONE };
        is_beside(inputs.human, place, within).then_some(Caution::Beside)
    }
}

/// Whether somebody stands nearer to a place than `within` metres on the level.
fn is_beside(human: &HumanState, place: &Isometry3<f64>, within: f64) -> bool {
    let level = (Vector3::from(human.stand) - place.translation.vector).xy().norm();
    // What is no number is not far.
    let far = level >= within;
    human.header.heard() && human.capsule_count > 0 && !far
}

#[cfg(test)]
mod tests {
    use super::*;
    use tandem_msg::{Header, Stamp};

    #[test]
    fn somebody_is_beside_the_arm_when_near_or_nowhere() {
        let place = Isometry3::translation(0.8, 0.2, 0.35);
        let mut human = HumanState { stand: [1.42, 0.15, -0.9], capsule_count: 10, ..HumanState::default() };
        assert!(!is_beside(&human, &place, ZONE), "never heard of");
        human.header = Header { seq: 1, stamp: Stamp(1), epoch: 1, config_hash: 0 };
        assert!(is_beside(&human, &place, ZONE));
        human.stand[0] = 1.95;
        assert!(!is_beside(&human, &place, ZONE));
        human.stand[0] = f64::NAN;
        assert!(is_beside(&human, &place, ZONE));
        human.capsule_count = 0;
        assert!(!is_beside(&human, &place, ZONE), "nobody is there");
    }
}
