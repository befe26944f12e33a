//! Against ruckig's C++: never longer than what it finds, and valid by an independent check.

use crate::cases::{self, Case, JointCase};
use crate::check::{Faults, check};
use tandem_trajectory::{Error, Interface, Profile, Trajectory};

fn solve<const N: usize>(case: &Case) -> Result<(f64, Vec<Profile>), Error> {
    let trajectory = Trajectory::calculate(&case.input::<N>())?;
    Ok((trajectory.duration(), trajectory.profiles().to_vec()))
}

fn minima_of<const N: usize>(case: &Case) -> Vec<f64> {
    case.input::<N>().minimum_durations().expect("solved above").to_vec()
}

/// The shortest duration of each joint alone.
fn minima(case: &Case) -> Vec<f64> {
    match case.joints.len() {
        1 => minima_of::<1>(case),
        3 => minima_of::<3>(case),
        6 => minima_of::<6>(case),
        joints => {
            assert_eq!(joints, 7, "case {}", case.id);
            minima_of::<7>(case)
        }
    }
}

fn solve_any(case: &Case) -> Result<(f64, Vec<Profile>), Error> {
    match case.joints.len() {
        1 => solve::<1>(case),
        3 => solve::<3>(case),
        6 => solve::<6>(case),
        7 => solve::<7>(case),
        joints => panic!("case {}: {joints} joints", case.id),
    }
}

/// Code -100 is invalid input; -104 a limit of zero, with which no motion exists.
#[test]
fn every_valid_case_is_solved_and_no_invalid_one() {
    for case in cases::load() {
        let solved = solve_any(&case);
        match case.code {
            -100 => assert!(solved.is_err(), "case {} ({}) is invalid and was solved", case.id, case.tag),
            -104 => {}
            code => assert!(solved.is_ok(), "case {} ({}, code {code}): {}", case.id, case.tag, solved.unwrap_err()),
        }
    }
}

/// Whether no motion of `duration` exists, for states almost at rest: a jerk `j` moves from rest to rest by at most
/// `j T^3 / 32`, changes a velocity by at most `j T^2 / 4`, and what the states bring with them adds little.
fn impossible(joint: &JointCase, duration: f64) -> bool {
    let JointCase { start, target, limits, .. } = joint;
    let jerk = limits.jerk_max.max(-limits.jerk_min);
    let speed = start.velocity.abs() + target.velocity.abs();
    let push = start.acceleration.abs() + target.acceleration.abs();
    let moved = jerk * duration.powi(3) / 32.0 + speed * duration + push * duration.powi(2);
    let changed = jerk * duration.powi(2) / 4.0 + push * duration;
    (target.position - start.position).abs() > moved || (target.velocity - start.velocity).abs() > changed
}

/// The only longer ones, of less than a tenth of a millisecond, belong to starts a few roundings from the target, which
/// ruckig takes for the target (it asks for 1e-8): it finds durations in which no motion gets there.
#[test]
fn no_duration_is_longer_than_the_verified_one() {
    let mut longer = 0;
    for case in cases::load().iter().filter(|case| case.verified) {
        let (duration, _) = solve_any(case).expect("solved above");
        let bound = |time: f64| time * (1.0 + 1e-9) + 1e-9;
        let name = format!("case {} ({})", case.id, case.tag);
        if duration > bound(case.duration) {
            longer += 1;
            let unreached = case.joints.iter().any(|joint| impossible(joint, case.duration));
            assert!(unreached && case.duration < 1e-4, "{name}: {duration} > {}", case.duration);
        }
        for (index, (&minimum, joint)) in minima(case).iter().zip(&case.joints).enumerate() {
            if minimum > bound(joint.minimum) {
                let unreached = impossible(joint, joint.minimum) && joint.minimum < 1e-4;
                assert!(unreached, "{name} joint {index}: {minimum} > {}", joint.minimum);
            }
            if let Some(best) = joint.best {
                assert!(minimum <= best * (1.0 + 1e-6), "{name} joint {index}: {minimum} > {best}");
            }
        }
    }
    println!("{longer} longer than what ruckig finds, in none of which a motion gets there");
}

