//! The network on its way from the source to the target, and the looks it learns from.

use std::collections::BTreeMap;
use std::path::Path;

use candle_core::Tensor;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use tandem_msg::{Coded, FEATURE_CLASSES};

use super::protocol::SHARD;
use crate::learning::encoder::Domain;
use crate::learning::encoder::augment::augmented;
use crate::learning::encoder::dataset::{Example, Look, Split, example};
use crate::learning::encoder::parameters::Parameters;
use crate::learning::encoder::pass::Pass;
use crate::learning::encoder::train::{Run, TrainError};
use crate::perception::engine::Engine;
use crate::perception::model::softmax;
use crate::perception::network::CLASS_HIDDEN;
use crate::perception::{Sampler, WEIGHTS_FILE};

/// Share of a target shard in the running statistics.
const MOMENTUM: f32 = 0.1;

/// Examples of a target: a few with labels, others without.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sets<'a> {
    pub(crate) labelled: &'a [Example],
    /// Their labels are never read.
    pub(crate) unlabelled: &'a [Example],
}

/// Draws `labels` examples of each class, and `unlabelled` others.
pub(crate) fn draw(domain: &Domain, seed: u64, labels: usize, unlabelled: usize) -> [Vec<Example>; 2] {
    let (mut sampler, mut cloud) = (Sampler::new(), Vec::new());
    let [mut some, mut others] = [Vec::new(), Vec::new()];
    let mut counts = [0; FEATURE_CLASSES];
    for index in 0.. {
        let class = domain.class(index).code() as usize;
        let set = if counts[class] < labels {
            counts[class] += 1;
            &mut some
        } else if others.len() < unlabelled {
            &mut others
        } else if counts.iter().all(|count| *count >= labels) {
            break;
        } else {
            continue;
        };
        set.push(example(domain, seed, Split::Train, index, &mut sampler, &mut cloud));
    }
    [some, others]
}

/// One look at each of `count` examples drawn from a set, seen anew.
pub(crate) fn batch(set: &[Example], count: usize, rng: &mut ChaCha8Rng) -> Vec<Look> {
    (0..count)
        .map(|_| {
            let example = &set[rng.random_range(0..set.len())];
            let closer = example.closer.as_ref().filter(|_| rng.random_bool(0.5));
            augmented(closer.unwrap_or(&example.look), rng)
        })
        .collect()
}

/// The look an example is watched by: whole views and closer ones in turn.
pub(crate) fn watched(set: &[Example]) -> Vec<&Look> {
    set.iter().enumerate().map(|(i, e)| e.closer.as_ref().filter(|_| i % 2 == 1).unwrap_or(&e.look)).collect()
}

/// What a network makes of looks, as it would in a cell.
#[derive(Debug, Default)]
pub(crate) struct Answers {
    /// Looks × [`crate::learning::encoder::pass::FEATURES`].
    pub(crate) features: Vec<f32>,
    pub(crate) probabilities: Vec<[f32; FEATURE_CLASSES]>,
}

impl Answers {
    pub(crate) fn of(engine: &mut Engine, looks: &[&Look]) -> Self {
        let mut out = Self::default();
        for look in looks {
            let logits = *engine.run(&look.sample).0;
            out.probabilities.push(softmax(&logits, 1.0));
            out.features.extend_from_slice(engine.features());
        }
        out
    }
}

/// Loss and accuracy of the classes, both looks at an example together.
pub(crate) fn verdict(engine: &mut Engine, examples: &[Example]) -> [f64; 2] {
    let (mut loss, mut right) = (0.0, 0.0);
    for example in examples {
        let mut logits = *engine.run(&example.look.sample).0;
        if let Some(closer) = &example.closer {
            let (again, _) = engine.run(&closer.sample);
            logits = std::array::from_fn(|c| 0.5 * (logits[c] + again[c]));
        }
        let (own, probabilities) = (example.class.code() as usize, softmax(&logits, 1.0));
        loss -= f64::from(probabilities[own].max(1e-6).ln());
        let best = (0..FEATURE_CLASSES).max_by(|&a, &b| logits[a].total_cmp(&logits[b]));
        right += f64::from(u8::from(best == Some(own)));
    }
    [loss, right].map(|sum| sum / examples.len().max(1) as f64)
}

/// A network that can be asked, differentiated, changed and put back.
pub(crate) struct Student {
    pub(crate) run: Run,
    /// Of the source and of the target.
    pub(crate) passes: [Pass; 2],
    mask: Vec<f32>,
}

/// Everything that changes.
#[derive(Clone, Debug)]
pub(crate) struct Snapshot {
    parameters: Vec<f32>,
    statistics: Vec<f32>,
}

impl Student {
    /// A copy of the model in a folder.
    pub(crate) fn load(folder: &Path) -> Result<Self, TrainError> {
        let tensors = candle_core::safetensors::load(folder.join(WEIGHTS_FILE), &candle_core::Device::Cpu)?;
        let tensors: BTreeMap<String, Tensor> = tensors.into_iter().collect();
        let run = Run::on(Parameters::stored(tensors))?;
        Ok(Self { run, passes: [Pass::default(), Pass::default()], mask: vec![1.0; 2 * SHARD * CLASS_HIDDEN] })
    }

    pub(crate) fn engine(&self) -> Result<Engine, TrainError> {
        self.run.engine()
    }

    pub(crate) fn snapshot(&self) -> Snapshot {
        Snapshot { parameters: self.run.parameters.clone(), statistics: self.run.statistics.clone() }
    }

    pub(crate) fn restore(&mut self, to: &Snapshot) {
        self.run.parameters.clone_from(&to.parameters);
        self.run.statistics.clone_from(&to.statistics);
    }

    /// Looks at a shard with the pass of a domain: 0 source, 1 target. Without dropout: so few labels need
    /// the whole network.
    pub(crate) fn see(&mut self, domain: usize, looks: &[Look], phase: usize) {
        let looks: Vec<&Look> = looks.iter().collect();
        self.passes[domain].see(&self.run.plan, &self.run.parameters, &looks, &self.mask, phase);
    }

    /// Gradient of what was asked about the shard seen last; left in the pass.
    pub(crate) fn learn(&mut self, domain: usize, demand: &crate::learning::encoder::pass::Demand<'_>) {
        self.passes[domain].backward(&self.run.plan, &self.run.parameters, &self.mask, demand);
    }

    /// Lets the running statistics follow the target shard seen last.
    pub(crate) fn follow(&mut self) {
        for (old, new) in self.run.statistics.iter_mut().zip(&self.passes[1].statistics) {
            *old += MOMENTUM * (new - *old);
        }
    }

    /// Takes all statistics anew from looks at the target.
    pub(crate) fn refresh(&mut self, looks: &[Look]) {
        let shards = looks.chunks_exact(SHARD);
        let share = 1.0 / shards.len().max(1) as f32;
        let mut sums = vec![0.0; self.run.statistics.len()];
        for shard in shards {
            self.see(1, shard, 0);
            sums.iter_mut().zip(&self.passes[1].statistics).for_each(|(sum, new)| *sum += share * new);
        }
        self.run.statistics = sums;
    }
}
