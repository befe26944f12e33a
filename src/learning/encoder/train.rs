//! The training run: data, epochs, selection on validation, calibration, card.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};
use std::time::Instant;

use candle_core::{Device, Tensor};
use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use super::adam::Adam;
use super::augment::{augmented, dropout_mask};
use super::dataset::{Example, Split, example};
use super::loss::loss;
use super::parameters::Parameters;
use super::report::{self, Answers};
use crate::perception::card::{Card, DataCard, Metrics};
use crate::perception::network::{ARCHITECTURE, Input, Network};
use crate::perception::{CARD_FILE, Sampler, WEIGHTS_FILE};

/// Examples of one step.
const BATCH: usize = 16;
/// Every so many points of a cloud are segmented in training; all are in use.
pub(crate) const SEGMENT_STRIDE: usize = 2;
/// Largest learning rate of the one-cycle schedule.
const RATE: f32 = 3e-3;
/// Share of the run in which the rate rises.
const WARM: f32 = 0.2;
const DECAY: f32 = 0.02;
const CLIP: f32 = 5.0;
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
}

/// How far a run is.
#[derive(Clone, Debug, PartialEq)]
pub enum TrainProgress {
    /// Scanning examples of training and validation: made, of all.
    Data(usize, usize),
    /// In an epoch, counted from 1: steps done, steps of an epoch, mean loss so far.
    Step(usize, usize, usize, f64),
    /// An epoch is over: its number, accuracy and point accuracy on validation, clouds a second.
    Epoch(usize, f64, f64, f64),
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
    let mut made = 0;
    let total = counts[0] + counts[1];
    let mut split = |split, count, progress: &mut dyn FnMut(&TrainProgress)| {
        let (mut sampler, mut cloud) = (Sampler::new(), Vec::new());
        let examples: Vec<Example> = (0..count as u64)
            .map(|index| {
                made += 1;
                if made % 100 == 0 {
                    progress(&TrainProgress::Data(made, total));
                }
                example(options.seed, split, index, &mut sampler, &mut cloud)
            })
            .collect();
        examples
    };
    let file = options.out.join(CHECKPOINT);
    let mut run = Run::begin(options, &file)?;
    if run.epoch < options.epochs {
        let training = split(Split::Train, counts[0], progress);
        let validation = split(Split::Validation, counts[1], progress);
        while run.epoch < options.epochs {
            run.epoch(&training, training.len() / BATCH, options, progress)?;
            let answers = Answers::of(&run.network, &validation)?;
            let (accuracy, points) = (answers.accuracy(), answers.point_accuracy());
            progress(&TrainProgress::Epoch(run.epoch, accuracy, points, run.clouds_a_second));
            run.save(&file, options)?;
        }
    }

    progress(&TrainProgress::Test);
    let calibration = report::calibrate(&run.network, options.seed, counts[1])?;
    let weights: HashMap<String, Tensor> = run.weights()?.into_iter().collect();
    let weights_file = options.out.join(WEIGHTS_FILE);
    candle_core::safetensors::save(&weights, &weights_file)?;
    let bytes =
        std::fs::read(&weights_file).map_err(|source| TrainError::File { file: weights_file.clone(), source })?;
    let mut card = Card {
        format: Card::FORMAT,
        name: "encoder".into(),
        architecture: ARCHITECTURE.into(),
        weights_blake3: blake3::hash(&bytes).to_hex().to_string(),
        data: DataCard {
            generator: "parts of eight feature classes, scanned by the plant's depth camera".into(),
            seed: options.seed,
            train: counts[0],
            validation: counts[1],
            test: counts[2],
            epochs: options.epochs,
        },
        temperature: calibration.temperature,
        threshold: calibration.threshold,
        winding: calibration.winding,
        metrics: Metrics::default(),
    };
    card.write(&options.out.join(CARD_FILE))?;
    // Measured as it will be used: read back from the files, cloud to feature.
    card.metrics = report::measure(&options.out, options.seed, counts[2])?;
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
    network: Network,
    parameters: Parameters,
    adam: Adam,
    /// Epochs finished.
    epoch: usize,
    clouds_a_second: f64,
}

impl Run {
    pub(crate) fn begin(options: &TrainOptions, file: &Path) -> Result<Self, TrainError> {
        let mut adam = Adam::new(DECAY);
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
            adam.restore(u64::from(steps), &tensors)?;
            let mut parameters = Parameters::stored(tensors);
            let network = Network::new(&mut parameters)?;
            return Ok(Self { network, parameters, adam, epoch: epoch as usize, clouds_a_second: 0.0 });
        }
        let mut parameters = Parameters::fresh(options.seed);
        let network = Network::new(&mut parameters)?;
        Ok(Self { network, parameters, adam, epoch: 0, clouds_a_second: 0.0 })
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
        steps: usize,
        options: &TrainOptions,
        progress: &mut dyn FnMut(&TrainProgress),
    ) -> Result<(), TrainError> {
        let begin = Instant::now();
        let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
        rng.set_stream(1 + self.epoch as u64);
        let mut order: Vec<usize> = (0..training.len()).collect();
        order.shuffle(&mut rng);
        let mut sum = 0.0;
        for (step, batch) in order.chunks_exact(BATCH).enumerate() {
            let examples: Vec<Example> = batch.iter().map(|&i| augmented(&training[i], &mut rng)).collect();
            let samples: Vec<_> = examples.iter().map(|e| &e.sample).collect();
            let input = Input::of(&samples, SEGMENT_STRIDE, &Device::Cpu)?;
            let mask = dropout_mask(BATCH, self.network.dropout_width(), &mut rng)?;
            let output = self.network.forward(&input, Some(&mask))?;
            let loss = loss(&output, &examples)?;
            let gradients = loss.backward()?;
            let done = (self.epoch * steps + step) as f32 / (options.epochs * steps) as f32;
            self.adam.step(&self.parameters.variables, &gradients, rate(done), CLIP)?;
            sum += f64::from(loss.to_scalar::<f32>()?);
            progress(&TrainProgress::Step(self.epoch + 1, step + 1, steps, sum / (step + 1) as f64));
        }
        self.epoch += 1;
        self.clouds_a_second = (steps * BATCH) as f64 / begin.elapsed().as_secs_f64();
        Ok(())
    }

    /// Weights and statistics, as a model stores them.
    pub(crate) fn weights(&self) -> Result<BTreeMap<String, Tensor>, TrainError> {
        let weights = self.parameters.variables.iter().map(|(name, v)| (name.clone(), v.as_tensor().clone()));
        Ok(weights.chain(self.network.statistics()?).collect())
    }

    pub(crate) fn save(&self, file: &Path, options: &TrainOptions) -> Result<(), TrainError> {
        let mut tensors = self.weights()?;
        tensors.extend(self.adam.state()?);
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
