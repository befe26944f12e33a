//! As a controller uses it: every cycle a new trajectory from the state the last one led to.

use crate::inputs::{Kind, Problem, Source, campaign};
use tandem_trajectory::{Input, Limits, State, Trajectory};

/// How a closed loop went.
struct Arrival {
    /// Duration of the first trajectory, and when the loop arrived.
    planned: f64,
    arrived: f64,
}

/// Recomputes every `cycle` seconds until the rest of the way takes less than one cycle, adding
/// `noise` to each state.
fn follow(problem: &Problem, cycle: f64, tolerance: f64, mut noise: impl FnMut() -> f64) -> Arrival {
    let mut input = Input {
        start: [problem.start],
        target: [problem.target],
        limits: [problem.limits],
        tolerance: [tolerance],
        ..Input::default()
    };
    let calculate = |input: &Input<1>| Trajectory::calculate(input).unwrap_or_else(|error| panic!("{error} {input:?}"));
    let mut trajectory = calculate(&input);
    let planned = trajectory.duration();
    let (mut cycles, most) = (0, (2.0 * planned / cycle) as u32 + 1000);
    while trajectory.duration() > cycle && cycles < most {
        let [State { position, velocity, acceleration }] = trajectory.at(cycle);
        input.start[0] =
            State { position: position + noise(), velocity: velocity + noise(), acceleration: acceleration + noise() };
        cycles += 1;
        trajectory = calculate(&input);
    }
    Arrival { planned, arrived: f64::from(cycles) * cycle + trajectory.duration() }
}

/// Without noise the loop arrives when the first trajectory said it would, within a microsecond, or what a
/// billion roundings make of hours.
#[test]
fn a_closed_loop_arrives_as_planned() {
    for kind in
        [Kind::Benchmark, Kind::Decimals(1), Kind::Asymmetric, Kind::Outside, Kind::UnitLimits(2), Kind::Integers]
    {
        let mut source = Source::new(kind, 3);
        let (mut late, mut worst) = (0, 0.0_f64);
        for index in 0..campaign(100) {
            let problem = source.problem();
            let Arrival { planned, arrived } = follow(&problem, 4e-3, 0.0, || 0.0);
            let drift = (arrived - planned).abs();
            let allowed = 1e-6 + 1e-9 * planned;
            worst = worst.max(drift);
            late += usize::from(drift > allowed);
            // Where the target position is zero itself, its own roundings say nothing about those collected, and
            // a loop that has microseconds left may take some more.
            let most = if problem.target.position == 0.0 { 1e-4 } else { allowed };
            assert!(drift < most, "{kind:?} {index}: planned {planned} arrived {arrived} {problem:?}");
        }
        let count = campaign(100);
        println!("{kind:?}: {late} of {count} by more than 1e-6 s, worst drift {worst:.1e} s");
        assert!(late * 1000 <= count, "{kind:?}: {late}");
    }
}

/// What noise of `size` in every cycle amounts to while the joint brakes with nothing left to correct it: a walk
/// of as many steps, each grown by the time that is left.
fn collected(size: f64, problem: &Problem, planned: f64, cycle: f64) -> f64 {
    let Limits { velocity_max: v, acceleration_max: a, jerk_max: j, .. } = problem.limits;
    let braking = (v / a + 2.0 * (v / j).sqrt()).min(planned);
    4.0 * size * (1.0 + braking) * (1.0 + braking / cycle).sqrt()
}

