//! What is built on a trajectory: stops, extremes, cursors, loops.

use crate::{
    check::check,
    inputs::{Kind, Problem, Source},
};
use tandem_trajectory::{Cursor, Error, Generator, Input, Limits, State, Stopping, Synchronization, Trajectory};

fn input<const N: usize>(source: &mut Source) -> Input<N> {
    let problems: [Problem; N] = std::array::from_fn(|_| source.problem());
    Input {
        start: problems.map(|problem| problem.start),
        target: problems.map(|problem| problem.target),
        limits: problems.map(|problem| problem.limits),
        ..Input::default()
    }
}

/// A stop ends at rest where it was said to, on the way no farther than said.
#[test]
fn a_stop_ends_where_it_was_said_to() {
    for kind in [Kind::Benchmark, Kind::Asymmetric, Kind::Outside, Kind::Decimals(1)] {
        let mut source = Source::new(kind, 11);
        for _ in 0..2000 {
            let Input { start, limits, .. } = input::<2>(&mut source);
            let stop = Trajectory::stop(&start, &limits).expect("a stop is always possible");
            for joint in 0..2 {
                let said = Stopping::of(&start[joint], &limits[joint]).expect("a stop is always possible");
                let end = stop.at(stop.duration())[joint];
                assert_eq!((end.velocity, end.acceleration), (0.0, 0.0), "{start:?}");
                assert!((end.position - said.position).abs() < 1e-12 * (1.0 + end.position.abs()), "{end:?} {said:?}");
                for share in 0..=50 {
                    let State { position, .. } = stop.at(stop.duration() * f64::from(share) / 50.0)[joint];
                    assert!(position >= said.lowest - 1e-12 && position <= said.highest + 1e-12, "{said:?}");
                }
            }
        }
    }
}

/// Braking from a steady speed: half the speed is lost at the highest jerk, the rest symmetrically.
#[test]
fn a_stop_from_steady_speed_has_the_textbook_distance() {
    // v = 2, A = 4, j = 10: 0.4 s up to A loses 0.8, another 0.4 s back loses 0.8, 0.1 s held loses 0.4.
    let start = State { position: 1.0, velocity: 2.0, acceleration: 0.0 };
    let stopping = Stopping::of(&start, &Limits::symmetric(3.0, 4.0, 10.0)).expect("valid");
    assert!((stopping.duration - 0.9).abs() < 1e-15);
    // The velocity falls symmetrically about its middle, so the mean is half of it.
    assert!((stopping.distance(&start) - 0.9).abs() < 1e-15, "{stopping:?}");
}

/// The extremes bound every sample, are reached when they say, and first.
#[test]
fn extremes_are_exact() {
    let mut source = Source::new(Kind::Benchmark, 12);
    for _ in 0..2000 {
        let input = input::<1>(&mut source);
        let trajectory = Trajectory::calculate(&input).expect("valid");
        let [profile] = trajectory.profiles();
        let extrema = profile.extrema();
        for reached in [extrema.lowest, extrema.highest] {
            let there = profile.at(reached.time).position;
            assert!((there - reached.position).abs() < 1e-11, "{extrema:?} {input:?}");
            let first = profile.first_time_at(reached.position).expect("it is reached");
            assert!(first <= reached.time + 1e-6, "{first} {extrema:?}");
        }
        for share in 0..=200 {
            let State { position, .. } = profile.at(trajectory.duration() * f64::from(share) / 200.0);
            assert!(position >= extrema.lowest.position - 1e-12 && position <= extrema.highest.position + 1e-12);
            if share % 50 == 25 {
                let first = profile.first_time_at(position).expect("it is passed");
                assert!((profile.at(first).position - position).abs() < 1e-10, "{first} {input:?}");
                assert!(first <= trajectory.duration() * f64::from(share) / 200.0 + 1e-6);
            }
        }
        assert_eq!(profile.first_time_at(extrema.highest.position + 1.0), None);
    }
}

/// A cursor gives the bits that a search gives, forwards and after a jump back.
#[test]
fn a_cursor_gives_what_a_search_gives() {
    let mut source = Source::new(Kind::Benchmark, 13);
    for _ in 0..200 {
        let trajectory = Trajectory::calculate(&input::<3>(&mut source)).expect("valid");
        let mut cursor = Cursor::default();
        for share in (0..=300).chain([10, 20]) {
            let time = (trajectory.duration() + 0.1) * f64::from(share) / 300.0;
            assert_eq!(cursor.at(&trajectory, time), trajectory.at(time));
        }
    }
}

