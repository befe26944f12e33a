//! A policy, and one step of it.

#![allow(unsafe_code, reason = "the step compiled for wider vectors is called after the processor was asked")]

use core::fmt;

use crate::dense::{accumulate, rectify};
use crate::tanh::tanh;
use crate::{ADAPTER, COLUMNS_MAX, HIDDEN, INPUTS_MAX, Lateral, Shape, ShapeError};

/// A precomputed policy, read where its numbers lie.
#[derive(Clone, Copy, Debug)]
pub struct Policy<'w> {
    shape: Shape,
    numbers: &'w [f32],
    /// The processor has the wider vectors that [`step_wide`] is compiled for.
    wide: bool,
}

/// The observation holds NaN or infinity, or is not of the policy's size: there is no action.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct NotFinite;

impl fmt::Display for NotFinite {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the observation is not finite or not of the policy's size")
    }
}

impl core::error::Error for NotFinite {}

/// Room for what a step works out. Kept by the caller, who uses it for one policy after another.
#[derive(Clone, Debug)]
pub struct Activations {
    input: [f32; INPUTS_MAX],
    /// Of each column, its two hidden layers.
    hidden: [[[f32; HIDDEN]; COLUMNS_MAX]; 2],
    /// Hidden layers of the earlier columns, times α.
    scaled: [f32; HIDDEN],
    adapter: [f32; ADAPTER],
}

impl Default for Activations {
    fn default() -> Self {
        Self {
            input: [0.0; INPUTS_MAX],
            hidden: [[[0.0; HIDDEN]; COLUMNS_MAX]; 2],
            scaled: [0.0; HIDDEN],
            adapter: [0.0; ADAPTER],
        }
    }
}

impl<'w> Policy<'w> {
    /// The policy of these numbers, which lie as [`Shape`] says.
    ///
    /// # Errors
    /// [`ShapeError`].
    pub fn new(shape: Shape, numbers: &'w [f32]) -> Result<Self, ShapeError> {
        shape.check(numbers)?;
        Ok(Self::checked(shape, numbers))
    }

    /// The policy of numbers that were checked before.
    pub(crate) fn checked(shape: Shape, numbers: &'w [f32]) -> Self {
        #[cfg(target_arch = "x86_64")]
        let wide = std::arch::is_x86_feature_detected!("avx2");
        #[cfg(not(target_arch = "x86_64"))]
        let wide = false;
        Self { shape, numbers, wide }
    }

    /// Its shape.
    #[must_use]
    pub fn shape(&self) -> Shape {
        self.shape
    }

    /// The same policy on vectors of the least width every processor has: the same bits, slower.
    #[must_use]
    pub fn narrow(self) -> Self {
        Self { wide: false, ..self }
    }

    /// Writes the action for an observation: increments of the joints, rad or m, each at most the
    /// policy's step of that joint.
    ///
    /// # Errors
    /// [`NotFinite`]; the action is then all zero.
    ///
    /// # Realtime
    /// Bounded by the shape; no allocation, lock, system call or panic.
    pub fn act(&self, room: &mut Activations, observation: &[f32], action: &mut [f32]) -> Result<(), NotFinite> {
        action.fill(0.0);
        let fits = observation.len() == self.shape.inputs && action.len() == self.shape.outputs;
        if !fits || observation.iter().any(|number| !number.is_finite()) {
            return Err(NotFinite);
        }
        #[cfg(target_arch = "x86_64")]
        if self.wide {
            // SAFETY: `wide` is true only where the processor was found to have AVX2.
            unsafe { step_wide(&self.shape, self.numbers, room, observation, action) };
        } else {
            step(&self.shape, self.numbers, room, observation, action);
        }
        #[cfg(not(target_arch = "x86_64"))]
        step(&self.shape, self.numbers, room, observation, action);
        // Finite weights can still overflow.
        if action.iter().any(|number| !number.is_finite()) {
            action.fill(0.0);
            return Err(NotFinite);
        }
        Ok(())
    }
}

