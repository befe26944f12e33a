//! What a look at a part is worth: may the recognition be acted on?
//!
//! A recognition that is sure by itself counts; so does one that is less sure but
//! points at the part that was called for, since carriers are seldom misloaded.
//! Anything else is a doubt with its reason.

use super::placing::nominal_at_station;
use nalgebra::{Isometry3, Translation3, Vector3};
use tandem_config::{Cell, Part, isometry_of};
use tandem_msg::{FEATURE_CLASSES, Feature, FeatureClass, Recognition};

/// What is known of a presented part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Recognised {
    /// Class of its feature.
    pub(super) class: FeatureClass,
    /// Probability of that class.
    pub(super) confidence: f64,
    /// Whether a person said so.
    pub(super) by_person: bool,
    /// Diameter, depth, length and width, metres; 0 where the class has none.
    pub(super) dimensions: [f64; 4],
    /// Where the part lies.
    pub(super) base_from_part: Isometry3<f64>,
    /// How far that is from where it should lie, metres.
    pub(super) offset: f64,
}

/// Why a look is not good enough.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Doubt {
    /// Nothing was seen.
    NoPart,
    /// The model is not sure.
    Unsure {
        /// What it tends to.
        class: FeatureClass,
        /// How strongly.
        confidence: f64,
    },
    /// Another feature than the part has.
    OtherClass {
        /// What was seen.
        class: FeatureClass,
        /// What the product file says.
        expected: FeatureClass,
    },
    /// The part lies too far off.
    OffPlace {
        /// How far, metres.
        offset: f64,
        /// How far its axis leans, radians.
        tilt: f64,
    },
    /// A dimension is not the part's.
    OffSize {
        /// Which.
        name: &'static str,
        /// Measured, metres.
        measured: f64,
        /// In the product file, metres.
        expected: f64,
    },
    /// Nothing was heard of the look in time.
    Silent,
    /// A number was not finite.
    NotFinite,
}

impl std::fmt::Display for Doubt {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoPart => f.write_str("no part seen"),
            Self::Unsure { class, confidence } => write!(f, "unsure: {class} at {:.0} %", confidence * 100.0),
            Self::OtherClass { class, expected } => write!(f, "saw {class}, the part has {expected}"),
            Self::OffPlace { offset, tilt } => {
                write!(f, "lies {:.1} mm and {:.1} degrees off", offset * 1e3, tilt.to_degrees())
            }
            Self::OffSize { name, measured, expected } => {
                write!(f, "{name} {:.1} mm, the part has {:.1} mm", measured * 1e3, expected * 1e3)
            }
            Self::Silent => f.write_str("no recognition in time"),
            Self::NotFinite => f.write_str("a number of the recognition is not finite"),
        }
    }
}

/// Judges a look at `part`. With the class in question a person is asked what it is; with
/// place or size in question, to look after it.
pub(super) fn judge(cell: &Cell, part: &Part, feature: &Feature) -> Result<Recognised, Doubt> {
    let class = feature.class.get().ok_or(Doubt::NotFinite)?;
    let confidence = f64::from(feature.probabilities[class as usize]);
    let dimensions = &feature.dimensions;
    let measured = [dimensions.diameter, dimensions.depth, dimensions.length, dimensions.width].map(|m| m.value);
    if !confidence.is_finite() || !measured.iter().all(|value| value.is_finite()) {
        return Err(Doubt::NotFinite);
    }
    let expected = part.feature.class;
    let certain = class == expected && certainty(confidence, cell) >= cell.perception.certainty_min;
    match feature.recognition.get() {
        Some(Recognition::Sure) => {}
        Some(Recognition::Unsure) if certain => {}
        Some(Recognition::Unsure) => return Err(Doubt::Unsure { class, confidence }),
        Some(Recognition::NoPart) | None => return Err(Doubt::NoPart),
    }
    if class != expected {
        return Err(Doubt::OtherClass { class, expected });
    }
    let base_from_feature = isometry_of(&feature.base_from_feature).ok_or(Doubt::NotFinite)?;
    let nominal = nominal_at_station(cell, part);
    let nominal_feature = nominal * part.part_from_feature;
    let mut shift = base_from_feature.translation.vector - nominal_feature.translation.vector;
    let axis = |pose: &Isometry3<f64>| pose.rotation * Vector3::z();
    let tilt = axis(&base_from_feature).angle(&axis(&nominal_feature));
    let offset = shift.norm();
    if offset > cell.perception.offset_max || tilt > cell.perception.tilt_max {
        return Err(Doubt::OffPlace { offset, tilt });
    }
    // The part lies on its carrier, whose height is known better than it is seen.
    shift.z = 0.0;
    for (name, measured, expected) in
        [("diameter", measured[0], part.feature.diameter), ("length", measured[2], part.feature.length)]
    {
        if expected > 0.0 && (measured - expected).abs() > cell.perception.dimension_tolerance * expected {
            return Err(Doubt::OffSize { name, measured, expected });
        }
    }
    // A feature's turn about its own axis is not seen on most classes, so the part is
    // moved by what was measured and keeps its nominal turn.
    Ok(Recognised {
        class,
        confidence,
        by_person: false,
        dimensions: measured,
        base_from_part: Translation3::from(shift) * nominal,
        offset: shift.norm(),
    })
}

/// Probability that the part called for lies there, when perception gives its class the
/// probability `seen`: Bayes' rule with the share of misloaded carriers as prior, a
/// misloaded part being of any other class alike.
fn certainty(seen: f64, cell: &Cell) -> f64 {
    let misload = cell.perception.misload_probability;
    let right = seen * (1.0 - misload);
    let wrong = (1.0 - seen) * misload / (FEATURE_CLASSES - 1) as f64;
    right / (right + wrong)
}

/// What a person's word makes of a part: its class is theirs, its place and size the file's.
pub(super) fn by_word(cell: &Cell, part: &Part, class: FeatureClass, confidence: f64) -> Recognised {
    let feature = &part.feature;
    Recognised {
        class,
        confidence,
        by_person: true,
        dimensions: [feature.diameter, feature.depth, feature.length, feature.width],
        base_from_part: nominal_at_station(cell, part),
        offset: 0.0,
    }
}
