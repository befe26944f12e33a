//! The trainable numbers: named, in sorted order, drawn from an own generator.
//!
//! candle's generator on the CPU cannot be seeded and its variable map has no order of
//! its own; neither is used.

use std::collections::BTreeMap;

use candle_core::{Device, Result, Tensor, Var};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::perception::network::{Kind, Source};

/// Variables of a network in training, sorted by name, and the statistics it starts from.
#[derive(Debug)]
pub(crate) struct Parameters {
    pub(crate) variables: BTreeMap<String, Var>,
    /// Numbers to start from instead of fresh ones.
    start: Option<BTreeMap<String, Tensor>>,
    rng: ChaCha8Rng,
}

impl Parameters {
    /// Fresh numbers from a seed.
    pub(crate) fn fresh(seed: u64) -> Self {
        Self { variables: BTreeMap::new(), start: None, rng: ChaCha8Rng::seed_from_u64(seed) }
    }

    /// Stored numbers.
    pub(crate) fn stored(tensors: BTreeMap<String, Tensor>) -> Self {
        Self { variables: BTreeMap::new(), start: Some(tensors), rng: ChaCha8Rng::seed_from_u64(0) }
    }

    fn tensor(&mut self, name: &str, shape: &[usize], kind: Kind) -> Result<Tensor> {
        if let Some(stored) = self.start.as_ref().and_then(|start| start.get(name)) {
            return stored.reshape(shape);
        }
        let count: usize = shape.iter().product();
        let numbers: Vec<f32> = match kind {
            // Variance 1 / inputs: most layers are normalised anyway, and attention must not
            // start out saturated.
            Kind::Matrix => {
                let spread = (1.0 / shape[0] as f32).sqrt();
                (0..count)
                    .map(|_| {
                        let unit: f32 = StandardNormal.sample(&mut self.rng);
                        spread * unit
                    })
                    .collect()
            }
            Kind::Gain => vec![1.0; count],
            Kind::Bias => vec![0.0; count],
        };
        Tensor::from_vec(numbers, shape, &Device::Cpu)
    }
}

impl Source for Parameters {
    fn weight(&mut self, name: &str, shape: &[usize], kind: Kind) -> Result<Tensor> {
        let variable = Var::from_tensor(&self.tensor(name, shape, kind)?)?;
        let tensor = variable.as_tensor().clone();
        self.variables.insert(name.to_owned(), variable);
        Ok(tensor)
    }

    fn statistics(&mut self, name: &str, width: usize, kind: Kind) -> Result<Vec<f32>> {
        self.tensor(name, &[width], kind)?.to_vec1()
    }
}
