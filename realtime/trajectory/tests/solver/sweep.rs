//! Random problems: all solved, all valid, and the durations share the symmetries of the problem.

use crate::{
    check::check,
    inputs::{KINDS, Kind, Problem, Source, campaign},
};
use tandem_trajectory::{Input, Limits, State, Synchronization, Trajectory};

/// Problems of each kind.
fn count() -> usize {
    campaign(4_000)
}

fn input<const N: usize>(kind: Kind, problems: &[Problem; N]) -> Input<N> {
    Input {
        start: problems.map(|problem| problem.start),
        target: problems.map(|problem| problem.target),
        limits: problems.map(|problem| problem.limits),
        // Joints of absurdly different scales share no duration.
        synchronization: [if kind == Kind::Scales { Synchronization::None } else { Synchronization::Time }; N],
        ..Input::default()
    }
}

/// Every problem of every kind, for one and for three joints, has a trajectory that keeps its limits
/// and ends where it shall, by exact integration of its segments.
#[test]
fn every_random_problem_is_solved_validly() {
    for kind in KINDS {
        let mut worst = [0.0_f64; 5];
        let mut source = Source::new(kind, 1);
        for index in 0..count() / 3 {
            let problems = [source.problem(), source.problem(), source.problem()];
            let trajectory = Trajectory::calculate(&input(kind, &problems));
            let trajectory = trajectory.unwrap_or_else(|error| panic!("{kind:?} {index}: {error} {problems:?}"));
            for (profile, problem) in trajectory.profiles().iter().zip(&problems) {
                let Problem { start, target, limits } = problem;
                let duration = profile.duration();
                let faults = check(profile, start, target, true, limits);
                let finite = |limit: f64| if limit.is_finite() { limit } else { 0.0 };
                // Switching times are known to 2^-77 of the duration; the jerk makes an acceleration of
                // that, which matters only where the scales are absurdly far apart.
                let blur = duration * finite(limits.jerk_max) * 2.0_f64.powi(-77);
                let push = finite(limits.acceleration_max.max(-limits.acceleration_min))
                    .max(start.acceleration.abs())
                    .max(1.0)
                    + blur / 1e-16;
                let speed =
                    limits.velocity_max.max(-limits.velocity_min).max(start.velocity.abs()).max(1.0) + duration * push;
                let reach = start.position.abs().max(target.position.abs()).max(1.0) + duration * speed;
                let relative = [
                    faults.position / reach,
                    faults.velocity / speed,
                    faults.acceleration / push,
                    faults.excess,
                    faults.jerk,
                ];
                for (worst, fault) in worst.iter_mut().zip(relative) {
                    *worst = worst.max(if fault.is_nan() { f64::INFINITY } else { fault });
                }
                // An acceleration far outside its limits leaves its own roundings to a cruise of hours.
                let (near, fast) = match kind {
                    Kind::Noise => (1e-10, 1e-11),
                    Kind::Scales => (1e-13, 1e-14),
                    Kind::Outside => (1e-13, 1e-13),
                    _ => (1e-14, 1e-14),
                };
                // A cruise of hours turns roundings of the acceleration before it into a velocity.
                let excess = 1e-11 + (2.0 * blur + 4e-15 * push) * duration;
                assert!(
                    relative[0] < near
                        && relative[1] < fast
                        && relative[2] < 1e-13
                        && relative[3] < excess
                        && relative[4] < 1e-13,
                    "{kind:?} {index}: {relative:?} {faults:?} T = {duration} {problem:?}"
                );
                if !matches!(kind, Kind::Scales | Kind::HighLimits | Kind::Infinite) && duration < 100.0 {
                    assert!(
                        faults.position <= 1e-9 && faults.velocity <= 1e-11 && faults.acceleration <= 1e-11,
                        "{kind:?} {index}: {faults:?} T = {duration} {problem:?}"
                    );
                }
            }
        }
        println!(
            "{kind:?}: worst dp {:.1e} dv {:.1e} da {:.1e} excess {:.1e} jerk {:.1e}",
            worst[0], worst[1], worst[2], worst[3], worst[4]
        );
    }
}

fn duration(problem: &Problem) -> f64 {
    Trajectory::calculate(&input(Kind::Benchmark, &[*problem]))
        .unwrap_or_else(|error| panic!("{error} {problem:?}"))
        .duration()
}