/// [`step`] for processors with AVX2. Not with fused multiplication, which would round otherwise.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn step_wide(shape: &Shape, numbers: &[f32], room: &mut Activations, observation: &[f32], action: &mut [f32]) {
    step(shape, numbers, room, observation, action);
}

/// Takes the numbers of a policy one block after another.
struct Blocks<'w>(&'w [f32]);

impl<'w> Blocks<'w> {
    /// The next `count` numbers; nothing when there are fewer, which [`Shape::check`] rules out.
    #[inline(always)]
    fn take(&mut self, count: usize) -> &'w [f32] {
        let (block, rest) = self.0.split_at_checked(count).unwrap_or((&[], &[]));
        self.0 = rest;
        block
    }
}

#[inline(always)]
fn step(shape: &Shape, numbers: &[f32], room: &mut Activations, observation: &[f32], action: &mut [f32]) {
    let mut blocks = Blocks(numbers);
    let (mean, scale, steps) = (blocks.take(shape.inputs), blocks.take(shape.inputs), blocks.take(shape.outputs));
    let inputs = room.input.iter_mut().zip(observation).zip(mean.iter().zip(scale));
    for ((input, observed), (mean, scale)) in inputs {
        *input = (observed - mean) * scale;
    }
    for column in 0..shape.columns.min(COLUMNS_MAX) {
        let last = column + 1 == shape.columns;
        let x = room.input.get(..shape.inputs).unwrap_or(&[]);

        let mut sums = [0.0; HIDDEN];
        layer(&mut sums, x, &mut blocks);
        rectify(&mut sums);
        room.hidden[0][column] = sums;

        layer(&mut sums, &room.hidden[0][column], &mut blocks);
        lateral(&mut sums, shape, column, 0, &mut blocks, room);
        rectify(&mut sums);
        room.hidden[1][column] = sums;

        if last {
            layer(action, &room.hidden[1][column], &mut blocks);
            lateral(action, shape, column, 1, &mut blocks, room);
        } else {
            // What an earlier column would do by itself is of no use to a later one.
            blocks.take((HIDDEN + 1) * shape.outputs + shape.lateral(column, shape.outputs));
        }
    }
    for (move_by, step) in action.iter_mut().zip(steps) {
        *move_by = step * tanh(*move_by);
    }
}

/// `sums = b + W · x`.
#[inline(always)]
fn layer(sums: &mut [f32], x: &[f32], blocks: &mut Blocks<'_>) {
    let matrix = blocks.take(x.len() * sums.len());
    let bias = blocks.take(sums.len());
    for (sum, bias) in sums.iter_mut().zip(bias) {
        *sum = *bias;
    }
    accumulate(sums, x, matrix);
}

/// Adds what a column sees of hidden layer `layer` of those before it.
#[inline(always)]
fn lateral(
    sums: &mut [f32],
    shape: &Shape,
    earlier: usize,
    layer: usize,
    blocks: &mut Blocks<'_>,
    room: &mut Activations,
) {
    if earlier == 0 {
        return;
    }
    let Activations { hidden, scaled, adapter, .. } = room;
    match shape.lateral {
        // Eq. (16): one matrix from each earlier column.
        Lateral::Linear => {
            for seen in hidden[layer].iter().take(earlier) {
                accumulate(sums, seen, blocks.take(HIDDEN * sums.len()));
            }
        }
        // Eq. (17): M σ(V α h), where V takes all earlier columns together down to one adapter; σ is
        // the rectifier. α is one number for each earlier column.
        Lateral::Adapter => {
            let alpha = blocks.take(earlier);
            adapter.fill(0.0);
            for (seen, alpha) in hidden[layer].iter().zip(alpha) {
                for (scaled, seen) in scaled.iter_mut().zip(seen) {
                    *scaled = alpha * seen;
                }
                accumulate(adapter, scaled, blocks.take(HIDDEN * ADAPTER));
            }
            rectify(adapter);
            accumulate(sums, adapter, blocks.take(ADAPTER * sums.len()));
        }
    }
}