/// With noise far above rounding, and a tolerance of what it collects, the loop arrives at a target at rest no
/// more than a cycle late. (A moving target can be missed by the noise, and is then approached anew.)
#[test]
fn a_noisy_closed_loop_arrives_in_spite_of_it() {
    let cycle = 4e-3;
    for size in [1e-12, 1e-9] {
        let (mut source, mut noise) = (Source::new(Kind::Benchmark, 4), Source::new(Kind::Noise, 5));
        let (mut late, mut worst) = (0, 0.0_f64);
        for index in 0..campaign(150) {
            let mut problem = source.problem();
            problem.target = State::at_rest(problem.target.position);
            let planned = follow(&problem, f64::INFINITY, 0.0, || 0.0).planned;
            let tolerance = collected(size, &problem, planned, cycle);
            let arrival = follow(&problem, cycle, tolerance, || noise.uniform(-size, size));
            let drift = (arrival.arrived - arrival.planned).abs();
            worst = worst.max(drift);
            late += usize::from(drift > cycle);
            let allowed = cycle + 2.0 * (32.0 * tolerance / problem.limits.jerk_max).cbrt();
            assert!(drift <= allowed, "{index}, noise {size:e}: off by {drift}, allowed {allowed} {problem:?}");
        }
        let count = campaign(150);
        println!("noise {size:e}: {late} of {count} by more than a cycle, worst {worst:.1e} s");
        assert!(late * 100 <= count, "noise {size:e}: {late}");
    }
}

/// At rest at the target nothing moves, and noise does not build up.
#[test]
fn an_idle_joint_stays() {
    let mut noise = Source::new(Kind::Noise, 6);
    let mut input = Input::<1>::default();
    input.target[0] = State::at_rest(0.3);
    input.start[0] = input.target[0];
    let trajectory = Trajectory::calculate(&input).expect("it is there");
    assert_eq!(trajectory.duration(), 0.0);
    assert_eq!(trajectory.at(17.0), input.target);
    for _ in 0..20_000 {
        let [State { position, velocity, acceleration }] = Trajectory::calculate(&input).expect("it is there").at(1e-3);
        let mut shake = || noise.uniform(-1e-9, 1e-9);
        input.start[0] =
            State { position: position + shake(), velocity: velocity + shake(), acceleration: acceleration + shake() };
        assert!((input.start[0].position - 0.3).abs() < 1e-7, "{:?}", input.start[0]);
    }
}

/// In its last moments a motion to a target about to leave the limits is itself about to: it must not be
/// braked then, which would take it round once more.
#[test]
fn a_motion_to_the_edge_of_the_limits_is_not_braked() {
    let state = |position, velocity, acceleration| State { position, velocity, acceleration };
    let problem = Problem {
        start: state(-2.3557667524672965, 0.3173449063895113, 0.5857945354834249),
        target: state(-0.9679396318101804, -0.8552238614433009, -0.918096818624193),
        limits: Limits::symmetric(1.2793842699565494, 1.1425122515211805, 0.9822844176244806),
    };
    let Arrival { planned, arrived } = follow(&problem, 4e-3, 0.0, || 0.0);
    assert!((planned - arrived).abs() < 1e-6, "{planned} {arrived}");
}

/// A target that may be missed by a tolerance may be missed by no more, and is no error then.
#[test]
fn a_motion_that_ends_within_the_tolerance_is_sound() {
    let mut input = Input::<1> { tolerance: [1e-11], ..Input::default() };
    input.start[0] =
        State { position: 0.0003726346952316704, velocity: -0.017393655415596256, acceleration: 0.19820326413800407 };
    input.target[0] = State::at_rest(-0.0006449712985624286);
    input.limits[0] = Limits::symmetric(7.27137832088671, 1.6299459557666829, 1.1292776870960957);
    let trajectory = Trajectory::calculate(&input).expect("valid");
    assert_eq!(trajectory.at(trajectory.duration()), input.target);
    // The roundings of velocities of 7.1, collected, in a last moment of far smaller ones.
    input = Input { tolerance: [0.0], ..input };
    input.start[0] =
        State { position: 1.6329507030918264e-8, velocity: -1.5325923037765396e-5, acceleration: 0.009589345052286015 };
    input.target[0] = State::at_rest(0.0);
    input.limits[0] = Limits::symmetric(7.1, 4.9, 3.0);
    Trajectory::calculate(&input).expect("valid");
}
