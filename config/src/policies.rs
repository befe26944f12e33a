//! Precomputed policies: weights as safetensors, and a card that says what they are.

use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use tandem_policy::{DOF, Lateral, OBSERVATION, Policies, Shape, Stored};

use crate::fault::Fault;
use crate::read::Reading;
use crate::tensors::Tensors;

/// Name of the one vector of a weights file.
const NUMBERS: &str = "policy";
/// Version of the card and of what a policy is given.
const FORMAT: u32 = 1;

/// What a policy was made of and how good it is, as `<subtask>.json` beside its weights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PolicyCard {
    /// Version of this layout.
    pub format: u32,
    /// Product it was trained for.
    pub product: String,
    /// Its subtask.
    pub subtask: String,
    /// How it was learned: `ac`, `pnn`, `fine_tuned`.
    pub method: String,
    /// Columns; the last one acts.
    pub columns: usize,
    /// BLAKE3 of the weights file.
    pub weights_blake3: String,
    /// BLAKE3 of the checkpoint whose columns it builds on, if any.
    pub source_blake3: Option<String>,
    /// Seed of the training.
    pub seed: u64,
    /// Scenes it was trained in.
    pub scenes: usize,
    /// Steps demonstrated before training.
    pub demonstrated: usize,
    /// Own episodes.
    pub episodes: u64,
    /// Demonstrations given on the way.
    pub corrections: u64,
    /// Updates.
    pub updates: u64,
    /// Share of the validation scenes where the goal was reached without contact, motions not being refused.
    pub validation_success: f64,
}

/// A policy as it lies in a folder.
#[derive(Clone, Debug, PartialEq)]
pub struct PolicyModel {
    /// Its card.
    pub card: PolicyCard,
    /// Its shape.
    pub shape: Shape,
    /// Its numbers, in the order of [`Shape`].
    pub numbers: Vec<f32>,
}

impl PolicyModel {
    /// Weights and card of a subtask in a folder.
    pub fn files(folder: &Path, subtask: &str) -> [PathBuf; 2] {
        ["safetensors", "json"].map(|extension| folder.join(format!("{subtask}.{extension}")))
    }

    /// Writes both files, and the weights' hash into the card.
    ///
    /// # Errors
    /// They cannot be written.
    pub fn save(&mut self, folder: &Path) -> io::Result<()> {
        std::fs::create_dir_all(folder)?;
        let [weights, card] = Self::files(folder, &self.card.subtask);
        let mut tensors = Tensors::default();
        let lateral = match self.shape.lateral {
            Lateral::Linear => "linear",
            Lateral::Adapter => "adapter",
        };
        tensors.notes.insert("lateral".into(), lateral.into());
        tensors.notes.insert("columns".into(), self.shape.columns.to_string());
        tensors.vectors.insert(NUMBERS.into(), self.numbers.clone());
        tensors.save(&weights)?;
        self.card.weights_blake3 = blake3::hash(&std::fs::read(&weights)?).to_hex().to_string();
        std::fs::write(card, format!("{}\n", serde_json::to_string_pretty(&self.card)?))
    }

    /// Reads both files and holds them together.
    ///
    /// # Errors
    /// A file cannot be read, is not what it should be, or the weights are not those of the card.
    pub fn load(folder: &Path, subtask: &str) -> io::Result<Self> {
        let [weights, card_file] = Self::files(folder, subtask);
        let bad = |file: &Path, what: String| {
            io::Error::new(io::ErrorKind::InvalidData, format!("{}: {what}", file.display()))
        };
        let text = std::fs::read(&card_file)?;
        let card: PolicyCard = serde_json::from_slice(&text).map_err(|error| bad(&card_file, error.to_string()))?;
        if card.format != FORMAT {
            return Err(bad(&card_file, format!("format = {}, allowed {FORMAT}: train it anew", card.format)));
        }
        let hash = blake3::hash(&std::fs::read(&weights)?).to_hex().to_string();
        if hash != card.weights_blake3 {
            return Err(bad(&weights, "its hash is not the card's: take both files of one training".into()));
        }
        let tensors = Tensors::load(&weights)?;
        let lateral = match tensors.notes.get("lateral").map(String::as_str) {
            Some("linear") => Lateral::Linear,
            Some("adapter") => Lateral::Adapter,
            other => return Err(bad(&weights, format!("lateral = {other:?}, allowed linear or adapter"))),
        };
        let shape = Shape { inputs: OBSERVATION, outputs: DOF, columns: tensors.number("columns")?, lateral };
        let numbers = tensors.vector(NUMBERS)?.to_vec();
        tandem_policy::Policy::new(shape, &numbers).map_err(|error| bad(&weights, error.to_string()))?;
        Ok(Self { card, shape, numbers })
    }

    /// As a controller holds it.
    ///
    /// # Errors
    /// Its shape is not that of an arm's policy.
    pub fn stored(&self) -> Result<Stored, tandem_policy::ShapeError> {
        Stored::new(self.shape, self.numbers.clone().into())
    }
}

impl PolicyCard {
    /// The present format.
    pub const FORMAT: u32 = FORMAT;
}

/// The policies of a product that lie in its folder; those that do not are done without.
pub(crate) fn read(folder: &Path, reading: &Reading) -> Policies {
    let one = |subtask: &str| {
        let files = PolicyModel::files(folder, subtask);
        if !files.iter().any(|file| file.exists()) {
            return None;
        }
        files.iter().for_each(|file| reading.fold(file));
        let stored = PolicyModel::load(folder, subtask)
            .map_err(|error| error.to_string())
            .and_then(|model| model.stored().map_err(|error| error.to_string()));
        stored
            .map_err(|found| {
                reading.note(Fault {
                    file: files[0].display().to_string(),
                    line: 0,
                    column: 0,
                    field: String::new(),
                    found,
                    allowed: "a policy and its card".into(),
                    advice: "make it with tandem train policy, or take both files away".into(),
                });
            })
            .ok()
    };
    Policies { grasp: one("grasp"), transfer: one("transfer"), place: one("place"), assemble: one("assemble") }
}
