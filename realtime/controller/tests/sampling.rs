//! Where no hand-designed path is clear, the sampling planner finds one, and it is followed like any other.
#![allow(clippy::disallowed_types, clippy::disallowed_macros, reason = "tests may allocate and print")]

mod cell;

use cell::{Cell, down, params, put, task};
use tandem_controller::Params;
use tandem_cycle::guard::{CountingAllocator, counted};
use tandem_msg::*;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// A cell whose arm stands on one side of a wall that none of the hand-made routes passes over.
fn walled(params: Params) -> Cell {
    let mut cell = Cell::with(params);
    assert_eq!(cell.perform(task(1, down(0.45, -0.60, 0.15, 0.0))), MotionPhase::Done);
    assert_eq!(cell.status().planner.get(), Some(Planner::Manual));
    put(&mut cell, 50, [0.85, -0.25, 0.42], [0.55, 0.02, 0.42]);
    cell
}

fn beyond() -> MotionTask {
    MotionTask { scene_version: 2, ..task(2, down(0.62, 0.1, 0.25, 0.0)) }
}

#[test]
fn a_way_nobody_thought_of_is_found_and_followed() {
    let mut by_hand = walled(Params { sampling_looks_max: 0, ..params() });
    assert_eq!(by_hand.perform(beyond()), MotionPhase::Failed);
    assert_eq!(by_hand.status().failure.get(), Some(MotionFailure::NoClearPath));

    let mut cell = walled(params());
    assert_eq!(cell.perform(beyond()), MotionPhase::Done, "{:#?}", cell.status());
    let status = cell.status();
    assert_eq!(status.planner.get(), Some(Planner::RrtConnect));
    assert!(status.clearance_min > 0.002, "{status:?}");
    assert!((status.elapsed - status.expected).abs() < 0.35, "{} s, expected {} s", status.elapsed, status.expected);
    let goal = [0.62, 0.1, 0.25];
    assert!((0..3).all(|axis| (cell.tcp().translation.vector[axis] - goal[axis]).abs() < 1e-5));
    assert_eq!(status.stop_count, 0);
    cell.assert_limits();

    // The way back, by hand or not, and a task that needs no search is the manual planner's again.
    let back = MotionTask { scene_version: 2, ..task(3, down(0.45, -0.60, 0.15, 0.0)) };
    assert_eq!(cell.perform(back), MotionPhase::Done, "{:#?}", cell.status());
    let near = MotionTask { scene_version: 2, ..task(4, down(0.55, -0.60, 0.20, 0.0)) };
    assert_eq!(cell.perform(near), MotionPhase::Done, "{:#?}", cell.status());
    assert_eq!(cell.status().planner.get(), Some(Planner::Manual));
    cell.assert_limits();
}

/// The same task in the same cell is planned alike, bit for bit, whatever the controller may do in one cycle.
#[test]
fn the_way_does_not_depend_on_the_cycle() {
    let ends = [4, 4, 1, 50].map(|planning_work| {
        let mut cell = walled(Params { planning_work, ..params() });
        cell.give(beyond());
        cell.until("a plan", 30_000, |cell| cell.status().planner.is(Planner::RrtConnect));
        let mut way = Vec::new();
        while cell.phase() != MotionPhase::Done {
            cell.step();
            way.push(cell.outputs.command.position);
            assert_eq!(cell.cause(), StopCause::None);
        }
        way
    });
    assert!(ends[0].len() > 1_000);
    for end in &ends[1..] {
        assert_eq!(&ends[0][..], &end[..]);
    }
}

/// Searching and following allocate nothing, whether there is a way or not.
#[test]
fn a_sampled_plan_allocates_nothing() {
    for looks in [300_000, 400] {
        let mut cell = walled(Params { sampling_looks_max: looks, ..params() });
        cell.give(beyond());
        let over =
            |cell: &Cell| cell.status().task_id == 2 && matches!(cell.phase(), MotionPhase::Done | MotionPhase::Failed);
        for cycle in 0..30_000 {
            let ((), calls) = counted(|| cell.step());
            assert!(calls.is_none(), "cycle {cycle}: {calls:?} {:#?}", cell.status());
            if over(&cell) {
                break;
            }
        }
        assert!(over(&cell), "{:#?}", cell.status());
    }
}
