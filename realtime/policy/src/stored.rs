//! Policies as a process holds them: numbers that were checked once, shared and never changed.

#![allow(clippy::disallowed_types, reason = "made while starting, and freed at the end")]

use std::sync::Arc;

use crate::{DOF, OBSERVATION, Policy, Shape, ShapeError};

/// The numbers of one policy, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Stored {
    shape: Shape,
    numbers: Arc<[f32]>,
}

impl Stored {
    /// Takes over numbers that lie as [`Shape`] says.
    ///
    /// # Errors
    /// [`ShapeError`]; so that [`Stored::policy`] cannot fail.
    pub fn new(shape: Shape, numbers: Arc<[f32]>) -> Result<Self, ShapeError> {
        let sizes = [("inputs", shape.inputs, OBSERVATION), ("outputs", shape.outputs, DOF)];
        for (field, found, max) in sizes {
            if found != max {
                return Err(ShapeError::Size { field, found, max });
            }
        }
        Policy::new(shape, &numbers)?;
        Ok(Self { shape, numbers })
    }

    /// The policy.
    pub fn policy(&self) -> Policy<'_> {
        Policy::checked(self.shape, &self.numbers)
    }
}

/// The policies of a product: one for each of the four subtasks that has one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Policies {
    /// To where something is taken.
    pub grasp: Option<Stored>,
    /// With a part across the cell.
    pub transfer: Option<Stored>,
    /// With a part to close above its place.
    pub place: Option<Stored>,
    /// With the tool to where a part is joined.
    pub assemble: Option<Stored>,
}
