//! Recognition of what comes in files: clouds and meshes of other people's parts.
//!
//! [`read`] turns a file into a [`Shape`], checked and in metres; [`in_camera`] brings it before a
//! camera: a cloud in a camera's frame as it is, any other as seen from above, a mesh as the plant's
//! camera sees it on a carrier. What comes out is what perception reads. [`score`] does so with a
//! folder of parts whose classes are known.

mod cloud;
mod mesh;
mod scan;
mod set;

use std::path::{Path, PathBuf};

pub use scan::{View, in_camera};
pub use set::{Score, score};

/// Points a cloud is thinned to when it has more than perception takes.
const POINTS_MAX: usize = 20_000;

/// Why a file cannot be looked at.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// It cannot be opened.
    #[error("{file}: {source}")]
    Open {
        /// The file.
        file: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Something in it is not as its format says, or not usable.
    #[error("{file}: {place}: {found}, expected {expected}")]
    Content {
        /// The file.
        file: PathBuf,
        /// Where in it.
        place: String,
        /// What stands there.
        found: String,
        /// What should.
        expected: String,
    },
}

/// What a file holds, metres.
#[derive(Clone, Debug, PartialEq)]
pub enum Shape {
    /// Points.
    Cloud(Vec<[f32; 3]>),
    /// Triangles: corners, and three indices of them each.
    Mesh(Vec<[f64; 3]>, Vec<[u32; 3]>),
}

/// A fault found by one of the readers: place, what was found, what was expected.
struct Fault {
    place: String,
    found: String,
    expected: String,
}

impl Fault {
    fn new(place: impl Into<String>, found: impl Into<String>, expected: impl Into<String>) -> Self {
        Self { place: place.into(), found: found.into(), expected: expected.into() }
    }
}

/// Reads a PLY, PCD, NPY, STL or OBJ file, whose numbers are `unit` metres each.
///
/// # Errors
/// [`ReadError`] with the file, the place in it and the value.
pub fn read(file: &Path, unit: f64) -> Result<Shape, ReadError> {
    let bytes = std::fs::read(file).map_err(|source| ReadError::Open { file: file.to_owned(), source })?;
    let ending = file.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    let shape = match ending.as_str() {
        "ply" => cloud::ply(&bytes).map(Raw::Cloud),
        "pcd" => cloud::pcd(&bytes).map(Raw::Cloud),
        "npy" => cloud::npy(&bytes).map(Raw::Cloud),
        "stl" => mesh::stl(&bytes).map(|(v, t)| Raw::Mesh(v, t)),
        "obj" => mesh::obj(&bytes).map(|(v, t)| Raw::Mesh(v, t)),
        other => Err(Fault::new("name", format!("ending .{other}"), ".ply, .pcd, .npy, .stl or .obj")),
    };
    shape.and_then(|raw| checked(raw, unit)).map_err(|Fault { place, found, expected }| ReadError::Content {
        file: file.to_owned(),
        place,
        found,
        expected,
    })
}

/// In the file's own unit.
enum Raw {
    Cloud(Vec<[f64; 3]>),
    Mesh(Vec<[f64; 3]>, Vec<[u32; 3]>),
}

/// Farthest from the origin a coordinate may be, metres.
const RANGE_MAX: f64 = 10.0;

fn checked(raw: Raw, unit: f64) -> Result<Shape, Fault> {
    let scaled = |points: Vec<[f64; 3]>, what: &str| -> Result<Vec<[f64; 3]>, Fault> {
        let points: Vec<[f64; 3]> = points.iter().map(|p| p.map(|v| v * unit)).collect();
        match points.iter().position(|p| p.iter().any(|v| v.abs() > RANGE_MAX)) {
            None => Ok(points),
            Some(i) => {
                let [x, y, z] = points[i];
                let found = format!("({x}, {y}, {z}) m");
                Err(Fault::new(format!("{what} {i}"), found, "within 10 m of the origin; is --unit right?"))
            }
        }
    };
    match raw {
        Raw::Cloud(points) => {
            // Cameras mark what they did not see by a number that is none.
            let seen = points.into_iter().filter(|p| p.iter().all(|v| v.is_finite())).collect();
            let mut points: Vec<[f32; 3]> = scaled(seen, "point")?.iter().map(|p| p.map(|v| v as f32)).collect();
            let least = crate::perception::sample::CLOUD_MIN;
            if points.len() < least {
                let found = format!("{} finite points", points.len());
                return Err(Fault::new("cloud", found, format!("at least {least}")));
            }
            thin(&mut points);
            Ok(Shape::Cloud(points))
        }
        Raw::Mesh(vertices, triangles) => {
            if triangles.is_empty() {
                return Err(Fault::new("mesh", "no triangle", "at least one"));
            }
            if let Some(i) = vertices.iter().position(|p| p.iter().any(|v| !v.is_finite())) {
                return Err(Fault::new(format!("vertex {i}"), format!("{:?}", vertices[i]), "finite numbers"));
            }
            Ok(Shape::Mesh(scaled(vertices, "vertex")?, triangles))
        }
    }
}

/// Keeps an even choice of at most [`POINTS_MAX`] points, the same each time.
fn thin(points: &mut Vec<[f32; 3]>) {
    use rand::SeedableRng;
    use rand::seq::SliceRandom;
    if points.len() > POINTS_MAX {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(points.len() as u64);
        points.shuffle(&mut rng);
        points.truncate(POINTS_MAX);
    }
}

#[cfg(test)]
mod tests;
