//! What a loop does about grid points that pass while it is busy or asleep.
//!
//! ```text
//! grid      1     2     3     4     5     6     7     8
//! skip      ##    ##############    ##    ##    ##    ##   3 and 4 are missed
//! catch up  ##    ##############3#4#5#    ##    ##    ##   3 and 4 are run late, one after another
//! degrade   ##    ##############          ##          ##   missed, then every second point is left out
//! ```
//! Whatever is done, the phase is kept: a cycle stands for a point of the grid.

use tandem_msg::Stamp;

use crate::Grid;

/// The policy of one loop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Overrun {
    /// Points that have passed are missed; the next cycle stands for the next one.
    #[default]
    Skip,
    /// Points that have passed are run one after another, without waiting; for loops that integrate over time.
    CatchUp {
        /// At most so many late cycles in a row; what is left then is missed.
        in_a_row_max: u32,
    },
    /// As `Skip`, and from then on only each second, fourth, … point is run, until the loop keeps its time.
    Degrade {
        /// At least every so many-th point is run; a power of two, others are rounded down.
        divisor_max: u32,
    },
    /// As `Skip`, and the loop is to be left when the bucket is full: a missed point fills it by one, a cycle on
    /// time drains it by one.
    Stop {
        /// What the bucket holds.
        bucket: u32,
    },
}

/// On time for so many cycles, a degraded loop takes on twice the rate.
const RECOVERY: u32 = 1_000;

/// Decides which grid point each cycle stands for.
#[derive(Clone, Debug)]
pub(crate) struct Pacer {
    policy: Overrun,
    grid: Grid,
    /// Late cycles in a row.
    caught_up: u32,
    /// Every so many-th point is run.
    divisor: u32,
    /// Cycles on time in a row.
    on_time: u32,
    bucket: u32,
}

/// A cycle that begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Beginning {
    pub(crate) now: Stamp,
    pub(crate) missed: u64,
    pub(crate) left_out: u64,
    pub(crate) caught_up: bool,
    pub(crate) overloaded: bool,
}

impl Pacer {
    pub(crate) fn new(policy: Overrun, grid: Grid) -> Self {
        Self { policy, grid, caught_up: 0, divisor: 1, on_time: 0, bucket: 0 }
    }

    pub(crate) fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The point to wait for, after the cycle of `last` has finished; one that has passed is to be caught up.
    pub(crate) fn deadline(&self, last: Option<Stamp>, finished: Stamp) -> Stamp {
        let run = self.grid.every(self.divisor);
        let Some(last) = last else { return run.at_or_after(finished) };
        let due = run.at_or_after(self.grid.next(last));
        if due < finished && !self.may_catch_up() { run.at_or_after(finished) } else { due }
    }

    fn may_catch_up(&self) -> bool {
        matches!(self.policy, Overrun::CatchUp { in_a_row_max } if self.caught_up < in_a_row_max)
    }

    /// Begins the cycle that waited for `deadline`, at `woken`; `late` when the deadline had passed before the wait.
    pub(crate) fn begin(&mut self, last: Option<Stamp>, deadline: Stamp, woken: Stamp, late: bool) -> Beginning {
        let now = if self.may_catch_up() { deadline } else { self.grid.every(self.divisor).at_or_before(woken) };
        let passed = last.map_or(self.grid.steps(deadline, now), |last| self.grid.steps(last, now) - 1);
        let left_out = passed.min(u64::from(self.divisor) - 1);
        let missed = passed - left_out;
        self.caught_up = if late { self.caught_up + 1 } else { 0 };
        self.on_time = if missed > 0 { 0 } else { self.on_time + 1 };
        match self.policy {
            Overrun::Skip | Overrun::CatchUp { .. } => {}
            Overrun::Degrade { divisor_max } if missed > 0 && self.divisor <= divisor_max / 2 => self.divisor *= 2,
            Overrun::Degrade { .. } if self.on_time >= RECOVERY && self.divisor > 1 => {
                self.divisor /= 2;
                self.on_time = 0;
            }
            Overrun::Degrade { .. } => {}
            Overrun::Stop { .. } => {
                let missed = u32::try_from(missed).unwrap_or(u32::MAX);
                self.bucket =
                    if missed > 0 { self.bucket.saturating_add(missed) } else { self.bucket.saturating_sub(1) };
            }
        }
        let overloaded = matches!(self.policy, Overrun::Stop { bucket } if self.bucket >= bucket.max(1));
        Beginning { now, missed, left_out, caught_up: late, overloaded }
    }
}
