//! People and a moving arm: it slows before it must stop, it stands before they can touch it, it
//! goes on when they have left, and it does not mind company while it stands.
#![allow(clippy::disallowed_types, clippy::disallowed_macros, reason = "tests may allocate and print")]

mod cell;

use cell::{Cell, down, task};
use proptest::prelude::*;
use tandem_msg::*;

/// Sends the arm back and forth for the given cycles.
fn shuttle(cell: &mut Cell, cycles: u64, id: &mut u32) {
    for _ in 0..cycles {
        if *id == 0 || matches!(cell.phase(), MotionPhase::Done | MotionPhase::Failed) {
            *id += 1;
            let goal = if *id % 2 == 1 { down(0.95, 0.45, 0.25, 0.0) } else { down(0.45, -0.50, 0.25, 0.0) };
            cell.give(task(*id, goal));
        }
        cell.step();
    }
}

/// At the credited 1.6 m/s, from every side: no contact while the arm moves, and no protective
/// stop either, because it has slowed down ahead of it; when the person leaves it goes on.
#[test]
fn a_person_walks_in_and_out() {
    for direction in 0..12 {
        let angle = f64::from(direction) * std::f64::consts::TAU / 12.0;
        let (x, y) = (angle.cos(), angle.sin());
        let mut cell = Cell::new();
        let mut id = 0;
        shuttle(&mut cell, 1_500, &mut id);
        cell.person_at(0.5 + 4.0 * x, 4.0 * y, [-1.6 * x, -1.6 * y, 0.0]);
        let mut slowest = 1.0_f64;
        for _ in 0..2_200 {
            shuttle(&mut cell, 1, &mut id);
            slowest = slowest.min(cell.status().speed);
        }
        assert_eq!(slowest, 0.0, "direction {direction}: the person stands in the arm's way");
        cell.human.capsules[0].velocity = [1.6 * x, 1.6 * y, 0.0];
        cell.human.capsules[1].velocity = [1.6 * x, 1.6 * y, 0.0];
        shuttle(&mut cell, 4_000, &mut id);
        assert!(cell.findings.separation_moving_min > 0.0, "direction {direction}: {:?}", cell.findings);
        assert_eq!(cell.status().stop_count, 0, "direction {direction}: slowed too late");
        assert!(cell.status().speed > 0.9, "direction {direction}: goes on");
        cell.assert_limits();
    }
}

/// A person who is suddenly there is a protective stop, ended by their leaving where the policy says so.
#[test]
fn a_person_who_appears_is_a_protective_stop() {
    let mut cell = Cell::new();
    cell.give(task(1, down(0.95, 0.50, 0.20, 0.0)));
    cell.until("under way", 5_000, |cell| cell.status().tcp_speed > 0.6);
    let at = cell.tcp().translation.vector;
    cell.person_at(at.x + 0.60, at.y + 0.2, [0.0; 3]);
    cell.step();
    assert_eq!((cell.stop(), cell.cause()), (StopState::Stopping, StopCause::Separation));
    cell.until("stopped", 500, |cell| cell.stop() == StopState::Stopped);
    assert!(cell.findings.separation_moving_min > 0.0);
    cell.run(1_000);
    assert_eq!((cell.stop(), cell.status().standstill), (StopState::Stopped, 1), "they are still there");
    cell.human.capsule_count = 0;
    cell.until("done", 10_000, |cell| cell.phase() == MotionPhase::Done);
    assert_eq!(cell.status().stop_count, 1);
    cell.assert_limits();
}

/// After a stop the arm stands a millimetre beside its goal, and a person holds the part: the tool lets
/// go all the same, and the arm does not move for it.
#[test]
fn a_tool_acts_beside_a_person_when_the_arm_is_near_enough() {
    let mut cell = Cell::new();
    assert_eq!(cell.perform(task(1, down(0.80, 0.20, 0.35, 0.0))), MotionPhase::Done);
    cell.person_at(1.35, 0.20, [0.0; 3]);
    cell.human.capsules[1].ends = [[0.85, 0.20, 0.33], [0.90, 0.20, 0.33]];
    let before = cell.tcp();
    let mut release = task(2, down(0.801, 0.20, 0.35, 0.0));
    (release.approach, release.retract) = (0.0, 0.0);
    release.action = EffectorAction::Release.into();
    cell.give(release);
    cell.until("done", 2_000, |cell| cell.phase() == MotionPhase::Done);
    assert!((cell.tcp().translation.vector - before.translation.vector).norm() < 1e-6);
}

