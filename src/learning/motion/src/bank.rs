//! Scenes and demonstrations of a subtask: the same for every method and seed.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tandem_planner::Planner;
use tandem_policy::{SAFETY, SCALE};

use crate::agent::DISCOUNT;
use crate::environment::{Environment, INPUTS, Shield};
use crate::expert;
use crate::replay::{Replay, Transition};
use crate::world::{Joints, Scene, Subtask, World};

/// Which scenes: those that are trained on, those by which something is chosen, those that only measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Split {
    /// For training.
    Train,
    /// For curves and choices.
    Validation,
    /// For the report.
    Test,
}

/// Nodes of the planner that demonstrates.
pub(crate) const NODES: usize = 4_096;

/// Randomness that nothing but these names decides.
pub(crate) fn draws(product: &str, subtask: Subtask, what: &str, seed: u64) -> ChaCha8Rng {
    let hash = blake3::hash(format!("{product}/{}/{what}/{seed}", subtask.name()).as_bytes());
    ChaCha8Rng::from_seed(*hash.as_bytes())
}

/// So many scenes of a split.
pub fn scenes(world: &World, subtask: Subtask, split: Split, seed: u64, count: usize) -> Vec<Scene> {
    let name = match split {
        Split::Train => "train",
        Split::Validation => "validation",
        Split::Test => "test",
    };
    let mut slots: Vec<Option<Scene>> = vec![None; count];
    let product = &world.cell.product.name;
    in_parallel(&mut slots, |index, slot, planner| {
        let mut draws = draws(product, subtask, &format!("{name}/{index}"), seed);
        *slot = Some(world.scene(subtask, planner, &mut draws));
    });
    slots.into_iter().flatten().collect()
}

/// As many threads as there are processors.
pub(crate) fn threads() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZeroUsize::get)
}

/// Does something to every item, on all processors; what comes out does not depend on how many there are.
pub(crate) fn in_parallel<T: Send>(items: &mut [T], work: impl Fn(usize, &mut T, &mut Planner) + Sync) {
    let each = items.len().div_ceil(threads()).max(1);
    std::thread::scope(|scope| {
        for (chunk, items) in items.chunks_mut(each).enumerate() {
            let work = &work;
            scope.spawn(move || {
                let mut planner = Planner::new(NODES);
                for (index, item) in items.iter_mut().enumerate() {
                    work(chunk * each + index, item, &mut planner);
                }
            });
        }
    });
}

/// Follows the planner's way from a joint position and keeps every step. Whether it came to the goal.
///
/// `refused`: a motion of the learner's was refused there, so the first step is shown as well for when it is told so.
pub(crate) fn demonstrate(
    environment: &mut Environment<'_>,
    scene: &Scene,
    way: &[Joints],
    time: f64,
    refused: bool,
    into: &mut Replay,
) -> bool {
    /// How often: it is one step among many that nothing was refused before.
    const TOLD: usize = 2;
    environment.shield = Shield::On;
    environment.reset(scene, &way[0], time);
    let (mut at, mut told) = (0.0, if refused { TOLD } else { 0 });
    loop {
        let mut state = [0.0; INPUTS];
        environment.write_input(&mut state);
        let begun = at;
        let action = expert::action(way, environment.joints(), &mut at, 1.0);
        let stepped = environment.step(&action);
        if stepped.refused {
            // A step that cuts a corner too short; asked for anew it is shorter.
            if stepped.over {
                return false;
            }
            at = begun;
            continue;
        }
        let step = transition(state, action, environment, stepped.reward, stepped.arrived);
        for _ in 0..std::mem::take(&mut told) {
            let mut step = step.clone();
            step.state[SAFETY] = -SCALE[SAFETY];
            into.push(step);
        }
        into.push(step);
        if stepped.over {
            return stepped.arrived;
        }
    }
}

/// A step as it is kept. Where the goal was reached the reward stands for staying there for ever.
pub(crate) fn transition(
    state: [f32; INPUTS],
    action: [f32; tandem_policy::DOF],
    environment: &Environment<'_>,
    reward: f64,
    arrived: bool,
) -> Transition {
    let mut next = [0.0; INPUTS];
    environment.write_input(&mut next);
    let reward = if arrived { reward as f32 / (1.0 - DISCOUNT) } else { reward as f32 };
    Transition { state, action, reward, next, terminal: arrived }
}

/// Demonstrations in all scenes: along the planner's way, and from places beside it, where a learner will err to.
pub fn demonstrations(world: &World, subtask: Subtask, scenes: &[Scene]) -> Replay {
    /// Joints are shifted this far, rad.
    const BESIDE: f64 = 0.3;
    /// Ways from beside, a scene.
    const WAYS: usize = 2;
    let product = &world.cell.product.name;
    let mut slots: Vec<Replay> = vec![Replay::new(usize::MAX); scenes.len()];
    in_parallel(&mut slots, |index, replay, planner| {
        let scene = &scenes[index];
        let mut draws = draws(product, subtask, "demonstrations", index as u64);
        let mut environment = Environment::new(world, scene, Shield::On);
        demonstrate(&mut environment, scene, &scene.way, 0.0, false, replay);
        for _ in 0..WAYS {
            let corner = draws.random_range(0..scene.way.len() - 1);
            let share: f64 = draws.random();
            let [from, to] = [corner, corner + 1].map(|k| scene.way[k]);
            let mut beside: Joints = std::array::from_fn(|k| from[k] + share * (to[k] - from[k]));
            for joint in beside.iter_mut().take(tandem_policy::DOF) {
                *joint += draws.random_range(-BESIDE..BESIDE);
            }
            let time = draws.random_range(0.0..3.0);
            if let Some(way) = expert::way(world, scene, &beside, time, planner, draws.random()) {
                demonstrate(&mut environment, scene, &way, time, false, replay);
            }
        }
    });
    let mut all = Replay::new(usize::MAX);
    for transition in slots.into_iter().flat_map(Replay::into_kept) {
        all.push(transition);
    }
    all
}
