//! What was experienced, and what was shown.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use tandem_policy::DOF;

use crate::environment::INPUTS;

/// One step, as a network in training sees it.
#[derive(Clone, Debug, PartialEq)]
pub struct Transition {
    /// Before.
    pub state: [f32; INPUTS],
    /// Shares of the largest increments.
    pub action: [f32; DOF],
    /// Eq. (15), in thousands.
    pub reward: f32,
    /// After.
    pub next: [f32; INPUTS],
    /// The goal was reached: nothing follows, and `reward` is what staying there is worth.
    pub terminal: bool,
}

/// The newest so many transitions.
#[derive(Clone, Debug)]
pub struct Replay {
    kept: Vec<Transition>,
    capacity: usize,
    next: usize,
    /// Those that were there before it grew.
    first: usize,
}

impl Replay {
    /// Room for so many.
    pub fn new(capacity: usize) -> Self {
        Self { kept: Vec::new(), capacity, next: 0, first: 0 }
    }

    /// Keeps one, in place of the oldest where all room is taken; what was there before it grew stays.
    pub fn push(&mut self, transition: Transition) {
        if self.kept.len() < self.capacity {
            self.kept.push(transition);
        } else {
            self.kept[self.next] = transition;
        }
        self.next = if self.next + 1 < self.capacity { self.next + 1 } else { self.first };
    }

    /// How many there are.
    pub fn count(&self) -> usize {
        self.kept.len()
    }

    /// The same with room for so many more.
    #[must_use]
    pub fn grown(mut self, more: usize) -> Self {
        self.next = self.kept.len();
        self.capacity = self.kept.len() + more;
        self.first = self.kept.len();
        self
    }

    /// All of them.
    pub(crate) fn into_kept(self) -> Vec<Transition> {
        self.kept
    }

    /// Where the next one goes.
    pub(crate) fn next(&self) -> usize {
        self.next
    }

    /// All that came after it grew, as plain numbers.
    pub(crate) fn numbers(&self) -> Vec<f32> {
        self.kept[self.first..].iter().flat_map(flat).collect()
    }

    /// What [`Replay::numbers`] has written.
    pub(crate) fn restore(&mut self, numbers: &[f32], next: usize) {
        self.kept.truncate(self.first);
        self.kept.extend(numbers.chunks_exact(TRANSITION).map(unflat));
        self.next = next % self.capacity;
    }

    /// One of those that came after it grew; of all where there are none yet.
    pub fn draw_late(&self, draws: &mut ChaCha8Rng) -> &Transition {
        let first = if self.kept.len() > self.first { self.first } else { 0 };
        &self.kept[draws.random_range(first..self.kept.len())]
    }

    /// One of them, drawn.
    pub fn draw(&self, draws: &mut ChaCha8Rng) -> &Transition {
        &self.kept[draws.random_range(0..self.kept.len())]
    }
}

/// Plain numbers of a step.
const TRANSITION: usize = 2 * INPUTS + DOF + 2;

fn flat(transition: &Transition) -> impl Iterator<Item = f32> + '_ {
    let Transition { state, action, reward, next, terminal } = transition;
    let tail = [*reward, f32::from(u8::from(*terminal))];
    state.iter().chain(action).chain(next).copied().chain(tail)
}

fn unflat(numbers: &[f32]) -> Transition {
    let at = |from: usize, k: usize| numbers[from + k];
    Transition {
        state: std::array::from_fn(|k| at(0, k)),
        action: std::array::from_fn(|k| at(INPUTS, k)),
        next: std::array::from_fn(|k| at(INPUTS + DOF, k)),
        reward: numbers[TRANSITION - 2],
        terminal: numbers[TRANSITION - 1] > 0.5,
    }
}
