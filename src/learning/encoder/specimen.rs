//! Random parts, surroundings and views.
//!
//! Ranges are wider than any product's on purpose. Sizes are drawn log-uniformly and
//! the view follows the feature, so what the network can use is shape, not scale; for
//! the same reason every class is seen on the same bodies and through the same views.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rand::{Rng, RngExt};
use tandem_msg::FeatureClass;

use crate::plant::camera::{Camera, View, extent, feature_from_camera};
use crate::plant::solid::{Body, Clutter, FeatureGeometry, Form, Other, Solid, Surroundings};

/// Smallest and largest feature, metres.
const SIZE: [f64; 2] = [0.004, 0.045];
/// Tilt of the view off the feature's axis, radians.
const TILT: [f64; 2] = [0.17, 0.70];
/// Half the view in extents of the feature.
const VIEW: [f64; 2] = [1.05, 2.3];
/// Range noise in half widths of the view, and its limits in metres.
const NOISE: [f64; 2] = [0.001, 0.008];
const NOISE_LIMITS: [f64; 2] = [20e-6, 300e-6];

/// A part, what lies around it, and how it is looked at.
#[derive(Clone, Debug)]
pub struct Specimen {
    /// The true feature.
    pub feature: FeatureGeometry,
    /// The part.
    pub solid: Solid,
    /// What lies around it.
    pub surroundings: Surroundings,
    /// The camera.
    pub camera: Camera,
    /// Where the camera stands.
    pub feature_from_camera: Isometry3<f64>,
    /// Tangent of half the field of view.
    pub half_tangent: f64,
}

impl Specimen {
    /// Draws a specimen of a class.
    pub fn draw(class: FeatureClass, rng: &mut impl Rng) -> Self {
        let (mut feature, form) = feature(class, rng);
        // A bare surface is looked at as closely as anything else.
        let size = match (class, form.other) {
            (FeatureClass::Other, Other::Bare) => log_uniform(SIZE, rng),
            (FeatureClass::Other, Other::Block(size, _)) => size[0].max(size[1]).max(size[2]),
            (FeatureClass::Other, Other::Dome(diameter, _)) => diameter,
            _ => extent(&feature),
        };
        let (body, top, at) = body(&mut feature, size, rng);
        let part_from_feature = Isometry3::from_parts(
            Translation3::new(at[0], at[1], top),
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), rng.random_range(0.0..std::f64::consts::TAU)),
        );
        let solid = Solid::with_form(&body, &feature, &form, &part_from_feature);

        let half_width = size * rng.random_range(VIEW[0]..VIEW[1]);
        let sigma = (half_width * log_uniform(NOISE, rng)).clamp(NOISE_LIMITS[0], NOISE_LIMITS[1]);
        let camera = Camera {
            range_sigma: sigma,
            dropout: rng.random_range(0.0..0.08),
            outliers: rng.random_range(0.0..0.008),
        };
        let aim = {
            let (off, turn) = (0.45 * half_width * rng.random::<f64>().sqrt(), rng.random_range(0.0..6.3_f64));
            [off * turn.cos(), off * turn.sin(), 0.0]
        };
        let distance = rng.random_range(0.25..0.5);
        let half_tangent = half_width / distance;
        let feature_from_camera = feature_from_camera(
            distance,
            rng.random_range(TILT[0]..TILT[1]),
            rng.random_range(0.0..std::f64::consts::TAU),
            rng.random_range(0.0..std::f64::consts::TAU),
            aim,
        );
        let surroundings = surroundings(&part_from_feature, 2.0 * top, size, half_width, rng);
        Self { feature, solid, surroundings, camera, feature_from_camera, half_tangent }
    }

    /// What the camera is pointed at.
    pub fn view(&self) -> View<'_> {
        View {
            solid: &self.solid,
            surroundings: &self.surroundings,
            feature_from_camera: self.feature_from_camera,
            half_tangent: self.half_tangent,
        }
    }
}

fn log_uniform([low, high]: [f64; 2], rng: &mut impl Rng) -> f64 {
    rng.random_range(low.ln()..high.ln()).exp()
}

fn feature(class: FeatureClass, rng: &mut impl Rng) -> (FeatureGeometry, Form) {
    let mut g = FeatureGeometry::plain(class);
    let mut form = Form::default();
    let size = log_uniform(SIZE, rng);
    let mut of = |low: f64, high: f64| size * rng.random_range(low..high);
    match class {
        FeatureClass::ThreadedHole | FeatureClass::SmoothHole => {
            g.diameter = size;
            g.depth = of(0.4, 2.5);
            g.chamfer = of(-0.08, 0.12).max(0.0);
            if class == FeatureClass::ThreadedHole {
                g.pitch = of(0.09, 0.19);
            }
        }
        FeatureClass::ThreadedAxis | FeatureClass::SmoothAxis => {
            g.diameter = size;
            g.depth = of(0.5, 2.8);
            g.chamfer = of(-0.05, 0.12).max(0.0).min(0.4 * g.depth);
            if class == FeatureClass::ThreadedAxis {
                g.pitch = of(0.09, 0.19);
            }
        }
        FeatureClass::Slot => {
            g.length = size;
            g.width = of(0.16, 0.62);
            g.depth = of(0.08, 0.6);
            g.chamfer = of(-0.03, 0.04).max(0.0);
        }
        FeatureClass::Cone => {
            g.diameter = size;
            g.angle = rng.random_range(0.10..0.65);
            form.seat = rng.random_bool(0.35);
            // No sharper than a tip of an eighth of the diameter.
            let sharpest = 0.5 * size * 0.87 / g.angle.tan();
            g.depth = (size * rng.random_range(0.5..2.2)).min(sharpest);
        }
        FeatureClass::Buckle => {
            form.twin = rng.random_bool(0.5);
            g.depth = size;
            g.width = of(0.35, 1.6);
            g.length = if form.twin { of(0.81, 1.8) } else { of(0.3, 0.79) };
        }
        FeatureClass::Other => {
            form.other = match rng.random_range(0..10) {
                0..4 => Other::Bare,
                4..8 => {
                    let (length, width) = (size, size * rng.random_range(0.12..1.0));
                    let height = size * rng.random_range(0.1..0.9);
                    Other::Block([length, width, height], 0.15 * width.min(height) * rng.random::<f64>())
                }
                _ => Other::Dome(size, size * rng.random_range(0.12..0.5)),
            };
        }
    }
    (g, form)
}

