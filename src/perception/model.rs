//! A trained model on disk: read, checked, ready to be asked.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use candle_core::{DType, Device, Tensor};
use tandem_msg::FEATURE_CLASSES;

use super::card::Card;
use super::engine::Engine;
use super::network::{ARCHITECTURE, Kind, Source};
use super::sample::Sample;

/// Name of the weights in a model's folder.
pub const WEIGHTS_FILE: &str = "encoder.safetensors";
/// Name of the card in a model's folder.
pub const CARD_FILE: &str = "card.json";

/// Why a model is refused.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// A file cannot be read or written.
    #[error("{file}: {source}; name a folder with a trained model, or train one with `tandem train encoder`")]
    Missing {
        /// The file.
        file: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The card is no card.
    #[error("{file}: {source}; restore the file, or train anew with `tandem train encoder`")]
    Card {
        /// The file.
        file: PathBuf,
        /// What is wrong, with line and column.
        source: serde_json::Error,
    },
    /// A value of the card is out of range.
    #[error("{file}: {field} = {found}, allowed {allowed}; restore the file, or train anew")]
    Field {
        /// The file.
        file: PathBuf,
        /// Name of the field.
        field: &'static str,
        /// What it says.
        found: String,
        /// What it may say.
        allowed: &'static str,
    },
    /// The weights are not those the card was written for.
    #[error("{file}: corrupted: BLAKE3 is {found}, the card says {expected}; restore the file, or train anew")]
    Hash {
        /// The file.
        file: PathBuf,
        /// Of the bytes found.
        found: String,
        /// Of the card.
        expected: String,
    },
    /// The weights do not fit the network.
    #[error("{file}: tensor {tensor}: {found}, expected {expected}; this model is for another version, train anew")]
    Shape {
        /// The file.
        file: PathBuf,
        /// Name of the tensor.
        tensor: String,
        /// What it is.
        found: String,
        /// What it should be.
        expected: String,
    },
    /// The weights cannot be parsed or computed with.
    #[error("{file}: {source}; restore the file, or train anew")]
    Weights {
        /// The file.
        file: PathBuf,
        /// What candle says.
        source: candle_core::Error,
    },
}

/// What a model makes of a sample.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Answer {
    /// Class logits, not yet calibrated.
    pub logits: [f32; FEATURE_CLASSES],
    /// Whether each point is of the feature.
    pub segment: Vec<bool>,
}

/// A checked model.
#[derive(Debug)]
pub struct Model {
    card: Card,
    engine: Engine,
}

impl Model {
    /// Reads the model in a folder and checks it: card, hash, names, shapes, finite numbers.
    ///
    /// # Errors
    /// [`ModelError`] names the file, what is wrong and what to do.
    pub fn load(folder: &Path) -> Result<Self, ModelError> {
        let card_file = folder.join(CARD_FILE);
        let card = Card::read(&card_file)?;
        if card.architecture != ARCHITECTURE {
            return Err(ModelError::Field {
                file: card_file,
                field: "architecture",
                found: card.architecture,
                allowed: ARCHITECTURE,
            });
        }
        let file = folder.join(WEIGHTS_FILE);
        let bytes = std::fs::read(&file).map_err(|source| ModelError::Missing { file: file.clone(), source })?;
        let found = blake3::hash(&bytes).to_hex().to_string();
        if found != card.weights_blake3 {
            return Err(ModelError::Hash { file, found, expected: card.weights_blake3 });
        }
        let wrong = |source| ModelError::Weights { file: file.clone(), source };
        let tensors = candle_core::safetensors::load_buffer(&bytes, &Device::Cpu).map_err(wrong)?;
        let mut stored = Stored { tensors, fault: None };
        match Engine::new(&mut stored) {
            Ok(engine) => Ok(Self { card, engine }),
            Err(source) => Err(match stored.fault {
                Some([tensor, found, expected]) => ModelError::Shape { file, tensor, found, expected },
                None => ModelError::Weights { file, source },
            }),
        }
    }

    /// The card.
    pub fn card(&self) -> &Card {
        &self.card
    }

    /// Asks the model about a sample; false if the answer is not finite.
    pub fn answer(&mut self, sample: &Sample, out: &mut Answer) -> bool {
        let (logits, segment) = self.engine.run(sample);
        out.logits = *logits;
        out.segment.clear();
        out.segment.extend(segment.iter().map(|v| *v > 0.0));
        logits.iter().chain(segment).all(|v| v.is_finite())
    }

    /// Calibrated probabilities of logits.
    pub fn probabilities(&self, logits: &[f32; FEATURE_CLASSES]) -> [f32; FEATURE_CLASSES] {
        softmax(logits, self.card.temperature)
    }
}

/// Softmax of logits over a temperature.
pub fn softmax(logits: &[f32; FEATURE_CLASSES], temperature: f64) -> [f32; FEATURE_CLASSES] {
    let top = logits.iter().fold(f32::NEG_INFINITY, |m, v| m.max(*v));
    let parts = logits.map(|v| (f64::from(v - top) / temperature).exp());
    let sum: f64 = parts.iter().sum();
    parts.map(|p| (p / sum) as f32)
}

/// Tensors of a file, given out by name once their shape and numbers are checked.
struct Stored {
    tensors: HashMap<String, Tensor>,
    /// Name of the tensor refused, what was found, what was expected.
    fault: Option<[String; 3]>,
}

impl Stored {
    fn take(&mut self, name: &str, shape: &[usize]) -> candle_core::Result<Tensor> {
        let expected = format!("f32 {shape:?}, finite");
        let found = match self.tensors.get(name) {
            None => "missing".to_owned(),
            Some(t) if t.dims() != shape || t.dtype() != DType::F32 => {
                format!("{} {:?}", t.dtype().as_str(), t.dims())
            }
            Some(t) => {
                if t.flatten_all()?.to_vec1::<f32>()?.iter().all(|v| v.is_finite()) {
                    return Ok(t.clone());
                }
                "a number that is not finite".to_owned()
            }
        };
        self.fault = Some([name.to_owned(), found, expected]);
        candle_core::bail!("tensor {name}")
    }
}

impl Source for Stored {
    fn weight(&mut self, name: &str, shape: &[usize], _kind: Kind) -> candle_core::Result<Tensor> {
        self.take(name, shape)
    }

    fn statistics(&mut self, name: &str, width: usize, _kind: Kind) -> candle_core::Result<Vec<f32>> {
        self.take(name, &[width])?.to_vec1()
    }
}
