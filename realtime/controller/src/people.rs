//! Where people are to the arm, link by link and body part by body part.
//!
//! Each pair of a link and a body part is measured at four places: where the
//! next set-point is, and halfway to and at the end of the way the arm would
//! still make if it were told to stop; and once beyond it. What decides is the pair that has least
//! to spare, which need not be the nearest: a forearm at one side that the arm
//! moves to counts before a trunk at the other that it leaves.
//!
//! Between two places that are a travel `l` apart a distance falls at most
//! `d - sqrt(d² - (l/2)²)` below the smaller of both, the case of a point passed by.

use tandem_clearance::Monitor;
use tandem_kinematics::{Chain, LinkPoses};
use tandem_msg::{HUMAN_CAPSULES_MAX, JOINTS_MAX};

use crate::path::Path;

/// Links that move, and body parts.
const PAIRS_MAX: usize = JOINTS_MAX * HUMAN_CAPSULES_MAX;

/// One link and one body part.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pair {
    /// Index of the body part.
    pub(crate) capsule: usize,
    pub(crate) link: usize,
    /// Where the next set-point is, metres.
    pub(crate) distance: f64,
    /// By how much the arm comes nearer on the way it looks ahead, metres; not below 0.
    pub(crate) approach: f64,
    /// By how much it ends farther off, having come no nearer in between, metres; else 0.
    pub(crate) retreat: f64,
    /// Whether it goes on leaving when it does not stop.
    pub(crate) leaves: bool,
    /// Measured speed of the body part towards the link, m/s.
    pub(crate) closing: f64,
}

impl Pair {
    pub(crate) const NONE: Self = Self {
        capsule: 0,
        link: 0,
        distance: f64::INFINITY,
        approach: 0.0,
        retreat: 0.0,
        leaves: false,
        closing: f64::NEG_INFINITY,
    };
}

/// Everybody in view, as seen from one set-point.
#[derive(Clone, Copy, Debug)]
pub(crate) struct People {
    pairs: [Pair; PAIRS_MAX],
    count: usize,
    /// The smallest distance of all, or a bound on it when they are all far.
    pub(crate) nearest: Pair,
    /// Length the arm looks ahead.
    pub(crate) way: f64,
    /// Age of what is known, s.
    pub(crate) age: f64,
    /// Standard deviation of their position, metres.
    pub(crate) sigma: f64,
}

/// A way along a path that begins where the next set-point is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ahead<'a> {
    pub(crate) path: &'a Path,
    pub(crate) from: f64,
    /// Length the arm would still go if it were told to stop.
    pub(crate) way: f64,
    /// A longer look: how it would go on.
    pub(crate) onward: f64,
    /// Bound on the travel of any point of the arm per length.
    pub(crate) rate: f64,
}

/// The smallest distance of each link to each body part.
type Table = [[f64; HUMAN_CAPSULES_MAX]; JOINTS_MAX];
const FAR: Table = [[f64::INFINITY; HUMAN_CAPSULES_MAX]; JOINTS_MAX];

impl People {
    pub(crate) fn nobody() -> Self {
        Self { pairs: [Pair::NONE; PAIRS_MAX], count: 0, nearest: Pair::NONE, way: 0.0, age: 0.0, sigma: 0.0 }
    }

    /// Somebody at a distance, whom the arm neither nears nor leaves.
    #[cfg(test)]
    pub(crate) fn at(distance: f64) -> Self {
        let mut people = Self { age: 0.001, sigma: 0.01, way: 0.1, ..Self::nobody() };
        people.add(Pair { distance, closing: 0.0, ..Pair::NONE });
        people
    }

    #[cfg(test)]
    pub(crate) fn first(&mut self) -> &mut Pair {
        &mut self.pairs[0]
    }

    /// The pairs that are near enough to count.
    pub(crate) fn pairs(&self) -> &[Pair] {
        &self.pairs[..self.count.min(PAIRS_MAX)]
    }

    pub(crate) fn nobody_in_view(&self) -> bool {
        self.count == 0 && self.nearest.distance == f64::INFINITY
    }

    fn add(&mut self, pair: Pair) {
        if let Some(slot) = self.pairs.get_mut(self.count) {
            *slot = pair;
            self.count += 1;
        }
        // Written so that what is no number is nearest.
        if !(pair.distance >= self.nearest.distance) {
            self.nearest = pair;
        }
    }

