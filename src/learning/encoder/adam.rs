//! Adam with decoupled weight decay (Loshchilov and Hutter 2019) on one flat vector, whose state can
//! be saved.

use crate::perception::kernel::widest;

const BETA: [f32; 2] = [0.9, 0.99];
const EPSILON: f32 = 1e-8;

/// The optimiser.
#[derive(Debug)]
pub(crate) struct Adam {
    /// Steps taken.
    pub(crate) steps: u64,
    decay: f32,
    /// First and second moment of each number.
    pub(crate) moments: [Vec<f32>; 2],
}

impl Adam {
    pub(crate) fn new(decay: f32, len: usize) -> Self {
        Self { steps: 0, decay, moments: [vec![0.0; len], vec![0.0; len]] }
    }

    /// One step along the gradient, which counts for no longer than `clip`; numbers marked in
    /// `decays` shrink besides.
    pub(crate) fn step(&mut self, numbers: &mut [f32], gradient: &[f32], decays: &[bool], rate: f32, clip: f32) {
        self.steps += 1;
        let squares: f64 = gradient.iter().map(|g| f64::from(*g) * f64::from(*g)).sum();
        let shrink = (f64::from(clip) / squares.sqrt().max(1e-12)).min(1.0) as f32;
        let correction = BETA.map(|b| 1.0 - b.powi(self.steps.min(i32::MAX as u64) as i32));
        let [first, second] = &mut self.moments;
        update(numbers, gradient, decays, first, second, rate, 1.0 - rate * self.decay, shrink, correction);
    }

    /// Takes up the state of an earlier run.
    pub(crate) fn restore(&mut self, steps: u64, moments: [Vec<f32>; 2]) {
        (self.steps, self.moments) = (steps, moments);
    }
}

widest! {
    fn update(numbers: &mut [f32], gradient: &[f32], decays: &[bool], first: &mut [f32], second: &mut [f32], rate: f32, decay: f32, shrink: f32, correction: [f32; 2]) {
        let moments = first.iter_mut().zip(second);
        for (((x, g), d), (m, v)) in numbers.iter_mut().zip(gradient).zip(decays).zip(moments) {
            let g = g * shrink;
            *m += (1.0 - BETA[0]) * (g - *m);
            *v += (1.0 - BETA[1]) * (g * g - *v);
            let kept = if *d { *x * decay } else { *x };
            *x = kept - rate * (*m / correction[0]) / ((*v / correction[1]).sqrt() + EPSILON);
        }
    }
}
