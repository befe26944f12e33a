//! Tasks carried out by an arm that follows perfectly: they end where they should, keep every
//! limit in every cycle, and keep clear of the scene.
#![allow(clippy::disallowed_types, clippy::disallowed_macros, reason = "tests may allocate and print")]

mod cell;

use cell::{BENCH, BOX_WALL, Cell, down, put, task};
use proptest::prelude::*;
use tandem_msg::*;

fn assert_at(cell: &Cell, goal: &Pose) {
    let tcp = cell.tcp();
    for axis in 0..3 {
        let error = (tcp.translation.vector[axis] - goal.position[axis]).abs();
        assert!(error < 1e-5, "axis {axis}: {error} m off, {:?}", cell.status());
    }
}

#[test]
fn transfers_end_at_their_goals() {
    let mut cell = Cell::new();
    let goals = [
        down(0.35, -0.55, 0.20, 0.0),
        down(0.62, 0.0, 0.25, 1.0),
        down(0.95, 0.50, 0.20, -0.5),
        down(0.35, -0.55, 0.20, 2.0),
    ];
    for (id, goal) in (1..).zip(goals) {
        let end = cell.perform(task(id, goal));
        assert_eq!(end, MotionPhase::Done, "{:#?}", cell.status());
        assert_at(&cell, &goal);
        let status = cell.status();
        assert!(
            (status.elapsed - status.expected).abs() < 0.35,
            "{} s, expected {} s",
            status.elapsed,
            status.expected
        );
        assert!(status.elapsed < 4.0, "{} s", status.elapsed);
        assert!(status.clearance_min > 0.0, "{status:?}");
    }
    cell.assert_limits();
    assert!(cell.findings.clearance_min > 0.0, "{:?}", cell.findings);
    assert_eq!(cell.status().stop_count, 0);
}

/// Grasp at a carrier, carry, set down in the box between its walls, press in the same pose, withdraw, go home.
#[test]
fn a_part_is_taken_carried_and_seated() {
    const PART: u32 = 40;
    let mut cell = Cell::new();
    let part = AttachedPart {
        present: 1,
        half_extents: [0.05, 0.04, 0.01],
        tcp_from_part: Pose { position: [0.0, 0.0, 0.005], ..Pose::IDENTITY },
        mass: 0.5,
        ..AttachedPart::default()
    };
    put(&mut cell, PART, [0.35, -0.55, 0.05], [0.05, 0.04, 0.01]);
    let mut grasp = task(1, down(0.35, -0.55, 0.055, 0.0));
    grasp.subtask = Code::of(Subtask::Grasp);
    grasp.retract = 0.12;
    grasp.action = Code::of(EffectorAction::Grasp);
    grasp.attached_after = part;
    grasp.touch = [PART, 20, 0, 0, 0, 0, 0, 0];
    assert_eq!(cell.perform(grasp), MotionPhase::Done, "{:#?}", cell.status());
    assert_at(&cell, &down(0.35, -0.55, 0.175, 0.0));
    assert_eq!((cell.outputs.command.effector.id, cell.arm.effector.holding), (1, 1));

    // The part is no object of the scene any more.
    cell.scene.object_count -= 1;
    cell.scene.version += 1;
    let carried =
        |id, goal| MotionTask { attached_before: part, attached_after: part, scene_version: 2, ..task(id, goal) };
    let hover = down(0.62, 0.0, 0.17, 0.0);
    assert_eq!(cell.perform(carried(2, hover)), MotionPhase::Done, "{:#?}", cell.status());

    let mut place = carried(3, down(0.62, 0.0, 0.05, 0.0));
    place.approach = 0.12;
    place.subtask = Code::of(Subtask::Place);
    place.touch = [BENCH, BOX_WALL, BOX_WALL + 1, BOX_WALL + 2, BOX_WALL + 3, 0, 0, 0];
    assert_eq!(cell.perform(place), MotionPhase::Done, "{:#?}", cell.status());
    assert_eq!(cell.outputs.command.effector.id, 1, "keep is no action");

    let mut press = MotionTask { id: 4, retract: 0.12, ..place };
    press.subtask = Code::of(Subtask::Assemble);
    press.action = Code::of(EffectorAction::Seat);
    press.attached_after = AttachedPart::default();
    let began = cell.now;
    assert_eq!(cell.perform(press), MotionPhase::Done, "{:#?}", cell.status());
    assert_at(&cell, &hover);
    assert!(began.age_at(cell.now).as_secs_f64() < 1.5, "the arm stood at the goal already");

    let home = MotionTask { subtask: Code::of(Subtask::Home), scene_version: 2, ..task(5, Pose::IDENTITY) };
    assert_eq!(cell.perform(home), MotionPhase::Done, "{:#?}", cell.status());
    for (commanded, home) in cell.outputs.command.position.iter().zip(cell::HOME) {
        assert!((commanded - home).abs() < 1e-6);
    }
    cell.assert_limits();
    assert_eq!(cell.status().stop_count, 0);
}

