//! Random problems of the kinds that break trajectory generators.

use rand_chacha::{
    ChaCha8Rng,
    rand_core::{Rng as _, SeedableRng as _},
};
use tandem_trajectory::{Limits, State};

/// One joint's problem.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Problem {
    pub(crate) start: State,
    pub(crate) target: State,
    pub(crate) limits: Limits,
}

/// What the numbers of a problem look like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Kind {
    /// The distribution of ruckig's benchmark.
    Benchmark,
    /// The same rounded to so many decimals: ties everywhere.
    Decimals(i32),
    /// Small integers.
    Integers,
    /// Limits of 1, states with so many decimals.
    UnitLimits(i32),
    /// Velocity, acceleration and jerk limits that have nothing to do with each other.
    HighLimits,
    /// All six limits different.
    Asymmetric,
    /// As benchmark, one rounding away from decimals.
    Neighbours,
    /// A start within roundings to 1e-9 of the target.
    Noise,
    /// Limits from 1e-9 to 1e12.
    Scales,
    /// No jerk limit, or no acceleration limit.
    Infinite,
    /// A start outside the limits.
    Outside,
}

pub(crate) const KINDS: [Kind; 16] = [
    Kind::Benchmark,
    Kind::Decimals(1),
    Kind::Decimals(2),
    Kind::Decimals(4),
    Kind::Integers,
    Kind::UnitLimits(1),
    Kind::UnitLimits(2),
    Kind::UnitLimits(4),
    Kind::UnitLimits(9),
    Kind::HighLimits,
    Kind::Asymmetric,
    Kind::Neighbours,
    Kind::Noise,
    Kind::Scales,
    Kind::Infinite,
    Kind::Outside,
];

/// So many, times what the environment asks for: `TANDEM_CAMPAIGN=1000` makes every test of many inputs a
/// thousand times as long.
pub(crate) fn campaign(count: usize) -> usize {
    let factor = std::env::var("TANDEM_CAMPAIGN").ok().and_then(|factor| factor.parse::<usize>().ok());
    count * factor.unwrap_or(1)
}

/// A source of problems; the seed and the kind make it repeatable.
pub(crate) struct Source {
    generator: ChaCha8Rng,
    kind: Kind,
}

impl Source {
    pub(crate) fn new(kind: Kind, seed: u64) -> Self {
        Source { generator: ChaCha8Rng::seed_from_u64(seed), kind }
    }

    pub(crate) fn bits(&mut self) -> u64 {
        self.generator.next_u64()
    }

    /// Uniform in `[low, high)`.
    pub(crate) fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn chance(&mut self, probability: f64) -> bool {
        self.uniform(0.0, 1.0) < probability
    }