/// A loop calculates once, and once more when the target moves.
#[test]
fn a_loop_calculates_only_what_has_changed() {
    let mut source = Source::new(Kind::Benchmark, 14);
    let mut input = input::<2>(&mut source);
    let mut generator = Generator::new(&input).expect("valid");
    let (mut cycles, mut calculated) = (0, 0);
    loop {
        let step = generator.update(&input, 1e-3).expect("valid");
        calculated += u32::from(step.calculated);
        input.start = step.states;
        cycles += 1;
        if cycles == 100 {
            input.target[0].position += 0.1;
        }
        if step.finished {
            break;
        }
    }
    assert_eq!(calculated, 1);
    assert_eq!(
        input.start.map(|state| state.velocity),
        generator.trajectory().at(generator.time()).map(|state| state.velocity)
    );
}

/// Strictly straight: every joint stays on the chord, within its own limits, even if that is slower.
#[test]
fn strict_lines_are_straight() {
    let mut source = Source::new(Kind::Benchmark, 15);
    for _ in 0..1000 {
        let mut input = input::<3>(&mut source);
        for joint in 0..3 {
            input.start[joint] = State::at_rest(input.start[joint].position);
            input.target[joint] = State::at_rest(input.target[joint].position);
        }
        let apart = Trajectory::calculate(&input).expect("valid").duration();
        input.synchronization = [Synchronization::StrictPhase; 3];
        let trajectory = Trajectory::calculate(&input).expect("from rest to rest is always a line");
        assert!(trajectory.duration() >= apart * (1.0 - 1e-12));
        let gone = |states: &[State; 3], joint: usize| states[joint].position - input.start[joint].position;
        let whole = |joint: usize| input.target[joint].position - input.start[joint].position;
        for share in 0..=60 {
            let states = trajectory.at(trajectory.duration() * f64::from(share) / 60.0);
            for joint in 0..3 {
                let other = (joint + 1) % 3;
                let off = gone(&states, joint) * whole(other) - gone(&states, other) * whole(joint);
                assert!(
                    off.abs() <= 1e-12 * (1.0 + whole(other).abs() + whole(joint).abs()).powi(2),
                    "{off:e} {input:?}"
                );
                assert!(states[joint].velocity.abs() <= input.limits[joint].velocity_max * (1.0 + 1e-12));
                assert!(states[joint].acceleration.abs() <= input.limits[joint].acceleration_max * (1.0 + 1e-12));
            }
        }
    }
    let mut bent = Input { synchronization: [Synchronization::StrictPhase; 2], ..Input::<2>::default() };
    bent.start[0].velocity = 0.5;
    bent.target[1].position = 1.0;
    assert!(matches!(Trajectory::calculate(&bent), Err(Error::NotStraight { .. })));
}

/// What is wrong is named, with its joint.
#[test]
fn errors_name_joint_and_reason() {
    let change = |change: &dyn Fn(&mut Input<2>)| {
        let mut input = Input::<2>::default();
        input.target[1].position = 1.0;
        change(&mut input);
        Trajectory::calculate(&input).map(|trajectory| trajectory.duration())
    };
    assert!(change(&|_| {}).is_ok());
    assert_eq!(change(&|input| input.start[1].velocity = f64::NAN), Err(Error::NotFinite { joint: 1 }));
    assert_eq!(change(&|input| input.limits[1].jerk_max = 0.0), Err(Error::Limits { joint: 1 }));
    assert_eq!(change(&|input| input.target[0].velocity = 1.5), Err(Error::TargetVelocity { joint: 0 }));
    assert_eq!(change(&|input| input.target[0].acceleration = -1.5), Err(Error::TargetAcceleration { joint: 0 }));
    assert_eq!(change(&|input| input.limits[1].velocity_max = 0.0), Err(Error::Unreachable { joint: 1 }));
    let shown = std::format!("{}", Error::Limits { joint: 3 });
    assert!(shown.starts_with("joint 3: a limit is NaN"), "{shown}");
}

