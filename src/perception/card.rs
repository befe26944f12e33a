//! The card of a model: what it was made of, how good it is, how far to trust it.

use std::path::Path;

use serde::{Deserialize, Serialize};
use tandem_msg::FEATURE_CLASSES;

use super::ModelError;

/// Card of an encoder, as `card.json` beside its weights.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Card {
    /// Version of this layout.
    pub format: u32,
    /// What it is.
    pub name: String,
    /// Name of the network's architecture.
    pub architecture: String,
    /// BLAKE3 of the weights file.
    pub weights_blake3: String,
    /// What it was trained on.
    pub data: DataCard,
    /// Logits are divided by this before the softmax: chosen on validation.
    pub temperature: f64,
    /// Smallest probability that may be acted on: chosen on validation.
    pub threshold: f64,
    /// How much the fitted wall's winding tells threads from smooth walls: the threaded class's
    /// logit grows by gain × (winding − level). Chosen on validation.
    pub winding: WindingCard,
    /// How it does on the test split.
    pub metrics: Metrics,
}

/// Weight of the winding.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WindingCard {
    /// Logits a share of one.
    pub gain: f64,
    /// Share at which it is no evidence either way.
    pub level: f64,
}

/// What a model was trained on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DataCard {
    /// Where the examples come from.
    pub generator: String,
    /// Seed of everything that was drawn.
    pub seed: u64,
    /// Training examples.
    pub train: usize,
    /// Validation examples.
    pub validation: usize,
    /// Test examples.
    pub test: usize,
    /// Passes over the training examples.
    pub epochs: usize,
}

/// Measured on the test split, through the same code as in a cell.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Metrics {
    /// Share of examples whose most probable class is right.
    pub accuracy: f64,
    /// Share of examples answered as sure.
    pub sure: f64,
    /// Accuracy among those.
    pub accuracy_when_sure: f64,
    /// Expected calibration error over ten bins.
    pub calibration_error: f64,
    /// Share of points segmented rightly.
    pub point_accuracy: f64,
    /// Intersection over union of feature points, mean over the examples that have any.
    pub segment_iou: f64,
    /// Rows: true class; columns: answered class; both by code.
    pub confusion: [[u32; FEATURE_CLASSES]; FEATURE_CLASSES],
    /// Median error of the feature's position, of examples classified rightly and sure, metres.
    pub position_error_m: f64,
    /// 90 % quantile of the same.
    pub position_error_p90_m: f64,
    /// Median error of the feature's axis, radians.
    pub axis_error_rad: f64,
    /// 90 % quantile of the same.
    pub axis_error_p90_rad: f64,
    /// Median relative errors of the dimensions, where they apply and were measured.
    pub diameter_error: f64,
    /// Of the depth.
    pub depth_error: f64,
    /// Of the length.
    pub length_error: f64,
    /// Of the width.
    pub width_error: f64,
    /// Of the pitch.
    pub pitch_error: f64,
    /// Share of threads whose pitch was measured.
    pub pitch_measured: f64,
}

impl Card {
    /// Version written and read.
    pub const FORMAT: u32 = 1;

    /// Reads a card.
    ///
    /// # Errors
    /// [`ModelError`] when it is missing, malformed or of another version.
    pub fn read(file: &Path) -> Result<Self, ModelError> {
        let bytes = std::fs::read(file).map_err(|source| ModelError::Missing { file: file.to_owned(), source })?;
        let card: Self =
            serde_json::from_slice(&bytes).map_err(|source| ModelError::Card { file: file.to_owned(), source })?;
        let refuse =
            |field, found: String, allowed| Err(ModelError::Field { file: file.to_owned(), field, found, allowed });
        if card.format != Self::FORMAT {
            return refuse("format", card.format.to_string(), "1");
        }
        if !(0.05..=20.0).contains(&card.temperature) {
            return refuse("temperature", card.temperature.to_string(), "0.05..=20");
        }
        if !(0.0..=1.0).contains(&card.threshold) {
            return refuse("threshold", card.threshold.to_string(), "0..=1");
        }
        if !(0.0..=200.0).contains(&card.winding.gain) || !(0.0..=1.0).contains(&card.winding.level) {
            return refuse("winding", format!("{:?}", card.winding), "gain 0..=200, level 0..=1");
        }
        Ok(card)
    }

    /// Writes a card.
    ///
    /// # Errors
    /// [`ModelError::Missing`] when the file cannot be written.
    pub fn write(&self, file: &Path) -> Result<(), ModelError> {
        let mut text =
            serde_json::to_string_pretty(self).map_err(|source| ModelError::Card { file: file.to_owned(), source })?;
        text.push('\n');
        std::fs::write(file, text).map_err(|source| ModelError::Missing { file: file.to_owned(), source })
    }
}
