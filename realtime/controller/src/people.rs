//! Where people are to the arm, link by link and body part by body part.
//!
//! Each pair of a link and a body part is measured at three places: where the
//! next set-point is, and halfway to and at the end of the way the arm would
//! still make if it were told to stop; and once beyond it if the arm leaves it. What decides is the pair that has least
//! to spare, which need not be the nearest: a forearm at one side that the arm
//! moves to counts before a trunk at the other that it leaves.
//!
//! Between two places that are a travel `l` apart a distance falls at most
//! `d - sqrt(d² - (l/2)²)` below the smaller of both, the case of a point passed by.

use tandem_clearance::{LinksToPeople, Monitor};
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
    /// Measured speed of the body part, whichever way, m/s.
    pub(crate) speed: f64,
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
        speed: 0.0,
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
        if monitor.human_count() == 0 {
            return;
        }
        let Some(table) = monitor.links_to_people(here) else {
            return self.add(Pair { distance: f64::NEG_INFINITY, ..Pair::NONE });
        };
        let mut speeds = [0.0; HUMAN_CAPSULES_MAX];
        for (capsule, speed) in speeds.iter_mut().enumerate().take(monitor.human_count()) {
            *speed = monitor.human_speed(capsule);
        }
        for (row, parts) in table.iter().enumerate() {
            for (capsule, seen) in parts.iter().take(monitor.human_count()).enumerate() {
                let (distance, closing, speed) = (seen.distance, seen.closing, speeds[capsule]);
                let pair = Pair { capsule, link: row + 1, distance, closing, speed, ..Pair::NONE };
                // Written so that what is no number counts.
                if !(seen.distance > horizon) {
                    self.add(pair);
                } else if seen.distance < self.nearest.distance {
                    self.nearest = pair;
                }
            }
        }
        if let Some(ahead) = ahead
            && self.count > 0
        {
            self.look(monitor, chain, ahead);
        }
    }

    /// Measures the pairs found halfway and at the end of the way ahead, and, of those the arm leaves, beyond.
    fn look(&mut self, monitor: &Monitor, chain: &Chain, ahead: &Ahead<'_>) {
        let travel = ahead.rate * ahead.way;
        let table_at =
            |length: f64| monitor.links_to_people(&chain.forward(&ahead.path.at(ahead.from + length).position));
        let [halfway, at_end] = [0.5 * ahead.way, ahead.way].map(table_at);
        let mut onward = None;
        for pair in &mut self.pairs[..self.count.min(PAIRS_MAX)] {
            let there = |table: &Option<LinksToPeople>| {
                let row = pair.link.saturating_sub(1).min(JOINTS_MAX - 1);
                table.as_ref().map_or(f64::NEG_INFINITY, |table| table[row][pair.capsule % HUMAN_CAPSULES_MAX].distance)
            };
            let (here, half, end) = (pair.distance, there(&halfway), there(&at_end));
            if here <= half && half <= end {
                pair.retreat = end - here;
                pair.leaves = end <= there(onward.get_or_insert_with(|| table_at(ahead.onward)));
                continue;
            }
            let low = here.min(half).min(end);
            let chord = 0.25 * travel;
            let dip = if low > chord { low - (low * low - chord * chord).sqrt() } else { chord };
            pair.approach = (here - low + dip).max(0.0).min(travel);
        }
    }
}
