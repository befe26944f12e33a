//! The loop itself.

use core::borrow::Borrow;

use tandem_msg::Stamp;

use crate::{Clock, Grid, Record, SharedRecord};

/// One wake-up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tick {
    /// The grid point this cycle stands for: the "now" of the role.
    pub now: Stamp,
    /// When the loop really woke; not before `now`, and less than a period after it.
    pub woken: Stamp,
    /// Grid points that have passed without a cycle since the previous one.
    pub missed: u64,
}

/// Waits for the points of a grid, by absolute deadlines, so that the phase is kept for ever.
///
/// What happens on an overrun: grid points that pass while a cycle runs, or while
/// the loop oversleeps, are skipped and counted. A cycle always stands for the
/// last point that has passed, never for one long ago, and two cycles never run
/// back to back to catch up.
///
/// ```text
/// grid      |     |     |     |     |     |
/// cycles    ##    ##########        ##    ##
///                       missed ^ 1
/// ```
pub struct FixedRate<C, R = SharedRecord> {
    clock: C,
    grid: Grid,
    /// The point of the last cycle; none before the first.
    last: Option<Stamp>,
    woken: Stamp,
    /// Lateness and busy time are recorded from here on.
    record: R,
}

impl<C: Clock> FixedRate<C> {
    /// A loop that has not run yet. Its first cycle stands for the next grid point.
    pub fn new(grid: Grid, clock: C) -> Self {
        Self::recording_in(SharedRecord::default(), grid, clock)
    }
}

impl<C: Clock, R: Borrow<SharedRecord>> FixedRate<C, R> {
    /// The same, with its record where others can read it.
    pub fn recording_in(record: R, grid: Grid, clock: C) -> Self {
        Self { clock, grid, last: None, woken: Stamp(0), record }
    }

    /// Ends the cycle in progress, if any, and waits for the next grid point.
    ///
    /// # Realtime
    /// One system call; allocates nothing.
    pub fn wait(&mut self) -> Tick {
        let finished = self.clock.now();
        let deadline = match self.last {
            None => self.grid.at_or_after(finished),
            Some(last) => {
                self.end_cycle(last, finished);
                self.grid.at_or_after(finished).max(self.grid.next(last))
            }
        };
        self.clock.wait_until(deadline);
        // A clock that wakes early by a tick of its resolution must not run a cycle for the point before.
        let woken = self.clock.now().max(deadline);
        let now = self.grid.at_or_before(woken);
        let missed = self.last.map_or(self.grid.steps(deadline, now), |last| self.grid.steps(last, now) - 1);
        self.begin_cycle(now, woken, woken.0 - deadline.0, missed);
        Tick { now, woken, missed }
    }

    fn end_cycle(&mut self, last: Stamp, finished: Stamp) {
        let busy = finished.0.saturating_sub(self.woken.0);
        self.record.borrow().cycle_ended(busy, finished > self.grid.next(last));
    }

    fn begin_cycle(&mut self, now: Stamp, woken: Stamp, lateness: u64, missed: u64) {
        self.last = Some(now);
        self.woken = woken;
        self.record.borrow().cycle_began(lateness, missed);
    }

    /// What the loop found out about itself so far: a copy, not for a cycle.
    pub fn record(&self) -> Record {
        let mut copy = Record::default();
        self.record.borrow().copy_to(&mut copy);
        copy
    }

    /// Where it records.
    pub fn recorder(&self) -> &R {
        &self.record
    }

    /// The grid it runs on.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }
}

#[cfg(test)]
#[allow(clippy::disallowed_types, clippy::disallowed_macros)] // Reason: the tests script whole runs.
mod tests {
    use super::*;
    use core::time::Duration;
    use proptest::prelude::*;

    /// A clock that oversleeps as scripted.
    struct Scripted {
        now: u64,
        late: Vec<u64>,
    }

    impl Clock for &mut Scripted {
        fn now(&mut self) -> Stamp {
            Stamp(self.now)
        }
        fn wait_until(&mut self, deadline: Stamp) {
            self.now = self.now.max(deadline.0) + self.late.pop().unwrap_or(0);
        }
    }

    const PERIOD: u64 = 1_000_000;
    const PHASE: u64 = 200_000;

