//! Whether a path is clear, sample by sample and in between.
//!
//! No point of the arm moves farther than `rate` times the length that is
//! followed, so halfway between two samples with clearances d1 and d2 that are a
//! travel t apart the clearance is at least (d1 + d2 - t)/2. The next sample is
//! placed so that this is the floor, if that sample passes: a path is walked
//! with few samples where there is room and many where there is none.

use tandem_clearance::Monitor;
use tandem_kinematics::Chain;

use crate::path::Path;

/// Samples on a path without any obstacle: also bounds how far one sample can be trusted.
const LENGTH_SHARE_MAX: f64 = 1.0 / 6.0;
/// Smallest travel between two samples, metres. Where the clearance is below it (leaving a
/// contact), the path is sampled this densely and no gap-free claim is made.
const TRAVEL_MIN: f64 = 0.004;

/// How a walk along a path stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Swept {
    /// Clear so far.
    More,
    /// Clear to the end.
    Clear,
    /// Too near at the sample that was taken last.
    Blocked,
}

/// A walk along one path.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Sweep {
    next: f64,
    clear_to: f64,
    rate: f64,
    margin: f64,
    floor: f64,
    blocked: bool,
    /// What blocked it: an object, 0 the arm itself.
    blocked_by: u32,
}

impl Sweep {
    /// A walk from `from` on that asks for `margin` metres at the samples and `floor` in between;
    /// `rate` is [`Path::sweep_rate`].
    pub(crate) fn new(from: f64, rate: f64, margin: f64, floor: f64) -> Self {
        Self { next: from, clear_to: from, rate, margin, floor, blocked: false, blocked_by: 0 }
    }

    /// A walk that has been made already, to the end of a path.
    pub(crate) fn done(length: f64) -> Self {
        Self { next: f64::INFINITY, clear_to: length, ..Self::default() }
    }

    /// The length up to which the path is known to be clear.
    pub(crate) fn clear_to(&self) -> f64 {
        self.clear_to
    }

    pub(crate) fn blocked(&self) -> bool {
        self.blocked
    }

    /// The object that was too near; 0 the arm itself.
    pub(crate) fn blocked_by(&self) -> u32 {
        self.blocked_by
    }

    pub(crate) fn finished(&self, path: &Path) -> bool {
        self.blocked || self.next > path.length()
    }

    /// Takes one sample.
    pub(crate) fn step(&mut self, chain: &Chain, monitor: &Monitor, path: &Path) -> Swept {
        if self.blocked {
            return Swept::Blocked;
        }
        if self.next > path.length() {
            return Swept::Clear;
        }
        let poses = chain.forward(&path.at(self.next).position);
        let found = monitor.clearance(&poses);
        let clearance = found.distance;
        // Written so that a clearance that is no number blocks.
        if !(clearance >= self.margin) {
            (self.blocked, self.blocked_by) = (true, found.object);
            return Swept::Blocked;
        }
        self.clear_to = self.next;
        if self.next >= path.length() {
            self.next = f64::INFINITY;
            return Swept::Clear;
        }
        let travel = (clearance + self.margin - 2.0 * self.floor).max(TRAVEL_MIN);
        let step = (travel / self.rate.max(1e-9)).min(path.length() * LENGTH_SHARE_MAX);
        self.next = (self.next + step).min(path.length());
        Swept::More
    }
}
