//! A policy is asked for the way across first; what it does not bring across clear, the hand-made routes do.
#![allow(clippy::disallowed_types, clippy::disallowed_macros, reason = "tests may allocate and print")]

mod cell;

use cell::{Cell, body, down, params, task, ur10};
use tandem_clearance::Monitor;
use tandem_controller::Controller;
use tandem_cycle::guard::{CountingAllocator, counted};
use tandem_msg::*;
use tandem_policy::{DOF, Lateral, OBSERVATION, Policies, STEP, Shape, Stored};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

const HIDDEN: usize = tandem_policy::HIDDEN;
/// Where an observation holds what is left to turn, joint by joint.
const TO_GO: usize = 15;

/// A policy that turns every joint straight towards the goal, `gain` times what is left, pulled aside by `bias`.
fn towards(gain: f32, bias: f32) -> Stored {
    let shape = Shape { inputs: OBSERVATION, outputs: DOF, columns: 1, lateral: Lateral::Adapter };
    let mut numbers = vec![0.0; OBSERVATION];
    numbers.extend([1.0; OBSERVATION]);
    numbers.extend([STEP; DOF]);
    let mut first = vec![0.0; OBSERVATION * HIDDEN];
    let mut second = vec![0.0; HIDDEN * HIDDEN];
    let mut third = vec![0.0; HIDDEN * DOF];
    for joint in 0..DOF {
        for (unit, sign) in [(2 * joint, 1.0), (2 * joint + 1, -1.0)] {
            first[(TO_GO + joint) * HIDDEN + unit] = sign;
            second[unit * HIDDEN + unit] = 1.0;
            third[unit * DOF + joint] = sign * gain;
        }
    }
    for (matrix, biases) in [(first, vec![0.0; HIDDEN]), (second, vec![0.0; HIDDEN]), (third, vec![bias; DOF])] {
        numbers.extend(matrix);
        numbers.extend(biases);
    }
    Stored::new(shape, numbers.into()).expect("a policy")
}

fn cell_with(policy: Stored) -> Cell {
    cell_of(Policies { transfer: Some(policy), ..Policies::default() })
}

fn cell_of(policies: Policies) -> Cell {
    let mut cell = Cell::new();
    cell.controller = Controller::new(ur10(), Monitor::new(body()), params()).expect("the parameters pass");
    cell.controller.set_policies(policies);
    cell
}

/// Across by policy, at the goal to the hair, within every limit, without an allocation; a bent way is passed
/// without a stop.
#[test]
fn a_policy_moves_the_arm() {
    for bias in [0.0, 0.3] {
        let mut cell = cell_with(towards(3.0, bias));
        for (id, goal) in [(1, [0.45, -0.60, 0.25]), (2, [0.55, 0.45, 0.35])] {
            cell.give(task(id, down(goal[0], goal[1], goal[2], 0.0)));
            for _ in 0..60_000 {
                let ((), calls) = counted(|| cell.step());
                assert!(calls.is_none(), "{calls:?}");
                if matches!(cell.phase(), MotionPhase::Done | MotionPhase::Failed) && cell.status().task_id == id {
                    break;
                }
            }
            assert_eq!(cell.phase(), MotionPhase::Done, "{:#?}", cell.status());
            assert_eq!(cell.status().planner.get(), Some(Planner::Policy), "bias {bias}, task {id}");
            let found = cell.tcp().translation.vector;
            assert!((0..3).all(|axis| (found[axis] - goal[axis]).abs() < 1e-5), "{found:?}");
        }
        cell.assert_limits();
    }
}

/// A policy that leads nowhere, and a subtask without one: the hand-made way, said to be so.
#[test]
fn where_the_policy_fails_the_next_planner_moves_the_arm() {
    let mut cell = cell_with(towards(-1.0, 0.0));
    assert_eq!(cell.perform(task(1, down(0.45, -0.60, 0.25, 0.0))), MotionPhase::Done);
    assert_eq!(cell.status().planner.get(), Some(Planner::Manual));
    let mut cell = cell_with(towards(3.0, 0.0));
    let grasp = MotionTask { subtask: Code::of(Subtask::Grasp), ..task(1, down(0.45, -0.60, 0.25, 0.0)) };
    assert_eq!(cell.perform(grasp), MotionPhase::Done);
    assert_eq!(cell.status().planner.get(), Some(Planner::Manual));
    cell.assert_limits();
}

/// Near its goal a transfer is led by the policy that places; where that one leads nowhere, by its own to the end.
#[test]
fn the_policy_that_places_leads_the_end_of_a_transfer() {
    let led_by = |gain: f32| {
        let (transfer, place) = (Some(towards(3.0, 0.0)), Some(towards(gain, 0.0)));
        let mut cell = cell_of(Policies { transfer, place, ..Policies::default() });
        assert_eq!(cell.perform(task(1, down(0.45, -0.60, 0.25, 0.0))), MotionPhase::Done);
        cell.give(task(2, down(0.55, 0.45, 0.35, 0.0)));
        cell.until("on the way", 5_000, |cell| cell.status().task_id == 2 && cell.phase() == MotionPhase::Transfer);
        assert_eq!(cell.status().planner.get(), Some(Planner::Policy));
        cell.status().led_by
    };
    let [transfer, place] = [Subtask::Transfer, Subtask::Place].map(|subtask| 1 << subtask.code());
    assert_eq!([led_by(3.0), led_by(-1.0)], [transfer | place, transfer]);
}
