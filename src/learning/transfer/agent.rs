//! The deep Q-network: values a move in a state, learns from what was remembered.

use std::path::Path;

use candle_core::{Device, Tensor};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::episode::STATE;
use super::moves::{DESCRIPTION, MOVES, Move};
use crate::learning::encoder::adam::Adam;

const INPUT: usize = STATE + DESCRIPTION;
const HIDDEN: usize = 48;
/// Where the numbers of each layer end.
const ENDS: [usize; 6] = {
    let first = INPUT * HIDDEN;
    let second = first + HIDDEN + HIDDEN * HIDDEN;
    [first, first + HIDDEN, second, second + HIDDEN, second + 2 * HIDDEN, second + 2 * HIDDEN + 1]
};
/// Learning rate, Table 3 of the paper.
const RATE: f32 = 1e-3;
const CLIP: f32 = 5.0;
/// Discount γ₀.
const DISCOUNT: f32 = 0.9;
/// Remembered moves a step learns from, and steps after which the target network follows.
const BATCH: usize = 32;
const FOLLOW: u64 = 50;
/// Name of the weights in a model's folder.
pub const AGENT_FILE: &str = "agent.safetensors";

/// A move that was made.
#[derive(Clone, Debug)]
pub(crate) struct Memory {
    pub(crate) state: [f32; STATE],
    pub(crate) action: usize,
    pub(crate) reward: f32,
    pub(crate) next: [f32; STATE],
    /// Moves that could be made next; none at the end.
    pub(crate) allowed: Vec<usize>,
}

/// Main and target network, and what is remembered.
#[derive(Debug)]
pub struct Agent {
    main: Vec<f32>,
    target: Vec<f32>,
    gradient: Vec<f32>,
    adam: Adam,
    decays: Vec<bool>,
    memories: Vec<Memory>,
    rng: ChaCha8Rng,
}

/// What a network makes of an input, kept for the way back.
struct Activity {
    input: [f32; INPUT],
    hidden: [[f32; HIDDEN]; 2],
    value: f32,
}

impl Agent {
    /// An agent that knows nothing.
    pub fn new(seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut main = vec![0.0; ENDS[5]];
        for (range, inputs) in [(0..ENDS[0], INPUT), (ENDS[1]..ENDS[2], HIDDEN), (ENDS[3]..ENDS[4], HIDDEN)] {
            for v in &mut main[range] {
                let unit: f32 = StandardNormal.sample(&mut rng);
                *v = unit / (inputs as f32).sqrt();
            }
        }
        Self::with(main, rng)
    }

    fn with(main: Vec<f32>, rng: ChaCha8Rng) -> Self {
        let len = main.len();
        Self {
            target: main.clone(),
            main,
            gradient: vec![0.0; len],
            adam: Adam::new(0.0, len),
            decays: vec![false; len],
            memories: Vec::new(),
            rng,
        }
    }

    /// The agent of a file.
    ///
    /// # Errors
    /// candle's, when it cannot be read or has other shapes.
    pub fn load(file: &Path) -> candle_core::Result<Self> {
        let tensors = candle_core::safetensors::load(file, &Device::Cpu)?;
        let Some(tensor) = tensors.get("q") else { candle_core::bail!("{}: no tensor q", file.display()) };
        let main = tensor.to_vec1::<f32>()?;
        if main.len() != ENDS[5] || main.iter().any(|v| !v.is_finite()) {
            candle_core::bail!(
                "{}: tensor q: {} numbers, expected {} finite ones",
                file.display(),
                main.len(),
                ENDS[5]
            );
        }
        Ok(Self::with(main, ChaCha8Rng::seed_from_u64(0)))
    }

    /// Writes it.
    ///
    /// # Errors
    /// candle's, when the file cannot be written.
    pub fn save(&self, file: &Path) -> candle_core::Result<()> {
        let q = Tensor::from_slice(&self.main, self.main.len(), &Device::Cpu)?;
        candle_core::safetensors::save(&std::collections::HashMap::from([("q", q)]), file)
    }

    /// The move of most value among those allowed.
    pub(crate) fn choose(&self, state: &[f32; STATE], allowed: &[usize]) -> usize {
        best(&self.main, state, allowed).0
    }

