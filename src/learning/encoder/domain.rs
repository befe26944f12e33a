//! What parts are like and how they are looked at: the ranges examples are drawn from.
//!
//! The source domain draws every part anew, from ranges wider than any product's. A product
//! has a few part types of its own, each of which comes in other sizes, and a scanner of its own.

use nalgebra::{Isometry3, Translation3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use tandem_config::{Body, FeatureGeometry, Product};
use tandem_msg::{CLOUD_POINTS, Coded, FeatureClass};

use super::specimen::log_uniform;
use crate::plant::camera::extent;
use crate::plant::solid::{Form, Other};

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
        let other = match self.form.other {
            Other::Bare => Other::Bare,
            Other::Block(extents, rounding) => Other::Block(extents.map(|v| v * by), rounding * by),
            Other::Dome(diameter, height) => Other::Dome(diameter * by, height * by),
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
            form: Form { other, ..self.form },
            body,
            part_from_feature: Isometry3::from_parts(place, self.part_from_feature.rotation),
            size: self.size * by,
        }
    }

    fn of(part: &tandem_config::Part) -> Self {
        Self {
            feature: part.feature,
            form: Form::of(&part.feature),
            body: part.body,
            part_from_feature: part.part_from_feature,
            size: extent(&part.feature),
        }
    }
}

/// What a scanner does to a cloud beyond noise. Lengths in half widths of the view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scanner {
    /// Fewest and most points of a scan.
    pub points: [usize; 2],
    /// Coarsest step of the range it reads.
    pub step: f64,
    /// Largest bending of the range towards the edge of the view.
    pub bowl: f64,
    /// Largest share of points that is missing at the darker side of the view.
    pub shade: f64,
}

impl Scanner {
    /// One scanner of these ranges: takes a place in the camera frame, answers what is read out of it,
    /// if anything.
    pub(crate) fn draw(
        &self,
        half_width: f64,
        focus: f64,
        rng: &mut ChaCha8Rng,
    ) -> impl FnMut([f32; 3], &mut ChaCha8Rng) -> Option<[f32; 3]> + use<> {
        let step = (half_width * self.step * rng.random::<f64>()).max(1e-9) as f32;
        let bowl = (half_width * self.bowl * rng.random_range(-1.0..=1.0)) as f32;
        let shade = (self.shade * rng.random::<f64>()) as f32;
        let turn = rng.random_range(0.0..std::f32::consts::TAU);
        let toward = [turn.cos(), turn.sin()];
        let across = (focus / half_width) as f32;
        move |p, rng| {
            // Place in the view, -1 to 1.
            let [x, y] = [p[0] / p[2] * across, p[1] / p[2] * across];
            let dark = 0.5 + 0.35 * (x * toward[0] + y * toward[1]);
            if rng.random::<f32>() < shade * dark {
                return None;
            }
            let depth = p[2] + bowl * (0.5 * (x * x + y * y) - 0.33);
            let depth = (depth / step).round() * step;
            Some(p.map(|v| v * depth / p[2]))
        }
    }
}

/// The ranges of a domain.
#[derive(Clone, Debug)]
pub struct Domain {
    /// Its part types; every part is one of its own when there are none.
    pub kinds: Vec<Kind>,
    /// Sizes of a part type, in its nominal one.
    pub scale: [f64; 2],
    /// Tilt of the view off the feature's axis, radians: straight from above a bore shows no wall.
    pub tilt: [f64; 2],
    /// Half the view in extents of the feature.
    pub view: [f64; 2],
    /// How far off the feature the camera may be aimed, in half widths of the view.
    pub aim: f64,
    /// Range noise in half widths of the view, and its limits in metres.
    pub noise: [f64; 2],
    /// The limits.
    pub noise_limits: [f64; 2],
    /// Largest share of points lost.
    pub dropout: f64,
    /// Largest share of stray points.
    pub outliers: f64,
    /// Share of views with nothing beside the part, and the most there is in the others.
    pub tidy: f64,
    /// The most there is in the others.
    pub clutter: usize,
    /// What else the scanner does; a plain one does nothing.
    pub scanner: Option<Scanner>,
    /// Tells the random streams of domains apart.
    pub stream: u64,
}

impl Domain {
    /// Where the encoder comes from: any part, the plant's camera.
    pub fn source() -> Self {
        Self {
            kinds: Vec::new(),
            scale: [1.0, 1.0],
            tilt: [0.22, 0.70],
            view: [1.1, 2.1],
            aim: 0.28,
            noise: [0.001, 0.0055],
            noise_limits: [20e-6, 250e-6],
            dropout: 0.08,
            outliers: 0.008,
            tidy: 0.35,
            clutter: 4,
            scanner: None,
            stream: 0,
        }
    }

    /// A product's part types under another scanner: coarse in range, bent towards the edges of its view,
    /// noisier, seen from farther away and from lower, with more lying about.
    pub fn product(product: &Product) -> Self {
        Self {
            kinds: product.parts.iter().map(Kind::of).collect(),
            scale: [0.75, 1.35],
            tilt: [0.35, 1.05],
            view: [1.5, 3.2],
            aim: 0.35,
            noise: [0.001, 0.013],
            noise_limits: [20e-6, 500e-6],
            dropout: 0.2,
            outliers: 0.03,
            tidy: 0.1,
            clutter: 7,
            scanner: Some(Scanner { points: [3_000, 8_000], step: 0.03, bowl: 0.15, shade: 0.9 }),
            stream: 0x5472_0000,
        }
    }

    /// A shift of the source that is made up: eleven part types of the generator's, some scanner.
    /// What agents of transfer learn on, since its labels cost nothing.
    pub fn made_up(rng: &mut ChaCha8Rng) -> Self {
        let classes = FeatureClass::ALL;
        let kinds = (0..11)
            .map(|i| {
                let class = if i < classes.len() { classes[i] } else { classes[rng.random_range(0..classes.len())] };
                super::specimen::kind(class, rng)
            })
            .collect();
        let noise = log_uniform([0.004, 0.013], rng);
        let view = rng.random_range(1.2..1.8);
        let scanner = Scanner {
            points: [rng.random_range(2_500..8_000), CLOUD_POINTS],
            step: rng.random_range(0.0..0.03),
            bowl: rng.random_range(0.0..0.2),
            shade: rng.random_range(0.0..1.0),
        };
        Self {
            kinds,
            scale: [0.75, 1.35],
            tilt: [rng.random_range(0.2..0.5), rng.random_range(0.7..1.0)],
            view: [view, view + rng.random_range(0.4..1.5)],
            aim: rng.random_range(0.2..0.4),
            noise: [0.001, noise],
            noise_limits: [20e-6, 500e-6],
            dropout: rng.random_range(0.05..0.25),
            outliers: rng.random_range(0.003..0.03),
            tidy: rng.random_range(0.0..0.4),
            clutter: rng.random_range(3..7),
            scanner: Some(scanner),
            stream: rng.random(),
        }
    }

    /// Class of an example: classes or part types follow each other in turn.
    pub fn class(&self, index: u64) -> FeatureClass {
        match self.kinds.len() as u64 {
            0 => FeatureClass::ALL[(index % FeatureClass::ALL.len() as u64) as usize],
            count => self.kinds[(index % count) as usize].feature.class,
        }
    }
}
