//! The plant with the real controller and supervisor around it. In perception's
//! place stands the truth, so what fails here is not for want of sight.

use tandem_controller::{Controller, ControllerInputs, ControllerOutputs};
use tandem_msg::{Feature, Measured, Message, Recognition};

use super::*;
use crate::strategy::Library;
use crate::supervisor::{
    Event, EventKind, Outcome, RoleHealth, RunOptions, Supervisor, SupervisorInputs, SupervisorOutputs,
};

/// Stamps what a role has written.
fn send(message: &mut impl Message, now: Stamp, config_hash: u64) {
    let header = message.header_mut();
    *header = Header { epoch: 1, config_hash, ..header.next(now) };
}

/// What a faultless eye makes of the presented part.
fn truth(plant: &Plant, cell: &Cell) -> Feature {
    let mut feature = Feature { request: plant.feeder.scan_request(), ..Feature::default() };
    if let Some(part) = plant.feeder.presented() {
        let shown = &cell.product.parts[part];
        let exactly = |value| Measured { value, sigma: 1e-5 };
        feature.recognition = Recognition::Sure.into();
        feature.class = shown.feature.class.into();
        feature.probabilities[shown.feature.class as usize] = 1.0;
        feature.dimensions.diameter = exactly(shown.feature.diameter);
        feature.dimensions.depth = exactly(shown.feature.depth);
        feature.dimensions.length = exactly(shown.feature.length);
        feature.dimensions.width = exactly(shown.feature.width);
        feature.dimensions.pitch = exactly(shown.feature.pitch);
        feature.base_from_feature = pose_of(&(plant.parts.base_from_part(part) * shown.part_from_feature));
    }
    feature
}

/// Assembles boxes until the supervisor is done; what it told, and the plant's last word.
fn assemble(seed: u64, boxes: u32) -> (Outcome, Vec<Event>, PlantOutputs) {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/cells/s471.toml");
    let cell = Cell::load(&file, None).expect("the shipped cell loads");
    let mut plant = Plant::new(&cell, seed).expect("a plant");
    let mut controller =
        Controller::new(cell.robot.chain, cell.robot.body, cell.controller).expect("the shipped parameters");
    let options = RunOptions { boxes, seed, run_id: "plant-test".into() };
    let mut supervisor = Supervisor::new(&cell, Library::new(cell.strategies.clone()), options);
    let mut p = PlantOutputs::default();
    let mut c = ControllerOutputs::default();
    let mut s = SupervisorOutputs::default();
    let mut feature = Feature::default();
    let mut look_ends = None;
    let mut events = Vec::new();
    let mut committed = 0;
    for millisecond in 0..boxes as u64 * 600_000 {
        let now = Stamp(millisecond * 1_000_000);
        plant.cycle(now, &PlantInputs { command: &c.command, request: &s.request, prompt: &s.prompt }, &mut p);
        send(&mut p.arm, now, cell.hash);
        send(&mut p.human, now, cell.hash);
        send(&mut p.cell, now, cell.hash);
        send(&mut p.operator, now, cell.hash);
        if p.scan_due {
            look_ends = Some(millisecond + 50);
        }
        let now = Stamp(now.0 + 200_000);
        controller.cycle(
            now,
            &ControllerInputs { arm: &p.arm, human: &p.human, scene: &s.scene, task: &s.task },
            &mut c,
        );
        send(&mut c.command, now, cell.hash);
        send(&mut c.status, now, cell.hash);
        if look_ends == Some(millisecond) {
            let header = feature.header;
            feature = Feature { header, ..truth(&plant, &cell) };
            send(&mut feature, now, cell.hash);
        }
        if millisecond % 10 == 0 {
            let now = Stamp(now.0 + 200_000);
            let inputs = SupervisorInputs {
                arm: &p.arm,
                human: &p.human,
                feature: &feature,
                motion: &c.status,
                operator: &p.operator,
                cell: &p.cell,
                roles: [RoleHealth::Up; 4],
                journal_committed: committed,
                halt: false,
            };
            supervisor.cycle(now, &inputs, &mut s);
            send(&mut s.task, now, cell.hash);
            send(&mut s.scene, now, cell.hash);
            send(&mut s.prompt, now, cell.hash);
            send(&mut s.request, now, cell.hash);
            committed = s.journal.last().map_or(committed, |entry| entry.seq);
            s.journal.clear();
            events.append(&mut s.events);
            if let Some(outcome) = s.finished.take() {
                return (outcome, events, p);
            }
        }
    }
    panic!("seed {seed}: the run does not end; {:?} {:?} {:?}", c.status, s.task, events.last());
}

/// Boxes are finished to the last part, every part where it belongs, and nothing is touched on the way.
#[test]
fn a_box_is_assembled_without_a_contact() {
    for seed in [1, 5] {
        let (outcome, events, last) = assemble(seed, 1);
        assert_eq!(outcome, Outcome::Completed, "seed {seed}: {:?}", events.last());
        assert_eq!((last.cell.contacts, last.cell.parts_seated), (0, 10), "seed {seed}");
        let finished = events.iter().any(|event| matches!(event.kind, EventKind::BoxDone { completed: true, .. }));
        assert!(finished, "seed {seed}: {events:?}");
    }
}
