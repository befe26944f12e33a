//! Pose and dimensions of a feature, fitted to the points segmented as such.
//!
//! 1. The segment labels of the 512 sampled points spread to the dense cloud.
//! 2. The surface around the feature: a plane by RANSAC, refined on dense points. Its
//!    normal is the first guess of the feature's axis, it is where the feature begins.
//! 3. By class: a circle by RANSAC, then cylinder or cone by least squares ([`round`]),
//!    the outline of a slot ([`slot`]), the box of a buckle ([`hook`]), the pitch of a
//!    thread by its periodicity along the helix ([`thread`]).
//!
//! What is laid out on the way lies in room made beforehand, so that a fit allocates nothing.
//!
//! Everything is deterministic: random choices come from a generator with a fixed seed.
//! Lengths in metres, in the camera frame unless said otherwise.

mod hook;
mod plane;
mod round;
mod slot;
mod thread;

use bumpalo::Bump;
use bumpalo::collections::CollectIn;
use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use tandem_msg::{FeatureClass, FeatureDimensions, Measured};

use super::columns::{Block, blocks, nearest};
use super::sample::Sample;
use plane::Plane;

/// Dense points that take part in a fit, at most.
const DENSE: usize = 10_000;
/// Feature points below which nothing is fitted.
const SEGMENT_MIN: usize = 8;

/// A list that lies in a fit's room.
pub(crate) type List<'r, T> = bumpalo::collections::Vec<'r, T>;

/// What the fits to one cloud lay out, bytes.
const ROOM: usize = 24 << 20;

/// Room for the fits to one cloud; it grows only for clouds larger than perception takes.
#[derive(Debug)]
pub struct Room(Bump);

impl Room {
    /// Forgets what was laid out.
    pub(crate) fn clear(&mut self) {
        self.0.reset();
    }
}

impl Default for Room {
    fn default() -> Self {
        Self(Bump::with_capacity(ROOM))
    }
}

impl Clone for Room {
    /// Room as large: what is in it means nothing between fits.
    fn clone(&self) -> Self {
        Self::default()
    }
}

/// Where a feature is and how large.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fit {
    /// Origin at mouth or foot, z along the axis, out of the part.
    pub camera_from_feature: Isometry3<f64>,
    /// Dimensions; zero where they do not apply or could not be told.
    pub dimensions: FeatureDimensions,
    /// Of a hole or axis: how much more of its wall's variance a helix of one hand explains than any of
    /// the other, 0 to 1.
    pub winding: Option<f64>,
}

/// A dense point in the frame of the surface: x, y in it, z above it.
pub(crate) type Local = Vector3<f64>;

/// Frame on a surface.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frame {
    pub(crate) origin: Vector3<f64>,
    /// Columns: x, y, z of the frame.
    pub(crate) axes: Matrix3<f64>,
}

impl Frame {
    /// The frame at `origin` with z along `normal`; x as near to the camera's x as may be.
    pub(crate) fn on(origin: Vector3<f64>, normal: Vector3<f64>) -> Self {
        let z = normal.normalize();
        let aside = if z.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
        let x = (aside - z * z.dot(&aside)).normalize();
        Self { origin, axes: Matrix3::from_columns(&[x, z.cross(&x), z]) }
    }

    pub(crate) fn local(&self, p: Vector3<f64>) -> Local {
        self.axes.tr_mul(&(p - self.origin))
    }

    /// Pose of the frame moved to `at`, its z leant to `z` and x turned towards `x` (all local).
    pub(crate) fn pose(&self, at: Local, z: Local, x: Local) -> Isometry3<f64> {
        let z = z.normalize();
        let x = x - z * z.dot(&x);
        let x = if x.norm() > 1e-9 { x.normalize() } else { z.cross(&Vector3::y()).normalize() };
        let axes = self.axes * Matrix3::from_columns(&[x, z.cross(&x), z]);
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(axes));
        Isometry3::from_parts(Translation3::from(self.origin + self.axes * at), rotation)
    }
}

/// Dense points, told apart.
pub(crate) struct Dense<'r> {
    /// On the feature.
    pub(crate) feature: List<'r, Vector3<f64>>,
    /// Elsewhere.
    pub(crate) rest: List<'r, Vector3<f64>>,
}

