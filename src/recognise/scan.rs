//! Shapes brought before a camera.

use core::f64::consts::PI;

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use parry3d_f64::math::Vector;
use parry3d_f64::query::{Ray, RayCast};
use parry3d_f64::shape::TriMesh;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use tandem_msg::CLOUD_POINTS;

use super::Shape;
use crate::plant::camera::{Camera, Meeting, Scene, TILT, feature_from_camera};
use crate::plant::solid::Material;

/// Distance of the camera in half widths of the view.
const DISTANCE: f64 = 8.0;
/// Range noise in half widths of the view at most, so that small parts are not drowned in it.
const NOISE_MAX: f64 = 0.005;
/// Tilt of a view of a feature that looks sideways, radians: from above the carrier.
const TILT_SIDEWAYS: f64 = 0.7;
/// The first look comes from here, radians about the axis; each further one a golden angle on.
const TURN_FIRST: f64 = 0.3;
const GOLDEN: f64 = 0.618_033_988_749_895;

/// How a shape without a camera of its own is looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Where its feature is, metres, in the file's frame; the middle when `None`.
    pub at: Option<[f64; 3]>,
    /// Direction the feature looks in.
    pub axis: [f64; 3],
    /// Direction that is up: the part lies on a carrier.
    pub up: [f64; 3],
    /// Half the width of the view, metres; the whole shape when `None`.
    pub half_width: Option<f64>,
    /// Number of the look: each is from another side and has noise of its own.
    pub look: u32,
}

impl Default for View {
    /// The whole, from above.
    fn default() -> Self {
        Self { at: None, axis: [0.0, 0.0, 1.0], up: [0.0, 0.0, 1.0], half_width: None, look: 0 }
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

/// The feature's frame in the file's: origin at the feature, z along its axis.
fn file_from_feature(view: &View, middle: [f64; 3]) -> Isometry3<f64> {
    let turn = UnitQuaternion::rotation_between(&Vector3::z(), &Vector3::from(view.axis))
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), PI));
    Isometry3::from_parts(Vector3::from(view.at.unwrap_or(middle)).into(), turn)
}

/// A cloud somebody else has scanned, as it looks along its axis: nothing is hidden anew.
fn turned(points: &[[f32; 3]], view: &View) -> Vec<[f32; 3]> {
    let wide = points.iter().map(|p| p.map(f64::from));
    let (middle, extent) = box_of(wide.clone());
    let distance = DISTANCE * view.half_width.unwrap_or(extent);
    let pose = file_from_feature(view, middle) * feature_from_camera(distance, 0.0, TURN_FIRST, 0.0, [0.0; 3]);
    let camera = pose.inverse();
    let seen = wide
        .map(|p| camera * Point3::from(p))
        .filter(|p| view.half_width.is_none_or(|half| p.x.abs() < half && p.y.abs() < half));
    seen.map(|p| [p.x as f32, p.y as f32, p.z as f32]).collect()
}

/// A mesh on a carrier, in the feature's frame.
struct Part {
    mesh: TriMesh,
    /// Unit vector out of the carrier, and its offset, metres.
    up: Vector3<f64>,
    floor: f64,
    feature_from_camera: Isometry3<f64>,
    half_width: f64,
}

impl Scene for Part {
    fn frame_from_camera(&self) -> Isometry3<f64> {
        self.feature_from_camera
    }

    fn field(&self) -> [f64; 2] {
        [DISTANCE * self.half_width, self.half_width]
    }

    fn meet(&self, origin: [f32; 3], along: [f32; 3], near: f32, far: f32) -> Option<Meeting> {
        let [from, to] = [origin, along].map(|v| v.map(f64::from));
        let ray = Ray::new(Vector::new(from[0], from[1], from[2]), Vector::new(to[0], to[1], to[2]));
        let part = self.mesh.cast_local_ray_and_get_normal(&ray, f64::from(far), true).map(|hit| Meeting {
            range: hit.time_of_impact as f32,
            cosine: hit.normal.dot(ray.dir).abs() as f32,
            material: Material::Body,
        });
        let (down, height) = (-self.up.dot(&Vector3::from(to)), self.up.dot(&Vector3::from(from)) - self.floor);
        let carrier = (down > 0.0 && height > 0.0).then(|| Meeting {
            range: (height / down) as f32,
            cosine: down as f32,
            material: Material::Surroundings,
        });
        let nearest = part.into_iter().chain(carrier).min_by(|a, b| a.range.total_cmp(&b.range))?;
        (near..far).contains(&nearest.range).then_some(nearest)
    }
}

/// A mesh as the plant's camera sees it on a carrier below it.
fn scanned(corners: &[[f64; 3]], triangles: &[[u32; 3]], view: &View) -> Result<Vec<[f32; 3]>, String> {
    let (middle, extent) = box_of(corners.iter().copied());
    let half_width = view.half_width.unwrap_or(extent);
    let feature_from_file = file_from_feature(view, middle).inverse();
    let up = (feature_from_file * Vector3::from(view.up)).normalize();
    let placed = corners.iter().map(|c| feature_from_file * Point3::from(*c));
    let floor = placed.clone().map(|p| up.dot(&p.coords)).fold(f64::MAX, f64::min);
    let vertices = placed.map(|p| Vector::new(p.x, p.y, p.z)).collect();
    let mesh = TriMesh::new(vertices, triangles.to_vec()).map_err(|error| error.to_string())?;
    let step = GOLDEN * f64::from(view.look);
    let (tilt, azimuth) = if up.z > 0.5 {
        (TILT, TURN_FIRST + 2.0 * PI * step)
    } else {
        (TILT_SIDEWAYS, up.y.atan2(up.x) + 1.2 * ((step + 0.5).fract() - 0.5))
    };
    let feature_from_camera = feature_from_camera(DISTANCE * half_width, tilt, azimuth, 0.0, [0.0; 3]);
    let part = Part { mesh, up, floor, feature_from_camera, half_width };
    let plain = Camera::default();
    let camera = Camera { range_sigma: plain.range_sigma.min(NOISE_MAX * half_width), ..plain };
    let mut rng = ChaCha8Rng::seed_from_u64(u64::from(view.look));
    let mut cloud = Vec::with_capacity(CLOUD_POINTS);
    camera.render(&part, CLOUD_POINTS, &mut rng, |p, _| cloud.push(p));
    Ok(cloud)
}
