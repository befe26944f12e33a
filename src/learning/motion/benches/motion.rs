//! How fast is the environment stepped, and how long does an update take?
//!
//! `cargo bench -p tandem-motion`; the environment on as many threads as there are processors.

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

/// Steps a second of one thread, walking at random.
fn steps(world: &World, scenes: &[Scene], count: usize, seed: u64) {
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
        std::thread::scope(|scope| {
            for thread in 0..threads {
                let (world, scenes) = (&world, &scenes);
                scope.spawn(move || steps(world, scenes, step_count, thread as u64));
            }
        });
        let rate = (threads * step_count) as f64 / began.elapsed().as_secs_f64();
        println!(
            "{:9} {rate:8.0} steps/s on {threads} threads; a scene in {each:.1} ms, straight line blocked in {blocked} of {scene_count}",
            subtask.name()
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
        let began = Instant::now();
        for _ in 0..update_count {
            agent.update(&replay, &replay, &Tuning::default(), &mut draws);
        }
        println!("{name}: {:.2} ms an update", began.elapsed().as_secs_f64() * 1e3 / f64::from(update_count));
    }
}
