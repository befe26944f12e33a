//! What a control cycle computes: its parts, and the whole of it over a stretch of a cell in lockstep.

mod parry;
mod scene;

use std::hint::black_box;
use std::path::Path;
use std::time::Duration;

use hdrhistogram::Histogram;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tandem_clearance::Monitor;
use tandem_config::Cell;
use tandem_kinematics::{JOINTS_MAX, LinkPoses};
use tandem_msg::{Coded as _, Role, Stamp};
use tandem_trajectory::{Generator, Input, Limits, State};

use super::rehearsal::{Rehearsal, Rests};
use super::series::histogram;
use super::{BenchError, Options, Report, Series, loops};
use crate::learning::encoder::{Domain, Split, example};
use crate::perception::{Perception, Sampler};

const FORWARD: &str = "forward kinematics";
const CLEARANCE: &str = "clearance and separation";
const PARRY: &str = "parry3d-f64, the same shapes";
const TRAJECTORY: &str = "trajectory to a new target, six joints";
const CONTROLLER: &str = "control cycle of a cell in lockstep";
const ENCODER: &str = "encoder, one cloud";
/// Postures each part goes through.
const POSTURES: usize = 512;
/// Calls that are timed together when one is near the clock's resolution.
const BATCH: usize = 32;
/// Cell time that is run through in a round, for a second of measuring.
const CELL_TIME: u64 = 40;
const PERIOD: f64 = 1e-3;

pub(super) fn run(options: &Options, report: &mut Report) -> Result<(), BenchError> {
    let Some(file) = &options.cell else {
        report.note("the kernels need the arm of a cell, and none was named");
        return Ok(());
    };
    let cell = Cell::load(file, None).map_err(BenchError::Config)?;
    let cpu = loops::processor(options.cpu);
    let mut all = [FORWARD, CLEARANCE, PARRY, TRAJECTORY, CONTROLLER, ENCODER].map(Series::new);
    let postures = postures(&cell);
    let mut differs = 0.0_f64;
    for round in 0..options.rounds {
        let seed = u64::from(round) + 1;
        let part = options.time / 4;
        let conditions = &mut report.conditions;
        let [forward, clearance, parry, trajectory, controller, encoder] = &mut all;
        forward.add(loops::set_up(cpu, conditions, || kinematics(&cell, &postures, part))?);
        let (ours, theirs, apart) = loops::set_up(cpu, conditions, || distances(&cell, &postures, part, seed))??;
        clearance.add(ours);
        parry.add(theirs);
        differs = differs.max(apart);
        trajectory.add(loops::set_up(cpu, conditions, || trajectories(&cell, &postures, part))?);
        controller.add(loops::set_up(cpu, conditions, || cycles(file, &cell, options.time, seed))??);
        encoder.add(loops::set_up(cpu, conditions, || recognitions(&cell, part, seed))??);
    }
    report.note(format!(
        "{} joints; clearance of {} capsules and {} objects, separation from a person of {} capsules; parry answers the same \
         within {:.1e} m",
        cell.robot.chain.joint_count(),
        cell.robot.body.capsules().len(),
        scene::OBJECTS,
        scene::CAPSULES,
        differs
    ));
    all.into_iter().for_each(|series| report.add(series));
    report.compare(FORWARD, None);
    report.compare(CLEARANCE, Some(PARRY));
    report.compare(TRAJECTORY, None);
    report.compare(CONTROLLER, None);
    report.compare(ENCODER, None);
    Ok(())
}

/// Calls `work` over and over for that long; a call counts as `batch` of what is measured.
fn timed(time: Duration, batch: usize, mut work: impl FnMut(usize)) -> Histogram<u64> {
    let mut times = histogram();
    let (mut spent, mut turn) = (Duration::ZERO, 0);
    let mut rests = Rests::begin();
    while spent < time {
        let before = loops::now();
        work(turn);
        let took = before.age_at(loops::now());
        times.saturating_record((took.as_nanos() as u64).div_ceil(batch as u64));
        (spent, turn) = (spent + took, turn + 1);
        rests.take();
    }
    times
}

/// Postures within the arm's limits, the same each time.
fn postures(cell: &Cell) -> Vec<[f64; JOINTS_MAX]> {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let posture = |_| {
        let mut position = [0.0; JOINTS_MAX];
        for (value, joint) in position.iter_mut().zip(cell.robot.chain.joints()) {
            *value = random.random_range(joint.position_min.max(-3.0)..joint.position_max.min(3.0));
        }
        position
    };
    (0..POSTURES).map(posture).collect()
}

