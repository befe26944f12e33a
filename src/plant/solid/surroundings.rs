//! What else the camera sees: the carrier a part lies on, and clutter beside it.

use nalgebra::{Isometry3, Point3, Vector3};

use super::body::{cuboid, extrude};

/// A stray object, evaluated in the feature frame.
#[derive(Clone, Copy, Debug)]
pub enum Clutter {
    /// Ball: centre, radius, metres.
    Ball([f32; 3], f32),
    /// Box along the frame's axes turned about z: centre, half extents, cosine and sine of the turn.
    Box([f32; 3], [f32; 3], [f32; 2]),
    /// Upright cylinder: centre, radius, half height.
    Post([f32; 3], f32, f32),
    /// Piece of cable: both ends of its centre line, radius.
    Cable([f32; 3], [f32; 3], f32),
}

impl Clutter {
    /// Signed distance, metres.
    #[inline]
    fn distance(&self, p: [f32; 3]) -> f32 {
        let from = |c: &[f32; 3]| [p[0] - c[0], p[1] - c[1], p[2] - c[2]];
        match self {
            Clutter::Ball(centre, radius) => {
                let d = from(centre);
                (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt() - radius
            }
            Clutter::Box(centre, half, [cos, sin]) => {
                let d = from(centre);
                cuboid([cos * d[0] + sin * d[1], cos * d[1] - sin * d[0], d[2]], *half)
            }
            Clutter::Post(centre, radius, half_height) => {
                let d = from(centre);
                extrude((d[0] * d[0] + d[1] * d[1]).sqrt() - radius, d[2].abs() - half_height)
            }
            Clutter::Cable(a, b, radius) => {
                let (d, e) = (from(a), [b[0] - a[0], b[1] - a[1], b[2] - a[2]]);
                let run = e[0] * e[0] + e[1] * e[1] + e[2] * e[2];
                let t = ((d[0] * e[0] + d[1] * e[1] + d[2] * e[2]) / run.max(1e-12)).clamp(0.0, 1.0);
                let g = [d[0] - t * e[0], d[1] - t * e[1], d[2] - t * e[2]];
                (g[0] * g[0] + g[1] * g[1] + g[2] * g[2]).sqrt() - radius
            }
        }
    }
}

/// Carrier and clutter, in the feature frame.
#[derive(Clone, Debug, Default)]
pub struct Surroundings {
    /// Unit normal of the carrier's top, out of the carrier, and its offset: n·p = offset. None floats.
    carrier: Option<([f32; 3], f32)>,
    clutter: Vec<Clutter>,
}

impl Surroundings {
    /// A carrier whose top is the plane z = 0 of the carrier frame, without clutter.
    pub fn on_carrier(feature_from_carrier: &Isometry3<f64>) -> Self {
        let normal = feature_from_carrier * Vector3::z();
        let offset = normal.dot(&(feature_from_carrier * Point3::origin()).coords);
        Self { carrier: Some(([0, 1, 2].map(|i| normal[i] as f32), offset as f32)), clutter: Vec::new() }
    }

    /// Adds clutter.
    #[must_use]
    pub fn with_clutter(mut self, clutter: &[Clutter]) -> Self {
        self.clutter.extend_from_slice(clutter);
        self
    }

    /// Signed distance to the nearest of it, metres; infinite when there is nothing.
    #[inline]
    pub fn distance(&self, p: [f32; 3]) -> f32 {
        let ground = self.carrier.map_or(f32::INFINITY, |(n, offset)| n[0] * p[0] + n[1] * p[1] + n[2] * p[2] - offset);
        self.clutter.iter().fold(ground, |nearest, clutter| nearest.min(clutter.distance(p)))
    }
}
