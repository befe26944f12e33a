//! What is compared with what: one place for every number the comparison rests on.
//!
//! All methods start from the same source encoder and see the same looks of the same parts: the
//! source's, an unlabelled set of the target's and, where labels are allowed, the same few labelled
//! ones. All may spend the same: a look forward counts one, forward and backward three. Each
//! has been tuned with four trials on the validation split of the target under seed [`TUNING_SEED`],
//! which no reported run uses, the moves of the agents by the random player, from a source encoder that
//! had seen fewer parts than the one that ships; what was found is in [`Settings::of`]. Nothing is
//! chosen by the test split, which is read once a run, at its end.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// Labelled examples a class, where there are any.
pub const LABELS: usize = 10;
/// Unlabelled target examples.
pub const UNLABELLED: usize = 440;
/// Labelled source examples that are at hand.
pub const SOURCE: usize = 800;
/// Target examples that are watched while a method works, and that settings were chosen by.
pub const VALIDATION: usize = 264;
/// Target examples of the test.
pub const TEST: usize = 330;
/// Seeds the comparison is over.
pub const SEEDS: [u64; 5] = [1, 2, 3, 4, 5];
/// Seed of the tuning.
pub const TUNING_SEED: u64 = 100;
/// Seed of the validation and test splits.
pub const DATA_SEED: u64 = 7;
/// Looks a method may spend.
pub const BUDGET: usize = 18_000;
/// What a look costs forward, and forward and backward.
pub const COST: [usize; 2] = [1, 3];
/// Looks of a shard.
pub const SHARD: usize = 16;

/// How an encoder is brought to the target.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// Not at all.
    Source,
    /// Statistics of the normalisations taken from the target (AdaBN, Li et al. 2016).
    Adabn,
    /// Gradient steps on the source and the few labels.
    Finetune,
    /// Domain-adversarial, by gradient reversal (Ganin et al. 2016).
    Dann,
    /// Deep adaptation, by multi-kernel discrepancy of two layers (Long et al. 2015).
    Dan,
    /// The moves of the paper's agent, chosen by a deep Q-network trained beforehand.
    Dqn,
    /// The same moves, chosen at random.
    Random,
    /// The same moves: of several tried ones that which shows most.
    Greedy,
}

impl Method {
    /// All of them.
    pub const ALL: [Self; 8] =
        [Self::Source, Self::Adabn, Self::Finetune, Self::Dann, Self::Dan, Self::Dqn, Self::Random, Self::Greedy];

    /// Name in files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Source => "source",
            Self::Adabn => "adabn",
            Self::Finetune => "finetune",
            Self::Dann => "dann",
            Self::Dan => "dan",
            Self::Dqn => "dqn",
            Self::Random => "random",
            Self::Greedy => "greedy",
        }
    }

    /// Numbers of labels a class the comparison asks it about.
    pub fn labels(self) -> &'static [usize] {
        match self {
            Self::Source | Self::Adabn => &[0],
            Self::Finetune | Self::Random | Self::Greedy => &[LABELS],
            Self::Dann | Self::Dan | Self::Dqn => &[0, LABELS],
        }
    }
}

impl fmt::Display for Method {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Method {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::ALL.into_iter().find(|method| method.name() == text).ok_or_else(|| {
            let names: Vec<&str> = Self::ALL.iter().map(|method| method.name()).collect();
            format!("allowed: {}", names.join(", "))
        })
    }
}

/// What was tuned.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// Learning rate; of the agents the factor on the units of their moves.
    pub rate: f32,
    /// Weight of the loss that brings the domains together.
    pub weight: f32,
    /// Looks it may spend.
    pub looks: usize,
}

impl Settings {
    /// The four settings a method was tried with.
    pub fn grid(method: Method) -> [Self; 4] {
        let of = |rate, weight| Self { rate, weight, looks: BUDGET };
        match method {
            Method::Dqn | Method::Random | Method::Greedy => [0.3, 0.6, 1.0, 2.0].map(|rate| of(rate, 1.0)),
            Method::Dann | Method::Dan => [of(5e-4, 0.3), of(5e-4, 1.0), of(2e-3, 0.3), of(2e-3, 1.0)],
            _ => [5e-4, 1e-3, 2e-3, 4e-3].map(|rate| of(rate, 1.0)),
        }
    }

    /// What a method did best with on validation.
    pub fn of(method: Method) -> Self {
        let (rate, weight) = match method {
            Method::Source | Method::Adabn => (0.0, 0.0),
            Method::Finetune => (2e-3, 1.0),
            Method::Dann => (2e-3, 0.3),
            Method::Dan => (2e-3, 1.0),
            // At school and since.
            Method::Dqn => (1.0, 1.0),
            Method::Random | Method::Greedy => (2.0, 1.0),
        };
        Self { rate, weight, looks: BUDGET }
    }
}
