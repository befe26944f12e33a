//! Shortening: straight motions between two places on a path replace what lies between.

#![allow(clippy::disallowed_types, reason = "allocated when it is made, never after")]

use tandem_kinematics::JOINTS_MAX;

use crate::Joints;
use crate::draws::Draws;

/// Positions a path has room for.
pub(crate) const PATH_MAX: usize = 1_024;
/// Shortcuts tried between places anywhere on the path.
const TRIES_MAX: u32 = 100;
/// So many tries in a row that gain nothing end it.
const FRUITLESS_MAX: u32 = 16;

/// A path of straight motions.
#[derive(Clone, Debug)]
pub(crate) struct Polyline {
    positions: Box<[Joints]>,
    count: usize,
}

/// A straight motion that would replace a piece of the path.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shortcut {
    /// From where to where.
    pub(crate) ends: [Joints; 2],
    /// Positions that stay before it.
    head: usize,
    /// First of the positions that stay after it.
    tail: usize,
    /// Whether its ends are new positions, or those that stay.
    new_ends: bool,
}

/// How far the shortening has come.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Pass {
    /// From a position straight to a later one, the farthest first.
    Skip { from: usize, to: usize },
    /// Between places that are drawn.
    Draw { tries: u32, fruitless: u32 },
    /// Once more from position to position.
    Last { from: usize, to: usize },
    /// Over.
    Done,
}

impl Polyline {
    #[allow(clippy::disallowed_macros, reason = "made before the first cycle")]
    pub(crate) fn new() -> Self {
        Self { positions: vec![[0.0; JOINTS_MAX]; PATH_MAX].into_boxed_slice(), count: 0 }
    }

    pub(crate) fn clear(&mut self) {
        self.count = 0;
    }

    /// False when there is no room.
    pub(crate) fn push(&mut self, position: &Joints) -> bool {
        if self.count >= self.positions.len() {
            return false;
        }
        self.positions[self.count] = *position;
        self.count += 1;
        true
    }

    pub(crate) fn reverse(&mut self, from: usize) {
        self.positions[from.min(self.count)..self.count].reverse();
    }

    pub(crate) fn positions(&self) -> &[Joints] {
        &self.positions[..self.count]
    }

    /// The first pass over a path just found.
    pub(crate) fn first_pass(&self) -> Pass {
        Pass::Skip { from: 0, to: self.count.saturating_sub(1) }
    }

    /// The next shortcut to be tried, or `None` when this pass has ended and another begins.
    pub(crate) fn propose(&self, pass: &mut Pass, draws: &mut Draws, weights: &Joints) -> Option<Shortcut> {
        match *pass {
            Pass::Skip { from, to } | Pass::Last { from, to } => {
                if to > from + 1 {
                    let ends = [self.positions[from], self.positions[to]];
                    return Some(Shortcut { ends, head: from + 1, tail: to, new_ends: false });
                }
                let end = self.count.saturating_sub(1);
                let next = from + 1;
                *pass = match *pass {
                    Pass::Skip { .. } if next + 1 < end => Pass::Skip { from: next, to: end },
                    Pass::Skip { .. } => Pass::Draw { tries: 0, fruitless: 0 },
                    _ if next + 1 < end => Pass::Last { from: next, to: end },
                    _ => Pass::Done,
                };
                None
            }
            Pass::Draw { tries, fruitless } => {
                if self.count < 3 || tries >= TRIES_MAX || fruitless >= FRUITLESS_MAX {
                    *pass = Pass::Last { from: 0, to: self.count.saturating_sub(1) };
                    return None;
                }
                let length = self.length(weights);
                let (a, b) = (draws.share() * length, draws.share() * length);
                let [(first, from), (last, to)] = [a.min(b), a.max(b)].map(|length| self.place(length, weights));
                if first == last {
                    *pass = Pass::Draw { tries: tries + 1, fruitless };
                    return None;
                }
                Some(Shortcut { ends: [from, to], head: first + 1, tail: last + 1, new_ends: true })
            }
            Pass::Done => None,
        }
    }

    /// Takes the answer to a shortcut that was proposed.
    pub(crate) fn settle(&mut self, pass: &mut Pass, shortcut: &Shortcut, clear: bool) {
        let gain = clear && self.replace(shortcut);
        *pass = match *pass {
            // What lies between is gone: the end of the shortcut is the next position now.
            Pass::Skip { from, .. } if gain => Pass::Skip { from, to: from + 1 },
            Pass::Skip { from, to } => Pass::Skip { from, to: to - 1 },
            Pass::Draw { tries, .. } if gain => Pass::Draw { tries: tries + 1, fruitless: 0 },
            Pass::Draw { tries, fruitless } => Pass::Draw { tries: tries + 1, fruitless: fruitless + 1 },
            Pass::Last { from, .. } if gain => Pass::Last { from, to: from + 1 },
            Pass::Last { from, to } => Pass::Last { from, to: to - 1 },
            Pass::Done => Pass::Done,
        };
    }

    /// Puts a shortcut in; false when there is no room for it.
    fn replace(&mut self, shortcut: &Shortcut) -> bool {
        let Shortcut { ends, head, tail, new_ends } = *shortcut;
        let tail_at = if new_ends { head + ends.len() } else { head };
        let count = tail_at + self.count - tail;
        if count > self.positions.len() {
            return false;
        }
        self.positions.copy_within(tail..self.count, tail_at);
        if new_ends {
            self.positions[head..tail_at].copy_from_slice(&ends);
        }
        self.count = count;
        true
    }

    fn length(&self, weights: &Joints) -> f64 {
        self.positions().windows(2).map(|pair| apart(&pair[0], &pair[1], weights)).sum()
    }

    /// The place at a length from the beginning, and the index of the position before it.
    fn place(&self, length: f64, weights: &Joints) -> (usize, Joints) {
        let mut left = length;
        let last = self.count - 1;
        for (after, pair) in self.positions().windows(2).enumerate() {
            let step = apart(&pair[0], &pair[1], weights);
            if left <= step || after + 1 == last {
                let share = if step > 0.0 { (left / step).min(1.0) } else { 0.0 };
                return (after, core::array::from_fn(|k| pair[0][k] + share * (pair[1][k] - pair[0][k])));
            }
            left -= step;
        }
        (0, self.positions[0])
    }
}

/// Euclidean distance of weighted positions.
pub(crate) fn apart(a: &Joints, b: &Joints, weights: &Joints) -> f64 {
    let squares = a.iter().zip(b).zip(weights).map(|((a, b), weight)| (weight * (a - b)) * (weight * (a - b)));
    squares.sum::<f64>().sqrt()
}
