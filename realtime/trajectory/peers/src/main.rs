//! Times one calculation, and one evaluation, of tandem-trajectory, ruckig (the official crate, which
//! binds the C++) and rsruckig.
//!
//! All solve the same random inputs (ruckig's benchmark distribution). Blocks of 256 inputs go through
//! the peers in turn, in rotating order, in several passes; an input's time is its minimum over the
//! passes, less the time of an empty measurement. Only ratios within one run mean anything.
//!
//! `cargo run --release --manifest-path realtime/trajectory/peers/Cargo.toml [inputs]`

mod inputs;

use inputs::{Problem, Source};
use std::{hint::black_box, time::Instant};
use tandem_trajectory::{Input, Interface, Trajectory};

const BLOCK: usize = 256;
const PASSES: usize = 3;
const PEERS: [&str; 3] = ["tandem", "ruckig", "rsruckig"];

/// Nanoseconds of one call, for each input the least over the passes.
struct Times([Vec<f64>; 3]);

impl Times {
    fn new(count: usize) -> Self {
        Times([(); 3].map(|()| vec![f64::INFINITY; count]))
    }

    fn record(&mut self, peer: usize, index: usize, nanos: f64) {
        let least = &mut self.0[peer][index];
        *least = least.min(nanos);
    }

    fn print(mut self, what: &str, empty: f64) {
        let mut means = [0.0; 3];
        for peer in 0..3 {
            let times = &mut self.0[peer];
            times
                .iter_mut()
                .for_each(|time| *time = (*time - empty).max(0.0));
            times.sort_by(f64::total_cmp);
            let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize];
            means[peer] = times.iter().sum::<f64>() / times.len() as f64;
            println!(
                "{what:<22} {:<9} mean {:>8.0}  median {:>8.0}  p99 {:>8.0}  p99.9 {:>8.0}  max {:>8.0} ns   p99.9/mean {:>5.2}",
                PEERS[peer],
                means[peer],
                at(0.5),
                at(0.99),
                at(0.999),
                at(1.0),
                at(0.999) / means[peer]
            );
        }
        println!(
            "{what:<22} mean ratios: tandem / ruckig {:.3}, tandem / rsruckig {:.3}",
            means[0] / means[1],
            means[0] / means[2]
        );
    }
}

/// What a measurement of nothing takes.
fn empty() -> f64 {
    (0..10_000)
        .map(|_| {
            let begin = Instant::now();
            begin.elapsed().as_nanos() as f64
        })
        .fold(f64::INFINITY, f64::min)
}

fn ours<const N: usize>(problems: &[Problem; N], velocity: bool) -> Input<N> {
    Input {
        start: problems.map(|problem| problem.start),
        target: problems.map(|problem| problem.target),
        limits: problems.map(|problem| problem.limits),
        interface: [if velocity {
            Interface::Velocity
        } else {
            Interface::Position
        }; N],
        ..Input::default()
    }
}

fn bound(problems: &[Problem], velocity: bool) -> ruckig::InputParameter {
    let mut input = ruckig::InputParameter::new(problems.len());
    let each = |value: fn(&Problem) -> f64| problems.iter().map(value).collect::<Vec<f64>>();
    input.control_interface = if velocity {
        ruckig::ControlInterface::Velocity
    } else {
        ruckig::ControlInterface::Position
    };
    input.current_position = each(|problem| problem.start.position);
    input.current_velocity = each(|problem| problem.start.velocity);
    input.current_acceleration = each(|problem| problem.start.acceleration);
    input.target_position = each(|problem| problem.target.position);
    input.target_velocity = each(|problem| problem.target.velocity);
    input.target_acceleration = each(|problem| problem.target.acceleration);
    input.max_velocity = each(|problem| problem.limits.velocity_max);
    input.max_acceleration = each(|problem| problem.limits.acceleration_max);
    input.max_jerk = each(|problem| problem.limits.jerk_max);
    input
}

fn ported<const N: usize>(
    problems: &[Problem; N],
    velocity: bool,
) -> rsruckig::prelude::InputParameter<N> {
    let mut input = rsruckig::prelude::InputParameter::new(None);
    input.control_interface = if velocity {
        rsruckig::prelude::ControlInterface::Velocity
    } else {
        rsruckig::prelude::ControlInterface::Position
    };
    for (index, problem) in problems.iter().enumerate() {
        input.current_position[index] = problem.start.position;
        input.current_velocity[index] = problem.start.velocity;
        input.current_acceleration[index] = problem.start.acceleration;
        input.target_position[index] = problem.target.position;
        input.target_velocity[index] = problem.target.velocity;
        input.target_acceleration[index] = problem.target.acceleration;
        input.max_velocity[index] = problem.limits.velocity_max;
        input.max_acceleration[index] = problem.limits.acceleration_max;
        input.max_jerk[index] = problem.limits.jerk_max;
    }
    input
}

