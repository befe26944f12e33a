//! What makes every pass over the examples a different one.

use candle_core::{Device, Result, Tensor};
use nalgebra::{Rotation3, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::dataset::Example;

/// Spread of the turn away from the view axis, radians.
const LEAN: f64 = 0.06;
/// Share of the hidden layer dropped.
const DROPOUT: f32 = 0.3;

/// The example turned at will about the view axis, leant a little, scaled and jittered.
pub(crate) fn augmented(example: &Example, rng: &mut ChaCha8Rng) -> Example {
    let mut lean = || {
        let unit: f64 = StandardNormal.sample(rng);
        LEAN * unit
    };
    let lean = Vector3::new(lean(), lean(), 0.0);
    let spin = Rotation3::from_axis_angle(&Vector3::z_axis(), rng.random_range(0.0..std::f64::consts::TAU));
    let turn: nalgebra::Matrix3<f32> = (Rotation3::new(lean) * spin).matrix().cast();
    let scale = rng.random_range(0.9_f32..1.1);
    let jitter = rng.random_range(0.0..0.004_f32);
    let mut out = example.clone();
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
pub(crate) fn dropout_mask(batch: usize, width: usize, rng: &mut ChaCha8Rng) -> Result<Tensor> {
    let keep = 1.0 / (1.0 - DROPOUT);
    let mask: Vec<f32> = (0..batch * width).map(|_| if rng.random::<f32>() < DROPOUT { 0.0 } else { keep }).collect();
    Tensor::from_vec(mask, (batch, width), &Device::Cpu)
}
