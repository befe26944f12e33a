//! Training of one policy: episodes of a batch of environments, updates in between, a curve on the way.

use std::io;
use std::path::PathBuf;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use tandem_config::Tensors;
use tandem_planner::Planner;
use tandem_policy::{DOF, Lateral};

use crate::agent::{Agent, Tuning};
use crate::bank::{NODES, demonstrate, draws, transition};
use crate::environment::{Environment, INPUTS, Shield};
use crate::expert;
use crate::network::Pass;
use crate::replay::Replay;
use crate::rollouts::{Outcome, rollouts};
use crate::world::{Joints, Scene, Subtask, World};

/// Environments that are stepped together.
const ENVIRONMENTS: usize = 32;
/// Updates after each step of all of them.
const UPDATES: usize = 2;
/// Largest noise on an action while exploring, at the start of training.
const NOISE: f32 = 0.15;
/// Steps kept of the agent's own.
const OWN_MAX: usize = 60_000;
/// Room for steps shown beyond the first demonstrations.
const CORRECTIONS_MAX: usize = 60_000;
/// Steps before a refused motion from which the way is shown.
const BEFORE: usize = 3;
/// Share of the episodes after which the planner shows the way from a place the agent came to: of those that
/// reached the goal and were refused nothing, of all others.
const CORRECTED: [f64; 2] = [0.2, 1.0];
/// The rate falls to this share of the first, along a cosine.
const RATE_END: f32 = 0.05;

/// How a policy is learned.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Actor-critic of one column, from nothing.
    Ac,
    /// A new column beside the frozen ones of the source product.
    Pnn,
    /// The source product's column itself, trained on.
    FineTuned,
}

impl Method {
    /// Name in files and on the screen.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ac => "ac",
            Self::Pnn => "pnn",
            Self::FineTuned => "fine_tuned",
        }
    }
}

/// What a training is told.
#[derive(Clone, Debug)]
pub struct TrainOptions {
    /// What is learned.
    pub subtask: Subtask,
    /// How.
    pub method: Method,
    /// Decides everything that is drawn in this run; scenes and first demonstrations are the same for all.
    pub seed: u64,
    /// Updates in all.
    pub updates: u64,
    /// Updates between two points of the curve, where a checkpoint is written.
    pub interval: u64,
    /// Settings of the agent.
    pub tuning: Tuning,
    /// Where the checkpoint is kept, if anywhere.
    pub checkpoint: Option<PathBuf>,
    /// Go on from it.
    pub resume: bool,
}

/// A point of the curve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Point {
    /// Own episodes begun so far.
    pub episodes: u64,
    /// Demonstrations that were given on the way: corrections.
    pub corrections: u64,
    /// Updates so far.
    pub updates: u64,
    /// Mean reward of a step, validation scenes, no noise.
    pub reward: f64,
    /// Share of the validation scenes where the goal was reached without contact.
    pub success: f64,
    /// Share with a contact.
    pub contact: f64,
    /// Mean TD error squared since the point before.
    pub critic_loss: f32,
    /// Mean imitation error since then.
    pub imitation_loss: f32,
}

/// What all trainings of a subtask share.
#[derive(Clone, Debug)]
pub struct Lessons<'a> {
    /// The cell.
    pub world: &'a World,
    /// Scenes to train in.
    pub scenes: &'a [Scene],
    /// Scenes for the curve.
    pub validation: &'a [Scene],
    /// First demonstrations.
    pub shown: &'a Replay,
}

/// A trained agent and how it came to be.
#[derive(Clone, Debug)]
pub struct Trained {
    /// The agent.
    pub agent: Agent,
    /// Its curve.
    pub curve: Vec<Point>,
}

/// A run under way.
struct Run<'a> {
    lessons: &'a Lessons<'a>,
    options: &'a TrainOptions,
    agent: Agent,
    corrections: Replay,
    own: Replay,
    draws: ChaCha8Rng,
    curve: Vec<Point>,
    episodes: u64,
    corrected: u64,
    planner: Planner,
}