/// Fits the feature of a class to a cloud (metres, camera frame), its sample and the sample's
/// segment, laid out in `room`. `None` when nothing can be fitted.
pub fn fit(cloud: &[[f32; 3]], sample: &Sample, segment: &[bool], class: FeatureClass, room: &Room) -> Option<Fit> {
    let room = &room.0;
    let mut rng = ChaCha8Rng::seed_from_u64(0x5eed);
    let dense = spread(cloud, sample, segment, room);
    let surface = plane::surface(cloud, sample, segment, &dense, room, &mut rng);
    if class == FeatureClass::Other || dense.feature.len() < SEGMENT_MIN {
        return surface.map(|plane| bare(&plane, &dense));
    }
    let fit = match class {
        FeatureClass::Slot => slot::fit(&surface?, &dense, room),
        FeatureClass::Buckle => hook::fit(&surface?, &dense, sample, segment, room),
        _ => round::fit(surface.as_ref(), cloud, sample, segment, &dense, class, room, &mut rng),
    };
    fit.filter(|fit| near(fit, &dense.feature, room))
}

/// Whether the origin lies where the feature's points are: a fit that ran away is none.
fn near(fit: &Fit, feature: &[Vector3<f64>], room: &Bump) -> bool {
    let middle = feature.iter().sum::<Vector3<f64>>() / feature.len() as f64;
    let mut reach: List<'_, f64> = feature.iter().map(|p| (p - middle).norm()).collect_in(room);
    (fit.camera_from_feature.translation.vector - middle).norm() < 2.0 * quantile(&mut reach, 0.9)
}

/// Where there is no feature to locate: the point of the surface the camera looks at, or the
/// middle of what stands on it.
fn bare(plane: &Plane, dense: &Dense<'_>) -> Fit {
    let at = if dense.feature.len() >= SEGMENT_MIN {
        let mid = dense.feature.iter().sum::<Vector3<f64>>() / dense.feature.len() as f64;
        mid - plane.normal * plane.height(mid)
    } else {
        // The view axis is x = y = 0.
        let along = if plane.normal.z.abs() > 0.1 { plane.offset / plane.normal.z } else { 0.0 };
        Vector3::new(0.0, 0.0, along)
    };
    let frame = Frame::on(at, plane.normal);
    Fit {
        camera_from_feature: frame.pose(Vector3::zeros(), Vector3::z(), Vector3::x()),
        dimensions: FeatureDimensions::default(),
        winding: None,
    }
}

/// Labels of the dense points: each takes that of the nearest sampled point.
fn spread<'r>(cloud: &[[f32; 3]], sample: &Sample, segment: &[bool], room: &'r Bump) -> Dense<'r> {
    let of = |wanted: bool| -> List<'_, Block> {
        let chosen = sample.source.iter().zip(segment).filter(move |(_, s)| **s == wanted);
        blocks(chosen.map(|(&i, _)| cloud[usize::from(i)])).collect_in(room)
    };
    let (on, off) = (of(true), of(false));
    let count = cloud.len().min(DENSE);
    let mut dense = Dense { feature: List::with_capacity_in(count, room), rest: List::with_capacity_in(count, room) };
    let stride = cloud.len().div_ceil(DENSE).max(1);
    for p in cloud.iter().step_by(stride) {
        let to = if nearest(&on, *p) < nearest(&off, *p) { &mut dense.feature } else { &mut dense.rest };
        to.push(wide(*p));
    }
    dense
}

pub(crate) fn wide(p: [f32; 3]) -> Vector3<f64> {
    Vector3::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]))
}

pub(crate) fn measured(value: f64, sigma: f64) -> Measured {
    if value.is_finite() && sigma.is_finite() && value > 0.0 { Measured { value, sigma } } else { Measured::default() }
}

/// The value below which `share` of the values lie; reorders them. Zero if there are none.
pub(crate) fn quantile(values: &mut [f64], share: f64) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let at = ((values.len() - 1) as f64 * share).round() as usize;
    *values.select_nth_unstable_by(at, f64::total_cmp).1
}
