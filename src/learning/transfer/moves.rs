//! What the agent may do to the encoder: the action of Eq. (3), as moves worth choosing.

use std::ops::Range;

use crate::learning::encoder::pass::Spans;

/// Weights a move offsets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Group {
    /// W_E: embedding.
    Embedding,
    /// W_A: attention.
    Attention,
    /// W_L: the linear layers behind attention.
    Linear,
    /// All three at once.
    All,
}

/// Where the signs of a move's offsets come from: from the labels there are, and from one thing more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Sign {
    /// Δ_F of the labelled looks.
    Similarity,
    /// Nothing more.
    Labels,
    /// The discrepancy of the looks from the source.
    Discrepancy,
    /// What the frozen decoder is sure of among unlabelled looks.
    Confident,
}

/// One move.
//
// Eq. (3): the triple (a1, a2, a3) is one choice of a group, or of all three, and of what happens to it;
// a choice for each of the three at every step would be a product of them.
// Eq. (4): α, β, γ add or subtract one to each element. Weights here are about a tenth, so a whole one
// destroys the network, and signs drawn at random are all but orthogonal to any useful direction in
// 10⁵ dimensions: one is read as one unit of a step, and the sign of each element as that of a
// gradient, kept with momentum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Move {
    /// Offsets every weight of a group by one unit to either side, [`STEPS`] times.
    Step(Group, Sign, f32),
    /// Takes the statistics of all normalisations anew from the unlabelled looks.
    Refresh,
    /// Goes back to where Δ_F was best.
    Undo,
    /// Goes to the running mean of the weights, where offsets of changing sign have cancelled.
    Average,
}

/// Offsets a move makes, each on other looks.
pub(crate) const STEPS: usize = 8;
pub(crate) const GROUPS: [Group; 4] = [Group::Embedding, Group::Attention, Group::Linear, Group::All];
pub(crate) const SIGNS: [Sign; 4] = [Sign::Similarity, Sign::Labels, Sign::Discrepancy, Sign::Confident];
pub(crate) const UNITS: [f32; 4] = [3e-5, 1e-4, 3e-4, 1e-3];
/// Moves that are not steps.
const OTHERS: usize = 3;
/// Number of moves.
pub(crate) const MOVES: usize = GROUPS.len() * SIGNS.len() * UNITS.len() + OTHERS;
/// Numbers that describe a move to the agent.
pub(crate) const DESCRIPTION: usize = 3 + SIGNS.len() + UNITS.len() + OTHERS;

impl Move {
    /// Move of a number.
    pub(crate) fn of(number: usize) -> Self {
        match number {
            0 => Self::Refresh,
            1 => Self::Undo,
            2 => Self::Average,
            n => {
                let n = n - OTHERS;
                let (group, rest) = (n % GROUPS.len(), n / GROUPS.len());
                Self::Step(GROUPS[group], SIGNS[rest % SIGNS.len()], UNITS[rest / SIGNS.len() % UNITS.len()])
            }
        }
    }

    /// Whether it can be made without labels.
    pub(crate) fn needs_labels(self) -> bool {
        matches!(self, Self::Step(_, Sign::Similarity | Sign::Labels, _))
    }

    /// What the agent knows of it.
    pub(crate) fn description(self) -> [f32; DESCRIPTION] {
        let mut out = [0.0; DESCRIPTION];
        match self {
            Self::Step(group, sign, unit) => {
                let groups = match group {
                    Group::Embedding => [1.0, 0.0, 0.0],
                    Group::Attention => [0.0, 1.0, 0.0],
                    Group::Linear => [0.0, 0.0, 1.0],
                    Group::All => [1.0; 3],
                };
                out[..3].copy_from_slice(&groups);
                for (i, known) in SIGNS.iter().enumerate() {
                    out[3 + i] = f32::from(u8::from(*known == sign));
                }
                for (i, known) in UNITS.iter().enumerate() {
                    out[3 + SIGNS.len() + i] = f32::from(u8::from(*known == unit));
                }
            }
            Self::Refresh => out[DESCRIPTION - 3] = 1.0,
            Self::Undo => out[DESCRIPTION - 2] = 1.0,
            Self::Average => out[DESCRIPTION - 1] = 1.0,
        }
        out
    }
}

/// Where the weights of each group lie.
#[derive(Clone, Debug, Default)]
pub(crate) struct Spread {
    groups: [Vec<Range<usize>>; 3],
}

impl Spread {
    // Eq. (5): W_A is what makes queries, keys and values. Queries and keys share weights in this network;
    // the projection of places, which enters attention only, goes with them.
    pub(crate) fn new(spans: &Spans) -> Self {
        let mut out = Self::default();
        for (name, span) in spans.iter().filter(|(name, _)| name.starts_with("encoder.")) {
            let group = if name.starts_with("encoder.embed") {
                0
            } else if [".key", ".value", ".place"].iter().any(|end| name.ends_with(end)) {
                1
            } else {
                2
            };
            out.groups[group].push(span.clone());
        }
        out
    }

    /// Spans of a group.
    pub(crate) fn of(&self, group: Group) -> impl Iterator<Item = &Range<usize>> {
        let groups = match group {
            Group::Embedding => 0..1,
            Group::Attention => 1..2,
            Group::Linear => 2..3,
            Group::All => 0..3,
        };
        self.groups[groups].iter().flatten()
    }
}
