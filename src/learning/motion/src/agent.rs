//! One actor and two critics, each as a predict and a global network (Fig. 7): twin delayed deep
//! deterministic policy gradient (Fujimoto et al., 2018), with a share of demonstrations in every batch.
//!
//! "Global" is what the field calls target: a copy that follows slowly and is bootstrapped from. On
//! demonstrated steps the actor is also drawn to what was shown (Fujimoto and Gu, 2021); agents with
//! progressive columns and those without are treated alike in all of this.

use std::io;

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use tandem_config::Tensors;
use tandem_policy::{DOF, Lateral, SCALE, STEP, Shape};

use crate::adam::Adam;
use crate::environment::INPUTS;
use crate::network::{Network, Pass};
use crate::replay::Replay;

/// Steps of a batch, half of them demonstrated, and half of those as corrections.
const BATCH: usize = 128;
/// Discount of what follows.
pub(crate) const DISCOUNT: f32 = 0.95;
/// How fast global networks follow.
const FOLLOW: f32 = 0.005;
/// Noise on the action that is bootstrapped from, and its bound.
const SMOOTHING: [f32; 2] = [0.1, 0.25];

/// What an agent is trained with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tuning {
    /// Learning rate of Adam (Table 3: 1e-3).
    pub rate: f32,
    /// Weight of the value in the actor's loss, per mean value: 0 imitates only.
    pub value: f32,
}

impl Default for Tuning {
    fn default() -> Self {
        Self { rate: 1e-3, value: 1.0 }
    }
}

/// Actor, critics and what their training needs.
#[derive(Clone, Debug)]
pub struct Agent {
    actor: Network,
    critics: [Network; 2],
    global_actor: Network,
    global_critics: [Network; 2],
    adam: [Adam; 3],
    updates: u64,
    room: Room,
}

/// Buffers of an update.
#[derive(Clone, Debug, Default)]
struct Room {
    state: Vec<f32>,
    next: Vec<f32>,
    action: Vec<f32>,
    reward: Vec<f32>,
    ends: Vec<bool>,
    pair: Vec<f32>,
    actor: Pass,
    critics: [Pass; 2],
    gradient: Vec<f32>,
    slope: Vec<f32>,
    by_action: Vec<f32>,
}

/// Losses of an update.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Losses {
    /// Mean squared TD error of both critics.
    pub critic: f32,
    /// Mean squared difference to the demonstrations.
    pub imitation: f32,
    /// Mean value of the actor's own actions.
    pub value: f32,
}

impl Agent {
    /// A new agent of one column.
    pub fn new(lateral: Lateral, draws: &mut ChaCha8Rng) -> Self {
        let actor = Network::new(INPUTS, DOF, lateral, draws);
        let critics = [0, 1].map(|_| Network::new(INPUTS + DOF, 1, lateral, draws));
        Self::of(actor, critics)
    }

    fn of(actor: Network, critics: [Network; 2]) -> Self {
        let moments = |network: &Network| Adam::new(network.trained().len());
        let adam = [moments(&actor), moments(&critics[0]), moments(&critics[1])];
        let (global_actor, global_critics) = (actor.clone(), critics.clone());
        Self { actor, critics, global_actor, global_critics, adam, updates: 0, room: Room::default() }
    }

    /// A progressive agent: this one's columns stand still, a new one in actor and critics sees them.
    #[must_use]
    pub fn progressive(&self, draws: &mut ChaCha8Rng) -> Self {
        let grown = |network: &Network, draws: &mut ChaCha8Rng| {
            let mut network = network.clone();
            network.add_column(draws);
            network
        };
        let actor = grown(&self.actor, draws);
        let critics = [grown(&self.critics[0], draws), grown(&self.critics[1], draws)];
        Self::of(actor, critics)
    }

    /// The same agent with its moments forgotten: what fine-tuning begins with.
    #[must_use]
    pub fn again(&self) -> Self {
        Self::of(self.actor.clone(), self.critics.clone())
    }

