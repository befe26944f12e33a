//! The domain discriminator of DANN: tells the source's features from the target's.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::learning::encoder::adam::Adam;
use crate::learning::encoder::pass::FEATURES;

const HIDDEN: usize = 64;
const RATE: f32 = 1e-3;
const CLIP: f32 = 5.0;

/// 512 – 64 – 1, ReLU between.
#[derive(Debug)]
pub(crate) struct Discriminator {
    /// Matrix 512 × 64, its bias, 64 weights, a bias.
    numbers: Vec<f32>,
    gradient: Vec<f32>,
    decays: Vec<bool>,
    adam: Adam,
}

impl Discriminator {
    pub(crate) fn new(seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let len = FEATURES * HIDDEN + 2 * HIDDEN + 1;
        let mut numbers = vec![0.0; len];
        for (i, v) in numbers.iter_mut().enumerate() {
            let unit: f32 = StandardNormal.sample(&mut rng);
            if i < FEATURES * HIDDEN {
                *v = unit * (2.0 / FEATURES as f32).sqrt();
            } else if (FEATURES * HIDDEN + HIDDEN..len - 1).contains(&i) {
                *v = unit * (1.0 / HIDDEN as f32).sqrt();
            }
        }
        Self { adam: Adam::new(0.0, len), decays: vec![false; len], gradient: vec![0.0; len], numbers }
    }

    /// One step of its own on standardised rows of both domains (`source` first); answers its loss,
    /// cross-entropy, and the gradient of that by the rows: what is learned against it goes the
    /// other way.
    pub(crate) fn learn(&mut self, rows: &[Vec<f32>], source: usize) -> (f32, Vec<Vec<f32>>) {
        let (first, rest) = self.numbers.split_at(FEATURES * HIDDEN);
        let (first_bias, rest) = rest.split_at(HIDDEN);
        let (second, second_bias) = rest.split_at(HIDDEN);
        self.gradient.fill(0.0);
        let (dfirst, drest) = self.gradient.split_at_mut(FEATURES * HIDDEN);
        let (dfirst_bias, drest) = drest.split_at_mut(HIDDEN);
        let (dsecond, dsecond_bias) = drest.split_at_mut(HIDDEN);
        let share = |row: usize| 0.5 / if row < source { source } else { rows.len() - source } as f32;
        let mut loss = 0.0;
        let mut gradients = Vec::with_capacity(rows.len());
        for (i, row) in rows.iter().enumerate() {
            let mut hidden = [0.0_f32; HIDDEN];
            hidden.copy_from_slice(first_bias);
            for (x, weights) in row.iter().zip(first.chunks_exact(HIDDEN)) {
                hidden.iter_mut().zip(weights).for_each(|(h, w)| *h += x * w);
            }
            let raw = second_bias[0] + hidden.iter().zip(second).map(|(h, w)| h.max(0.0) * w).sum::<f32>();
            let mark = f32::from(u8::from(i < source));
            loss += share(i) * (raw.max(0.0) + (-raw.abs()).exp().ln_1p() - raw * mark);
            let d = share(i) * (1.0 / (1.0 + (-raw).exp()) - mark);
            dsecond_bias[0] += d;
            let mut dhidden = [0.0_f32; HIDDEN];
            for (j, h) in hidden.iter().enumerate() {
                if *h > 0.0 {
                    dsecond[j] += d * h;
                    dhidden[j] = d * second[j];
                    dfirst_bias[j] += dhidden[j];
                }
            }
            let mut drow = vec![0.0; FEATURES];
            for (((x, weights), out), dw) in
                row.iter().zip(first.chunks_exact(HIDDEN)).zip(&mut drow).zip(dfirst.chunks_exact_mut(HIDDEN))
            {
                for ((w, d), dw) in weights.iter().zip(&dhidden).zip(dw) {
                    *out += w * d;
                    *dw += x * d;
                }
            }
            gradients.push(drow);
        }
        self.adam.step(&mut self.numbers, &self.gradient, &self.decays, RATE, CLIP);
        (loss, gradients)
    }
}