/// Trains a policy.
///
/// `source` is the agent of the source product, for those methods that build on it; `progress` is told of
/// every point of the curve.
///
/// # Errors
/// The checkpoint cannot be written or read.
pub fn train(
    lessons: &Lessons<'_>,
    options: &TrainOptions,
    source: Option<&Agent>,
    progress: &mut dyn FnMut(&Point),
) -> io::Result<Trained> {
    let product = &lessons.world.cell.product.name;
    let mut draws = draws(product, options.subtask, options.method.name(), options.seed);
    let agent = match (options.method, source) {
        (Method::Pnn, Some(source)) => source.progressive(&mut draws),
        (Method::FineTuned, Some(source)) => source.again(),
        _ => Agent::new(Lateral::Adapter, &mut draws),
    };
    let mut run = Run {
        lessons,
        options,
        agent,
        corrections: lessons.shown.clone().grown(CORRECTIONS_MAX),
        own: Replay::new(OWN_MAX),
        draws,
        curve: Vec::new(),
        episodes: 0,
        corrected: 0,
        planner: Planner::new(NODES),
    };
    if options.resume
        && let Some(file) = options.checkpoint.as_deref().filter(|file| file.exists())
    {
        run.restore(&Tensors::load(file)?)?;
        run.curve.iter().for_each(&mut *progress);
    }
    while run.agent.updates() < options.updates {
        let losses = run.interval();
        let point = run.measure(losses);
        progress(&point);
        run.curve.push(point);
        if let Some(file) = &options.checkpoint {
            run.state()?.save(file)?;
        }
    }
    Ok(Trained { agent: run.agent, curve: run.curve })
}

