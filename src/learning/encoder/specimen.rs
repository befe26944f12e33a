//! Random parts, surroundings and views.
//!
//! Ranges are wider than any product's on purpose. Sizes are drawn log-uniformly and
//! the view follows the feature, so what the network can use is shape, not scale; for
//! the same reason every class is seen on the same bodies and through the same views.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use tandem_config::{Body, FeatureGeometry};
use tandem_msg::FeatureClass;

use super::domain::{Domain, Kind};
use crate::plant::camera::{Camera, View, extent, feature_from_camera};
use crate::plant::solid::{Clutter, Form, Other, Solid, Surroundings};

/// Smallest and largest feature, metres.
const SIZE: [f64; 2] = [0.004, 0.045];
/// Turns of a thread there are at least: less is a groove.
const TURNS_MIN: f64 = 2.5;

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
    /// Focus of the view, metres.
    pub focus: f64,
    /// Half its width, metres.
    pub half_width: f64,
}

impl Specimen {
    /// Draws specimen `index` of a domain.
    pub fn draw(domain: &Domain, index: u64, rng: &mut ChaCha8Rng) -> Self {
        let kind = match domain.kinds.len() as u64 {
            0 => kind(domain.class(index), rng),
            count => domain.kinds[(index % count) as usize].scaled(log_uniform(domain.scale, rng)),
        };
        let Kind { feature, form, body, part_from_feature, size } = kind;
        let class = feature.class;
        let solid = Solid::with_form(&body, &feature, &form, &part_from_feature);

        let mut half_width = size * log_uniform(domain.view, rng);
        let sigma = (half_width * log_uniform(domain.noise, rng)).clamp(domain.noise_limits[0], domain.noise_limits[1]);
        let camera = Camera {
            range_sigma: sigma,
            dropout: rng.random_range(0.0..domain.dropout),
            outliers: rng.random_range(0.0..domain.outliers),
        };
        let mut reach = domain.aim * half_width;
        if class == FeatureClass::Slot {
            // Mostly both its ends are in view.
            half_width = half_width.max(0.55 * feature.length);
            reach = reach.min((half_width - 0.5 * feature.length).max(0.08 * half_width));
        }
        let (off, toward) = (reach * rng.random::<f64>().sqrt(), rng.random_range(0.0..TAU));
        let aim = [off * toward.cos(), off * toward.sin(), 0.0];
        let focus = rng.random_range(0.25..0.5);

        // A part mostly stands on its carrier, feature up; now and then it lies on its side.
        let lying = !matches!(body, Body::Tray { .. } | Body::Ring { .. } | Body::Cable { .. })
            && rng.random_bool(if class == FeatureClass::Cone { 0.35 } else { 0.18 });
        let up = part_from_feature.inverse() * Vector3::z();
        let (feature_from_carrier, tilt, azimuth) = if lying {
            lying_on(&body, &part_from_feature, size, rng)
        } else {
            // The carrier lies under the part, a little askew and sometimes well below.
            let gap = if rng.random_bool(0.3) { rng.random_range(0.0..0.06) } else { 0.0 };
            let bottom = Translation3::new(0.0, 0.0, -body.half_extents()[2] - gap);
            let on = part_from_feature.inverse() * Isometry3::from_parts(bottom, askew(rng));
            if up.z > 0.5 {
                (on, rng.random_range(domain.tilt[0]..domain.tilt[1]), rng.random_range(0.0..TAU))
            } else {
                // It looks sideways: seen from above the carrier.
                (on, rng.random_range(0.45..0.95), up.y.atan2(up.x) + rng.random_range(-0.6..0.6))
            }
        };
        let roll = rng.random_range(0.0..TAU);
        let feature_from_camera = feature_from_camera(focus, tilt, azimuth, roll, aim);
        let count = if rng.random_bool(domain.tidy) { 0 } else { rng.random_range(1..=domain.clutter) };
        let height = 2.0 * part_from_feature.translation.z.abs();
        let clutter: Vec<Clutter> = (0..count).map(|_| stray(size, half_width, height, rng)).collect();
        let surroundings = Surroundings::on_carrier(&feature_from_carrier).with_clutter(&clutter);
        Self { feature, solid, surroundings, camera, feature_from_camera, focus, half_width }
    }

    /// What the camera is pointed at.
    pub fn view(&self) -> View<'_> {
        View {
            solid: &self.solid,
            surroundings: &self.surroundings,
            feature_from_camera: self.feature_from_camera,
            focus: self.focus,
            half_width: self.half_width,
        }
    }
}

