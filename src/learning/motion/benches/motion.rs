//! How fast is the environment stepped, and how long does an update take?
//!
//! `cargo bench -p tandem-motion`; the environment on as many threads as there are processors. Beside the rate of the
//! wall clock stands the rate of the time the threads had a processor: on a machine that others use, that one holds.

use std::path::Path;
use std::time::Instant;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tandem_config::Cell;
use tandem_motion::{Agent, Environment, Replay, Scene, Shield, Subtask, Transition, Tuning, World};
use tandem_planner::Planner;
use tandem_policy::{DOF, Lateral};

fn world(product: &str) -> World {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../config/cells/s471.toml");
    World::new(Cell::load(&file, Some(product)).expect("the shipped cell"))
}

/// Seconds this thread has had a processor; `None` where the kernel does not tell.
fn processor_time() -> Option<f64> {
    let told = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    Some(told.split_whitespace().next()?.parse::<f64>().ok()? * 1e-9)
}

/// Walks at random; seconds of a processor that took.
fn steps(world: &World, scenes: &[Scene], count: usize, seed: u64) -> f64 {
    let began = processor_time();
    let mut draws = ChaCha8Rng::seed_from_u64(seed);
    let mut environments: Vec<_> = scenes.iter().map(|scene| Environment::new(world, scene, Shield::On)).collect();
    for step in 0..count {
        let index = step % environments.len();
        let environment = &mut environments[index];
        let action: [f32; DOF] = std::array::from_fn(|_| 2.0 * draws.random::<f32>() - 1.0);
        if environment.step(&action).over {
            environment.reset(&scenes[index], &scenes[index].start, 0.0);
        }
    }
    processor_time().zip(began).map_or(f64::NAN, |(ended, began)| ended - began)
}

fn main() {
    let brief = !std::env::args().any(|argument| argument == "--bench");
    let (scene_count, step_count, update_count) = if brief { (4, 2_000, 4) } else { (64, 400_000, 200) };
    let threads = std::thread::available_parallelism().map_or(1, std::num::NonZeroUsize::get);
    let world = world("s472");
    let mut planner = Planner::new(4_096);
    let mut draws = ChaCha8Rng::seed_from_u64(1);
    for subtask in Subtask::ALL {
        let began = Instant::now();
        let scenes: Vec<_> = (0..scene_count).map(|_| world.scene(subtask, &mut planner, &mut draws)).collect();
        let each = began.elapsed().as_secs_f64() * 1e3 / scene_count as f64;
        let blocked = scenes.iter().filter(|scene| scene.straight_blocked).count();
        let began = Instant::now();
        let processor: f64 = std::thread::scope(|scope| {
            let (world, scenes) = (&world, &scenes);
            let walk = |thread| scope.spawn(move || steps(world, scenes, step_count, thread as u64));
            let walks: Vec<_> = (0..threads).map(walk).collect();
            walks.into_iter().map(|walk| walk.join().expect("a walk")).sum()
        });
        let all = (threads * step_count) as f64;
        println!(
            "{:9} {:8.0} steps/s on {threads} threads, {:8.0} a second of one processor; a scene in {each:.1} ms, straight line blocked in {blocked} of {scene_count}",
            subtask.name(),
            all / began.elapsed().as_secs_f64(),
            all / processor
        );
    }
    let mut replay = Replay::new(4_096);
    for _ in 0..4_096 {
        let mut number = || draws.random::<f32>() - 0.5;
        replay.push(Transition {
            state: std::array::from_fn(|_| number()),
            action: std::array::from_fn(|_| number()),
            reward: number(),
            next: std::array::from_fn(|_| number()),
            terminal: false,
        });
    }
    let plain = Agent::new(Lateral::Adapter, &mut draws);
    let progressive = plain.progressive(&mut draws);
    for (name, mut agent) in [("actor-critic", plain), ("progressive, 2 columns", progressive)] {
        let (began, processor) = (Instant::now(), processor_time());
        for _ in 0..update_count {
            agent.update(&replay, &replay, &Tuning::default(), &mut draws);
        }
        let each = |seconds: f64| seconds * 1e3 / f64::from(update_count);
        let processor = processor_time().zip(processor).map_or(f64::NAN, |(ended, began)| ended - began);
        println!(
            "{name}: {:.2} ms an update, {:.2} of a processor",
            each(began.elapsed().as_secs_f64()),
            each(processor)
        );
    }
}