impl Run<'_> {
    /// Episodes and updates up to the next point of the curve; mean losses.
    fn interval(&mut self) -> [f32; 2] {
        let Lessons { world, scenes, .. } = *self.lessons;
        let mut scene_of: Vec<usize> = (0..ENVIRONMENTS).map(|_| self.draws.random_range(0..scenes.len())).collect();
        let mut environments: Vec<_> =
            scene_of.iter().map(|scene| Environment::new(world, &scenes[*scene], Shield::On)).collect();
        let mut visited: Vec<Vec<(Joints, f64)>> = vec![Vec::new(); ENVIRONMENTS];
        let mut refused: Vec<Option<usize>> = vec![None; ENVIRONMENTS];
        self.episodes += ENVIRONMENTS as u64;
        let (mut states, mut pass) = (vec![0.0; ENVIRONMENTS * INPUTS], Pass::default());
        let end = (self.agent.updates() + self.options.interval).min(self.options.updates);
        let (mut sums, mut count) = ([0.0_f32; 2], 0.0_f32);
        while self.agent.updates() < end {
            for (state, environment) in states.chunks_exact_mut(INPUTS).zip(&environments) {
                environment.write_input(state);
            }
            self.agent.act(&states, &mut pass);
            let done = self.agent.updates() as f32 / self.options.updates as f32;
            let noise = NOISE * (1.0 - done);
            for (index, environment) in environments.iter_mut().enumerate() {
                let mut action = [0.0; DOF];
                for (action, output) in action.iter_mut().zip(&pass.output[index * DOF..]) {
                    let draw = self.draws.random::<f32>() + self.draws.random::<f32>() - 1.0;
                    *action = (output + 2.4 * noise * draw).clamp(-1.0, 1.0);
                }
                visited[index].push((*environment.joints(), environment.time()));
                let stepped = environment.step(&action);
                if stepped.refused && refused[index].is_none() {
                    refused[index] = Some(visited[index].len() - 1);
                }
                let mut state = [0.0; INPUTS];
                state.copy_from_slice(&states[index * INPUTS..(index + 1) * INPUTS]);
                self.own.push(transition(state, action, environment, stepped.reward, stepped.arrived));
                if stepped.over {
                    let share = CORRECTED[usize::from(!stepped.arrived || refused[index].is_some())];
                    if self.draws.random::<f64>() < share {
                        // Up to where a motion was refused first, if any was: there, or a little before.
                        let (place, there) = match refused[index].take() {
                            Some(at) if self.draws.random() => (at, true),
                            Some(at) => (at - self.draws.random_range(0..=at.min(BEFORE)), false),
                            None => (self.draws.random_range(0..visited[index].len()), false),
                        };
                        let (joints, time) = visited[index][place];
                        self.correct(environment, scene_of[index], &joints, time, there);
                    }
                    visited[index].clear();
                    refused[index] = None;
                    scene_of[index] = self.draws.random_range(0..scenes.len());
                    let scene = &scenes[scene_of[index]];
                    environment.shield = Shield::On;
                    environment.reset(scene, &scene.start, 0.0);
                    self.episodes += 1;
                }
            }
            for _ in 0..UPDATES {
                let cosine = 0.5 * (1.0 + (std::f32::consts::PI * done).cos());
                let rate = self.options.tuning.rate * (RATE_END + (1.0 - RATE_END) * cosine);
                let tuning = Tuning { rate, ..self.options.tuning };
                let losses = self.agent.update(&self.corrections, &self.own, &tuning, &mut self.draws);
                sums[0] += losses.critic;
                sums[1] += losses.imitation;
                count += 1.0;
            }
        }
        sums.map(|sum| sum / count.max(1.0))
    }

    /// The planner shows the way from a place the agent came to and did not get on from; `refused`: its motion
    /// there was refused, so the same is shown for when it is told so.
    fn correct(&mut self, environment: &mut Environment<'_>, scene: usize, joints: &Joints, time: f64, refused: bool) {
        let Lessons { world, scenes, .. } = *self.lessons;
        let seed = self.draws.random();
        if let Some(way) = expert::way(world, &scenes[scene], joints, time, &mut self.planner, seed) {
            self.corrected += 1;
            demonstrate(environment, &scenes[scene], &way, time, refused, &mut self.corrections);
        }
    }

    fn measure(&self, [critic_loss, imitation_loss]: [f32; 2]) -> Point {
        let mut act = |states: &[f32], pass: &mut Pass| self.agent.act(states, pass);
        let outcomes = rollouts(self.lessons.world, self.lessons.validation, Shield::Off, &mut act);
        let count = outcomes.len().max(1) as f64;
        let share = |what: &dyn Fn(&Outcome) -> bool| outcomes.iter().filter(|o| what(o)).count() as f64 / count;
        let steps: f64 = outcomes.iter().map(|outcome| outcome.steps as f64).sum();
        Point {
            episodes: self.episodes,
            corrections: self.corrected,
            updates: self.agent.updates(),
            reward: outcomes.iter().map(|outcome| outcome.reward).sum::<f64>() / steps.max(1.0),
            success: share(&|outcome| outcome.arrived && !outcome.contact),
            contact: share(&|outcome| outcome.contact),
            critic_loss,
            imitation_loss,
        }
    }

    /// Everything needed to go on.
    fn state(&self) -> io::Result<Tensors> {
        let mut tensors = Tensors::default();
        let mut note = |name: &str, value: String| tensors.notes.insert(name.into(), value);
        note("draws", self.draws.get_word_pos().to_string());
        note("updates", self.agent.updates().to_string());
        note("episodes", self.episodes.to_string());
        note("corrected", self.corrected.to_string());
        note("curve", serde_json::to_string(&self.curve)?);
        note("own", self.own.next().to_string());
        note("corrections", self.corrections.next().to_string());
        for (index, network) in self.agent.networks().into_iter().enumerate() {
            tensors.vectors.insert(format!("network.{index}"), network.to_vec());
        }
        for (index, adam) in self.agent.moments().into_iter().enumerate() {
            let (first, second, steps) = adam.state();
            tensors.vectors.insert(format!("moment.{index}.first"), first.to_vec());
            tensors.vectors.insert(format!("moment.{index}.second"), second.to_vec());
            tensors.notes.insert(format!("moment.{index}.steps"), steps.to_string());
        }
        tensors.vectors.insert("replay.own".into(), self.own.numbers());
        tensors.vectors.insert("replay.corrections".into(), self.corrections.numbers());
        Ok(tensors)
    }

    fn restore(&mut self, tensors: &Tensors) -> io::Result<()> {
        self.agent.take_networks(tensors)?;
        for (index, adam) in self.agent.moments_mut().iter_mut().enumerate() {
            let name = |what: &str| format!("moment.{index}.{what}");
            let (first, second) = (tensors.vector(&name("first"))?, tensors.vector(&name("second"))?);
            adam.restore(first, second, tensors.number(&name("steps"))?);
        }
        let wrong = || io::Error::new(io::ErrorKind::InvalidData, "the checkpoint has no curve");
        self.agent.set_updates(tensors.number("updates")?);
        self.draws.set_word_pos(tensors.number("draws")?);
        self.episodes = tensors.number("episodes")?;
        self.corrected = tensors.number("corrected")?;
        self.curve = serde_json::from_str(tensors.notes.get("curve").ok_or_else(wrong)?)?;
        self.own.restore(tensors.vector("replay.own")?, tensors.number("own")?);
        self.corrections.restore(tensors.vector("replay.corrections")?, tensors.number("corrections")?);
        Ok(())
    }
}