    fn normal(&mut self, deviation: f64) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform(0.0, 1.0)).ln()).sqrt();
        deviation * radius * (std::f64::consts::TAU * self.uniform(0.0, 1.0)).cos()
    }

    fn sometimes(&mut self, probability: f64, deviation: f64) -> f64 {
        let value = self.normal(deviation);
        if self.chance(probability) { value } else { 0.0 }
    }

    fn one_of(&mut self, values: &[f64]) -> f64 {
        values[self.bits() as usize % values.len()]
    }

    /// A problem whose target is within its limits.
    pub(crate) fn problem(&mut self) -> Problem {
        loop {
            let problem = self.draw();
            if reachable(&problem) {
                return problem;
            }
        }
    }

    fn draw(&mut self) -> Problem {
        match self.kind {
            Kind::Benchmark => self.benchmark(),
            Kind::Decimals(digits) => {
                let Problem { start, target, limits } = self.benchmark();
                let round = |x: f64| (x * 10_f64.powi(digits)).round() / 10_f64.powi(digits);
                let round_state = |s: State| State {
                    position: round(s.position),
                    velocity: round(s.velocity),
                    acceleration: round(s.acceleration),
                };
                let (v, a, j) = (limits.velocity_max, limits.acceleration_max, limits.jerk_max);
                let up = |x: f64| round(x + 10_f64.powi(-digits));
                Problem {
                    start: round_state(start),
                    target: round_state(target),
                    limits: Limits::symmetric(up(v), up(a), up(j)),
                }
            }
            Kind::Integers => {
                let values = [-1.0, 0.0, 1.0];
                let state = [0; 6].map(|_| self.one_of(&values));
                let limits = [0; 3].map(|_| self.one_of(&[1.0, 2.0]));
                problem(state, limits)
            }
            Kind::UnitLimits(digits) => {
                let round = |x: f64| (x * 10_f64.powi(digits)).round() / 10_f64.powi(digits);
                let state = [4.0, 1.0, 1.0, 4.0, 1.0, 1.0].map(|reach| round(self.uniform(-reach, reach)));
                problem(state, [1.0; 3])
            }
            Kind::HighLimits => {
                let mut problem = self.benchmark();
                let [v, a, j] = [0; 3].map(|_| self.uniform(10.0, 1e6));
                problem.limits = Limits::symmetric(v, a, j);
                problem
            }
            Kind::Asymmetric => {
                let mut problem = self.benchmark();
                let (v, a) = (problem.target.velocity.abs(), problem.target.acceleration.abs());
                problem.limits.velocity_min = -self.uniform(0.08, 16.0) - v;
                problem.limits.acceleration_min = -self.uniform(0.08, 16.0) - a;
                problem.limits.jerk_min = -self.uniform(0.08, 16.0);
                problem
            }
            Kind::Neighbours => {
                self.kind = Kind::Decimals(1);
                let mut problem = self.draw();
                self.kind = Kind::Neighbours;
                for state in [&mut problem.start, &mut problem.target] {
                    for value in [&mut state.position, &mut state.velocity, &mut state.acceleration] {
                        *value = match self.bits() % 3 {
                            0 => value.next_up(),
                            1 => value.next_down(),
                            _ => *value,
                        };
                    }
                }
                problem
            }
            Kind::Noise => {
                let mut problem = self.benchmark();
                if self.chance(0.5) {
                    problem.target = State::at_rest(problem.target.position);
                }
                let mut noise = || {
                    let size = 10_f64.powf(self.uniform(-20.0, -9.0));
                    self.normal(1.0) * size
                };
                problem.start.position = problem.target.position + noise();
                problem.start.velocity = problem.target.velocity + noise();
                problem.start.acceleration = problem.target.acceleration + noise();
                problem
            }
            Kind::Scales => {
                let mut size = |low: f64, high: f64| 10_f64.powf(self.uniform(low, high));
                let [v, a, j] = [size(-9.0, 12.0), size(-9.0, 12.0), size(-9.0, 12.0)];
                let p = size(-9.0, 9.0);
                let [p0, v0, a0, pf, vf, af] = [p, v, a, p, v, a].map(|size| size * self.uniform(-1.0, 1.0));
                let rest = if self.chance(0.5) { 0.0 } else { 1.0 };
                problem([p0, v0 * rest, a0 * rest, pf, vf * rest, af * rest], [v, a, j])
            }
            Kind::Infinite => {
                let mut problem = self.benchmark();
                let all = self.chance(0.3);
                let (v, a) = (problem.limits.velocity_max, problem.limits.acceleration_max);
                let a = if all { f64::INFINITY } else { a };
                let j = if all || self.chance(0.5) { f64::INFINITY } else { problem.limits.jerk_max };
                let a = if j.is_finite() { f64::INFINITY } else { a };
                problem.limits = Limits::symmetric(v, a, j);
                problem
            }
            Kind::Outside => {
                let mut problem = self.benchmark();
                problem.start.velocity *= 8.0;
                problem.start.acceleration *= 8.0;
                problem
            }
        }
    }

    /// Section "Benchmark input" of ruckig's benchmark_target.cpp.
    fn benchmark(&mut self) -> Problem {
        let (vf, af) = (self.sometimes(0.7, 0.8), self.sometimes(0.6, 0.8));
        let state = [self.normal(4.0), self.sometimes(0.9, 0.8), self.sometimes(0.8, 0.8), self.normal(4.0), vf, af];
        let limits = [self.uniform(0.1, 12.0) + vf.abs(), self.uniform(0.1, 12.0) + af.abs(), self.uniform(0.1, 12.0)];
        problem(state, limits)
    }
}

fn problem([p0, v0, a0, pf, vf, af]: [f64; 6], [v, a, j]: [f64; 3]) -> Problem {
    Problem {
        start: State { position: p0, velocity: v0, acceleration: a0 },
        target: State { position: pf, velocity: vf, acceleration: af },
        limits: Limits::symmetric(v, a, j),
    }
}

/// Whether the target lies within the limits, and can be reached and left within them.
fn reachable(problem: &Problem) -> bool {
    let Problem { target: State { velocity: v, acceleration: a, .. }, limits, .. } = *problem;
    let before = if a < 0.0 { v + a * a / (-2.0 * limits.jerk_min) } else { v };
    let after = if a > 0.0 { v - a * a / (2.0 * limits.jerk_max) } else { v };
    let within = |x: f64, low: f64, high: f64| x >= low && x <= high;
    limits.velocity_max > 0.0
        && limits.acceleration_max > 0.0
        && limits.jerk_max > 0.0
        && within(a, limits.acceleration_min, limits.acceleration_max)
        && within(v, limits.velocity_min, limits.velocity_max)
        && within(before, limits.velocity_min, limits.velocity_max)
        && within(after, limits.velocity_min, limits.velocity_max)
}
