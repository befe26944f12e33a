//! Part geometry as signed distances, for the depth camera and the training data.
//!
//! A part is a body with one assembly feature on it, as the product file says.
//! Everything is evaluated in the *feature frame*: origin at the feature's mouth
//! or foot on the part's surface, z along its axis, out of the part. Distances
//! are lower bounds of the true one (exact for most shapes), zero on the
//! surface, so that sphere tracing never steps through anything.
//!
//! Numbers are `f32`: at the ranges of an inspection camera their resolution is
//! some 30 nm, a thousandth of its noise.

mod body;
mod feature;
mod form;
mod surroundings;
mod thread;

pub use feature::FeatureSolid;
pub use form::{Form, Hook, Other, Recess, Section};
pub use surroundings::{Clutter, Surroundings};

use nalgebra::Isometry3;
use tandem_config::{Body, FeatureGeometry};

use body::BodySolid;

/// What a surface point belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Material {
    /// Carrier, clutter: nothing of the part.
    Surroundings,
    /// The part, off its feature.
    Body,
    /// The assembly feature.
    Feature,
}

/// A part: body and feature, ready to be traced.
#[derive(Clone, Debug)]
pub struct Solid {
    body: BodySolid,
    feature: FeatureSolid,
    part_from_feature: Isometry3<f64>,
}

impl Solid {
    /// The solid of a part; `part_from_feature` places the feature frame on the body.
    pub fn new(body: &Body, feature: &FeatureGeometry, part_from_feature: &Isometry3<f64>) -> Self {
        Self::with_form(body, feature, &Form::of(feature), part_from_feature)
    }

    /// The same with what the dimensions leave open.
    pub fn with_form(body: &Body, feature: &FeatureGeometry, form: &Form, part_from_feature: &Isometry3<f64>) -> Self {
        Self {
            body: BodySolid::new(body, form.sides, part_from_feature),
            feature: FeatureSolid::new(feature, form),
            part_from_feature: *part_from_feature,
        }
    }

    /// Where the feature frame stands in the part frame.
    pub fn part_from_feature(&self) -> &Isometry3<f64> {
        &self.part_from_feature
    }

    /// Signed distance to the part, metres, at a point of the feature frame, metres.
    #[inline]
    pub fn distance(&self, point: [f32; 3]) -> f32 {
        self.feature.combine(point, self.body.distance(point)).0
    }

    /// Signed distance and what the nearest surface belongs to.
    #[inline]
    pub fn distance_and_material(&self, point: [f32; 3]) -> (f32, Material) {
        self.feature.combine(point, self.body.distance(point))
    }
}

#[cfg(test)]
mod tests;
