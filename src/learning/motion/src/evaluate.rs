//! Fig. 10 on our data: collision rate and running time of hand-made, learned and planned paths.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use tandem_planner::Planner;
use tandem_policy::{Activations, DOF, OBSERVATION, Policy, SCALE, STEP, Shape};

use crate::bank::{in_parallel, threads};
use crate::baselines::{follow, manual, planned, shortened};
use crate::environment::Shield;
use crate::network::Pass;
use crate::rollouts::{Outcome, rollouts};
use crate::timing::duration;
use crate::world::{Joints, Scene, World};

/// A rate with its 95 % interval after Wilson (1927).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Rate {
    /// How often.
    pub count: usize,
    /// Of how many.
    pub of: usize,
    /// Their ratio.
    pub rate: f64,
    /// Ends of the interval.
    pub interval: [f64; 2],
}

impl Rate {
    /// The rate of `count` in `of`.
    pub fn new(count: usize, of: usize) -> Self {
        const Z: f64 = 1.959_963_984_540_054;
        let n = of.max(1) as f64;
        let p = count as f64 / n;
        let centre = (p + Z * Z / (2.0 * n)) / (1.0 + Z * Z / n);
        let half = Z / (1.0 + Z * Z / n) * (p * (1.0 - p) / n + Z * Z / (4.0 * n * n)).sqrt();
        Self { count, of, rate: p, interval: [(centre - half).max(0.0), (centre + half).min(1.0)] }
    }
}

/// What one method made of the tests of a subtask.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Row {
    /// Grasp, transfer, place, assemble.
    pub subtask: String,
    /// Manual, planner, or a policy's method.
    pub method: String,
    /// Seed of the training; 0 where nothing was trained.
    pub seed: u64,
    /// Whether motions that are not clear were refused.
    pub shielded: bool,
    /// The goal was reached, within the tolerance of the controller's last approach, without contact.
    pub reached: Rate,
    /// The arm touched something while it moved.
    pub contact: Rate,
    /// Median seconds of those that reached the goal, at the joints' limits.
    pub time_s: f64,
    /// Median ratio to the hand-made path of the same scene.
    pub time_over_manual: f64,
    /// Median ratio to the sampling planner's path of the same scene, passed without stopping.
    pub time_over_planner: f64,
}

/// A precomputed policy under test.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// Its method.
    pub method: String,
    /// Seed of its training.
    pub seed: u64,
    /// Its shape.
    pub shape: Shape,
    /// Its numbers.
    pub numbers: Vec<f32>,
}

/// Moves through scenes with a precomputed policy, by the inference that a cell runs.
///
/// # Panics
/// The numbers are no policy of that shape.
pub fn move_by(world: &World, scenes: &[Scene], shield: Shield, candidate: &Candidate) -> Vec<Outcome> {
    let policy = Policy::new(candidate.shape, &candidate.numbers).expect("a policy");
    let mut room = Activations::default();
    let mut observation = [0.0; OBSERVATION];
    rollouts(world, scenes, shield, &mut |states: &[f32], pass: &mut Pass| {
        pass.output.resize(states.len() / OBSERVATION * DOF, 0.0);
        let rows = states.chunks_exact(OBSERVATION).zip(pass.output.chunks_exact_mut(DOF));
        for (state, action) in rows {
            for ((to, from), scale) in observation.iter_mut().zip(state).zip(&SCALE) {
                *to = from / scale;
            }
            // What is not finite moves nothing.
            let _ = policy.act(&mut room, &observation, action);
            action.iter_mut().for_each(|increment| *increment /= STEP);
        }
    })
}

/// What is measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// Every method, alone and shielded, and times beside the hand-made and the planned path of the same scene.
    All,
    /// Policies alone in being measured, and only as the cell moves them: for very many tests. No times.
    ShieldedPolicies,
}

