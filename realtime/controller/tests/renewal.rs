//! A way that something comes into while the arm follows it is left for another one, smoothly and on verified ground.
#![allow(clippy::disallowed_types, clippy::disallowed_macros, reason = "tests may allocate and print")]

mod cell;

use std::time::Duration;

use cell::{Cell, down, params, put, task};
use proptest::prelude::*;
use tandem_controller::Params;
use tandem_cycle::guard::{CountingAllocator, counted};
use tandem_msg::*;
use tandem_trajectory::{Input, Limits, State, Trajectory};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// What the test puts into the way.
const OBSTACLE: u32 = 50;

/// A controller that keeps to what was planned at rest.
fn without() -> Params {
    Params { renewal_period: Duration::ZERO, ..params() }
}

/// On its way across the bench, its TCP beyond y.
fn on_the_way(params: Params, y: f64) -> Cell {
    let mut cell = Cell::with(params);
    assert_eq!(cell.perform(task(1, down(0.45, -0.60, 0.25, 0.0))), MotionPhase::Done);
    cell.give(task(2, down(0.55, 0.55, 0.35, 0.0)));
    cell.until("on the way across", 5_000, |cell| {
        cell.phase() == MotionPhase::Transfer && cell.tcp().translation.y > y
    });
    cell
}

/// A forearm that reaches over the bench from the front, to x.
fn reach_in(cell: &mut Cell, x: f64) {
    cell.human.capsule_count = 1;
    cell.human.position_sigma = 0.005;
    cell.human.body[0] = Code::of(BodyPart::Forearm);
    let ends = [[x + 0.6, 0.0, 0.25], [x, 0.0, 0.25]];
    cell.human.capsules[0] = Capsule { ends, radius: 0.05, velocity: [0.0; 3] };
}

/// What became of a motion.
#[derive(Debug)]
struct Run {
    seconds: f64,
    /// Cycles in which the arm stood on its way across.
    stood: u64,
    changes: u32,
    reasons: Vec<ChangeReason>,
}

/// To the end of the task. The person leaves after `stays` seconds.
fn finish(cell: &mut Cell, stays: f64) -> Run {
    let began = cell.cycle;
    let passed = |cell: &Cell| (cell.cycle - began) as f64 * cell::PERIOD;
    let mut run = Run { seconds: 0.0, stood: 0, changes: cell.status().changes, reasons: Vec::new() };
    while !matches!(cell.phase(), MotionPhase::Done | MotionPhase::Failed) && passed(cell) < 30.0 {
        if passed(cell) >= stays {
            cell.human.capsule_count = 0;
        }
        let before = (cell.outputs.command, cell.status().changes);
        cell.step();
        if cell.status().changes != before.1 {
            run.reasons.extend(cell.status().change_reason.get());
        }
        assert_reachable(cell, &before.0);
        let across = matches!(cell.phase(), MotionPhase::Transfer | MotionPhase::Planning);
        run.stood += u64::from(across && !cell.moving());
    }
    assert_eq!(cell.phase(), MotionPhase::Done, "{:#?}", cell.status());
    assert!((0..3).all(|axis| (cell.tcp().translation.vector[axis] - [0.55, 0.55, 0.35][axis]).abs() < 1e-5));
    cell.assert_limits();
    run.seconds = passed(cell);
    run.changes = cell.status().changes - run.changes;
    run
}