    fn grid() -> Grid {
        Grid::new(Duration::from_nanos(PERIOD), Duration::from_nanos(PHASE)).expect("in range")
    }

    /// Runs one cycle after another, each `(oversleeps, works)` ns; returns the ticks and the record.
    fn run(start: u64, script: &[(u64, u64)]) -> (Vec<Tick>, Record) {
        let mut clock = Scripted { now: start, late: script.iter().rev().map(|step| step.0).collect() };
        let mut rate = FixedRate::new(grid(), &mut clock);
        let mut ticks = Vec::new();
        for &(_, busy) in script {
            ticks.push(rate.wait());
            rate.clock.now += busy;
        }
        (ticks, rate.record())
    }

    /// A cycle that takes 2.5 periods costs exactly two grid points, and the phase stays.
    #[test]
    fn a_stall_of_two_and_a_half_periods_misses_two() {
        let (ticks, record) = run(0, &[(0, 100), (0, 5 * PERIOD / 2), (0, 100)]);
        let points: Vec<u64> = ticks.iter().map(|tick| tick.now.0).collect();
        assert_eq!(points, [PHASE, PHASE + PERIOD, PHASE + 4 * PERIOD]);
        assert_eq!((record.missed, record.overruns, record.cycles), (2, 1, 3));
        assert_eq!(ticks[2].missed, 2);
    }

    /// Oversleeping by 2.5 periods also misses two: the cycle stands for the last point that has passed.
    #[test]
    fn oversleeping_by_two_and_a_half_periods_misses_two() {
        let (ticks, record) = run(0, &[(0, 100), (5 * PERIOD / 2, 100), (0, 100)]);
        let points: Vec<u64> = ticks.iter().map(|tick| tick.now.0).collect();
        assert_eq!(points, [PHASE, PHASE + 3 * PERIOD, PHASE + 4 * PERIOD]);
        assert_eq!((record.missed, record.lateness.max_ns()), (2, 5 * PERIOD / 2));
    }

    /// A cycle that ends exactly at the next grid point has missed nothing.
    #[test]
    fn a_cycle_that_just_fits_is_no_overrun() {
        let (_, record) = run(0, &[(0, PERIOD), (0, PERIOD), (0, 0)]);
        assert_eq!((record.missed, record.overruns), (0, 0));
    }

    proptest! {
        /// Whatever the loop sleeps and works: each cycle stands for a grid point of its own, later than the one before
        /// and at most a period ago; and cycles and missed points together are exactly the points that have passed.
        #[test]
        fn every_grid_point_is_run_once_or_counted_missed(
            start in 0u64..10_000_000_000,
            script in prop::collection::vec((0u64..4 * PERIOD, 0u64..4 * PERIOD), 1..200),
        ) {
            let (ticks, record) = run(start, &script);
            let first = grid().at_or_after(Stamp(start));
            let last = ticks[ticks.len() - 1].now;
            for pair in ticks.windows(2) {
                prop_assert!(pair[1].now > pair[0].now);
                prop_assert_eq!(grid().steps(pair[0].now, pair[1].now), pair[1].missed + 1);
            }
            for tick in &ticks {
                prop_assert_eq!(tick.now.0 % PERIOD, PHASE);
                prop_assert!(tick.now <= tick.woken && tick.woken.0 - tick.now.0 < PERIOD);
            }
            prop_assert_eq!(record.cycles + record.missed, grid().steps(first, last) + 1);
            prop_assert_eq!(record.missed, ticks.iter().map(|tick| tick.missed).sum::<u64>());
            prop_assert_eq!(record.cycles, script.len() as u64);
        }
    }

    /// On the real clock: no cycle before its grid point, and the counts add up.
    #[test]
    fn the_monotonic_clock_keeps_the_grid() {
        let mut rate = FixedRate::new(grid(), crate::Monotonic);
        let ticks: Vec<Tick> = (0..50).map(|_| rate.wait()).collect();
        for tick in &ticks {
            assert_eq!(tick.now.0 % PERIOD, PHASE);
            assert!(tick.now <= tick.woken);
        }
        let steps = grid().steps(ticks[0].now, ticks[49].now);
        assert_eq!(rate.record().cycles + rate.record().missed, steps + 1 + ticks[0].missed);
    }
}