    /// Actions for a batch of states, in shares of the largest increments.
    pub fn act(&self, states: &[f32], pass: &mut Pass) {
        self.actor.forward(states, pass);
        for value in &mut pass.output {
            *value = value.tanh();
        }
    }

    /// Shape and numbers of the actor as a precomputed policy.
    pub fn policy(&self) -> (Shape, Vec<f32>) {
        let shape =
            Shape { inputs: INPUTS, outputs: DOF, columns: self.actor.columns(), lateral: self.actor.lateral() };
        let head = [0.0; INPUTS].into_iter().chain(SCALE).chain([STEP; DOF]);
        (shape, head.chain(self.actor.numbers().iter().copied()).collect())
    }

    /// All networks, for a checkpoint: actor, critics, global actor, global critics.
    pub fn networks(&self) -> [&[f32]; 6] {
        [
            self.actor.numbers(),
            self.critics[0].numbers(),
            self.critics[1].numbers(),
            self.global_actor.numbers(),
            self.global_critics[0].numbers(),
            self.global_critics[1].numbers(),
        ]
    }

    /// Moments of actor and critics, for a checkpoint.
    pub fn moments(&self) -> [&Adam; 3] {
        [&self.adam[0], &self.adam[1], &self.adam[2]]
    }

    /// Updates made.
    pub fn updates(&self) -> u64 {
        self.updates
    }

    /// The same, to be gone on from.
    pub(crate) fn moments_mut(&mut self) -> &mut [Adam; 3] {
        &mut self.adam
    }

    /// Updates made before.
    pub(crate) fn set_updates(&mut self, updates: u64) {
        self.updates = updates;
    }

    /// Takes over the networks of a checkpoint.
    pub(crate) fn take_networks(&mut self, tensors: &Tensors) -> io::Result<()> {
        let [first, second] = &mut self.critics;
        let [global_first, global_second] = &mut self.global_critics;
        let networks = [&mut self.actor, first, second, &mut self.global_actor, global_first, global_second];
        for (index, network) in networks.into_iter().enumerate() {
            let numbers = tensors.vector(&format!("network.{index}"))?;
            if numbers.len() != network.numbers().len() {
                let what = "the checkpoint is of networks of another shape";
                return Err(io::Error::new(io::ErrorKind::InvalidData, what));
            }
            network.set_numbers(numbers);
        }
        Ok(())
    }

    /// One update of the critics and of the actor: delayed, as is usual, it would imitate half as much for four fifths of
    /// the work.
    pub fn update(&mut self, shown: &Replay, own: &Replay, tuning: &Tuning, draws: &mut ChaCha8Rng) -> Losses {
        let mut room = std::mem::take(&mut self.room);
        let demonstrated = room.fill(shown, own, draws);
        self.updates += 1;
        let mut losses = Losses { critic: self.learn_value(&mut room, tuning, draws), ..Losses::default() };
        (losses.imitation, losses.value) = self.learn_action(&mut room, demonstrated, tuning);
        self.global_actor.follow(&self.actor, FOLLOW);
        for (global, critic) in self.global_critics.iter_mut().zip(&self.critics) {
            global.follow(critic, FOLLOW);
        }
        self.room = room;
        losses
    }