/// End state and limits by exact integration of the segments. The errors of the end state are
/// relative to what roundings of the switching times do: such a time is known to 2e-16 of the
/// duration, which the jerk turns into an acceleration, and that, over the duration, into a
/// velocity and a position.
#[test]
fn every_trajectory_is_valid_by_exact_integration() {
    let mut worst = Faults::default();
    for case in cases::load() {
        let Ok((duration, profiles)) = solve_any(&case) else {
            continue;
        };
        for (index, (profile, joint)) in profiles.iter().zip(&case.joints).enumerate() {
            let position = case.interface == Interface::Position;
            let faults = check(profile, &joint.start, &joint.target, position, &joint.limits);
            let reach = profile.segments().fold(1.0_f64, |reach, segment| reach.max(segment.start.position.abs()));
            let bounded = |limit: f64, start: f64| match limit.is_finite() {
                true => limit.max(start.abs()).max(1.0),
                false => start.abs().max(1.0),
            };
            let limits = &joint.limits;
            let jerk = if limits.jerk_max.is_finite() { limits.jerk_max } else { 0.0 };
            let push = bounded(limits.acceleration_max, joint.start.acceleration) + duration * jerk;
            let speed = bounded(limits.velocity_max, joint.start.velocity) + duration * push;
            let relative = Faults {
                position: faults.position / (reach + duration * speed),
                velocity: faults.velocity / speed,
                acceleration: faults.acceleration / push,
                drift: faults.drift / (reach + duration * speed),
                ..faults
            };
            let name = || format!("case {} ({}) joint {index}: {faults:?} {joint:?}", case.id, case.tag);
            assert!(relative.position <= 1e-14 && relative.drift <= 1e-14, "{relative:?} {}", name());
            assert!(relative.velocity <= 1e-14 && relative.acceleration <= 1e-14, "{relative:?} {}", name());
            if case.tag != "huge" && duration < 50.0 {
                assert!(
                    faults.position <= 1e-9 && faults.velocity <= 1e-11 && faults.acceleration <= 1e-11,
                    "{}",
                    name()
                );
            }
            assert!(faults.excess <= 1e-11 && faults.jerk <= 1e-12, "{}", name());
            if position {
                let end = profile.at(profile.duration());
                assert_eq!(end, joint.target, "{}", name());
            }
            worst.merge(&relative);
        }
    }
    println!("worst, relative to the sizes on the way: {worst:?}");
}

/// Where ruckig achieves a straight line, so does this, in the same time.
#[test]
fn straight_lines_are_straight() {
    for case in cases::load().iter().filter(|case| case.straight && case.verified && case.joints.len() > 1) {
        if case.synchronization != tandem_trajectory::Synchronization::Phase {
            continue;
        }
        let (duration, profiles) = solve_any(case).expect("solved above");
        let lead = (0..profiles.len()).max_by(|a, b| {
            let reach = |i: usize| (case.joints[i].target.position - case.joints[i].start.position).abs();
            reach(*a).total_cmp(&reach(*b))
        });
        let lead = lead.expect("there are joints");
        for step in 0..=100 {
            let time = duration * f64::from(step) / 100.0;
            let gone = |i: usize| profiles[i].at(time).position - case.joints[i].start.position;
            let whole = |i: usize| case.joints[i].target.position - case.joints[i].start.position;
            for index in 0..profiles.len() {
                if whole(lead) != 0.0 && case.interface == Interface::Position {
                    let off = gone(index) - gone(lead) * (whole(index) / whole(lead));
                    assert!(off.abs() <= 1e-10, "case {} joint {index} at {time}: {off:e} off the line", case.id);
                }
            }
        }
    }
}

/// A valid input on which ruckig's C++ writes past an array and dies.
#[test]
fn the_input_that_crashes_ruckig_is_solved() {
    use tandem_trajectory::{Input, State};
    let mut input = Input::<1>::default();
    let line = include_str!("crash.txt");
    let numbers: Vec<f64> = line
        .lines()
        .last()
        .expect("a line")
        .split_whitespace()
        .skip(8)
        .map(|word| word.parse().expect("a number"))
        .collect();
    let [p0, v0, a0, pf, vf, af] = numbers[..6] else { panic!("{numbers:?}") };
    input.start[0] = State { position: p0, velocity: v0, acceleration: a0 };
    input.target[0] = State { position: pf, velocity: vf, acceleration: af };
    let trajectory = Trajectory::calculate(&input).expect("it is valid");
    let faults = check(&trajectory.profiles()[0], &input.start[0], &input.target[0], true, &input.limits[0]);
    assert!(
        faults.position < 1e-12 && faults.velocity < 1e-13 && faults.excess < 1e-13 && faults.jerk < 1e-13,
        "{faults:?}"
    );
}
