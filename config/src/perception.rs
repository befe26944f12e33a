//! Which model recognises the parts, and how far it is trusted.

use crate::read::{Bound, Table, bound};
use std::path::{Path, PathBuf};

const LOOKS: Bound = bound("looks_max", "", 1.0, 10.0);
const OFFSET: Bound = bound("offset_max_m", "m", 0.001, 0.1);
const TILT: Bound = bound("tilt_max_rad", "rad", 0.01, 1.0);
const MISLOAD: Bound = bound("misload_probability", "", 0.001, 0.9);
const CERTAINTY: Bound = bound("certainty_min", "", 0.5, 1.0);
const DIMENSION: Bound = bound("dimension_tolerance", "", 0.01, 1.0);

/// Recognition: the model, and what the supervisor makes of its answers.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Perception {
    /// Folder of the model: weights and card.
    pub model: PathBuf,
    /// Looks at a part before a person is asked.
    pub looks_max: u32,
    /// Largest offset between a perceived feature and where it should be that is corrected, metres.
    pub offset_max: f64,
    /// Largest angle between a perceived feature axis and where it should point, radians.
    pub tilt_max: f64,
    /// Share of carriers that hold another part than was called for: the prior of a recognition.
    pub misload_probability: f64,
    /// Probability, with that prior, from which a recognition may be acted on.
    pub certainty_min: f64,
    /// Largest relative deviation of a measured dimension from the product file's.
    pub dimension_tolerance: f64,
}

impl Perception {
    pub(crate) fn read(cell: &Table<'_>, folder: &Path) -> Option<Self> {
        let table = cell.table("perception")?;
        let model = crate::cell::beside(folder, &table.text("model").unwrap_or_default());
        Some(Self {
            model,
            looks_max: table.whole(&LOOKS),
            offset_max: table.number(&OFFSET),
            tilt_max: table.number(&TILT),
            misload_probability: table.number(&MISLOAD),
            certainty_min: table.number(&CERTAINTY),
            dimension_tolerance: table.number(&DIMENSION),
        })
    }
}