    /// Measures everybody up to `horizon` metres off, from an arm at `here` with nowhere to go, or along
    /// its way `ahead`. They are known as of `age` s ago, with a deviation of `sigma` m.
    pub(crate) fn measure(
        &mut self,
        monitor: &Monitor,
        chain: &Chain,
        here: &LinkPoses,
        ahead: Option<&Ahead<'_>>,
        horizon: f64,
        (age, sigma): (f64, f64),
    ) {
        (self.count, self.nearest) = (0, Pair::NONE);
        (self.age, self.sigma, self.way) = (age, sigma, ahead.map_or(0.0, |ahead| ahead.way));
        let mut table = FAR;
        let mut points = [[[[0.0; 3]; 2]; HUMAN_CAPSULES_MAX]; JOINTS_MAX];
        let rest = monitor.pairs(here, horizon, |seen| {
            let (row, column) = (seen.link.saturating_sub(1).min(JOINTS_MAX - 1), seen.capsule % HUMAN_CAPSULES_MAX);
            if seen.distance < table[row][column] {
                table[row][column] = seen.distance;
                points[row][column] = seen.points;
            }
        });
        self.nearest.distance = rest;
        if rest == f64::NEG_INFINITY {
            return self.add(Pair { distance: rest, ..Pair::NONE });
        }
        for (row, (distances, points)) in table.iter().zip(&points).enumerate() {
            for (capsule, velocity) in monitor.human_velocities().iter().enumerate() {
                let distance = distances[capsule];
                if distance < f64::INFINITY {
                    let closing = closing(&points[capsule], distance, velocity);
                    self.add(Pair { capsule, link: row + 1, distance, closing, ..Pair::NONE });
                }
            }
        }
        if let Some(ahead) = ahead
            && self.count > 0
        {
            self.look(monitor, chain, ahead, horizon);
        }
    }

    /// Measures the pairs found halfway and at the end of the way ahead.
    fn look(&mut self, monitor: &Monitor, chain: &Chain, ahead: &Ahead<'_>, horizon: f64) {
        let travel = ahead.rate * ahead.way;
        let table_at = |length: f64| {
            let mut table = FAR;
            let poses = chain.forward(&ahead.path.at(ahead.from + length).position);
            // Wide enough to see every pair again that was within the horizon.
            let rest = monitor.pairs(&poses, horizon + ahead.rate * length, |seen| {
                let row = seen.link.saturating_sub(1).min(JOINTS_MAX - 1);
                let slot = &mut table[row][seen.capsule % HUMAN_CAPSULES_MAX];
                *slot = slot.min(seen.distance);
            });
            if rest == f64::NEG_INFINITY { [[rest; HUMAN_CAPSULES_MAX]; JOINTS_MAX] } else { table }
        };
        let [halfway, at_end, onward] = [0.5 * ahead.way, ahead.way, ahead.onward].map(table_at);
        for pair in &mut self.pairs[..self.count.min(PAIRS_MAX)] {
            let row = pair.link.saturating_sub(1).min(JOINTS_MAX - 1);
            let column = pair.capsule % HUMAN_CAPSULES_MAX;
            let (here, half, end) = (pair.distance, halfway[row][column], at_end[row][column]);
            if here <= half && half <= end {
                pair.retreat = end - here;
                pair.leaves = end <= onward[row][column];
                continue;
            }
            let low = here.min(half).min(end);
            let chord = 0.25 * travel;
            let dip = if low > chord { low - (low * low - chord * chord).sqrt() } else { chord };
            pair.approach = (here - low + dip).max(0.0).min(travel);
        }
    }
}

/// Speed of a body part towards the arm, from their nearest points, m/s.
fn closing(points: &[[f64; 3]; 2], distance: f64, velocity: &[f64; 3]) -> f64 {
    let [arm, person] = points;
    let mut sum = 0.0;
    let mut square = 0.0;
    for axis in 0..3 {
        let apart = person[axis] - arm[axis];
        sum += apart * velocity[axis];
        square += apart * apart;
    }
    if square > 1e-18 {
        // Overlapping, the points have changed sides.
        -sum / square.sqrt() * if distance < 0.0 { -1.0 } else { 1.0 }
    } else {
        // No direction: as if straight at it.
        velocity.iter().map(|v| v * v).sum::<f64>().sqrt()
    }
}
