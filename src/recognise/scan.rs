//! Shapes brought before a camera.

use nalgebra::{Isometry3, Point3, Vector3};
use parry3d_f64::math::Vector;
use parry3d_f64::query::{Ray, RayCast};
use parry3d_f64::shape::TriMesh;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::Shape;
use crate::plant::camera::{Camera, TILT, feature_from_camera};

/// Rays along each side of a scan.
const RAYS: usize = 110;
/// Distance of the camera in half widths of the view.
const DISTANCE: f64 = 8.0;

/// How a shape without a camera of its own is looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Where its feature is, metres, in the file's frame; the middle when `None`.
    pub at: Option<[f64; 3]>,
    /// Direction the feature looks in.
    pub axis: [f64; 3],
    /// Half the width of the view, metres; the whole shape when `None`.
    pub half_width: Option<f64>,
}

impl Default for View {
    /// The whole, from above.
    fn default() -> Self {
        Self { at: None, axis: [0.0, 0.0, 1.0], half_width: None }
    }
}

/// The shape as a cloud in a camera's frame, metres, z along the view. A cloud that lies before the
/// origin already is taken as it is unless a `view` is asked for.
///
/// # Errors
/// When a mesh is none that rays can be traced against.
pub fn in_camera(shape: &Shape, view: Option<&View>) -> Result<Vec<[f32; 3]>, String> {
    match shape {
        Shape::Cloud(points) => {
            let before = points.iter().all(|p| p[2] > 0.0);
            Ok(match view {
                None if before => points.clone(),
                view => turned(points, &view.copied().unwrap_or_default()),
            })
        }
        Shape::Mesh(corners, triangles) => scanned(corners, triangles, &view.copied().unwrap_or_default()),
    }
}

/// Middle and half extent of points.
fn box_of(points: impl Iterator<Item = [f64; 3]>) -> ([f64; 3], f64) {
    let (mut low, mut high) = ([f64::MAX; 3], [f64::MIN; 3]);
    for p in points {
        for k in 0..3 {
            low[k] = low[k].min(p[k]);
            high[k] = high[k].max(p[k]);
        }
    }
    let half = [0, 1, 2].map(|k| 0.5 * (high[k] - low[k]));
    ([0, 1, 2].map(|k| 0.5 * (low[k] + high[k])), half[0].max(half[1]).max(half[2]))
}

/// Pose of a camera in the file's frame, `tilt` off the axis.
fn pose(view: &View, middle: [f64; 3], half_width: f64, tilt: f64) -> Isometry3<f64> {
    let at = Vector3::from(view.at.unwrap_or(middle));
    let turn = nalgebra::UnitQuaternion::rotation_between(&Vector3::z(), &Vector3::from(view.axis))
        .unwrap_or_else(|| nalgebra::UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
    let file_from_feature = Isometry3::from_parts(at.into(), turn);
    file_from_feature * feature_from_camera(DISTANCE * half_width, tilt, 0.3, 0.0, [0.0; 3])
}

/// A cloud somebody else has scanned, as it looks along its axis: nothing is hidden anew.
fn turned(points: &[[f32; 3]], view: &View) -> Vec<[f32; 3]> {
    let wide = points.iter().map(|p| p.map(f64::from));
    let (middle, extent) = box_of(wide.clone());
    let half_width = view.half_width.unwrap_or(extent);
    let camera = pose(view, middle, half_width, 0.0).inverse();
    let seen = wide
        .map(|p| camera * Point3::from(p))
        .filter(|p| view.half_width.is_none_or(|half| p.x.abs() < half && p.y.abs() < half));
    seen.map(|p| [p.x as f32, p.y as f32, p.z as f32]).collect()
}

/// Rays over the view, each with the plant camera's noise.
fn scanned(corners: &[[f64; 3]], triangles: &[[u32; 3]], view: &View) -> Result<Vec<[f32; 3]>, String> {
    let (middle, extent) = box_of(corners.iter().copied());
    let half_width = view.half_width.unwrap_or(extent);
    let vertices = corners.iter().map(|c| Vector::new(c[0], c[1], c[2])).collect();
    let mesh = TriMesh::new(vertices, triangles.to_vec()).map_err(|error| error.to_string())?;
    let pose = pose(view, middle, half_width, TILT);
    let origin = pose * Point3::origin();
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let sigma = Camera::default().range_sigma;
    let mut cloud = Vec::with_capacity(RAYS * RAYS);
    for i in 0..RAYS * RAYS {
        // One ray a cell, anywhere in it.
        let [x, y] =
            [i % RAYS, i / RAYS].map(|c| ((c as f64 + rng.random::<f64>()) / RAYS as f64 * 2.0 - 1.0) / DISTANCE);
        let along = Vector3::new(x, y, 1.0).normalize();
        let turned = pose * along;
        let ray = Ray::new(Vector::new(origin.x, origin.y, origin.z), Vector::new(turned.x, turned.y, turned.z));
        if let Some(range) = mesh.cast_local_ray(&ray, 2.0 * DISTANCE * half_width.max(extent), true) {
            let unit: f64 = StandardNormal.sample(&mut rng);
            let p = along * (range + sigma.min(0.005 * half_width) * unit);
            cloud.push([p.x as f32, p.y as f32, p.z as f32]);
        }
    }
    Ok(cloud)
}