/// A body with room for the feature: the body, the height of its top, and where on it the
/// feature stands. Sunk features may come out as through ones.
fn body(feature: &mut FeatureGeometry, size: f64, rng: &mut impl Rng) -> (Body, f64, [f64; 2]) {
    let sunk = matches!(feature.class, FeatureClass::ThreadedHole | FeatureClass::SmoothHole | FeatureClass::Slot)
        || feature.class == FeatureClass::Cone;
    let least = if sunk { feature.depth * 1.15 } else { 0.0015 };
    let mut height = least.max(size * rng.random_range(0.1..2.5));
    if sunk && feature.class != FeatureClass::Cone && rng.random_bool(0.35) {
        // Through: the hole is as deep as the part is thick.
        height = feature.depth;
        feature.depth *= 1.0 + 1e-3;
    }
    let top = 0.5 * height;
    let room = 0.62 * size + feature.chamfer;
    match rng.random_range(0..10) {
        0..6 => {
            let half = [0, 1].map(|_| room * log_uniform([1.0, 9.0], rng));
            let at = half.map(|h| (h - room) * rng.random_range(-1.0..=1.0));
            if rng.random_bool(0.2) && !sunk {
                // The floor of a tray, walls around.
                let wall = size * rng.random_range(0.1..0.5);
                let floor = height;
                let tall = floor + size * rng.random_range(0.2..1.2);
                let half = half.map(|h| h.max(2.0 * room) + wall);
                let body = Body::Tray { size: [2.0 * half[0], 2.0 * half[1], tall], wall, floor };
                return (body, floor - 0.5 * tall, at);
            }
            (Body::Box { size: [2.0 * half[0], 2.0 * half[1], height] }, top, at)
        }
        6..8 => {
            let radius = room * log_uniform([1.0, 5.0], rng);
            let off = (radius - room) * rng.random::<f64>();
            (Body::Cylinder { radius, height }, top, [off, 0.0])
        }
        _ => {
            let bar = room * rng.random_range(1.0..2.5);
            let inner = [0, 1].map(|_| size * rng.random_range(1.0..8.0));
            let outer = inner.map(|i| i + 4.0 * bar);
            let slide = 0.5 * outer[1] - bar;
            let at = [0.5 * inner[0] + bar, slide * rng.random_range(-1.0..1.0)];
            (Body::Ring { outer, inner, height }, top, at)
        }
    }
}

fn surroundings(
    part_from_feature: &Isometry3<f64>,
    height: f64,
    size: f64,
    half_width: f64,
    rng: &mut impl Rng,
) -> Surroundings {
    // The carrier lies under the part, a little askew and sometimes well below.
    let gap = if rng.random_bool(0.3) { rng.random_range(0.0..0.06) } else { 0.0 };
    let skew = UnitQuaternion::from_euler_angles(rng.random_range(-0.04..0.04), rng.random_range(-0.04..0.04), 0.0);
    let bottom = Translation3::new(0.0, 0.0, -0.5 * height - gap);
    let feature_from_carrier = part_from_feature.inverse() * Isometry3::from_parts(bottom, skew);

    let count = if rng.random_bool(0.35) { 0 } else { rng.random_range(1..5) };
    let clutter: Vec<Clutter> = (0..count).map(|_| stray(size, half_width, height, rng)).collect();
    Surroundings::on_carrier(&feature_from_carrier).with_clutter(&clutter)
}

/// A stray object beside the feature, on the part or beside it, clear of the feature.
fn stray(size: f64, half_width: f64, height: f64, rng: &mut impl Rng) -> Clutter {
    let big = half_width * rng.random_range(0.08..0.45);
    let away = 0.75 * size + 1.5 * big + half_width * rng.random_range(0.0..0.8);
    let turn = rng.random_range(0.0..std::f64::consts::TAU);
    let z = if rng.random_bool(0.7) { 0.0 } else { -rng.random::<f64>() * height };
    let centre = [away * turn.cos(), away * turn.sin(), z];
    let f = |v: [f64; 3]| v.map(|v| v as f32);
    match rng.random_range(0..4) {
        0 => Clutter::Ball(f(centre), (0.8 * big) as f32),
        1 => {
            let half = [big, big * rng.random_range(0.2..1.0), big * rng.random_range(0.2..1.0)];
            let turn: f64 = rng.random_range(0.0..std::f64::consts::PI);
            Clutter::Box(f(centre), f(half), [turn.cos() as f32, turn.sin() as f32])
        }
        2 => Clutter::Post(f(centre), (big * rng.random_range(0.3..0.9)) as f32, (big * rng.random_range(0.2..1.2)) as f32),
        _ => {
            // A cable passes by at a tangent.
            let run = half_width * rng.random_range(0.5..2.0);
            let radius = big * rng.random_range(0.15..0.4);
            let along = [-run * turn.sin(), run * turn.cos(), 0.0];
            let ends = [-1.0, 1.0].map(|s| f([0, 1, 2].map(|i| centre[i] + s * along[i])));
            Clutter::Cable(ends[0], ends[1], radius as f32)
        }
    }
}
