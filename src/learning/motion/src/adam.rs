//! Adam (Kingma and Ba, 2015), as Table 3 has it.

/// Moments of one set of numbers.
#[derive(Clone, Debug)]
pub struct Adam {
    first: Vec<f32>,
    second: Vec<f32>,
    steps: i32,
}

const DECAY: [f32; 2] = [0.9, 0.999];
const TINY: f32 = 1e-8;

impl Adam {
    /// Moments of so many numbers, at rest.
    pub fn new(count: usize) -> Self {
        Self { first: vec![0.0; count], second: vec![0.0; count], steps: 0 }
    }

    /// One step down the gradient.
    pub fn step(&mut self, numbers: &mut [f32], gradient: &[f32], rate: f32) {
        self.steps += 1;
        let first_bias = 1.0 - DECAY[0].powi(self.steps);
        let second_bias = 1.0 - DECAY[1].powi(self.steps);
        let rate = rate / first_bias;
        let moments = self.first.iter_mut().zip(&mut self.second);
        for ((number, gradient), (first, second)) in numbers.iter_mut().zip(gradient).zip(moments) {
            *first += (1.0 - DECAY[0]) * (gradient - *first);
            *second += (1.0 - DECAY[1]) * (gradient * gradient - *second);
            *number -= rate * *first / ((*second / second_bias).sqrt() + TINY);
        }
    }

    /// Everything a checkpoint needs.
    pub fn state(&self) -> (&[f32], &[f32], i32) {
        (&self.first, &self.second, self.steps)
    }

    /// Goes on from a checkpoint.
    pub fn restore(&mut self, first: &[f32], second: &[f32], steps: i32) {
        self.first.copy_from_slice(first);
        self.second.copy_from_slice(second);
        self.steps = steps;
    }
}
