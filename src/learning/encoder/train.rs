//! The training run: data, epochs, selection on validation, calibration, card.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};
use std::time::Instant;

use candle_core::{Device, Tensor};
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::adam::Adam;
use super::augment::{augmented, dropout_mask};
use super::dataset::{Example, Look, Split, examples};
use super::domain::Domain;
use super::parameters::Parameters;
use super::pass::{Pass, Plan, SEGMENT_STRIDE, Spans};
use super::report::{self, Answers};
use crate::perception::card::{Card, DataCard, Metrics};
use crate::perception::engine::Engine;
use crate::perception::network::{ARCHITECTURE, CLASS_HIDDEN, MOMENTUM, Network};
use crate::perception::{CARD_FILE, WEIGHTS_FILE, WindingCard};

/// Looks of one step, in shards that each have their own batch statistics.
const BATCH: usize = 32;
const SHARD: usize = 16;
/// Share of closer looks.
const CLOSER: f64 = 0.5;
/// Largest learning rate of the one-cycle schedule.
const RATE: f32 = 4e-3;
/// Share of the run in which the rate rises.
const WARM: f32 = 0.15;
const DECAY: f32 = 0.05;
const CLIP: f32 = 5.0;
/// Validation examples that are looked at after each epoch.
const WATCHED: usize = 320;
/// What the card says of the data.
const GENERATOR: &str =
    "parts of eight feature classes, scanned by the plant's depth camera; whole views and closer looks";
/// File that holds an unfinished run.
const CHECKPOINT: &str = "encoder.checkpoint.safetensors";

/// What to train on, and where to.
#[derive(Clone, Debug)]
pub struct TrainOptions {
    /// Training examples; a tenth as many for validation, an eighth for the test.
    pub samples: usize,
    /// Passes over them.
    pub epochs: usize,
    /// Decides everything that is drawn.
    pub seed: u64,
    /// Folder for weights and card; also for the checkpoint of an unfinished run.
    pub out: PathBuf,
    /// Go on from the checkpoint, if there is one of the same run.
    pub resume: bool,
    /// Threads that scan and train; the result does not depend on it.
    pub threads: usize,
}

/// How far a run is.
#[derive(Clone, Debug, PartialEq)]
pub enum TrainProgress {
    /// Scanning examples of training and validation: made, of all.
    Data(usize, usize),
    /// In an epoch, counted from 1: steps done, steps of an epoch, mean loss so far.
    Step(usize, usize, usize, f64),
    /// An epoch is over.
    Epoch {
        /// Counted from 1.
        epoch: usize,
        /// Of the classes, on validation, both looks together.
        accuracy: f64,
        /// Of the points, on validation.
        points: f64,
        /// Trained with.
        clouds_a_second: f64,
    },
    /// Calibrating on the validation split, measuring on the test split.
    Test,
}

