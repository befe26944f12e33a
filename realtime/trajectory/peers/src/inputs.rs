//! The random inputs of ruckig's own benchmark (test/benchmark_target.cpp), from another generator.

use rand_chacha::{
    ChaCha8Rng,
    rand_core::{Rng as _, SeedableRng as _},
};
use tandem_trajectory::{Limits, State};

/// One joint's problem.
#[derive(Clone, Copy, Debug)]
pub struct Problem {
    pub start: State,
    pub target: State,
    pub limits: Limits,
}

pub struct Source(ChaCha8Rng);

impl Source {
    pub fn new(seed: u64) -> Self {
        Source(ChaCha8Rng::seed_from_u64(seed))
    }

    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.0.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self, deviation: f64) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform(0.0, 1.0)).ln()).sqrt();
        deviation * radius * (std::f64::consts::TAU * self.uniform(0.0, 1.0)).cos()
    }

    fn sometimes(&mut self, probability: f64) -> f64 {
        let value = self.normal(0.8);
        if self.uniform(0.0, 1.0) < probability { value } else { 0.0 }
    }

    /// A problem whose target can be reached and left within its limits.
    pub fn problem(&mut self) -> Problem {
        loop {
            let start =
                State { position: self.normal(4.0), velocity: self.sometimes(0.9), acceleration: self.sometimes(0.8) };
            let target =
                State { position: self.normal(4.0), velocity: self.sometimes(0.7), acceleration: self.sometimes(0.6) };
            let (v, a) = (target.velocity, target.acceleration);
            let (velocity, acceleration, jerk) =
                (self.uniform(0.1, 12.0) + v.abs(), self.uniform(0.1, 12.0) + a.abs(), self.uniform(0.1, 12.0));
            let reach = a * a / (2.0 * jerk);
            if (a < 0.0 && v + reach > velocity) || (a > 0.0 && v - reach < -velocity) {
                continue;
            }
            return Problem { start, target, limits: Limits::symmetric(velocity, acceleration, jerk) };
        }
    }
}
