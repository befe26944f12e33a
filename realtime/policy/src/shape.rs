//! What a policy consists of, and where each number of it lies.

use core::fmt;

use crate::{ADAPTER, COLUMNS_MAX, HIDDEN, INPUTS_MAX, OUTPUTS_MAX};

/// How a column sees the hidden layers of the columns before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lateral {
    /// A matrix from each earlier column, Eq. (16).
    Linear,
    /// One adapter for all earlier columns together, Eq. (17).
    Adapter,
}

/// Sizes of a policy. Its numbers follow one another in this order, matrices input by input
/// (`inputs × outputs`, the row of an input contiguous):
///
/// ```text
/// mean, scale                     inputs each: the network sees (x - mean) * scale
/// step                            outputs: the largest increment of each joint
/// for each column, first to last
///   W1, b1                        inputs × 256, 256
///   W2, b2, lateral into layer 2  256 × 256, 256
///   W3, b3, lateral into layer 3  256 × outputs, outputs
/// lateral of column k into a layer of width w, from k - 1 earlier columns
///   linear                        M of each: 256 × w
///   adapter                       α: k - 1;  V: 256 (k - 1) × 64;  M: 64 × w
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Numbers of an observation.
    pub inputs: usize,
    /// Numbers of an action.
    pub outputs: usize,
    /// Columns; the last one acts.
    pub columns: usize,
    /// Their connections.
    pub lateral: Lateral,
}

/// Why numbers are no policy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShapeError {
    /// A size is out of range.
    Size {
        /// Which.
        field: &'static str,
        /// What was asked for.
        found: usize,
        /// What is allowed: from 1 to this.
        max: usize,
    },
    /// Not as many numbers as the shape has.
    Length {
        /// What was given.
        found: usize,
        /// What the shape has.
        wanted: usize,
    },
    /// A number that is NaN or infinite.
    NotFinite {
        /// Where it stands.
        index: usize,
    },
}

impl fmt::Display for ShapeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ShapeError::Size { field, found, max } => write!(f, "a policy has {found} {field}, allowed 1..={max}"),
            ShapeError::Length { found, wanted } => {
                write!(f, "a policy of this shape has {wanted} numbers, found {found}")
            }
            ShapeError::NotFinite { index } => write!(f, "number {index} of a policy is not finite"),
        }
    }
}

impl core::error::Error for ShapeError {}

impl Shape {
    /// Numbers of a policy of this shape.
    ///
    /// # Errors
    /// [`ShapeError::Size`].
    pub fn numbers(&self) -> Result<usize, ShapeError> {
        let sizes = [
            ("inputs", self.inputs, INPUTS_MAX),
            ("outputs", self.outputs, OUTPUTS_MAX),
            ("columns", self.columns, COLUMNS_MAX),
        ];
        for (field, found, max) in sizes {
            if found == 0 || found > max {
                return Err(ShapeError::Size { field, found, max });
            }
        }
        let columns: usize = (0..self.columns).map(|column| self.column(column)).sum();
        Ok(2 * self.inputs + self.outputs + columns)
    }

    /// Numbers of the column with `earlier` columns before it.
    fn column(&self, earlier: usize) -> usize {
        let layers = [(self.inputs, HIDDEN), (HIDDEN, HIDDEN), (HIDDEN, self.outputs)];
        let own: usize = layers.iter().map(|(inputs, outputs)| (inputs + 1) * outputs).sum();
        own + self.lateral(earlier, HIDDEN) + self.lateral(earlier, self.outputs)
    }

    /// Numbers of a lateral connection from `earlier` columns into a layer of `width` units.
    pub(crate) fn lateral(&self, earlier: usize, width: usize) -> usize {
        match self.lateral {
            _ if earlier == 0 => 0,
            Lateral::Linear => earlier * HIDDEN * width,
            Lateral::Adapter => earlier + (earlier * HIDDEN + width) * ADAPTER,
        }
    }

    /// That `numbers` are a policy of this shape.
    pub(crate) fn check(&self, numbers: &[f32]) -> Result<(), ShapeError> {
        let wanted = self.numbers()?;
        if numbers.len() != wanted {
            return Err(ShapeError::Length { found: numbers.len(), wanted });
        }
        match numbers.iter().position(|number| !number.is_finite()) {
            Some(index) => Err(ShapeError::NotFinite { index }),
            None => Ok(()),
        }
    }
}