/// The methods on the scenes of one subtask, on all processors; what comes out does not depend on how many there are.
pub fn evaluate(world: &World, subtask: &str, scenes: &[Scene], candidates: &[Candidate], extent: Extent) -> Vec<Row> {
    let mut paths: Vec<Paths> = Vec::new();
    if extent == Extent::All {
        let mut draws = ChaCha8Rng::seed_from_u64(1);
        let begin = |scene| (scene, draws.random::<u64>(), Paths::default());
        let mut slots: Vec<_> = scenes.iter().map(begin).collect();
        in_parallel(&mut slots, |_, (scene, seed, paths), planner| *paths = Paths::of(world, scene, planner, *seed));
        paths = slots.into_iter().map(|(.., paths)| paths).collect();
    }
    let shields: &[Shield] = if extent == Extent::All { &[Shield::Off, Shield::On] } else { &[Shield::On] };
    let baselines: &[Mover<'_>] = if extent == Extent::All { &[Mover::Manual, Mover::Planner] } else { &[] };
    let movers = || baselines.iter().copied().chain(candidates.iter().map(Mover::Policy));
    let jobs: Vec<_> = shields.iter().flat_map(|shield| movers().map(move |mover| (*shield, mover))).collect();
    let mut rows: Vec<Option<Row>> = vec![None; jobs.len()];
    let (next, finished) = (AtomicUsize::new(0), Mutex::new(&mut rows));
    std::thread::scope(|scope| {
        for _ in 0..threads() {
            scope.spawn(|| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some((shield, mover)) = jobs.get(index) else { break };
                    let row = measure(world, subtask, scenes, &paths, *shield, *mover);
                    finished.lock().unwrap_or_else(PoisonError::into_inner)[index] = Some(row);
                }
            });
        }
    });
    rows.into_iter().flatten().collect()
}

/// Who moves.
#[derive(Clone, Copy)]
enum Mover<'a> {
    Manual,
    Planner,
    Policy(&'a Candidate),
}

/// What a policy is compared with in one scene.
#[derive(Clone, Default)]
struct Paths {
    by_hand: Vec<Joints>,
    by_hand_s: Option<f64>,
    planned: Option<Vec<Joints>>,
    planned_s: Option<f64>,
}

impl Paths {
    fn of(world: &World, scene: &Scene, planner: &mut Planner, seed: u64) -> Self {
        let chain = world.chain();
        let by_hand = manual(world, scene);
        let by_hand_s = duration(chain, &by_hand, true);
        let planned = planned(world, scene, planner, seed);
        let planned_s = planned.as_deref().and_then(|way| duration(chain, way, false));
        Self { by_hand, by_hand_s, planned, planned_s }
    }
}

/// One row: one mover in all scenes.
fn measure(world: &World, subtask: &str, scenes: &[Scene], paths: &[Paths], shield: Shield, mover: Mover<'_>) -> Row {
    let both = || scenes.iter().zip(paths);
    let (method, seed, outcomes, seconds): (_, _, Vec<Outcome>, Vec<Option<f64>>) = match mover {
        Mover::Manual => {
            let moved = both().map(|(scene, paths)| follow(world, scene, &paths.by_hand, shield));
            ("manual", 0, moved.collect(), paths.iter().map(|paths| paths.by_hand_s).collect())
        }
        Mover::Planner => {
            let moved = both().map(|(scene, paths)| match &paths.planned {
                Some(way) => follow(world, scene, way, shield),
                None => Outcome::default(),
            });
            ("planner", 0, moved.collect(), paths.iter().map(|paths| paths.planned_s).collect())
        }
        Mover::Policy(candidate) => {
            let outcomes = move_by(world, scenes, shield, candidate);
            let timed = scenes.iter().zip(&outcomes).take(paths.len()).map(|(scene, outcome)| match shield {
                Shield::Off => duration(world.chain(), &outcome.path, false),
                // In the cell a preview is shortened where the straight way is clear as well.
                Shield::On => {
                    let short = shortened(world, &world.monitor_of(scene, 0.0, 0.0), &outcome.path);
                    duration(world.chain(), &short, false)
                }
            });
            let seconds = timed.collect();
            (candidate.method.as_str(), candidate.seed, outcomes, seconds)
        }
    };
    let good: Vec<_> = (0..outcomes.len()).filter(|k| outcomes[*k].arrived && !outcomes[*k].contact).collect();
    let seconds_of = |k: &usize| *seconds.get(*k)?;
    let ratio =
        |to: fn(&Paths) -> Option<f64>| median(good.iter().filter_map(|k| Some(seconds_of(k)? / to(paths.get(*k)?)?)));
    Row {
        subtask: subtask.into(),
        method: method.into(),
        seed,
        shielded: shield == Shield::On,
        reached: Rate::new(good.len(), outcomes.len()),
        contact: Rate::new(outcomes.iter().filter(|outcome| outcome.contact).count(), outcomes.len()),
        time_s: median(good.iter().filter_map(seconds_of)),
        time_over_manual: ratio(|paths| paths.by_hand_s),
        time_over_planner: ratio(|paths| paths.planned_s),
    }
}

/// The middle value; NaN of nothing.
pub fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Newcombe (1998), method 3: 81 of 263 and 15 of 148.
    #[test]
    fn intervals_are_those_of_the_literature() {
        for (count, of, low, high) in [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611)] {
            let rate = Rate::new(count, of);
            assert!((rate.interval[0] - low).abs() < 5e-5, "{rate:?}");
            assert!((rate.interval[1] - high).abs() < 5e-5, "{rate:?}");
        }
    }
}
