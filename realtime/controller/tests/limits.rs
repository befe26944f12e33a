//! Limits besides those of the joints: walls, reduced speed, contact speed, and the way back from beyond them.
#![allow(clippy::disallowed_types, clippy::disallowed_macros, reason = "tests may allocate and print")]

mod cell;

use cell::{Cell, down, task};
use tandem_controller::{Params, Wall, Workspace};
use tandem_msg::*;

/// Highest TCP speed while the task is carried out.
fn fastest(cell: &mut Cell, task: MotionTask) -> f64 {
    let id = task.id;
    cell.give(task);
    let mut fastest = 0.0_f64;
    for _ in 0..30_000 {
        cell.step();
        fastest = fastest.max(cell.status().tcp_speed);
        if cell.status().task_id == id && matches!(cell.phase(), MotionPhase::Done | MotionPhase::Failed) {
            break;
        }
    }
    assert_eq!(cell.phase(), MotionPhase::Done, "{:#?}", cell.status());
    fastest
}

/// A goal behind a wall has no path; one before it has, and no part of the arm passes the wall on the way.
#[test]
fn a_wall_is_kept() {
    let wall = Wall { point: [0.0, 0.30, 0.0], inwards: [0.0, -1.0, 0.0] };
    let workspace = Workspace::new(&[wall]).expect("a wall");
    let mut cell = Cell::with(Params { workspace, ..cell::params() });
    assert_eq!(cell.perform(task(1, down(0.60, 0.0, 0.30, 0.0))), MotionPhase::Done);
    assert_eq!(cell.perform(task(2, down(0.60, 0.45, 0.30, 0.0))), MotionPhase::Failed);
    assert_eq!(cell.status().failure.get(), Some(MotionFailure::NoClearPath));
    assert_eq!(cell.perform(task(3, down(0.60, 0.20, 0.30, 0.0))), MotionPhase::Done);
    assert_eq!(cell.status().stop_count, 0);
    assert!(cell.status().clearance_min > 0.0, "{:?}", cell.status());
}

/// An arm that is found beyond a wall comes back from there, and never goes farther out.
#[test]
fn an_arm_beyond_a_wall_comes_back() {
    let mut other = Cell::new();
    assert_eq!(other.perform(task(1, down(0.60, 0.25, 0.30, 0.0))), MotionPhase::Done);
    let wall = Wall { point: [0.0, 0.27, 0.0], inwards: [0.0, -1.0, 0.0] };
    let workspace = Workspace::new(&[wall]).expect("a wall");
    let mut cell = Cell::with(Params { workspace, ..cell::params() });
    cell.arm.position = other.arm.position;
    cell.run(20);
    let start = cell.status().clearance;
    assert!(start < 0.0, "{start}");
    // Where it goes from there is the planner's to say.
    cell.perform(task(2, down(0.60, 0.0, 0.30, 0.0)));
    assert!(cell.status().clearance >= cell::params().path_margin, "{:?}", cell.status());
    assert!(cell.status().clearance_min >= start - 1e-3, "{:?}", cell.status());
    assert_eq!(cell.status().stop_count, 0);
    cell.assert_limits();
}

/// Reduced by request: no faster than the limit, and the task is done all the same. Asked for on the
/// way the arm slows down within half a second and keeps to it; then it is free again.
#[test]
fn reduced_mode_is_slow() {
    let goal = down(0.95, 0.45, 0.25, 0.0);
    let reduced = |id, goal| MotionTask { run: Code::of(RunMode::Reduced), ..task(id, goal) };
    let mut cell = Cell::new();
    assert!(fastest(&mut cell, reduced(1, goal)) <= 0.25 * 1.001);
    assert_eq!(cell.status().mode.get(), Some(SafetyMode::Reduced));
    assert!(fastest(&mut cell, task(2, down(0.45, -0.50, 0.25, 0.0))) > 0.6);
    cell.give(task(3, goal));
    cell.until("fast", 5_000, |cell| cell.status().tcp_speed > 0.6);
    cell.task.run = Code::of(RunMode::Reduced);
    cell.run(500);
    for _ in 0..200 {
        cell.step();
        assert!(cell.status().tcp_speed <= 0.25 * 1.001, "{}", cell.status().tcp_speed);
    }
    assert!(cell.moving());
    cell.task.run = Code::of(RunMode::Run);
    cell.until("done", 20_000, |cell| cell.phase() == MotionPhase::Done);
    assert_eq!(cell.status().mode.get(), Some(SafetyMode::Normal));
    assert_eq!(cell.status().stop_count, 0);
    cell.assert_limits();
}