fn kinematics(cell: &Cell, postures: &[[f64; JOINTS_MAX]], time: Duration) -> Histogram<u64> {
    let chain = &cell.robot.chain;
    timed(time, BATCH, |turn| {
        for call in 0..BATCH {
            black_box(chain.forward(black_box(&postures[(turn * BATCH + call) % POSTURES])));
        }
    })
}

/// Ours and parry's, posture by posture; and by how much they differ, metres.
fn distances(
    cell: &Cell,
    postures: &[[f64; JOINTS_MAX]],
    time: Duration,
    seed: u64,
) -> Result<(Histogram<u64>, Histogram<u64>, f64), BenchError> {
    let (objects, person) = scene::draw(seed);
    let body = cell.robot.body;
    let mut monitor = Monitor::new(body);
    monitor.set_scene(&objects).map_err(|fault| BenchError::Refused(format!("{fault:?}")))?;
    monitor.set_human(&person);
    let peer = parry::Peer::of(&body, &objects, &person);
    let poses: Vec<LinkPoses> = postures.iter().map(|position| cell.robot.chain.forward(position)).collect();
    let ours = |poses: &LinkPoses| monitor.clearance(poses).distance.min(monitor.separation(poses).distance);
    let apart = poses.iter().map(|poses| (ours(poses).max(0.0) - peer.distance(poses)).abs()).fold(0.0, f64::max);
    let clearance = timed(time, 1, |turn| {
        black_box(ours(black_box(&poses[turn % POSTURES])));
    });
    let parry = timed(time, 1, |turn| {
        black_box(peer.distance(black_box(&poses[turn % POSTURES])));
    });
    Ok((clearance, parry, apart))
}

/// A new target in every cycle, from wherever the last one has led.
fn trajectories(cell: &Cell, postures: &[[f64; JOINTS_MAX]], time: Duration) -> Histogram<u64> {
    let mut input = Input::<6>::default();
    for (limits, joint) in input.limits.iter_mut().zip(cell.robot.chain.joints()) {
        *limits = Limits::symmetric(joint.velocity_max, joint.acceleration_max, joint.jerk_max);
    }
    let mut generator: Option<Generator<6>> = None;
    timed(time, 1, |turn| {
        for (target, position) in input.target.iter_mut().zip(&postures[turn % POSTURES]) {
            *target = State::at_rest(*position);
        }
        let step = match &mut generator {
            Some(generator) => generator.update(&input, PERIOD).ok(),
            None => {
                generator = Generator::new(&input).ok();
                None
            }
        };
        if let Some(step) = step {
            input.start = step.states;
        }
    })
}

/// Every cycle of the controller, ports included, while a cell assembles in lockstep.
fn cycles(file: &Path, cell: &Cell, time: Duration, seed: u64) -> Result<Histogram<u64>, BenchError> {
    let rehearsal = Rehearsal::new(file, cell, 1, seed)?;
    let mut sim = rehearsal.cell(cell, 1, seed)?;
    let mut times = histogram();
    let end = Stamp::default().after(time * CELL_TIME as u32);
    let mut rests = Rests::begin();
    while sim.now() < end {
        let before = loops::now();
        let outcome = sim.step(rehearsal.store(), &mut |_| {}).map_err(|error| rehearsal.refused(&error))?;
        let after = loops::now();
        if sim.role() == Role::Controller {
            times.saturating_record(after.0 - before.0);
        }
        if outcome.is_some() {
            break;
        }
        rests.take();
    }
    Ok(times)
}

/// Clouds of the test set, one of each class in turn.
fn recognitions(cell: &Cell, time: Duration, seed: u64) -> Result<Histogram<u64>, BenchError> {
    let mut perception =
        Perception::load(&cell.perception.model).map_err(|error| BenchError::Refused(error.to_string()))?;
    let classes = tandem_msg::FeatureClass::ALL.len() as u64;
    let mut sampler = Sampler::new();
    let clouds: Vec<Vec<[f32; 3]>> = (0..classes)
        .map(|index| {
            let mut cloud = Vec::new();
            example(&Domain::source(), seed, Split::Test, index, &mut sampler, &mut cloud);
            cloud
        })
        .collect();
    Ok(timed(time, 1, |turn| {
        black_box(perception.recognise(black_box(&clouds[turn % clouds.len()])));
    }))
}
