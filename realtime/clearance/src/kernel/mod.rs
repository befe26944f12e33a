//! Distances between two convex cores: the heart of every query.
//!
//! A capsule is a segment with a radius, so its distance is the segment's minus
//! the radius. Segments and boxes have closed forms, one solid a file, in the solid's own
//! frame; all else goes through [`gjk`]. Distances are signed: where two cores
//! overlap they are minus a depth that is at least the true one.

mod boxes;
mod core;
mod cylinder;
mod depth;
mod gjk;
mod segment;
mod segments;
mod simplex;

pub(crate) use self::core::{Core, core_to_core};
pub(crate) use boxes::{OrientedBox, box_to_box};
pub(crate) use cylinder::segment_to_cylinder;
pub(crate) use gjk::Wanted;
pub(crate) use segment::{point_to_segment, segment_to_segment};
pub(crate) use segments::Segments;
pub(crate) use simplex::nearest_of_triangle;

use nalgebra::Vector3;

/// Cores nearer than this, metres, touch: what is left is rounding.
const TOUCHING: f64 = 1e-12;

/// The nearest points of two cores and their signed distance, metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Near {
    /// Signed distance.
    pub(crate) distance: f64,
    /// Point of the first.
    pub(crate) on_first: Vector3<f64>,
    /// Point of the second.
    pub(crate) on_second: Vector3<f64>,
}

impl Near {
    /// What is not known to be apart.
    pub(crate) const LOST: Self = Self {
        distance: f64::NEG_INFINITY,
        on_first: Vector3::new(0.0, 0.0, 0.0),
        on_second: Vector3::new(0.0, 0.0, 0.0),
    };

    /// Seen from the other side.
    pub(crate) fn swapped(self) -> Self {
        Self { distance: self.distance, on_first: self.on_second, on_second: self.on_first }
    }

    /// With both points taken through `map`.
    pub(crate) fn mapped(self, map: impl Fn(Vector3<f64>) -> Vector3<f64>) -> Self {
        Self { distance: self.distance, on_first: map(self.on_first), on_second: map(self.on_second) }
    }

    /// Between the surfaces, when the cores are padded by these radii.
    pub(crate) fn padded(self, first: f64, second: f64) -> Self {
        let towards = if self.distance.abs() > TOUCHING {
            (self.on_second - self.on_first) / self.distance
        } else {
            Vector3::zeros()
        };
        Self {
            distance: self.distance - first - second,
            on_first: self.on_first + towards * first,
            on_second: self.on_second - towards * second,
        }
    }
}