    /// Remembers a move.
    pub(crate) fn remember(&mut self, memory: Memory) {
        self.memories.push(memory);
    }

    /// Learns from moves drawn from memory; answers the mean loss.
    //
    // Eq. (9): (r + γ₀ max Q(a') − Q(a))². The maximum is the target network's; its rate follows
    // the error no further than one (Huber), since a few moves ruin an encoder. The action is an
    // input: what is learned of one move then holds for its likes.
    pub(crate) fn learn(&mut self, steps: usize) -> f32 {
        let mut sum = 0.0;
        for _ in 0..steps {
            self.gradient.fill(0.0);
            for _ in 0..BATCH {
                let memory = &self.memories[self.rng.random_range(0..self.memories.len())];
                let next =
                    if memory.allowed.is_empty() { 0.0 } else { best(&self.target, &memory.next, &memory.allowed).1 };
                let seen = forward(&self.main, &memory.state, memory.action);
                let error = memory.reward + DISCOUNT * next - seen.value;
                sum += error * error / BATCH as f32;
                backward(&self.main, &seen, -error.clamp(-1.0, 1.0) / BATCH as f32, &mut self.gradient);
            }
            self.adam.step(&mut self.main, &self.gradient, &self.decays, RATE, CLIP);
            if self.adam.steps.is_multiple_of(FOLLOW) {
                self.target.clone_from(&self.main);
            }
        }
        sum / steps.max(1) as f32
    }
}

fn best(numbers: &[f32], state: &[f32; STATE], allowed: &[usize]) -> (usize, f32) {
    let values = allowed.iter().map(|&action| (action, forward(numbers, state, action).value));
    values.max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, 0.0))
}

fn forward(numbers: &[f32], state: &[f32; STATE], action: usize) -> Activity {
    debug_assert!(action < MOVES);
    let mut input = [0.0; INPUT];
    input[..STATE].copy_from_slice(state);
    input[STATE..].copy_from_slice(&Move::of(action).description());
    let layer = |from: &[f32], matrix: &[f32], bias: &[f32]| {
        let mut out = [0.0; HIDDEN];
        out.copy_from_slice(bias);
        for (x, weights) in from.iter().zip(matrix.chunks_exact(HIDDEN)) {
            out.iter_mut().zip(weights).for_each(|(o, w)| *o += x * w);
        }
        out.map(|v: f32| v.max(0.0))
    };
    let first = layer(&input, &numbers[..ENDS[0]], &numbers[ENDS[0]..ENDS[1]]);
    let second = layer(&first, &numbers[ENDS[1]..ENDS[2]], &numbers[ENDS[2]..ENDS[3]]);
    let last = &numbers[ENDS[3]..ENDS[4]];
    let value = numbers[ENDS[4]] + second.iter().zip(last).map(|(h, w)| h * w).sum::<f32>();
    Activity { input, hidden: [first, second], value }
}

fn backward(numbers: &[f32], seen: &Activity, d: f32, gradient: &mut [f32]) {
    let [first, second] = &seen.hidden;
    gradient[ENDS[4]] += d;
    let mut dsecond = [0.0; HIDDEN];
    for j in 0..HIDDEN {
        gradient[ENDS[3] + j] += d * second[j];
        dsecond[j] = if second[j] > 0.0 { d * numbers[ENDS[3] + j] } else { 0.0 };
        gradient[ENDS[2] + j] += dsecond[j];
    }
    let mut dfirst = [0.0; HIDDEN];
    for i in 0..HIDDEN {
        let row = ENDS[1] + i * HIDDEN;
        for j in 0..HIDDEN {
            gradient[row + j] += first[i] * dsecond[j];
            dfirst[i] += numbers[row + j] * dsecond[j];
        }
        if first[i] <= 0.0 {
            dfirst[i] = 0.0;
        }
        gradient[ENDS[0] + i] += dfirst[i];
    }
    for (i, x) in seen.input.iter().enumerate() {
        for j in 0..HIDDEN {
            gradient[i * HIDDEN + j] += x * dfirst[j];
        }
    }
}
