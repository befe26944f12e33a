//! Adam with decoupled weight decay (Loshchilov and Hutter 2019), whose state can be saved.

use std::collections::BTreeMap;

use candle_core::backprop::GradStore;
use candle_core::{Device, Result, Tensor, Var};

const BETA: [f32; 2] = [0.9, 0.99];
const EPSILON: f32 = 1e-8;

/// The optimiser.
#[derive(Debug)]
pub(crate) struct Adam {
    /// Steps taken.
    pub(crate) steps: u64,
    decay: f32,
    /// First and second moment by name.
    moments: BTreeMap<String, [Vec<f32>; 2]>,
}

impl Adam {
    pub(crate) fn new(decay: f32) -> Self {
        Self { steps: 0, decay, moments: BTreeMap::new() }
    }

    /// One step along the gradients, none longer than `clip` in all. Matrices decay, gains
    /// and biases do not.
    pub(crate) fn step(
        &mut self,
        variables: &BTreeMap<String, Var>,
        gradients: &GradStore,
        rate: f32,
        clip: f32,
    ) -> Result<()> {
        self.steps += 1;
        let mut flat = Vec::with_capacity(variables.len());
        let mut squares = 0.0_f64;
        for (name, variable) in variables {
            let Some(gradient) = gradients.get(variable) else {
                continue;
            };
            let gradient = gradient.flatten_all()?.to_vec1::<f32>()?;
            squares += gradient.iter().map(|g| f64::from(*g) * f64::from(*g)).sum::<f64>();
            flat.push((name, variable, gradient));
        }
        let shrink = (f64::from(clip) / squares.sqrt().max(1e-12)).min(1.0) as f32;
        let correction = BETA.map(|b| 1.0 - b.powi(self.steps.min(i32::MAX as u64) as i32));
        for (name, variable, gradient) in flat {
            let mut numbers = variable.flatten_all()?.to_vec1::<f32>()?;
            let decay = if variable.rank() == 2 { 1.0 - rate * self.decay } else { 1.0 };
            let [first, second] = self
                .moments
                .entry(name.clone())
                .or_insert_with(|| [vec![0.0; gradient.len()], vec![0.0; gradient.len()]]);
            for (((x, g), m), v) in numbers.iter_mut().zip(&gradient).zip(first).zip(second) {
                let g = g * shrink;
                *m += (1.0 - BETA[0]) * (g - *m);
                *v += (1.0 - BETA[1]) * (g * g - *v);
                *x = *x * decay - rate * (*m / correction[0]) / ((*v / correction[1]).sqrt() + EPSILON);
            }
            variable.set(&Tensor::from_vec(numbers, variable.shape(), &Device::Cpu)?)?;
        }
        Ok(())
    }

    /// The moments as tensors, named after their variable.
    pub(crate) fn state(&self) -> Result<Vec<(String, Tensor)>> {
        let mut out = Vec::with_capacity(2 * self.moments.len());
        for (name, moments) in &self.moments {
            for (order, moment) in moments.iter().enumerate() {
                let tensor = Tensor::from_slice(moment, moment.len(), &Device::Cpu)?;
                out.push((format!("adam.{order}.{name}"), tensor));
            }
        }
        Ok(out)
    }

    /// Takes up the state of an earlier run.
    pub(crate) fn restore(&mut self, steps: u64, tensors: &BTreeMap<String, Tensor>) -> Result<()> {
        self.steps = steps;
        for (name, first) in tensors {
            let Some(variable) = name.strip_prefix("adam.0.") else {
                continue;
            };
            let Some(second) = tensors.get(&format!("adam.1.{variable}")) else {
                continue;
            };
            self.moments.insert(variable.to_owned(), [first.to_vec1()?, second.to_vec1()?]);
        }
        Ok(())
    }
}