/// Why there is no model.
#[derive(Debug, thiserror::Error)]
pub enum TrainError {
    /// Options that make no sense.
    #[error("train encoder: {field} = {found}, allowed {allowed}")]
    Option {
        /// Name of the option.
        field: &'static str,
        /// What was given.
        found: usize,
        /// What is allowed.
        allowed: &'static str,
    },
    /// A file could not be written or read.
    #[error("{file}: {source}; choose a writable folder with --out")]
    File {
        /// The file.
        file: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The checkpoint belongs to another run.
    #[error("{file}: made with other options; repeat those, or train without --resume")]
    Checkpoint {
        /// The file.
        file: PathBuf,
    },
    /// candle refused an operation.
    #[error("the network could not be computed: {0}")]
    Network(#[from] candle_core::Error),
    /// The trained model could not be read back.
    #[error("the model just written is refused: {0}")]
    Model(#[from] crate::perception::ModelError),
}

/// Trains, calibrates, measures, and writes the model; answers its card.
///
/// # Errors
/// [`TrainError`]; the checkpoint of the last finished epoch stays for `resume`.
pub fn train(options: &TrainOptions, progress: &mut dyn FnMut(&TrainProgress)) -> Result<Card, TrainError> {
    check(options)?;
    std::fs::create_dir_all(&options.out).map_err(|source| TrainError::File { file: options.out.clone(), source })?;
    let counts = [options.samples, options.samples.div_ceil(10).max(64), options.samples.div_ceil(8).max(64)];
    let total = counts[0] + counts[1];
    let source = Domain::source();
    let made = |split, before: usize, count, progress: &mut dyn FnMut(&TrainProgress)| {
        let mut report = |made| {
            if made % 100 == 0 {
                progress(&TrainProgress::Data(before + made, total));
            }
        };
        examples(&source, options.seed, split, count, options.threads, &mut report)
    };
    let file = options.out.join(CHECKPOINT);
    let mut run = Run::begin(options, &file)?;
    if run.epoch < options.epochs {
        let training = made(Split::Train, 0, counts[0], progress);
        let validation = made(Split::Validation, counts[0], counts[1], progress);
        while run.epoch < options.epochs {
            run.epoch(&training, options, progress);
            let shown = &validation[..validation.len().min(WATCHED)];
            let answers = Answers::of(&mut run.engine()?, shown);
            progress(&TrainProgress::Epoch {
                epoch: run.epoch,
                accuracy: answers.accuracy(),
                points: answers.point_accuracy(),
                clouds_a_second: run.clouds_a_second,
            });
            run.save(&file, options)?;
        }
    }

    progress(&TrainProgress::Test);
    let mut card = Card {
        format: Card::FORMAT,
        name: "encoder".into(),
        architecture: ARCHITECTURE.into(),
        weights_blake3: run.export(&options.out)?,
        data: DataCard {
            generator: GENERATOR.into(),
            seed: options.seed,
            train: counts[0],
            validation: counts[1],
            test: counts[2],
            epochs: options.epochs,
        },
        temperature: 1.0,
        threshold: 1.0,
        winding: WindingCard::default(),
        metrics: Metrics::default(),
    };
    card.write(&options.out.join(CARD_FILE))?;
    report::calibrate(&options.out, &source, options.seed, counts[1], &mut card)?;
    card.write(&options.out.join(CARD_FILE))?;
    // Measured as it will be used: read back from the files, cloud to feature.
    card.metrics = report::measure(&options.out, &source, options.seed, counts[2])?;
    card.write(&options.out.join(CARD_FILE))?;
    let _ = std::fs::remove_file(&file);
    Ok(card)
}

fn check(options: &TrainOptions) -> Result<(), TrainError> {
    if options.samples < 2 * BATCH || options.samples > 1_000_000 {
        return Err(TrainError::Option { field: "samples", found: options.samples, allowed: "64..=1000000" });
    }
    if options.epochs == 0 || options.epochs > 1000 {
        return Err(TrainError::Option { field: "epochs", found: options.epochs, allowed: "1..=1000" });
    }
    Ok(())
}

/// A network on its way.
pub(crate) struct Run {
    pub(crate) plan: Plan,
    pub(crate) spans: [Spans; 2],
    shapes: BTreeMap<String, Vec<usize>>,
    /// Trainable numbers, and running statistics, as the spans say.
    pub(crate) parameters: Vec<f32>,
    pub(crate) statistics: Vec<f32>,
    /// Parameters that decay: the matrices.
    decays: Vec<bool>,
    adam: Adam,
    passes: Vec<Pass>,
    /// Epochs finished.
    epoch: usize,
    clouds_a_second: f64,
}

impl Run {
    pub(crate) fn begin(options: &TrainOptions, file: &Path) -> Result<Self, TrainError> {
        if options.resume && file.exists() {
            let tensors: BTreeMap<String, Tensor> =
                candle_core::safetensors::load(file, &Device::Cpu)?.into_iter().collect();
            let run = tensors.get("run").map(|t| t.to_vec1::<u32>()).transpose()?.unwrap_or_default();
            let [fingerprint, epoch, steps] = run[..] else {
                return Err(TrainError::Checkpoint { file: file.to_owned() });
            };
            if fingerprint != Self::fingerprint(options) {
                return Err(TrainError::Checkpoint { file: file.to_owned() });
            }
            let moment = |name| tensors.get(name).map(Tensor::to_vec1::<f32>).transpose();
            let (Some(first), Some(second)) = (moment("adam.0")?, moment("adam.1")?) else {
                return Err(TrainError::Checkpoint { file: file.to_owned() });
            };
            let mut run = Self::on(Parameters::stored(tensors))?;
            run.adam.restore(u64::from(steps), [first, second]);
            run.epoch = epoch as usize;
            return Ok(run);
        }
        Self::on(Parameters::fresh(options.seed))
    }

    /// A run on these numbers.
    pub(crate) fn on(mut parameters: Parameters) -> Result<Self, TrainError> {
        let network = Network::new(&mut parameters)?;
        let mut spans = [Spans::default(), Spans::default()];
        let (mut numbers, mut statistics, mut decays) = (Vec::new(), Vec::new(), Vec::new());
        let mut shapes = BTreeMap::new();
        for (name, variable) in &parameters.variables {
            let values = variable.flatten_all()?.to_vec1::<f32>()?;
            spans[0].add(name, values.len());
            decays.extend(std::iter::repeat_n(variable.rank() == 2, values.len()));
            shapes.insert(name.clone(), variable.dims().to_vec());
            numbers.extend(values);
        }
        for (name, values) in network.statistics()? {
            let values = values.to_vec1::<f32>()?;
            spans[1].add(&name, values.len());
            shapes.insert(name, vec![values.len()]);
            statistics.extend(values);
        }
        Ok(Self {
            plan: Plan::new(&spans[0], &spans[1]),
            spans,
            shapes,
            adam: Adam::new(DECAY, numbers.len()),
            parameters: numbers,
            statistics,
            decays,
            passes: (0..BATCH / SHARD).map(|_| Pass::default()).collect(),
            epoch: 0,
            clouds_a_second: 0.0,
        })
    }

    /// What must agree for a checkpoint to be of the same run.
    fn fingerprint(options: &TrainOptions) -> u32 {
        let text = format!("{ARCHITECTURE} {} {} {}", options.samples, options.epochs, options.seed);
        let hash = blake3::hash(text.as_bytes());
        hash.as_bytes()[..4].iter().fold(0, |n, b| n << 8 | u32::from(*b))
    }

    pub(crate) fn epoch(
        &mut self,
        training: &[Example],
        options: &TrainOptions,
        progress: &mut dyn FnMut(&TrainProgress),
    ) {
        let begin = Instant::now();
        let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
        rng.set_stream(1 + self.epoch as u64);
        let mut order: Vec<usize> = (0..training.len()).collect();
        order.shuffle(&mut rng);
        let steps = training.len() / BATCH;
        let mut sum = 0.0;
        for (step, batch) in order.chunks_exact(BATCH).enumerate() {
            let looks: Vec<Look> = batch
                .iter()
                .map(|&i| {
                    let closer = training[i].closer.as_ref().filter(|_| rng.random_bool(CLOSER));
                    augmented(closer.unwrap_or(&training[i].look), &mut rng)
                })
                .collect();
            let masks: Vec<Vec<f32>> =
                looks.chunks(SHARD).map(|_| dropout_mask(SHARD * CLASS_HIDDEN, &mut rng)).collect();
            let phase = rng.random_range(0..SEGMENT_STRIDE);
            let done = (self.epoch * steps + step) as f32 / (options.epochs * steps) as f32;
            sum += f64::from(self.step(&looks, &masks, phase, rate(done), options.threads));
            progress(&TrainProgress::Step(self.epoch + 1, step + 1, steps, sum / (step + 1) as f64));
        }
        self.epoch += 1;
        self.clouds_a_second = (steps * BATCH) as f64 / begin.elapsed().as_secs_f64();
    }

    /// One step of the optimiser; answers the loss before it. The shards are added up in their order, so
    /// that the number of threads changes nothing.
    fn step(&mut self, looks: &[Look], masks: &[Vec<f32>], phase: usize, rate: f32, threads: usize) -> f32 {
        let looks: Vec<&Look> = looks.iter().collect();
        let (plan, parameters) = (&self.plan, &self.parameters);
        let shards = self.passes.iter_mut().zip(looks.chunks(SHARD)).zip(masks);
        if threads > 1 {
            std::thread::scope(|scope| {
                for ((pass, looks), mask) in shards {
                    scope.spawn(move || pass.run(plan, parameters, looks, mask, phase));
                }
            });
        } else {
            shards.for_each(|((pass, looks), mask)| pass.run(plan, parameters, looks, mask, phase));
        }
        let share = 1.0 / self.passes.len() as f32;
        let (first, rest) = self.passes.split_at_mut(1);
        for pass in rest.iter() {
            first[0].gradient.iter_mut().zip(&pass.gradient).for_each(|(sum, g)| *sum += g);
        }
        first[0].gradient.iter_mut().for_each(|g| *g *= share);
        self.adam.step(&mut self.parameters, &first[0].gradient, &self.decays, rate, CLIP);
        for pass in &self.passes {
            for (old, new) in self.statistics.iter_mut().zip(&pass.statistics) {
                *old += MOMENTUM * share * (new - *old);
            }
        }
        self.passes.iter().map(|pass| pass.loss * share).sum()
    }

    /// Weights and statistics by name, as a model stores them.
    pub(crate) fn weights(&self) -> Result<BTreeMap<String, Tensor>, TrainError> {
        let mut out = BTreeMap::new();
        for (spans, numbers) in self.spans.iter().zip([&self.parameters, &self.statistics]) {
            for (name, span) in spans.iter() {
                let tensor = Tensor::from_slice(&numbers[span.clone()], self.shapes[name].as_slice(), &Device::Cpu)?;
                out.insert(name.clone(), tensor);
            }
        }
        Ok(out)
    }

    /// Writes weights and statistics into the folder of a model; answers their BLAKE3.
    pub(crate) fn export(&self, folder: &Path) -> Result<String, TrainError> {
        let file = folder.join(WEIGHTS_FILE);
        let failed = |source| TrainError::File { file: file.clone(), source };
        std::fs::create_dir_all(folder).map_err(failed)?;
        let weights: HashMap<String, Tensor> = self.weights()?.into_iter().collect();
        candle_core::safetensors::save(&weights, &file)?;
        let bytes = std::fs::read(&file).map_err(failed)?;
        Ok(blake3::hash(&bytes).to_hex().to_string())
    }

    /// The network as it is now, ready to be asked.
    pub(crate) fn engine(&self) -> Result<Engine, TrainError> {
        Ok(Engine::new(&mut Parameters::stored(self.weights()?))?)
    }

    pub(crate) fn save(&self, file: &Path, options: &TrainOptions) -> Result<(), TrainError> {
        let mut tensors = self.weights()?;
        for (name, moment) in ["adam.0", "adam.1"].into_iter().zip(&self.adam.moments) {
            tensors.insert(name.to_owned(), Tensor::from_slice(moment, moment.len(), &Device::Cpu)?);
        }
        let run = [Self::fingerprint(options), self.epoch as u32, self.adam.steps as u32];
        tensors.insert("run".into(), Tensor::new(&run, &Device::Cpu)?);
        // Beside the old one first: a run that dies while saving keeps its last epoch.
        let fresh = file.with_extension("part");
        let tensors: HashMap<_, _> = tensors.into_iter().collect();
        candle_core::safetensors::save(&tensors, &fresh)?;
        std::fs::rename(&fresh, file).map_err(|source| TrainError::File { file: file.to_owned(), source })
    }
}

/// One-cycle schedule: the rate rises in a cosine to [`RATE`] and falls in another to nothing.
fn rate(done: f32) -> f32 {
    let half_cosine = |t: f32| 0.5 - 0.5 * (std::f32::consts::PI * t).cos();
    if done < WARM {
        RATE * (0.04 + 0.96 * half_cosine(done / WARM))
    } else {
        RATE * half_cosine((1.0 - done) / (1.0 - WARM))
    }
}