/// After a limit has been lowered in motion, a soft return comes down to it and stays; the fastest
/// one dips below it.
#[test]
fn a_soft_return_never_dips_below_the_lowered_limit() {
    let mut source = Source::new(Kind::Benchmark, 16);
    let mut softened = 0;
    for _ in 0..3000 {
        let mut input = input::<1>(&mut source);
        let limits = &mut input.limits[0];
        // In motion at the old limit, and the limit is halved.
        let ahead = input.target[0].position > input.start[0].position;
        let speed = limits.velocity_max * if ahead { 1.0 } else { -1.0 };
        input.start[0] = State { velocity: speed, acceleration: 0.0, ..input.start[0] };
        let far = 10.0 + 4.0 * speed.abs() / limits.acceleration_max + 4.0 * limits.acceleration_max / limits.jerk_max;
        input.target[0] = State::at_rest(input.target[0].position + far * speed);
        *limits = Limits::symmetric(limits.velocity_max / 2.0, limits.acceleration_max, limits.jerk_max);
        let fast = Trajectory::calculate(&input).expect("valid");
        input.soft_limits[0] = true;
        let soft = Trajectory::calculate(&input).expect("valid");
        let faults = check(&soft.profiles()[0], &input.start[0], &input.target[0], true, &input.limits[0]);
        assert!(
            faults.position < 1e-11 * input.target[0].position.abs().max(100.0)
                && faults.velocity < 1e-10
                && faults.excess < 1e-10,
            "{faults:?} {input:?}"
        );
        let limit = input.limits[0].velocity_max;
        let mut below = false;
        let mut last = f64::INFINITY;
        // Until the joint brakes for the target, its speed falls to the limit and stays there.
        for step in 0..400 {
            let time = soft.duration() * f64::from(step) / 400.0;
            let [State { velocity, .. }] = soft.at(time);
            let braking = soft.duration() - time
                < limit / input.limits[0].acceleration_max
                    + input.limits[0].acceleration_max / input.limits[0].jerk_max
                    + 1e-9
                || soft.duration() - time < 2.0 * (limit / input.limits[0].jerk_max).sqrt() + 1e-9;
            if !braking {
                assert!(velocity.abs() >= limit * (1.0 - 1e-9), "{velocity} at {time} {input:?}");
                assert!(velocity.abs() <= last * (1.0 + 1e-12));
                last = velocity.abs();
            }
            let [State { velocity, .. }] = fast.at(fast.duration() * f64::from(step) / 800.0);
            below |= velocity.abs() < limit * 0.999;
        }
        softened += u32::from(below);
    }
    assert!(softened > 1500, "the fastest return dips: {softened}");
}

/// A position limit is kept or refused, never passed.
#[test]
fn a_position_limit_is_never_passed() {
    let mut source = Source::new(Kind::Benchmark, 17);
    let (mut kept, mut refused) = (0, 0);
    for _ in 0..3000 {
        let mut input = input::<1>(&mut source);
        let (start, target) = (input.start[0].position, input.target[0].position);
        input.position_min[0] = start.min(target) - 0.2;
        input.position_max[0] = start.max(target) + 0.2;
        match Trajectory::calculate(&input) {
            Ok(trajectory) => {
                kept += 1;
                for step in 0..=100 {
                    let [State { position, .. }] = trajectory.at(trajectory.duration() * f64::from(step) / 100.0);
                    assert!(
                        position >= input.position_min[0] - 1e-12 && position <= input.position_max[0] + 1e-12,
                        "{input:?}"
                    );
                }
            }
            Err(error) => {
                refused += 1;
                assert_eq!(error, Error::PositionLimit { joint: 0 });
            }
        }
    }
    assert!(kept > 500 && refused > 500, "{kept} kept, {refused} refused");
}

/// A target outside the limits is refused unless asked for; then the way there is that of the motion
/// backwards in time, whose start lies outside.
#[test]
fn a_target_outside_the_limits_is_reached_when_asked_for() {
    let mut source = Source::new(Kind::Outside, 18);
    let mut outside = 0;
    for index in 0..3000 {
        // The way back: a start outside the limits, which becomes the target.
        let back = input::<1>(&mut source);
        let turned = |state: State| State {
            position: -state.position,
            velocity: state.velocity,
            acceleration: -state.acceleration,
        };
        let mut there = back;
        (there.start[0], there.target[0]) = (turned(back.target[0]), turned(back.start[0]));
        outside += u32::from(Trajectory::calculate(&there).is_err());
        there.target_outside[0] = true;
        let (there_and, back_again) =
            (Trajectory::calculate(&there).expect("asked for"), Trajectory::calculate(&back).expect("valid"));
        let (duration, other) = (there_and.duration(), back_again.duration());
        assert!((duration - other).abs() <= 1e-9 * duration, "{index}: {duration} {other} {there:?}");
        assert_eq!(there_and.at(duration), there.target);
        let reach = 1.0 + duration * there.limits[0].velocity_max + there.target[0].velocity.abs() * duration;
        for step in 0..=100 {
            let time = duration * f64::from(step) / 100.0;
            let ([on], [off]) = (there_and.at(time), back_again.at(duration - time));
            let off = turned(off);
            assert!(
                (on.position - off.position).abs() <= 1e-10 * reach
                    && (on.velocity - off.velocity).abs() <= 1e-7 * reach,
                "{index}: {on:?} {off:?} {there:?}"
            );
        }
    }
    assert!(outside > 1000, "{outside}");
}
