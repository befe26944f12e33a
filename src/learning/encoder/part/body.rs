//! Bodies with room for a feature.

use nalgebra::{Isometry3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use tandem_config::{Body, FeatureGeometry};
use tandem_msg::FeatureClass;

use super::log_uniform;
use crate::plant::solid::{Form, Section};

/// Half the room the feature needs along x and y, metres.
pub(super) fn room(feature: &FeatureGeometry, form: &Form, size: f64, aligned: bool) -> [f64; 2] {
    let below = if form.section == Section::Plain { 0.0 } else { 0.5 * feature.width };
    let step = 0.5 * (form.counterbore[0] - feature.diameter).max(0.0);
    let edge = 0.05 * size + feature.chamfer + below + step;
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
pub(super) fn any(
    feature: &mut FeatureGeometry,
    size: f64,
    room: [f64; 2],
    rng: &mut ChaCha8Rng,
) -> (Body, f64, [f64; 2]) {
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

/// A bar or a disc with a groove from one end to the other; a bar may be longer than the view.
pub(super) fn grooved(feature: &mut FeatureGeometry, form: &Form, rng: &mut ChaCha8Rng) -> (Body, Isometry3<f64>) {
    let disc = form.section == Section::Plain && rng.random_bool(0.4);
    let height = feature.depth * rng.random_range(1.15..6.0);
    let foot = match form.section {
        Section::Plain => feature.width,
        Section::Tee(_, foot) => feature.width * foot,
        Section::Dovetail(slope) => feature.width + 2.0 * slope * feature.depth,
    };
    let body = if disc {
        Body::Cylinder { radius: 0.5 * feature.length, height }
    } else {
        Body::Box { size: [feature.length, foot * log_uniform([1.2, 6.0], rng), height] }
    };
    let slide = match &body {
        Body::Box { size } => 0.5 * (size[1] - 1.15 * foot).max(0.0) * rng.random_range(-1.0..=1.0),
        _ => 0.0,
    };
    (body, Isometry3::translation(0.0, slide, 0.5 * height))
}

/// A shaft with a keyway along it, or a hole across.
pub(super) fn shaft(feature: &mut FeatureGeometry, rng: &mut ChaCha8Rng) -> (Body, Isometry3<f64>) {
    let (across, run) = match feature.class {
        FeatureClass::Slot => (feature.width, feature.length),
        _ => (feature.diameter, feature.diameter),
    };
    let radius = across * rng.random_range(0.8..3.0);
    feature.depth = feature.depth.min(1.2 * radius);
    feature.chamfer = 0.0;
    // The feature looks along the part's x, its own x runs along the shaft.
    let axes = Rotation3::from_basis_unchecked(&[Vector3::z(), -Vector3::y(), Vector3::x()]);
    let rotation = UnitQuaternion::from_rotation_matrix(&axes);
    let place = Translation3::new(radius, 0.0, 0.0);
    let height = run * rng.random_range(1.15..4.0);
    (Body::Cylinder { radius, height }, Isometry3::from_parts(place, rotation))
}