    /// TD error of both critics against the lesser of the global ones.
    fn learn_value(&mut self, room: &mut Room, tuning: &Tuning, draws: &mut ChaCha8Rng) -> f32 {
        self.global_actor.forward(&room.next, &mut room.actor);
        for value in &mut room.actor.output {
            // The mean of four draws is near enough to normal.
            let noise = (0..4).map(|_| draws.random::<f32>() - 0.5).sum::<f32>() * 1.7 * SMOOTHING[0];
            *value = (value.tanh() + noise.clamp(-SMOOTHING[1], SMOOTHING[1])).clamp(-1.0, 1.0);
        }
        join(&room.next, &room.actor.output, &mut room.pair);
        for (critic, pass) in self.global_critics.iter().zip(&mut room.critics) {
            critic.forward(&room.pair, pass);
        }
        let [first, second] = &room.critics;
        let targets: Vec<f32> = (0..BATCH)
            .map(|k| {
                let ahead = first.output[k].min(second.output[k]);
                room.reward[k] + if room.ends[k] { 0.0 } else { DISCOUNT * ahead }
            })
            .collect();
        join(&room.state, &room.action, &mut room.pair);
        let mut loss = 0.0;
        for (index, critic) in self.critics.iter_mut().enumerate() {
            let pass = &mut room.critics[index];
            critic.forward(&room.pair, pass);
            room.slope.clear();
            for (value, target) in pass.output.iter().zip(&targets) {
                let error = value - target;
                loss += 0.5 * error * error / BATCH as f32;
                room.slope.push(2.0 * error / BATCH as f32);
            }
            room.gradient.resize(critic.trained().len(), 0.0);
            critic.backward(&room.slope, pass, Some(&mut room.gradient), None);
            self.adam[1 + index].step(critic.trained_mut(), &room.gradient, tuning.rate);
        }
        loss
    }

    /// Up the value of the first critic, and towards what was shown.
    fn learn_action(&mut self, room: &mut Room, demonstrated: usize, tuning: &Tuning) -> (f32, f32) {
        self.actor.forward(&room.state, &mut room.actor);
        for value in &mut room.actor.output {
            *value = value.tanh();
        }
        let mut value = 0.0;
        room.by_action.clear();
        room.by_action.resize(BATCH * DOF, 0.0);
        if tuning.value > 0.0 {
            join(&room.state, &room.actor.output, &mut room.pair);
            let (critic, pass) = (&self.critics[0], &mut room.critics[0]);
            critic.forward(&room.pair, pass);
            let size = pass.output.iter().map(|q| q.abs()).sum::<f32>() / BATCH as f32;
            value = pass.output.iter().sum::<f32>() / BATCH as f32;
            let weight = tuning.value / size.max(1e-3) / BATCH as f32;
            room.slope.clear();
            room.slope.resize(BATCH, -weight);
            critic.backward(&room.slope, pass, None, Some((INPUTS, &mut room.by_action)));
        }
        let mut imitation = 0.0;
        for (index, (slope, action)) in room.by_action.iter_mut().zip(&room.actor.output).enumerate() {
            if index < demonstrated * DOF {
                let error = action - room.action[index];
                imitation += error * error / (demonstrated * DOF) as f32;
                *slope += 2.0 * error / demonstrated as f32;
            }
            *slope *= 1.0 - action * action;
        }
        room.gradient.resize(self.actor.trained().len(), 0.0);
        self.actor.backward(&room.by_action, &mut room.actor, Some(&mut room.gradient), None);
        self.adam[0].step(self.actor.trained_mut(), &room.gradient, tuning.rate);
        (imitation, value)
    }
}

/// States and actions side by side.
fn join(states: &[f32], actions: &[f32], pair: &mut Vec<f32>) {
    pair.clear();
    for (state, action) in states.chunks_exact(INPUTS).zip(actions.chunks_exact(DOF)) {
        pair.extend_from_slice(state);
        pair.extend_from_slice(action);
    }
}

impl Room {
    /// Draws a batch, what was shown first; returns how many those are.
    fn fill(&mut self, shown: &Replay, own: &Replay, draws: &mut ChaCha8Rng) -> usize {
        for numbers in [&mut self.state, &mut self.next, &mut self.action, &mut self.reward] {
            numbers.clear();
        }
        self.ends.clear();
        let demonstrated = match (shown.count(), own.count()) {
            (0, _) => 0,
            (_, 0) => BATCH,
            _ => BATCH / 2,
        };
        for k in 0..BATCH {
            let transition = match k {
                k if k < demonstrated / 2 => shown.draw_late(draws),
                k if k < demonstrated => shown.draw(draws),
                _ => own.draw(draws),
            };
            self.state.extend_from_slice(&transition.state);
            self.next.extend_from_slice(&transition.next);
            self.action.extend_from_slice(&transition.action);
            self.reward.push(transition.reward);
            self.ends.push(transition.terminal);
        }
        demonstrated
    }
}