fn map_state(state: State, by: [f64; 3]) -> State {
    State {
        position: state.position * by[0],
        velocity: state.velocity * by[1],
        acceleration: state.acceleration * by[2],
    }
}

/// The same motion with lengths multiplied by `length` and times by `time`.
fn scaled(problem: &Problem, length: f64, time: f64) -> Problem {
    let by = [length, length / time, length / time / time, length / time / time / time];
    let limits = &problem.limits;
    let state = |s: State| map_state(s, [by[0], by[1], by[2]]);
    Problem {
        start: state(problem.start),
        target: state(problem.target),
        limits: Limits {
            velocity_min: limits.velocity_min * by[1],
            velocity_max: limits.velocity_max * by[1],
            acceleration_min: limits.acceleration_min * by[2],
            acceleration_max: limits.acceleration_max * by[2],
            jerk_min: limits.jerk_min * by[3],
            jerk_max: limits.jerk_max * by[3],
        },
    }
}

fn mirrored(problem: &Problem) -> Problem {
    let state = |s: State| map_state(s, [-1.0, -1.0, -1.0]);
    let l = &problem.limits;
    Problem {
        start: state(problem.start),
        target: state(problem.target),
        limits: Limits {
            velocity_min: -l.velocity_max,
            velocity_max: -l.velocity_min,
            acceleration_min: -l.acceleration_max,
            acceleration_max: -l.acceleration_min,
            jerk_min: -l.jerk_max,
            jerk_max: -l.jerk_min,
        },
    }
}

/// The motion backwards in time, with positions mirrored so that velocities keep their signs.
fn reversed(problem: &Problem) -> Problem {
    let state = |s: State| map_state(s, [-1.0, 1.0, -1.0]);
    let l = &problem.limits;
    Problem {
        start: state(problem.target),
        target: state(problem.start),
        limits: Limits { acceleration_min: -l.acceleration_max, acceleration_max: -l.acceleration_min, ..*l },
    }
}

/// A start within the limits, so that the motion backwards is a problem, too.
fn starts_inside(problem: &Problem) -> bool {
    let Problem { start: State { velocity: v, acceleration: a, .. }, limits: l, .. } = *problem;
    let after = if a > 0.0 { v + a * a / (-2.0 * l.jerk_min) } else { v };
    let before = if a < 0.0 { v - a * a / (2.0 * l.jerk_max) } else { v };
    l.acceleration_min < a
        && a < l.acceleration_max
        && after < l.velocity_max
        && before > l.velocity_min
        && v < l.velocity_max
        && v > l.velocity_min
}

/// Mirroring leaves the duration as it is to the bit; so do powers of two in length, and those in time
/// scale it. The motion backwards takes as long.
#[test]
fn durations_share_the_symmetries_of_the_problem() {
    for kind in KINDS {
        let (mut backwards, mut worst) = (0, 0.0_f64);
        let mut source = Source::new(kind, 2);
        for index in 0..count() {
            let problem = source.problem();
            let own = duration(&problem);
            // A start one subnormal from zero: what is left of it does not scale.
            if own < 1e-100 {
                continue;
            }
            assert_eq!(duration(&mirrored(&problem)), own, "{kind:?} {index} mirrored: {problem:?}");
            // To the bit, but for neighbours of zero, which are too small to scale exactly.
            let tie = if kind == Kind::Neighbours { 1e-14 * own } else { 0.0 };
            let same = |problem: Problem, wanted: f64| (duration(&problem) - wanted).abs() <= tie;
            assert!(same(scaled(&problem, 16.0, 1.0), own), "{kind:?} {index} longer: {problem:?}");
            assert!(same(scaled(&problem, 1.0, 0.125), own / 8.0), "{kind:?} {index} faster: {problem:?}");
            if kind != Kind::Outside && kind != Kind::Infinite && starts_inside(&problem) {
                backwards += 1;
                let other = duration(&reversed(&problem));
                let off = (other - own).abs() / own.max(1e-3);
                worst = worst.max(off);
                assert!(
                    off < 1e-9 || kind == Kind::Noise || kind == Kind::Scales,
                    "{kind:?} {index} backwards: {own} {other} {problem:?}"
                );
            }
        }
        println!("{kind:?}: {backwards} backwards, worst difference {worst:.1e}");
    }
}