/// Reduced by trigger: somebody within the distance, though far beyond what they are owed.
#[test]
fn a_person_in_view_reduces_the_speed() {
    let mut cell = Cell::with(Params { reduced_within: 3.0, ..cell::params() });
    cell.person_at(3.2, 0.0, [0.0; 3]);
    assert!(fastest(&mut cell, task(1, down(0.95, 0.45, 0.25, 0.0))) <= 0.25 * 1.001);
    cell.human.capsule_count = 0;
    cell.run(1_000);
    assert!(fastest(&mut cell, task(2, down(0.45, -0.50, 0.25, 0.0))) > 0.6);
}

/// At a person in a hand-over the arm is no faster than a hand bears: the more it carries the slower.
#[test]
fn a_hand_over_is_as_slow_as_hands_bear() {
    let speed = |mass: f64, subtask| {
        let mut cell = Cell::with(Params { line_speed_max: 1.0, moving_mass: mass, ..cell::params() });
        let offer = MotionTask { subtask: Code::of(subtask), approach: 0.45, ..task(1, down(0.70, 0.20, 0.15, 0.0)) };
        assert_eq!(
            cell.perform(MotionTask { approach: 0.0, ..task(9, down(0.70, 0.20, 0.60, 0.0)) }),
            MotionPhase::Done
        );
        fastest(&mut cell, MotionTask { id: 10, ..offer })
    };
    let bears = |mass| tandem_clearance::pfl::contact_speed_max(BodyPart::Forearm, mass, 0.0, true);
    eprintln!("{} {} {}", speed(200.0, Subtask::HandOver), speed(200.0, Subtask::Transfer), bears(200.0));
    assert!(speed(200.0, Subtask::HandOver) <= bears(200.0) * 1.001);
    assert!(speed(200.0, Subtask::Transfer) > bears(200.0));
}

/// A joint that stands outside its range comes back into it, slowly and without going farther out, and then works.
#[test]
fn an_arm_out_of_range_comes_back() {
    let mut cell = Cell::new();
    let limit = std::f64::consts::TAU;
    cell.arm.position[5] = limit + 0.05;
    cell.run(20);
    cell.give(task(1, down(0.60, 0.20, 0.30, 0.0)));
    let mut farthest = 0.0_f64;
    let mut recovered = false;
    for _ in 0..20_000 {
        cell.step();
        farthest = farthest.max(cell.outputs.command.position[5]);
        if cell.status().mode.is(SafetyMode::Recovery) && cell.moving() {
            recovered = true;
            assert!(cell.outputs.command.velocity.iter().all(|v| v.abs() <= 0.33), "slowly");
        }
        if matches!(cell.phase(), MotionPhase::Done | MotionPhase::Failed) {
            break;
        }
    }
    assert_eq!(cell.phase(), MotionPhase::Done, "{:#?}", cell.status());
    assert_eq!(cell.status().stop_count, 0);
    assert!(recovered && farthest <= limit + 0.05 + 1e-9, "{farthest}");
    cell.assert_limits();
}

/// Something has come to lie against the arm. Once reset it frees itself, slowly, never nearer to it than it
/// was.
#[test]
fn an_arm_in_contact_frees_itself() {
    let mut cell = Cell::new();
    assert_eq!(cell.perform(task(1, down(0.60, 0.20, 0.35, 0.0))), MotionPhase::Done);
    let forearm = cell.chain.forward(&cell.arm.position).base_from_link[3];
    let beside = forearm * nalgebra::Point3::new(-0.28, 0.07, 0.07);
    let index = cell.scene.object_count as usize;
    cell.scene.objects[index] = SceneObject {
        id: 60,
        shape: Code::of(ShapeKind::Sphere),
        size: [0.05, 0.0, 0.0],
        base_from_object: Pose { position: beside.coords.into(), ..Pose::IDENTITY },
    };
    cell.scene.object_count += 1;
    cell.scene.version += 1;
    cell.run(20);
    let start = cell.status().clearance;
    assert!(start < 0.0, "{start}");
    cell.give(MotionTask { scene_version: 2, ..task(2, down(0.45, -0.50, 0.25, 0.0)) });
    let mut slow = true;
    let mut least = f64::INFINITY;
    let mut recovered = 0;
    for _ in 0..60_000 {
        cell.step();
        if cell.status().mode.is(SafetyMode::Recovery) && cell.moving() {
            recovered += 1;
            slow &= cell.status().tcp_speed <= 0.051;
        }
        least = least.min(cell.status().clearance);
        if matches!(cell.phase(), MotionPhase::Done | MotionPhase::Failed) {
            break;
        }
    }
    assert!(cell.status().clearance >= cell::params().path_margin, "{:?}", cell.status());
    assert!(recovered > 100 && slow, "{recovered} cycles");
    assert!(least >= start - 1e-3, "{least} after {start}");
    assert_eq!(cell.status().stop_count, 0);
    cell.assert_limits();
}
