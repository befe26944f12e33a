//! Operations of the network that candle lacks, or whose gradients it loses.
//!
//! `candle_nn`'s fused softmax and layer normalisation cut the gradient without an
//! error, and its stock forms are several times slower than these. Everything
//! here is `f32`, contiguous, on the CPU, and deterministic.

use std::sync::{Arc, Mutex, PoisonError};

use candle_core::{CpuStorage, CustomOp1, CustomOp3, Layout, Result, Shape, Storage, Tensor, bail};

/// Keeps a channel without variance finite.
const EPSILON: f32 = 1e-5;

/// The values of a contiguous CPU operand.
fn values<'a>(storage: &'a CpuStorage, layout: &Layout) -> Result<&'a [f32]> {
    let Some((start, end)) = layout.contiguous_offsets() else { bail!("operand is not contiguous") };
    Ok(&storage.as_slice::<f32>()?[start..end])
}

/// Calls `f` with the values of a tensor.
fn with_values<T>(tensor: &Tensor, f: impl FnOnce(&[f32]) -> Result<T>) -> Result<T> {
    let tensor = tensor.contiguous()?;
    let (storage, layout) = tensor.storage_and_layout();
    match &*storage {
        Storage::Cpu(cpu) => f(values(cpu, layout)?),
        _ => bail!("operand is not on the CPU"),
    }
}

/// Softmax over the last dimension.
pub(crate) struct Softmax;

impl CustomOp1 for Softmax {
    fn name(&self) -> &'static str {
        "softmax"
    }

    fn cpu_fwd(&self, storage: &CpuStorage, layout: &Layout) -> Result<(CpuStorage, Shape)> {
        let width = *layout.dims().last().unwrap_or(&1);
        let mut out = values(storage, layout)?.to_vec();
        for row in out.chunks_exact_mut(width) {
            let top = row.iter().fold(f32::NEG_INFINITY, |m, v| m.max(*v));
            let mut sum = 0.0;
            for v in row.iter_mut() {
                *v = (*v - top).exp();
                sum += *v;
            }
            let inverse = 1.0 / sum;
            row.iter_mut().for_each(|v| *v *= inverse);
        }
        Ok((CpuStorage::F32(out), layout.shape().clone()))
    }

    fn bwd(&self, _arg: &Tensor, res: &Tensor, grad: &Tensor) -> Result<Option<Tensor>> {
        let width = res.dim(res.rank() - 1)?;
        let out = with_values(res, |y| {
            with_values(grad, |g| {
                let mut out = vec![0.0; y.len()];
                for ((o, y), g) in out.chunks_exact_mut(width).zip(y.chunks_exact(width)).zip(g.chunks_exact(width)) {
                    let along: f32 = y.iter().zip(g).map(|(y, g)| y * g).sum();
                    for ((o, y), g) in o.iter_mut().zip(y).zip(g) {
                        *o = y * (g - along);
                    }
                }
                Ok(out)
            })
        })?;
        Ok(Some(Tensor::from_vec(out, res.shape(), res.device())?))
    }
}

/// Mean and variance of each channel of one batch.
#[derive(Clone, Debug, Default)]
pub(crate) struct BatchStatistics {
    pub(crate) mean: Vec<f32>,
    pub(crate) variance: Vec<f32>,
}

/// Batch normalisation of rows × channels with gain and bias, then ReLU; leaves the batch's
/// statistics in `statistics`.
pub(crate) struct BatchNormRelu {
    pub(crate) statistics: Arc<Mutex<BatchStatistics>>,
}

impl BatchNormRelu {
    fn lock(&self) -> std::sync::MutexGuard<'_, BatchStatistics> {
        self.statistics.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl CustomOp3 for BatchNormRelu {
    fn name(&self) -> &'static str {
        "batch_norm_relu"
    }

    fn cpu_fwd(
        &self,
        s1: &CpuStorage,
        l1: &Layout,
        s2: &CpuStorage,
        l2: &Layout,
        s3: &CpuStorage,
        l3: &Layout,
    ) -> Result<(CpuStorage, Shape)> {
        let (x, gain, bias) = (values(s1, l1)?, values(s2, l2)?, values(s3, l3)?);
        let channels = gain.len();
        let rows = x.len() / channels;
        let mut mean = vec![0.0_f32; channels];
        let mut variance = vec![0.0_f32; channels];
        for row in x.chunks_exact(channels) {
            mean.iter_mut().zip(row).for_each(|(m, v)| *m += v);
        }
        let share = 1.0 / rows as f32;
        mean.iter_mut().for_each(|m| *m *= share);
        for row in x.chunks_exact(channels) {
            for ((s, v), m) in variance.iter_mut().zip(row).zip(&mean) {
                *s += (v - m) * (v - m);
            }
        }
        variance.iter_mut().for_each(|v| *v *= share);
        let scale: Vec<f32> = gain.iter().zip(&variance).map(|(g, v)| g / (v + EPSILON).sqrt()).collect();
        let shift: Vec<f32> = bias.iter().zip(&mean).zip(&scale).map(|((b, m), s)| b - m * s).collect();
        let out = affine_relu(x, &scale, &shift);
        *self.lock() = BatchStatistics { mean, variance };
        Ok((CpuStorage::F32(out), l1.shape().clone()))
    }