/// Hand-over: somebody stands at the resting arm, hand at the tool. That is no stop; the arm waits with
/// its next motion until they have stepped back.
#[test]
fn a_resting_arm_has_company() {
    let mut cell = Cell::new();
    assert_eq!(cell.perform(task(1, down(0.80, 0.20, 0.35, 0.0))), MotionPhase::Done);
    cell.person_at(1.35, 0.20, [0.0; 3]);
    cell.human.capsules[1].ends = [[0.85, 0.20, 0.33], [0.90, 0.20, 0.33]];
    cell.run(500);
    assert_eq!((cell.stop(), cell.status().stop_count), (StopState::Running, 0));
    cell.give(task(2, down(0.45, -0.50, 0.25, 0.0)));
    cell.run(3_000);
    assert!(!cell.moving());
    assert_eq!((cell.status().speed, cell.status().stop_count), (0.0, 0));
    assert!(cell.status().separation < cell.status().separation_required, "{:?}", cell.status());
    cell.human.capsule_count = 0;
    cell.until("done", 10_000, |cell| cell.phase() == MotionPhase::Done);
    assert_eq!(cell.status().stop_count, 0);
    cell.assert_limits();
}

/// Nobody near: full speed. Somebody at the other end of the bench: slower. Nearer: slower still.
#[test]
fn the_arm_slows_with_the_distance() {
    let fastest = |x: f64| {
        let mut cell = Cell::new();
        cell.person_at(x, 0.6, [0.0; 3]);
        let mut id = 0;
        let mut fastest = 0.0_f64;
        for _ in 0..6_000 {
            shuttle(&mut cell, 1, &mut id);
            fastest = fastest.max(cell.status().tcp_speed);
        }
        assert_eq!(cell.status().stop_count, 0);
        fastest
    };
    let speeds = [4.0, 1.55, 1.5].map(fastest);
    assert!(speeds[0] > speeds[1] + 0.05 && speeds[1] > speeds[2] + 0.05, "{speeds:?}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 48, ..ProptestConfig::default() })]

    /// People who come from anywhere at up to 1.6 m/s, turn on the spot, and are seen late by up to
    /// ten periods: never a contact while the arm moves.
    #[test]
    fn nobody_is_touched_by_a_moving_arm(
        angle in 0.0..std::f64::consts::TAU,
        speed in 0.1..1.6f64,
        offset in -0.5..0.5f64,
        turns in prop::collection::vec((0.0..std::f64::consts::TAU, 100u64..900), 1..6),
        late in 0u64..10,
    ) {
        let mut cell = Cell::new();
        let mut id = 0;
        let (x, y) = (angle.cos(), angle.sin());
        cell.person_at(0.5 + 2.5 * x - offset * y, 2.5 * y + offset * x, [-speed * x, -speed * y, 0.0]);
        cell.late = late;
        shuttle(&mut cell, 1_200, &mut id);
        for (turn, cycles) in turns {
            for capsule in &mut cell.human.capsules[..2] {
                capsule.velocity = [speed * turn.cos(), speed * turn.sin(), 0.0];
            }
            shuttle(&mut cell, cycles, &mut id);
        }
        prop_assert!(cell.findings.separation_moving_min > 0.0, "{:?}", cell.findings);
        cell.assert_limits();
    }
}

/// The control of the test above: with the separation terms at nothing the same walk does touch.
#[test]
fn without_separation_there_is_contact() {
    let mut params = cell::params();
    params.separation.human_speed_min = 0.0;
    params.separation.intrusion = 0.0;
    params.separation.reserve = 0.0;
    params.separation.hysteresis = 0.0;
    params.separation.sigma_factor = 0.0;
    params.separation.arm_uncertainty = 0.0;
    let mut touched = false;
    for direction in 0..12 {
        let angle = f64::from(direction) * std::f64::consts::TAU / 12.0;
        let (x, y) = (angle.cos(), angle.sin());
        let mut cell = Cell::with(params);
        let mut id = 0;
        shuttle(&mut cell, 1_500, &mut id);
        cell.person_at(0.5 + 4.0 * x, 4.0 * y, [-1.6 * x, -1.6 * y, 0.0]);
        cell.blind = true;
        shuttle(&mut cell, 3_000, &mut id);
        touched |= cell.findings.separation_moving_min <= 0.0;
    }
    assert!(touched, "the referee sees nothing");
}
