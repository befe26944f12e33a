//! Boxes are assembled, by whom the capability check says, the same way for the same seed.

use std::collections::BTreeSet;

use tandem::strategy::StepState;
use tandem::supervisor::{EventKind, Outcome};

use crate::rig::{Rig, shipped};

/// Wherever the parts lie and whatever the person does: the box is complete, nothing was touched,
/// and the journal has one finished entry for every step.
#[test]
fn a_box_is_assembled_whatever_the_seed() {
    for (product, seed) in (1..=20).map(|seed| ("s471", seed)).chain((1..=10).map(|seed| ("s472", seed))) {
        let steps = shipped(product).product.parts.len();
        let mut rig = Rig::of(product, 1, seed);
        let outcome = rig.finish();
        let summary = rig.summary();
        assert_eq!(outcome, Outcome::Completed, "{product}, seed {seed}: {}", rig.tail());
        assert_eq!(summary.boxes_completed, 1, "{product}, seed {seed}: {summary:?}");
        assert_eq!(summary.contacts, 0, "{product}, seed {seed}: {summary:?}");
        assert!(
            summary.min_clearance_m.is_some_and(|clearance| clearance > 0.0),
            "{product}, seed {seed}: {summary:?}"
        );
        let journal = rig.journal();
        let finished: BTreeSet<u32> = journal
            .iter()
            .filter(|entry| entry.state != StepState::Started && entry.state != StepState::Failed)
            .map(|entry| entry.step)
            .collect();
        assert_eq!(finished.len(), steps, "{product}, seed {seed}: {journal:?}");
    }
}

/// One box needs the robot alone and all three forms in which a person is in the lead (Fig. 5).
#[test]
fn a_box_needs_every_form_of_cooperation() {
    let mut rig = Rig::new(1, 3);
    assert_eq!(rig.finish(), Outcome::Completed, "{}", rig.tail());
    let forms: BTreeSet<&str> = rig
        .events
        .iter()
        .filter_map(|event| match &event.kind {
            EventKind::StepDone { form, .. } => Some(*form),
            _ => None,
        })
        .collect();
    assert_eq!(forms.len(), 4, "{forms:?}");
}

/// Two runs of one seed tell the same story to the last digit; another seed tells another.
#[test]
fn a_seed_reproduces_its_run() {
    let story = |seed| {
        let mut rig = Rig::new(1, seed);
        rig.finish();
        (rig.events, rig.sim.summary())
    };
    let first = story(7);
    assert!(first == story(7), "the same seed told two stories");
    assert!(first != story(8), "two seeds told one story");
}

/// Several boxes in a row start from an empty fixture each.
#[test]
fn boxes_follow_one_another() {
    let mut rig = Rig::new(2, 11);
    assert_eq!(rig.finish(), Outcome::Completed, "{}", rig.tail());
    assert_eq!(rig.summary().boxes_completed, 2);
}