    fn bwd(
        &self,
        x: &Tensor,
        gain: &Tensor,
        bias: &Tensor,
        res: &Tensor,
        grad: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>, Option<Tensor>)> {
        let BatchStatistics { mean, variance } = self.lock().clone();
        let channels = mean.len();
        let inverse: Vec<f32> = variance.iter().map(|v| 1.0 / (v + EPSILON).sqrt()).collect();
        let gains = gain.to_vec1::<f32>()?;
        let (dx, dgain, dbias) = with_values(x, |x| {
            with_values(res, |y| {
                with_values(grad, |g| {
                    let rows = x.len() / channels;
                    let (mut dgain, mut dbias) = (vec![0.0_f32; channels], vec![0.0_f32; channels]);
                    let triple =
                        || x.chunks_exact(channels).zip(y.chunks_exact(channels)).zip(g.chunks_exact(channels));
                    for ((x, y), g) in triple() {
                        for c in 0..channels {
                            let live = if y[c] > 0.0 { g[c] } else { 0.0 };
                            dbias[c] += live;
                            dgain[c] += live * (x[c] - mean[c]) * inverse[c];
                        }
                    }
                    let share = 1.0 / rows as f32;
                    let mut dx = vec![0.0_f32; x.len()];
                    for (((x, y), g), d) in triple().zip(dx.chunks_exact_mut(channels)) {
                        for c in 0..channels {
                            let live = if y[c] > 0.0 { g[c] } else { 0.0 };
                            let normal = (x[c] - mean[c]) * inverse[c];
                            d[c] = gains[c] * inverse[c] * (live - share * (dbias[c] + normal * dgain[c]));
                        }
                    }
                    Ok((dx, dgain, dbias))
                })
            })
        })?;
        let device = x.device();
        Ok((
            Some(Tensor::from_vec(dx, x.shape(), device)?),
            Some(Tensor::from_vec(dgain, gain.shape(), device)?),
            Some(Tensor::from_vec(dbias, bias.shape(), device)?),
        ))
    }
}

fn affine_relu(x: &[f32], scale: &[f32], shift: &[f32]) -> Vec<f32> {
    let mut out = vec![0.0; x.len()];
    for (o, x) in out.chunks_exact_mut(scale.len()).zip(x.chunks_exact(scale.len())) {
        for c in 0..scale.len() {
            o[c] = (x[c] * scale[c] + shift[c]).max(0.0);
        }
    }
    out
}

/// Normalisation with fixed statistics, then ReLU: inference only, no gradient.
pub(crate) struct AffineRelu {
    scale: Vec<f32>,
    shift: Vec<f32>,
}

impl AffineRelu {
    pub(crate) fn new(gain: &[f32], bias: &[f32], statistics: &BatchStatistics) -> Self {
        let scale: Vec<f32> = gain.iter().zip(&statistics.variance).map(|(g, v)| g / (v + EPSILON).sqrt()).collect();
        let shift = bias.iter().zip(&statistics.mean).zip(&scale).map(|((b, m), s)| b - m * s).collect();
        Self { scale, shift }
    }
}

impl CustomOp1 for AffineRelu {
    fn name(&self) -> &'static str {
        "affine_relu"
    }

    fn cpu_fwd(&self, storage: &CpuStorage, layout: &Layout) -> Result<(CpuStorage, Shape)> {
        let out = affine_relu(values(storage, layout)?, &self.scale, &self.shift);
        Ok((CpuStorage::F32(out), layout.shape().clone()))
    }
}

/// Largest value over the middle dimension of groups × members × channels.
pub(crate) struct MaxOverMembers;

impl MaxOverMembers {
    /// For each group and channel the first member with the largest value.
    fn winners(x: &[f32], members: usize, channels: usize) -> (Vec<f32>, Vec<u32>) {
        let groups = x.len() / (members * channels);
        let mut top = vec![f32::NEG_INFINITY; groups * channels];
        let mut at = vec![0_u32; groups * channels];
        for (g, group) in x.chunks_exact(members * channels).enumerate() {
            let (top, at) = (&mut top[g * channels..][..channels], &mut at[g * channels..][..channels]);
            for (m, row) in group.chunks_exact(channels).enumerate() {
                for c in 0..channels {
                    if row[c] > top[c] {
                        top[c] = row[c];
                        at[c] = m as u32;
                    }
                }
            }
        }
        (top, at)
    }
}

impl CustomOp1 for MaxOverMembers {
    fn name(&self) -> &'static str {
        "max_over_members"
    }

    fn cpu_fwd(&self, storage: &CpuStorage, layout: &Layout) -> Result<(CpuStorage, Shape)> {
        let (groups, members, channels) = layout.shape().dims3()?;
        let (top, _) = Self::winners(values(storage, layout)?, members, channels);
        Ok((CpuStorage::F32(top), Shape::from((groups, channels))))
    }

    fn bwd(&self, arg: &Tensor, _res: &Tensor, grad: &Tensor) -> Result<Option<Tensor>> {
        let (_, members, channels) = arg.dims3()?;
        let out = with_values(arg, |x| {
            with_values(grad, |g| {
                let (_, at) = Self::winners(x, members, channels);
                let mut out = vec![0.0_f32; x.len()];
                for (i, (m, g)) in at.iter().zip(g).enumerate() {
                    let (group, channel) = (i / channels, i % channels);
                    out[(group * members + *m as usize) * channels + channel] = *g;
                }
                Ok(out)
            })
        })?;
        Ok(Some(Tensor::from_vec(out, arg.shape(), arg.device())?))
    }
}
