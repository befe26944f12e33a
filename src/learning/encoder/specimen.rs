//! Random parts in their surroundings, and views of them.
//!
//! The view follows the feature, so that what the network can use is shape, not scale; every class is seen
//! through the same views.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use tandem_config::{Body, FeatureGeometry};
use tandem_msg::FeatureClass;

use super::domain::Domain;
use super::part::{Kind, log_uniform};
use crate::plant::camera::{Camera, View, feature_from_camera};
use crate::plant::solid::{Clutter, Solid, Surroundings};

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
            0 => Kind::draw(domain.class(index), rng),
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
        if class == FeatureClass::Slot && !(form.open && rng.random_bool(0.4)) {
            // Mostly both its ends are in view; a groove may run through it.
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

fn askew(rng: &mut ChaCha8Rng) -> UnitQuaternion<f64> {
    UnitQuaternion::from_euler_angles(rng.random_range(-0.04..0.04), rng.random_range(-0.04..0.04), 0.0)
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
