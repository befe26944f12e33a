//! Part types: a feature in one of its forms, on a body.
//!
//! Ranges are wider than any product's on purpose. Sizes are drawn log-uniformly, so that what the network can
//! use is shape, not scale; for the same reason every class is seen on the same bodies.

mod body;
mod feature;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;
use tandem_config::{Body, FeatureGeometry};
use tandem_msg::FeatureClass;

use crate::plant::camera::extent;
use crate::plant::solid::{Form, Other};

/// Smallest and largest feature, metres.
const SIZE: [f64; 2] = [0.004, 0.045];
/// Sides of the prisms.
const PRISMS: [u8; 4] = [4, 6, 6, 8];

/// A part type.
#[derive(Clone, Debug)]
pub struct Kind {
    /// Its feature.
    pub feature: FeatureGeometry,
    /// What the feature's dimensions leave open.
    pub form: Form,
    /// What it is on.
    pub body: Body,
    /// Where on it.
    pub part_from_feature: Isometry3<f64>,
    /// Extent of the feature as the camera frames it, metres.
    pub size: f64,
}

impl Kind {
    /// One of a class: any of them.
    pub(super) fn draw(class: FeatureClass, rng: &mut ChaCha8Rng) -> Self {
        let (mut feature, mut form) = feature::draw(class, rng);
        // A bare surface is looked at as closely as anything else.
        let size = match (class, form.other) {
            (FeatureClass::Other, Other::Bare) => log_uniform(SIZE, rng),
            (FeatureClass::Other, Other::Block(size, _) | Other::Ribs { extents: size, .. } | Other::Wedge(size)) => {
                size[0].max(size[1]).max(size[2])
            }
            (
                FeatureClass::Other,
                Other::Dome(diameter, _) | Other::Prism { across: diameter, .. } | Other::Torus(diameter, _),
            ) => diameter,
            _ => extent(&feature),
        };
        let sideways = match class {
            FeatureClass::Slot => 0.15,
            FeatureClass::SmoothHole | FeatureClass::ThreadedHole => 0.08,
            _ => 0.0,
        };
        if !form.open && rng.random_bool(sideways) {
            let (body, part_from_feature) = body::shaft(&mut feature, rng);
            return Self { feature, form, body, part_from_feature, size };
        }
        if form.open {
            let (body, part_from_feature) = body::grooved(&mut feature, &form, rng);
            return Self { feature, form, body, part_from_feature, size };
        }
        let aligned = rng.random_bool(0.5);
        let room = body::room(&feature, &form, size, aligned);
        let (body, top, at) = body::any(&mut feature, size, room, rng);
        if matches!(body, Body::Cylinder { .. }) && rng.random_bool(0.3) {
            form.sides = PRISMS[rng.random_range(0..PRISMS.len())];
        }
        // Along the body's edges, or in any direction.
        let turn = if aligned { 0.0 } else { rng.random_range(0.0..TAU) };
        let part_from_feature = Isometry3::from_parts(
            Translation3::new(at[0], at[1], top),
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), turn),
        );
        Self { feature, form, body, part_from_feature, size }
    }

    /// The same in another size.
    #[must_use]
    pub fn scaled(&self, by: f64) -> Self {
        let f = &self.feature;
        let feature = FeatureGeometry {
            diameter: f.diameter * by,
            depth: f.depth * by,
            length: f.length * by,
            width: f.width * by,
            pitch: f.pitch * by,
            chamfer: f.chamfer * by,
            ..*f
        };
        let body = match self.body {
            Body::Box { size } => Body::Box { size: size.map(|v| v * by) },
            Body::Tray { size, wall, floor } => {
                Body::Tray { size: size.map(|v| v * by), wall: wall * by, floor: floor * by }
            }
            Body::Ring { outer, inner, height } => {
                Body::Ring { outer: outer.map(|v| v * by), inner: inner.map(|v| v * by), height: height * by }
            }
            Body::Cylinder { radius, height } => Body::Cylinder { radius: radius * by, height: height * by },
            Body::Cable { length, radius } => Body::Cable { length: length * by, radius: radius * by },
        };
        let place = Translation3::from(self.part_from_feature.translation.vector * by);
        Self {
            feature,
            form: self.form.scaled(by),
            body,
            part_from_feature: Isometry3::from_parts(place, self.part_from_feature.rotation),
            size: self.size * by,
        }
    }

    pub(super) fn of(part: &tandem_config::Part) -> Self {
        Self {
            feature: part.feature,
            form: Form::of(&part.feature),
            body: part.body,
            part_from_feature: part.part_from_feature,
            size: extent(&part.feature),
        }
    }
}

pub(super) fn log_uniform([low, high]: [f64; 2], rng: &mut ChaCha8Rng) -> f64 {
    rng.random_range(low.ln()..high.ln()).exp()
}