/// A part type of a class: any of them.
pub(super) fn kind(class: FeatureClass, rng: &mut ChaCha8Rng) -> Kind {
    let (mut feature, form) = feature(class, rng);
    // A bare surface is looked at as closely as anything else.
    let size = match (class, form.other) {
        (FeatureClass::Other, Other::Bare) => log_uniform(SIZE, rng),
        (FeatureClass::Other, Other::Block(size, _)) => size[0].max(size[1]).max(size[2]),
        (FeatureClass::Other, Other::Dome(diameter, _)) => diameter,
        _ => extent(&feature),
    };
    let aligned = rng.random_bool(0.5);
    let room = room(&feature, size, aligned);
    let (body, top, at) = body(&mut feature, size, room, rng);
    // Along the body's edges, or in any direction.
    let turn = if aligned { 0.0 } else { rng.random_range(0.0..TAU) };
    let part_from_feature = Isometry3::from_parts(Translation3::new(at[0], at[1], top), about_z(turn));
    Kind { feature, form, body, part_from_feature, size }
}

pub(super) fn log_uniform([low, high]: [f64; 2], rng: &mut ChaCha8Rng) -> f64 {
    rng.random_range(low.ln()..high.ln()).exp()
}

fn feature(class: FeatureClass, rng: &mut ChaCha8Rng) -> (FeatureGeometry, Form) {
    let mut g = FeatureGeometry {
        class,
        diameter: 0.0,
        depth: 0.0,
        length: 0.0,
        width: 0.0,
        pitch: 0.0,
        angle: 0.0,
        chamfer: 0.0,
    };
    let mut form = Form::default();
    let size = log_uniform(SIZE, rng);
    let of = |rng: &mut ChaCha8Rng, low: f64, high: f64| size * rng.random_range(low..high);
    match class {
        FeatureClass::ThreadedHole | FeatureClass::SmoothHole => {
            g.diameter = size;
            g.depth = size * log_uniform([0.25, 2.2], rng);
            g.chamfer = of(rng, -0.08, 0.12).max(0.0).min(0.3 * g.depth);
            if class == FeatureClass::ThreadedHole {
                g.pitch = of(rng, 0.08, 0.19).min((g.depth - g.chamfer) / TURNS_MIN);
            }
        }
        FeatureClass::ThreadedAxis | FeatureClass::SmoothAxis => {
            g.diameter = size;
            g.depth = of(rng, 0.5, 2.8);
            g.chamfer = of(rng, -0.05, 0.12).max(0.0).min(0.4 * g.depth);
            if class == FeatureClass::ThreadedAxis {
                g.pitch = of(rng, 0.08, 0.19).min((g.depth - g.chamfer) / TURNS_MIN);
            }
        }
        FeatureClass::Slot => {
            g.length = size;
            g.width = size * log_uniform([0.06, 0.62], rng);
            g.depth = (g.width * rng.random_range(0.25..1.5)).min(0.6 * size);
            g.chamfer = (g.width * rng.random_range(-0.1..0.12)).max(0.0);
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
            g.width = of(rng, 0.35, 1.6);
            g.length = if form.twin { of(rng, 0.81, 1.8) } else { of(rng, 0.3, 0.79) };
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

fn about_z(angle: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle)
}

fn askew(rng: &mut ChaCha8Rng) -> UnitQuaternion<f64> {
    UnitQuaternion::from_euler_angles(rng.random_range(-0.04..0.04), rng.random_range(-0.04..0.04), 0.0)
}

/// Half the room the feature needs along x and y, metres.
fn room(feature: &FeatureGeometry, size: f64, aligned: bool) -> [f64; 2] {
    let edge = 0.05 * size + feature.chamfer;
    match feature.class {
        FeatureClass::Slot | FeatureClass::Buckle if aligned => {
            [0.55 * feature.length + edge, 0.55 * feature.width + edge]
        }
        FeatureClass::Buckle => [0.5 * feature.length.hypot(feature.width) + edge; 2],
        FeatureClass::Slot => [0.5 * feature.length + edge; 2],
        FeatureClass::Other => [0.6 * size; 2],
        _ => [0.5 * feature.diameter + edge; 2],
    }
}

/// A body with room for the feature: the body, the height of its top, and where on it the
/// feature stands. Sunk features may come out as through ones.
fn body(feature: &mut FeatureGeometry, size: f64, room: [f64; 2], rng: &mut ChaCha8Rng) -> (Body, f64, [f64; 2]) {
    use FeatureClass as C;
    let sunk = matches!(feature.class, C::ThreadedHole | C::SmoothHole | C::Slot | C::Cone);
    let least = if sunk { feature.depth * 1.15 } else { 0.001 };
    let mut height = least.max(size * rng.random_range(0.05..2.5));
    if sunk && feature.class != C::Cone && rng.random_bool(0.35) {
        // Through: the hole is as deep as the part is thick.
        height = feature.depth;
        feature.depth *= 1.0 + 1e-3;
    }
    let top = 0.5 * height;
    let widest = room[0].max(room[1]);
    let spread = |r: f64, rng: &mut ChaCha8Rng| (r + 1e-4) * log_uniform([1.0, 9.0], rng);
    match rng.random_range(0..10) {
        0..5 => {
            let half = room.map(|r| spread(r, rng));
            let at = [0, 1].map(|i| (half[i] - room[i]) * rng.random_range(-1.0..=1.0));
            (Body::Box { size: [2.0 * half[0], 2.0 * half[1], height] }, top, at)
        }
        5 => {
            // The floor of a tray, walls around; or its rim.
            let inner = room.map(|r| spread(r.max(0.5 * size), rng));
            let floor = height;
            let tall = floor + size * rng.random_range(0.2..3.0);
            let bar = room[1] * rng.random_range(1.0..2.2);
            let wall = 2.0 * bar;
            let half = inner.map(|i| i.max(room[0]) + wall);
            let body = Body::Tray { size: [2.0 * half[0], 2.0 * half[1], tall.max(least)], wall, floor };
            if rng.random_bool(0.4) {
                let at = [0, 1].map(|i| (half[i] - wall - room[i]).max(0.0) * rng.random_range(-1.0..=1.0));
                (body, floor - 0.5 * tall.max(least), at)
            } else {
                let slide = (half[0] - room[0]) * rng.random_range(-1.0..=1.0);
                (body, 0.5 * tall.max(least), [slide, half[1] - bar])
            }
        }
        6..9 if feature.class == C::Cone => rod(feature, size, height, rng),
        6..8 => {
            let radius = widest * log_uniform([1.0, 5.0], rng);
            let off = (radius - widest) * rng.random::<f64>();
            (Body::Cylinder { radius, height }, top, [off, 0.0])
        }
        8 if !sunk => rod(feature, size, height, rng),
        _ => {
            let bar = room[1] * rng.random_range(1.0..2.5);
            let inner = [0, 1].map(|_| size * rng.random_range(1.0..8.0));
            let outer = inner.map(|i| i + 4.0 * bar);
            let slide = (0.5 * outer[0] - room[0]).max(0.0) * rng.random_range(-1.0..=1.0);
            (Body::Ring { outer, inner, height }, top, [slide, 0.5 * inner[1] + bar])
        }
    }
}

/// The end of a rod or cable, thinner or thicker than the feature.
fn rod(feature: &FeatureGeometry, size: f64, height: f64, rng: &mut ChaCha8Rng) -> (Body, f64, [f64; 2]) {
    let radius = 0.5 * feature.diameter.max(0.6 * size) * rng.random_range(0.4..1.3);
    let height = height.max(4.0 * radius);
    (Body::Cylinder { radius, height }, 0.5 * height, [0.0, 0.0])
}

/// The carrier of a part that lies on its side, and a view from above it: carrier pose in the
/// feature frame, tilt and azimuth of the view.
fn lying_on(
    body: &Body,
    part_from_feature: &Isometry3<f64>,
    size: f64,
    rng: &mut ChaCha8Rng,
) -> (Isometry3<f64>, f64, f64) {
    let half = body.half_extents();
    // The side that looks down: against x or y of the part.
    let (side, up) = if rng.random_bool(0.5) { (0, Vector3::x()) } else { (1, Vector3::y()) };
    let foot = up * -half[side].max(0.5 * size * rng.random_range(0.2..1.2));
    let turn = UnitQuaternion::rotation_between(&Vector3::z(), &up).unwrap_or_default();
    let part_from_carrier = Isometry3::from_parts(Translation3::from(foot), turn * askew(rng));
    let up = part_from_feature.inverse() * up;
    let tilt = rng.random_range(0.45..0.95);
    (part_from_feature.inverse() * part_from_carrier, tilt, up.y.atan2(up.x) + rng.random_range(-0.6..0.6))
}

/// A stray object beside the feature, on the part or beside it, clear of the feature.
fn stray(size: f64, half_width: f64, height: f64, rng: &mut ChaCha8Rng) -> Clutter {
    let big = half_width * rng.random_range(0.08..0.45);
    // What is nearest to the middle of the view is what is asked about.
    let near = (0.75 * size + 1.5 * big).max(0.5 * half_width + 1.3 * big);
    let away = near + half_width * rng.random_range(0.0..0.7);
    let turn = rng.random_range(0.0..TAU);
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
        2 => Clutter::Post(
            f(centre),
            (big * rng.random_range(0.3..0.9)) as f32,
            (big * rng.random_range(0.2..1.2)) as f32,
        ),
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
