//! What makes every pass over the examples a different one.

use nalgebra::{Matrix3, Rotation3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::dataset::Look;

/// Spread of the turn away from the view axis, radians.
const LEAN: f64 = 0.06;
/// Share of the hidden layer dropped.
const DROPOUT: f32 = 0.3;

/// The look turned at will about the view axis, leant a little, mirrored or not, scaled and jittered.
pub(crate) fn augmented(look: &Look, rng: &mut ChaCha8Rng) -> Look {
    let mut lean = || {
        let unit: f64 = StandardNormal.sample(rng);
        LEAN * unit
    };
    let lean = Vector3::new(lean(), lean(), 0.0);
    let spin = Rotation3::from_axis_angle(&Vector3::z_axis(), rng.random_range(0.0..std::f64::consts::TAU));
    let mirror = Vector3::new(if rng.random_bool(0.5) { -1.0 } else { 1.0 }, 1.0, 1.0);
    let turn = Rotation3::new(lean) * spin;
    let turn: Matrix3<f32> = (turn.matrix() * Matrix3::from_diagonal(&mirror)).cast();
    let scale = rng.random_range(0.9_f32..1.1);
    let jitter = rng.random_range(0.0..0.004_f32);
    let mut out = look.clone();
    for p in &mut out.sample.points {
        let place = turn * Vector3::new(p[0], p[1], p[2]) * scale;
        let normal = turn * Vector3::new(p[3], p[4], p[5]);
        for k in 0..3 {
            let unit: f32 = StandardNormal.sample(rng);
            p[k] = place[k] + jitter * unit;
            p[3 + k] = normal[k];
        }
    }
    out
}

/// Zero for what is dropped, more than one for what is kept.
pub(crate) fn dropout_mask(len: usize, rng: &mut ChaCha8Rng) -> Vec<f32> {
    let keep = 1.0 / (1.0 - DROPOUT);
    (0..len).map(|_| if rng.random::<f32>() < DROPOUT { 0.0 } else { keep }).collect()
}
