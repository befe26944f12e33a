//! Fig. 10 on our data: collision rate and running time of hand-made, learned and planned paths.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use tandem_planner::Planner;
use tandem_policy::{Activations, DOF, OBSERVATION, Policy, SCALE, STEP, Shape};

use crate::bank::NODES;
use crate::baselines::{follow, manual, planned, shortened};
use crate::environment::Shield;
use crate::network::Pass;
use crate::rollouts::{Outcome, rollouts};
use crate::timing::duration;
use crate::world::{Scene, World};

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

/// All methods on the scenes of one subtask.
pub fn evaluate(world: &World, subtask: &str, scenes: &[Scene], candidates: &[Candidate]) -> Vec<Row> {
    let chain = world.chain();
    let mut planner = Planner::new(NODES);
    let mut draws = ChaCha8Rng::seed_from_u64(1);
    let by_hand: Vec<_> = scenes.iter().map(|scene| manual(world, scene)).collect();
    let manual_s: Vec<_> = by_hand.iter().map(|path| duration(chain, path, true)).collect();
    let ways: Vec<_> = scenes.iter().map(|scene| planned(world, scene, &mut planner, draws.random())).collect();
    let planner_s: Vec<_> = ways.iter().map(|way| way.as_deref().and_then(|way| duration(chain, way, false))).collect();
    let mut rows = Vec::new();
    for shield in [Shield::Off, Shield::On] {
        let mut add = |method: &str, seed: u64, outcomes: &[Outcome], seconds: &[Option<f64>]| {
            let good = |outcome: &Outcome| outcome.arrived && !outcome.contact;
            let timed: Vec<_> = (0..outcomes.len()).filter(|k| good(&outcomes[*k])).collect();
            let ratio = |to: &[Option<f64>]| median(timed.iter().filter_map(|k| Some(seconds[*k]? / to[*k]?)));
            rows.push(Row {
                subtask: subtask.into(),
                method: method.into(),
                seed,
                shielded: shield == Shield::On,
                reached: Rate::new(timed.len(), outcomes.len()),
                contact: Rate::new(outcomes.iter().filter(|outcome| outcome.contact).count(), outcomes.len()),
                time_s: median(timed.iter().filter_map(|k| seconds[*k])),
                time_over_manual: ratio(&manual_s),
                time_over_planner: ratio(&planner_s),
            });
        };
        let outcomes: Vec<_> =
            scenes.iter().zip(&by_hand).map(|(scene, path)| follow(world, scene, path, shield)).collect();
        add("manual", 0, &outcomes, &manual_s);
        let outcomes: Vec<_> = scenes
            .iter()
            .zip(&ways)
            .map(|(scene, way)| way.as_ref().map_or_else(Outcome::default, |way| follow(world, scene, way, shield)))
            .collect();
        add("planner", 0, &outcomes, &planner_s);
        for candidate in candidates {
            let outcomes = move_by(world, scenes, shield, candidate);
            let seconds: Vec<_> = scenes
                .iter()
                .zip(&outcomes)
                .map(|(scene, outcome)| {
                    let path = match shield {
                        Shield::Off => outcome.path.clone(),
                        // In the cell a preview is shortened where the straight way is clear as well.
                        Shield::On => shortened(world, &world.monitor_of(scene, 0.0, 0.0), &outcome.path),
                    };
                    duration(chain, &path, false)
                })
                .collect();
            add(&candidate.method, candidate.seed, &outcomes, &seconds);
        }
    }
    rows
}

/// The middle value; NaN of nothing.
fn median(values: impl Iterator<Item = f64>) -> f64 {
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