/// After a release without retract the tool stands in contact; the next task may leave it, straight back.
#[test]
fn a_contact_can_be_left() {
    let mut cell = Cell::new();
    let low = MotionTask { touch: [20, 0, 0, 0, 0, 0, 0, 0], ..task(1, down(0.35, -0.55, 0.035, 0.0)) };
    assert_eq!(cell.perform(low), MotionPhase::Done, "{:#?}", cell.status());
    let goal = down(0.62, 0.0, 0.30, 0.0);
    assert_eq!(cell.perform(task(2, goal)), MotionPhase::Done, "{:#?}", cell.status());
    assert_at(&cell, &goal);

    // The same with a controller that does not know what was touched.
    let mut stranded = Cell::new();
    stranded.arm.position = {
        let mut other = Cell::new();
        other.perform(low);
        other.arm.position
    };
    assert_eq!(stranded.perform(task(2, goal)), MotionPhase::Done, "{:#?}", stranded.status());
    cell.assert_limits();
    stranded.assert_limits();
}

/// What goes wrong, what it is called, and how it is brought about.
type Case = (&'static str, MotionFailure, fn(&mut Cell) -> MotionTask);

/// Each way a task can fail has its name, and the arm stays where it can go on from.
#[test]
fn failures_are_named() {
    let cases: [Case; 8] = [
        ("beyond reach", MotionFailure::Unreachable, |_| task(1, down(2.0, 0.0, 0.3, 0.0))),
        ("inside the bench", MotionFailure::NoClearPath, |_| task(1, down(0.6, 0.3, -0.05, 0.0))),
        ("not a number", MotionFailure::InvalidTask, |_| task(1, down(f64::NAN, 0.0, 0.3, 0.0))),
        ("no speed", MotionFailure::InvalidTask, |_| MotionTask { speed: 0.0, ..task(1, down(0.6, 0.0, 0.3, 0.0)) }),
        ("unknown action", MotionFailure::InvalidTask, |_| MotionTask {
            action: Code::from_raw(77),
            ..task(1, down(0.6, 0.0, 0.3, 0.0))
        }),
        ("nothing gripped", MotionFailure::ActionFailed, |cell| {
            cell.effector_fails = true;
            MotionTask { action: Code::of(EffectorAction::Grasp), ..task(1, down(0.6, 0.0, 0.3, 0.0)) }
        }),
        ("tool silent", MotionFailure::ActionTimeout, |cell| {
            cell.tamper = Some(|arm, _, _, _, _| arm.effector.command_id = 0);
            MotionTask { action: Code::of(EffectorAction::Grasp), ..task(1, down(0.6, 0.0, 0.3, 0.0)) }
        }),
        ("part gone", MotionFailure::PartLost, |_| {
            let part = AttachedPart { present: 1, half_extents: [0.02; 3], ..AttachedPart::default() };
            MotionTask { attached_before: part, attached_after: part, ..task(1, down(0.6, 0.0, 0.3, 0.0)) }
        }),
    ];
    for (what, failure, prepare) in cases {
        let mut cell = Cell::new();
        let given = prepare(&mut cell);
        assert_eq!(cell.perform(given), MotionPhase::Failed, "{what}");
        assert_eq!(cell.status().failure.get(), Some(failure), "{what}");
        assert_eq!(cell.status().stop_count, 0, "{what}");
        assert!(!cell.moving(), "{what}");
        cell.tamper = None;
        cell.run(200);
        let end = cell.perform(task(2, down(0.62, 0.1, 0.35, 0.0)));
        assert_eq!(end, MotionPhase::Done, "after {what}: {:#?}", cell.status());
        cell.assert_limits();
    }
}

/// An obstacle between start and goal is gone around; the lowest clearance on the way says so.
#[test]
fn a_blocked_way_is_gone_around() {
    let mut cell = Cell::new();
    assert_eq!(cell.perform(task(1, down(0.35, -0.55, 0.15, 0.0))), MotionPhase::Done);
    put(&mut cell, 50, [0.65, -0.28, 0.25], [0.4, 0.02, 0.25]);
    let goal = down(0.62, 0.1, 0.25, 0.0);
    assert_eq!(
        cell.perform(MotionTask { scene_version: 2, ..task(2, goal) }),
        MotionPhase::Done,
        "{:#?}",
        cell.status()
    );
    assert_at(&cell, &goal);
    assert!(cell.status().clearance_min > 0.002);
    cell.assert_limits();
}

/// A new task replaces the old one: stop on the path, then the new goal.
#[test]
fn a_new_number_replaces_the_task() {
    let mut cell = Cell::new();
    cell.give(task(1, down(0.95, 0.50, 0.20, 0.0)));
    cell.until("under way", 5_000, |cell| cell.status().tcp_speed > 0.5);
    let goal = down(0.35, -0.55, 0.20, 0.0);
    assert_eq!(cell.perform(task(2, goal)), MotionPhase::Done);
    assert_at(&cell, &goal);
    cell.assert_limits();
    assert_eq!(cell.status().stop_count, 0);
}

/// Pause stops on the path within the time a stop takes, run goes on, and nothing is latched.
#[test]
fn pause_and_halt_stop_and_run_goes_on() {
    for mode in [RunMode::Pause, RunMode::Halt] {
        let mut cell = Cell::new();
        let goal = down(0.95, 0.50, 0.20, 0.0);
        cell.give(task(1, goal));
        cell.until("under way", 5_000, |cell| cell.status().tcp_speed > 0.5);
        cell.task.run = Code::of(mode);
        let cycles = cell.until("standing", 600, |cell| cell.status().standstill == 1);
        assert!(cycles > 20, "{mode}: {cycles} cycles is no jerk-limited stop");
        let at = cell.outputs.command.position;
        cell.run(500);
        assert_eq!(cell.outputs.command.position, at, "{mode}");
        assert_eq!((cell.stop(), cell.status().stop_count), (StopState::Running, 0));
        cell.task.run = Code::of(RunMode::Run);
        cell.until("done", 10_000, |cell| cell.phase() == MotionPhase::Done);
        assert_at(&cell, &goal);
        cell.assert_limits();
    }
}

/// On the approach and on the withdrawal the TCP stays on its line and keeps its direction.
#[test]
fn straight_stretches_are_straight() {
    let mut cell = Cell::new();
    let goal = down(0.55, -0.30, 0.15, 0.7);
    let mut there = task(1, goal);
    there.approach = 0.20;
    there.retract = 0.25;
    there.action = Code::of(EffectorAction::Screw);
    cell.give(there);
    let (mut off, mut turned, mut samples) = (0.0_f64, 0.0_f64, 0);
    while cell.phase() != MotionPhase::Done {
        cell.step();
        if matches!(cell.phase(), MotionPhase::Approach | MotionPhase::Retract) {
            let tcp = cell.tcp();
            off = off.max((tcp.translation.vector.xy() - nalgebra::Vector2::new(0.55, -0.30)).norm());
            turned = turned.max((tcp.rotation * nalgebra::Vector3::z() + nalgebra::Vector3::z()).norm());
            samples += 1;
        }
        assert!(cell.cycle < 20_000, "{:#?}", cell.status());
    }
    assert!(samples > 500 && off < 5e-5 && turned < 2e-4, "{samples} samples, {off} m off, {turned} rad turned");
    cell.assert_limits();
}

/// The share of speed that a task asks for is kept.
#[test]
fn a_slow_task_is_slow() {
    let mut fast = Cell::new();
    let mut slow = Cell::new();
    fast.perform(task(1, down(0.95, 0.50, 0.20, 0.0)));
    slow.perform(MotionTask { speed: 0.25, ..task(1, down(0.95, 0.50, 0.20, 0.0)) });
    assert!(slow.status().elapsed > 1.8 * fast.status().elapsed);
    slow.assert_limits();
    assert!(slow.findings.velocity_excess < 0.30 - 1.0, "{:?}", slow.findings);
}

/// Something new on the remaining path: the arm stops short of it, plans anew and arrives.
#[test]
fn a_scene_that_changes_ahead_is_planned_around() {
    let mut cell = Cell::new();
    assert_eq!(cell.perform(task(1, down(0.35, -0.55, 0.15, 0.0))), MotionPhase::Done);
    let goal = down(0.95, 0.45, 0.15, 0.0);
    cell.give(task(2, goal));
    cell.until("on the way across", 5_000, |cell| {
        cell.phase() == MotionPhase::Transfer && cell.tcp().translation.y > -0.40
    });
    put(&mut cell, 50, [0.85, 0.25, 0.15], [0.10, 0.02, 0.15]);
    cell.until("done", 20_000, |cell| cell.phase() == MotionPhase::Done);
    assert_at(&cell, &goal);
    assert_eq!(cell.status().stop_count, 0);
    cell.assert_limits();
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    /// Random goals one after the other: done or a named failure, never a limit broken, never a contact.
    #[test]
    fn random_goals_are_safe(goals in prop::collection::vec((0.2..1.1f64, -0.7..0.7f64, -0.02..0.5f64, -3.0..3.0f64, 0.2..1.0f64), 1..5)) {
        let mut cell = Cell::new();
        for (id, (x, y, z, turn, speed)) in (1..).zip(goals) {
            let goal = down(x, y, z, turn);
            let end = cell.perform(MotionTask { speed, ..task(id, goal) });
            if end == MotionPhase::Done {
                assert_at(&cell, &goal);
            }
            prop_assert!(cell.findings.clearance_min >= 0.0, "{:?} at {goal:?}", cell.findings);
        }
        cell.assert_limits();
        prop_assert_eq!(cell.status().stop_count, 0);
    }
}
