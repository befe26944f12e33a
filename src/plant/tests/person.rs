//! The person: every prompt has its answer, and a body moves like one.

use super::*;

/// Alone: the person fetches the part from its station and assembles it, from either station.
#[test]
fn a_person_assembles_alone() {
    for name in ["sealing_ring", "fuse"] {
        let mut rig = Rig::new(10);
        let part = rig.part(name);
        rig.seat_all_before(part);
        rig.ask(RequestKind::Present, part);
        rig.tell(PromptKind::Assemble, part, &Isometry3::identity());
        assert_eq!(rig.until(Answer::Done, 60), [Answer::Started, Answer::Done], "{name}");
        assert_eq!(rig.plant.parts.place(part), Place::Product);
        let stand = Vector3::from(rig.out.human.stand);
        assert!((stand - Vector3::from(rig.cell.human.rest)).norm() < 0.02, "{name}: stepped back");
    }
    let mut rig = Rig::new(10);
    rig.tell(PromptKind::Assemble, 1, &Isometry3::identity());
    assert_eq!(rig.until(Answer::Declined, 60), [Answer::Started, Answer::Declined], "no part there");
}

/// Hand-over: the person takes hold, the tool lets go, the person finishes; nobody touches a moving arm.
#[test]
fn a_person_receives_a_part() {
    let mut rig = Rig::new(11);
    let part = rig.take("heat_guard_plate", Tool::ParallelGripper);
    rig.tcp_to(&rig.cell.layout.base_from_handover.clone());
    rig.tell(PromptKind::Receive, part, &rig.plant.parts.base_from_part(part));
    assert_eq!(rig.until(Answer::Holding, 60), [Answer::Started, Answer::Holding]);
    rig.cycles(2_000);
    assert_eq!(rig.plant.parts.place(part), Place::Tool, "they wait for the tool");
    assert_eq!(rig.act(EffectorAction::Release, Tool::None), Some(EffectorPhase::Done));
    assert_eq!(rig.plant.parts.place(part), Place::Person);
    assert_eq!(rig.until(Answer::Done, 60), [Answer::Holding, Answer::Done]);
    assert_eq!(rig.plant.parts.place(part), Place::Product);
    assert_eq!(rig.out.cell.contacts, 0);
}

/// Hold: the person fastens the part in the tool; let go of later, it stays in the product.
#[test]
fn a_person_assembles_what_the_robot_holds() {
    let mut rig = Rig::new(12);
    let part = rig.take("heat_guard_plate", Tool::ParallelGripper);
    rig.tcp_to(&rig.cell.layout.base_from_hold.clone());
    rig.tell(PromptKind::AssembleHeld, part, &rig.plant.parts.base_from_part(part));
    assert_eq!(rig.until(Answer::Done, 60), [Answer::Started, Answer::Done]);
    assert_eq!(rig.out.arm.effector.holding, 1);
    assert_eq!(rig.act(EffectorAction::Release, Tool::None), Some(EffectorPhase::Done));
    assert_eq!(rig.plant.parts.place(part), Place::Product);
    assert_eq!(rig.out.cell.contacts, 0);
}

/// A person tells what a part's feature is, if the part is there to be seen.
#[test]
fn a_person_identifies_a_presented_part() {
    let mut rig = Rig::new(13);
    let part = rig.part("fuse");
    rig.ask(RequestKind::Present, part);
    rig.tell(PromptKind::Identify, part, &Isometry3::identity());
    assert_eq!(rig.until(Answer::Done, 30), [Answer::Done]);
    assert!(rig.out.operator.class.is(tandem_msg::FeatureClass::ThreadedAxis));
    rig.tell(PromptKind::Identify, part - 1, &Isometry3::identity());
    assert_eq!(rig.until(Answer::Declined, 30), [Answer::Declined]);
    rig.tell(PromptKind::Inspect, part, &Isometry3::identity());
    assert_eq!(rig.until(Answer::Done, 30), [Answer::Started, Answer::Done]);
}

/// Taking over: out of the tool, from the station, from where it fell.
#[test]
fn a_person_finishes_what_the_robot_could_not() {
    for place in [Place::Tool, Place::Station, Place::Lost] {
        let mut rig = Rig::new(14);
        let part = rig.take("heat_guard_plate", Tool::ParallelGripper);
        if place == Place::Tool {
            rig.tcp_to(&rig.cell.layout.base_from_hold.clone());
        } else {
            rig.tcp_to(&(Isometry3::translation(0.1, 0.25, 0.25) * rig.plant.base_from_tcp));
            rig.act(EffectorAction::Release, Tool::None);
            rig.cycles(1_000);
            if place == Place::Station {
                rig.ask(RequestKind::Present, part);
            }
        }
        assert_eq!(rig.plant.parts.place(part), place);
        rig.tell(PromptKind::TakeOver, part, &Isometry3::identity());
        assert_eq!(rig.until(Answer::Done, 90), [Answer::Started, Answer::Done], "{place:?}");
        assert_eq!(rig.plant.parts.place(part), Place::Product, "{place:?}");
        assert_eq!(rig.out.arm.effector.holding, 0, "{place:?}");
    }
}

/// The tracked person keeps to what a body can do, and the velocities are those of the positions.
#[test]
fn a_tracked_person_moves_like_one() {
    let mut rig = Rig::new(15);
    let part = rig.part("sealing_ring");
    rig.ask(RequestKind::Present, part);
    rig.tell(PromptKind::Assemble, part, &Isometry3::identity());
    let (mut fastest_stand, mut fastest_hand): (f64, f64) = (0.0, 0.0);
    let mut before = Vector3::from(rig.out.human.stand);
    for _ in 0..12_000 {
        rig.cycle();
        let stand = Vector3::from(rig.out.human.stand);
        fastest_stand = fastest_stand.max((stand - before).norm() / 1e-3);
        before = stand;
        for capsule in &rig.out.human.capsules[..rig.out.human.capsule_count as usize] {
            fastest_hand = fastest_hand.max(Vector3::from(capsule.velocity).norm());
        }
    }
    assert!(fastest_stand > 0.5 && fastest_stand <= rig.cell.human.walk_speed + 1e-6, "{fastest_stand} m/s");
    assert!(fastest_hand <= rig.cell.human.walk_speed + rig.cell.human.reach_speed, "{fastest_hand} m/s");
}