/// The oracle: from the command before, the next one, with its position, velocity and acceleration, is within reach of a
/// time-optimal trajectory in one period under the limits of each joint. That it would not be after any step in them.
fn assert_reachable(cell: &Cell, before: &JointCommand) {
    let command = &cell.outputs.command;
    if command.brake == 1 || before.brake == 1 {
        return;
    }
    /// What is rounding, and what the spline of an approach takes at its ends: shares.
    const SLACK: f64 = 1.06;
    for (joint, limits) in cell.chain.joints().iter().enumerate() {
        let state = |of: &JointCommand| State {
            position: of.position[joint],
            velocity: of.velocity[joint],
            acceleration: of.acceleration[joint],
        };
        let (start, target) = (state(before), state(command));
        // No step: what a jerk within the limit does to the state in one period, and not more.
        let (h, jerk) = (cell::PERIOD, SLACK * limits.jerk_max);
        let coasting = State {
            position: start.position + start.velocity * h + 0.5 * start.acceleration * h * h,
            velocity: start.velocity + start.acceleration * h,
            acceleration: start.acceleration,
        };
        assert!((target.acceleration - coasting.acceleration).abs() <= jerk * h + 1e-9, "joint {joint}");
        assert!((target.velocity - coasting.velocity).abs() <= jerk * h * h / 2.0 + 1e-9, "joint {joint}");
        assert!((target.position - coasting.position).abs() <= jerk * h * h * h / 6.0 + 1e-9, "joint {joint}");
        let input = Input::<1> {
            start: [start],
            target: [target],
            limits: [Limits::symmetric(
                SLACK * limits.velocity_max,
                SLACK * limits.acceleration_max,
                // Within a period the jerk may turn.
                4.0 * SLACK * limits.jerk_max,
            )],
            tolerance: [1e-9],
            ..Input::default()
        };
        let shortest = Trajectory::calculate(&input).map(|way| way.duration());
        assert!(
            shortest.is_ok_and(|time| time <= h * 1.05),
            "joint {joint}: {shortest:?} from {start:?} to {target:?}"
        );
    }
}

/// A forearm stays in the way: an arm that keeps to its plan waits until it leaves, one that looks for another way goes
/// round it. (The first stop is the person's, who comes out of nothing.)
#[test]
fn a_person_who_stays_in_the_way_is_passed() {
    const STAYS: f64 = 20.0;
    for (x, y) in [(0.97, -0.50), (1.00, -0.45), (1.02, -0.55)] {
        let [waits, passes] = [without(), params()].map(|params| {
            let mut cell = on_the_way(params, y);
            reach_in(&mut cell, x);
            let run = finish(&mut cell, STAYS);
            assert!(cell.findings.separation_moving_min > 0.05, "{:?}", cell.findings);
            run
        });
        assert!(waits.changes == 0 && waits.seconds > STAYS && waits.stood > 10_000, "{x}: {waits:?}");
        assert!(passes.seconds < 0.5 * STAYS && passes.stood < 500, "{x}: {passes:?}");
        assert_eq!(passes.reasons, [ChangeReason::Blocked], "{x}: {passes:?}");
    }
}

/// Looking for another way and taking it allocate nothing, and twice the same gives the same commands.
#[test]
fn a_renewal_allocates_nothing_and_repeats_itself() {
    let run = || {
        let mut cell = on_the_way(params(), -0.45);
        reach_in(&mut cell, 1.0);
        let mut commands = Vec::with_capacity(12_000);
        for _ in 0..12_000 {
            let ((), calls) = counted(|| cell.step());
            assert!(calls.is_none(), "{calls:?} {:#?}", cell.status());
            commands.push(cell.outputs.command.position);
        }
        assert_eq!((cell.phase(), cell.status().changes), (MotionPhase::Done, 1), "{:#?}", cell.status());
        commands
    };
    assert!(run() == run(), "two runs differ");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 16, ..ProptestConfig::default() })]

    /// Whatever comes into the way, wherever the arm is then: it arrives, no command is a step in position, velocity or
    /// acceleration or beyond a limit, and nothing is touched.
    #[test]
    fn a_change_of_way_is_smooth(
        y in -0.58..0.0f64,
        (angle, radius, height) in (-0.3..0.4f64, 0.55..0.95f64, 0.1..0.55f64),
        (wide, deep) in (0.02..0.10f64, 0.02..0.10f64),
        person in prop::option::of(0.95..1.3f64),
    ) {
        let mut cell = on_the_way(params(), y);
        let centre = [radius * angle.cos(), radius * angle.sin(), height / 2.0];
        match person {
            Some(x) => reach_in(&mut cell, x),
            None => put(&mut cell, OBSTACLE, centre, [wide, deep, height / 2.0]),
        }
        // Nothing comes out of nothing nearer than a stop is long.
        let tcp = cell.tcp().translation.vector;
        prop_assume!(person.is_some() || (tcp.x - centre[0]).hypot(tcp.y - centre[1]) > 0.45);
        finish(&mut cell, 5.0);
        prop_assert!(cell.findings.clearance_min > 0.0, "{:?}", cell.findings);
        prop_assert!(cell.findings.separation_moving_min > 0.0, "{:?}", cell.findings);
    }
}
