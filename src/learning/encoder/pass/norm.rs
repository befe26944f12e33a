//! Normalisation by the statistics of a shard, with its ReLU, there and back.

use super::{Block, sized};
use crate::perception::engine::EPSILON;
use crate::perception::kernel::widest;

/// Channels a layer may have.
const CHANNELS_MAX: usize = 256;

/// What a block keeps for its backward pass.
#[derive(Debug, Default)]
pub(super) struct Normalised {
    /// Of the linear layer.
    pub(super) raw: Vec<f32>,
    /// After normalisation and ReLU.
    pub(super) out: Vec<f32>,
    mean: Vec<f32>,
    inverse: Vec<f32>,
}

widest! {
    /// Mean and inverse deviation of each channel, and the normalised, rectified rows.
    fn normalise(raw: &[f32], gain: &[f32], bias: &[f32], mean: &mut [f32], variance: &mut [f32], inverse: &mut [f32], out: &mut [f32]) {
        let channels = gain.len();
        let share = channels as f32 / raw.len() as f32;
        mean.fill(0.0);
        variance.fill(0.0);
        for row in raw.chunks_exact(channels) {
            for (m, v) in mean.iter_mut().zip(row) {
                *m += v;
            }
        }
        mean.iter_mut().for_each(|m| *m *= share);
        for row in raw.chunks_exact(channels) {
            for ((s, v), m) in variance.iter_mut().zip(row).zip(&*mean) {
                *s += (v - m) * (v - m);
            }
        }
        let mut scale = [0.0_f32; CHANNELS_MAX];
        let mut shift = [0.0_f32; CHANNELS_MAX];
        let (scale, shift) = (&mut scale[..channels], &mut shift[..channels]);
        for c in 0..channels {
            variance[c] *= share;
            inverse[c] = 1.0 / (variance[c] + EPSILON).sqrt();
            scale[c] = gain[c] * inverse[c];
            shift[c] = bias[c] - mean[c] * scale[c];
        }
        for (out, row) in out.chunks_exact_mut(channels).zip(raw.chunks_exact(channels)) {
            for ((o, x), (a, b)) in out.iter_mut().zip(row).zip(scale.iter().zip(&*shift)) {
                *o = (x * a + b).max(0.0);
            }
        }
    }
}

widest! {
    /// Turns the gradient of a normalised, rectified output into that of its raw input, in
    /// place, and adds those of gain and bias.
    fn denormalise(raw: &[f32], out: &[f32], gain: &[f32], mean: &[f32], inverse: &[f32], d: &mut [f32], dgain: &mut [f32], dbias: &mut [f32]) {
        let channels = gain.len();
        let share = channels as f32 / raw.len() as f32;
        let mut sums = [[0.0_f32; CHANNELS_MAX]; 2];
        let [along, level] = &mut sums;
        let (along, level) = (&mut along[..channels], &mut level[..channels]);
        for ((d, out), raw) in d.chunks_exact_mut(channels).zip(out.chunks_exact(channels)).zip(raw.chunks_exact(channels)) {
            for c in 0..channels {
                let live = if out[c] > 0.0 { d[c] } else { 0.0 };
                d[c] = live;
                level[c] += live;
                along[c] += live * (raw[c] - mean[c]);
            }
        }
        let mut terms = [[0.0_f32; CHANNELS_MAX]; 3];
        let [scale, slope, shift] = &mut terms;
        for c in 0..channels {
            dbias[c] += level[c];
            dgain[c] += along[c] * inverse[c];
            // d = scale·live − slope·(raw − mean) − shift
            scale[c] = gain[c] * inverse[c];
            slope[c] = scale[c] * share * along[c] * inverse[c] * inverse[c];
            shift[c] = scale[c] * share * level[c];
        }
        let (scale, slope, shift) = (&scale[..channels], &slope[..channels], &shift[..channels]);
        for (d, raw) in d.chunks_exact_mut(channels).zip(raw.chunks_exact(channels)) {
            for c in 0..channels {
                d[c] = scale[c] * d[c] - slope[c] * (raw[c] - mean[c]) - shift[c];
            }
        }
    }
}

impl Normalised {
    /// Normalises `raw`; leaves statistics for the running means.
    pub(super) fn forward(&mut self, block: &Block, parameters: &[f32], statistics: &mut [f32]) {
        let channels = block.output;
        let (mean, inverse) = (sized(&mut self.mean, channels), sized(&mut self.inverse, channels));
        let mut variance = [0.0_f32; CHANNELS_MAX];
        let variance = &mut variance[..channels];
        let out = sized(&mut self.out, self.raw.len());
        normalise(
            &self.raw,
            &parameters[block.gain.clone()],
            &parameters[block.bias.clone()],
            mean,
            variance,
            inverse,
            out,
        );
        statistics[block.mean.clone()].copy_from_slice(mean);
        statistics[block.variance.clone()].copy_from_slice(variance);
    }

    /// Gradient of the output to gradient of `raw`, in place.
    pub(super) fn backward(&self, block: &Block, parameters: &[f32], gradient: &mut [f32], d: &mut [f32]) {
        let mut sums = [[0.0_f32; CHANNELS_MAX]; 2];
        let [dgain, dbias] = &mut sums;
        let (dgain, dbias) = (&mut dgain[..block.output], &mut dbias[..block.output]);
        let gain = &parameters[block.gain.clone()];
        denormalise(&self.raw, &self.out, gain, &self.mean, &self.inverse, d, dgain, dbias);
        gradient[block.gain.clone()].iter_mut().zip(dgain).for_each(|(g, d)| *g += *d);
        gradient[block.bias.clone()].iter_mut().zip(dbias).for_each(|(g, d)| *g += *d);
    }
}