fn compare<const N: usize>(count: usize, velocity: bool, empty: f64) {
    use rsruckig::prelude::{
        DataArrayOrVec, Ruckig as Port, ThrowErrorHandler, Trajectory as PortTrajectory,
    };
    let mut source = Source::new(1000 + N as u64);
    let (mut a, mut b, mut c) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..count {
        let problems: [Problem; N] = std::array::from_fn(|_| source.problem());
        a.push(ours(&problems, velocity));
        b.push(bound(&problems, velocity));
        c.push(ported(&problems, velocity));
    }
    let mut bound_solver = ruckig::Ruckig::new_direct_and_offline(N);
    let mut bound_trajectory = ruckig::Trajectory::new_direct(N);
    let mut port_solver = Port::<N, ThrowErrorHandler>::new(None, 1e-3);
    let mut port_trajectory = PortTrajectory::new(None);
    let (mut position, mut speed, mut push) = (
        DataArrayOrVec::<f64, N>::new(None, 0.0),
        DataArrayOrVec::<f64, N>::new(None, 0.0),
        DataArrayOrVec::<f64, N>::new(None, 0.0),
    );
    let (mut solve, mut evaluate) = (Times::new(count), Times::new(count));
    let instants: Vec<f64> = (0..64).map(|_| source.uniform(0.0, 1.0)).collect();
    let mut differing = 0;
    for pass in 0..PASSES {
        for (block, begin) in (0..count).step_by(BLOCK).enumerate() {
            for turn in 0..3 {
                let peer = (turn + block + pass) % 3;
                for index in begin..(begin + BLOCK).min(count) {
                    let start = Instant::now();
                    match peer {
                        0 => {
                            let trajectory = black_box(Trajectory::calculate(black_box(&a[index])));
                            solve.record(0, index, start.elapsed().as_nanos() as f64);
                            let trajectory = trajectory.expect("a valid input");
                            let duration = trajectory.duration();
                            let start = Instant::now();
                            for share in &instants {
                                black_box(trajectory.at(black_box(share * duration)));
                            }
                            evaluate.record(0, index, start.elapsed().as_nanos() as f64);
                        }
                        1 => {
                            let result = black_box(
                                bound_solver
                                    .calculate(black_box(&mut b[index]), &mut bound_trajectory),
                            );
                            solve.record(1, index, start.elapsed().as_nanos() as f64);
                            let duration = bound_trajectory.get_duration();
                            if pass == 0 {
                                let own = Trajectory::calculate(&a[index])
                                    .expect("a valid input")
                                    .duration();
                                let differs = result != ruckig::Result::Working
                                    || (own - duration).abs() > 1e-8 * duration.max(1.0);
                                differing += u32::from(differs);
                            }
                            let start = Instant::now();
                            for share in &instants {
                                black_box(bound_trajectory.at_time(black_box(share * duration)));
                            }
                            evaluate.record(1, index, start.elapsed().as_nanos() as f64);
                        }
                        _ => {
                            let _ = black_box(
                                port_solver.calculate(black_box(&c[index]), &mut port_trajectory),
                            );
                            solve.record(2, index, start.elapsed().as_nanos() as f64);
                            let duration = port_trajectory.get_duration();
                            let start = Instant::now();
                            for share in &instants {
                                port_trajectory.at_time(
                                    black_box(share * duration),
                                    &mut Some(&mut position),
                                    &mut Some(&mut speed),
                                    &mut Some(&mut push),
                                    &mut None,
                                    &mut None,
                                );
                                black_box((&position, &speed, &push));
                            }
                            evaluate.record(2, index, start.elapsed().as_nanos() as f64);
                        }
                    }
                }
            }
        }
    }
    let interface = if velocity { "velocity" } else { "position" };
    solve.print(&format!("{interface}, {N} joints"), empty);
    for times in &mut evaluate.0 {
        times
            .iter_mut()
            .for_each(|time| *time = (*time - empty) / 64.0);
    }
    evaluate.print(&format!("  evaluation, {N} joints"), 0.0);
    println!("  durations that differ from ruckig's by more than 1e-8: {differing} of {count}\n");
}

fn main() {
    let count = std::env::args()
        .nth(1)
        .and_then(|count| count.parse().ok())
        .unwrap_or(20_000);
    let empty = empty();
    println!("{count} inputs a row, {PASSES} passes, empty measurement {empty} ns\n");
    for velocity in [false, true] {
        compare::<1>(count, velocity, empty);
        compare::<3>(count, velocity, empty);
        compare::<6>(count, velocity, empty);
        compare::<7>(count, velocity, empty);
    }
}
