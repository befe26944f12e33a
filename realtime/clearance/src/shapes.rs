//! Shapes known by number from start-up on: convex hulls and triangle meshes.
//!
//! A message has no room for a hull, so the cell's files name it once and scene objects, carried
//! parts and links of the arm then refer to its number. Making [`Shapes`] allocates; asking them does not.
#![allow(clippy::disallowed_types, reason = "shapes are made while starting")]

use core::fmt;

use nalgebra::Vector3;

use crate::hull::Hull;
use crate::mesh::Mesh;
use crate::obstacle::FAR;

/// Points a hull may have: the search over them is what bounds a query.
pub const HULL_POINTS_MAX: usize = 256;
/// Triangles a mesh may have.
pub const MESH_TRIANGLES_MAX: usize = 65_536;

/// Why points make no shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShapeError {
    /// Fewer than four points or more than [`HULL_POINTS_MAX`].
    HullPoints {
        /// Points given.
        count: usize,
    },
    /// No triangle or more than [`MESH_TRIANGLES_MAX`].
    MeshTriangles {
        /// Triangles given.
        count: usize,
    },
    /// A coordinate is not finite or farther off than 10 km.
    Point {
        /// Index of the point.
        index: usize,
    },
    /// A triangle names a point that is not there.
    Triangle {
        /// Index of the triangle.
        index: usize,
    },
}

impl fmt::Display for ShapeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::HullPoints { count } => write!(f, "the hull has {count} points, allowed 4..={HULL_POINTS_MAX}"),
            Self::MeshTriangles { count } => {
                write!(f, "the mesh has {count} triangles, allowed 1..={MESH_TRIANGLES_MAX}")
            }
            Self::Point { index } => write!(f, "point {index} is not finite or farther off than {FAR} m"),
            Self::Triangle { index } => write!(f, "triangle {index} names a point that is not there"),
        }
    }
}

impl core::error::Error for ShapeError {}

/// Middle and half extents of the box around some points.
pub(crate) fn middle_of(points: &[[f64; 3]]) -> Result<(Vector3<f64>, Vector3<f64>), ShapeError> {
    let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
    for (index, point) in points.iter().enumerate() {
        if !point.iter().all(|x| x.abs() <= FAR) {
            return Err(ShapeError::Point { index });
        }
        low = low.inf(&Vector3::from(*point));
        high = high.sup(&Vector3::from(*point));
    }
    let centre = (low + high) * 0.5;
    // As the points are stored, so that rounding leaves none outside.
    let half = points
        .iter()
        .fold(Vector3::zeros(), |half: Vector3<f64>, point| half.sup(&(Vector3::from(*point) - centre).abs()));
    Ok((centre, half))
}

#[derive(Clone, Debug)]
enum Shape {
    Hull(Hull),
    Mesh(Mesh),
}

/// The shapes of a cell, by their numbers: 1 for the first. 0 is no shape.
#[derive(Clone, Debug, Default)]
pub struct Shapes {
    shapes: Vec<Shape>,
}

impl Shapes {
    /// No shapes.
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes in the convex hull of `points`, metres; points inside it do no harm but cost time. Returns its number.
    ///
    /// # Errors
    /// What [`ShapeError`] names.
    pub fn add_hull(&mut self, points: &[[f64; 3]]) -> Result<u32, ShapeError> {
        let hull = Hull::of(points)?;
        Ok(self.add(Shape::Hull(hull)))
    }

    /// Takes in a mesh: `points` in metres and triangles as indices into them. One whose edges all have
    /// two sides, wound alike, is a solid; any other is a surface. Returns its number.
    ///
    /// # Errors
    /// What [`ShapeError`] names.
    pub fn add_mesh(&mut self, points: &[[f64; 3]], triangles: &[[u32; 3]]) -> Result<u32, ShapeError> {
        let mesh = Mesh::of(points, triangles)?;
        Ok(self.add(Shape::Mesh(mesh)))
    }

    fn add(&mut self, shape: Shape) -> u32 {
        self.shapes.push(shape);
        self.shapes.len() as u32
    }

    pub(crate) fn hull(&self, number: u32) -> Option<&Hull> {
        match self.shapes.get(number.checked_sub(1)? as usize)? {
            Shape::Hull(hull) => Some(hull),
            Shape::Mesh(_) => None,
        }
    }

    pub(crate) fn mesh(&self, number: u32) -> Option<&Mesh> {
        match self.shapes.get(number.checked_sub(1)? as usize)? {
            Shape::Mesh(mesh) => Some(mesh),
            Shape::Hull(_) => None,
        }
    }
}
