//! The loop itself.

use core::borrow::Borrow;
use core::time::Duration;

use tandem_msg::Stamp;

use crate::overrun::Pacer;
use crate::{Clock, Grid, Overrun, Record, SharedRecord};

/// Wake-ups whose lateness is measured before the spin tail is set.
const CALIBRATION: u64 = 500;
/// Share of the wake-ups a tail is to be long enough for: more than the 99 of 100 that a loop is usually judged by.
const COVERED: f64 = 0.995;
/// Share of the period a spin tail may take at most: a loop that spins at FIFO for most of its time is throttled.
const TAIL_SHARE: u32 = 4;

/// One wake-up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tick {
    /// The grid point this cycle stands for: the "now" of the role.
    pub now: Stamp,
    /// When the loop really woke; not before `now`, and less than a period after it unless it is catching up.
    pub woken: Stamp,
    /// Grid points that have passed without a cycle since the previous one, and were not left out on purpose.
    pub missed: u64,
    /// The policy says that the loop is to be left: [`Overrun::Stop`].
    pub overloaded: bool,
}

/// How a loop keeps its time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Pace {
    /// What is done about points that have passed.
    pub overrun: Overrun,
    /// Longest time spent spinning before each point, instead of sleeping; zero: the loop sleeps to the end. How much
    /// of it is used is measured over the first wake-ups; never more than a quarter of the period.
    pub spin_max: Duration,
}

/// Waits for the points of a grid, by absolute deadlines, so that the phase is kept for ever.
///
/// What happens on an overrun is [`Overrun`]'s to say; by default points that pass
/// while a cycle runs, or while the loop oversleeps, are skipped and counted.
///
/// The kernel wakes a loop some microseconds late. With a *spin tail* the loop
/// sleeps until a little before its point and spins the rest: it starts with the
/// longest tail allowed, measures how late the kernel is, and from then on spins
/// only as long as 199 of 200 wake-ups need.
pub struct FixedRate<C, R = SharedRecord> {
    clock: C,
    pacer: Pacer,
    tail_max: Duration,
    tail: Duration,
    /// The point of the last cycle; none before the first.
    last: Option<Stamp>,
    woken: Stamp,
    /// Lateness and busy time are recorded from here on.
    record: R,
}

impl<C: Clock> FixedRate<C> {
    /// A loop that has not run yet. Its first cycle stands for the next grid point.
    pub fn new(grid: Grid, clock: C) -> Self {
        Self::recording_in(SharedRecord::default(), grid, clock, Pace::default())
    }
}

impl<C: Clock, R: Borrow<SharedRecord>> FixedRate<C, R> {
    /// The same, with its record where others can read it, and a pace of its own.
    pub fn recording_in(record: R, grid: Grid, clock: C, pace: Pace) -> Self {
        let tail = pace.spin_max.min(grid.period() / TAIL_SHARE);
        record.borrow().spins(tail);
        let pacer = Pacer::new(pace.overrun, grid);
        Self { clock, pacer, tail_max: tail, tail, last: None, woken: Stamp(0), record }
    }

    /// Ends the cycle in progress, if any, and waits for the next grid point.
    ///
    /// # Realtime
    /// One system call, none when a point is caught up; allocates nothing.
    pub fn wait(&mut self) -> Tick {
        let finished = self.clock.now();
        if let Some(last) = self.last {
            let busy = finished.0.saturating_sub(self.woken.0);
            self.record.borrow().cycle_ended(busy, finished > self.grid().next(last));
        }
        let deadline = self.pacer.deadline(self.last, finished);
        let late = deadline < finished;
        // A clock that wakes early by a tick of its resolution must not run a cycle for the point before.
        let woken = if late { finished } else { self.sleep_until(deadline).max(deadline) };
        let begun = self.pacer.begin(self.last, deadline, woken, late);
        self.last = Some(begun.now);
        self.woken = woken;
        self.record.borrow().cycle_began(woken.0 - deadline.0, &begun);
        Tick { now: begun.now, woken, missed: begun.missed, overloaded: begun.overloaded }
    }

    /// Sleeps, and spins the tail; answers when it is.
    fn sleep_until(&mut self, deadline: Stamp) -> Stamp {
        if self.tail_max.is_zero() {
            self.clock.wait_until(deadline);
            return self.clock.now();
        }
        let early = Stamp(deadline.0.saturating_sub(self.tail.as_nanos() as u64));
        self.clock.wait_until(early);
        let woken = self.clock.now();
        let wakeups = &self.record.borrow().wakeup;
        wakeups.record(woken.0.saturating_sub(early.0));
        if self.record.borrow().cycles() + 1 == CALIBRATION {
            self.tail = self.tail_for(wakeups.quantile_ns(COVERED));
            self.record.borrow().spins(self.tail);
        }
        self.clock.spin_until(deadline)
    }

    /// What is measured and an eighth, within what is allowed.
    fn tail_for(&self, lateness_ns: u64) -> Duration {
        Duration::from_nanos(lateness_ns + lateness_ns / 8).min(self.tail_max)
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
        self.pacer.grid()
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
        fn spin_until(&mut self, deadline: Stamp) -> Stamp {
            self.now = self.now.max(deadline.0);
            Stamp(self.now)
        }
    }

    const PERIOD: u64 = 1_000_000;
    const PHASE: u64 = 200_000;

    fn grid() -> Grid {
        Grid::new(Duration::from_nanos(PERIOD), Duration::from_nanos(PHASE)).expect("in range")
    }

    /// Runs one cycle after another, each `(oversleeps, works)` ns; returns the ticks and the record.
    fn run_at(pace: Pace, start: u64, script: &[(u64, u64)]) -> (Vec<Tick>, Record) {
        let mut clock = Scripted { now: start, late: script.iter().rev().map(|step| step.0).collect() };
        let mut rate = FixedRate::recording_in(SharedRecord::default(), grid(), &mut clock, pace);
        let mut ticks = Vec::new();
        for &(_, busy) in script {
            ticks.push(rate.wait());
            rate.clock.now += busy;
        }
        (ticks, rate.record())
    }

    fn run(start: u64, script: &[(u64, u64)]) -> (Vec<Tick>, Record) {
        run_at(Pace::default(), start, script)
    }

    fn points(ticks: &[Tick]) -> Vec<u64> {
        ticks.iter().map(|tick| (tick.now.0 - PHASE) / PERIOD).collect()
    }

    const STALL: u64 = 5 * PERIOD / 2;

    /// A stall of 2.5 periods under each policy: which points are run, and every counter.
    #[test]
    fn a_stall_costs_what_the_policy_says() {
        let script = [(0, 100), (0, STALL), (0, 100), (0, 100), (0, 100), (0, 100)];
        let counts = |r: &Record| (r.cycles, r.missed, r.overruns, r.caught_up, r.left_out, r.stops);
        let under = |overrun| {
            let (ticks, record) = run_at(Pace { overrun, ..Pace::default() }, 0, &script);
            assert!(ticks.iter().all(|tick| tick.now.0 % PERIOD == PHASE && tick.now <= tick.woken), "{ticks:?}");
            (points(&ticks), counts(&record), ticks.iter().any(|tick| tick.overloaded))
        };
        assert_eq!(under(Overrun::Skip), (vec![0, 1, 4, 5, 6, 7], (6, 2, 1, 0, 0, 0), false));
        assert_eq!(under(Overrun::CatchUp { in_a_row_max: 8 }), (vec![0, 1, 2, 3, 4, 5], (6, 0, 2, 2, 0, 0), false));
        assert_eq!(
            under(Overrun::CatchUp { in_a_row_max: 1 }),
            (vec![0, 1, 2, 4, 5, 6], (6, 1, 2, 1, 0, 0), false),
            "one is caught up, which ends late in its turn; the other is missed"
        );
        assert_eq!(under(Overrun::Degrade { divisor_max: 4 }), (vec![0, 1, 4, 6, 8, 10], (6, 2, 1, 0, 3, 0), false));
        assert_eq!(under(Overrun::Stop { bucket: 2 }), (vec![0, 1, 4, 5, 6, 7], (6, 2, 1, 0, 0, 1), true));
        assert_eq!(under(Overrun::Stop { bucket: 3 }), (vec![0, 1, 4, 5, 6, 7], (6, 2, 1, 0, 0, 0), false));
    }

    /// The same while asleep: a stall that catching up makes good.
    #[test]
    fn oversleeping_is_caught_up_too() {
        let pace = Pace { overrun: Overrun::CatchUp { in_a_row_max: 8 }, ..Pace::default() };
        let (ticks, record) = run_at(pace, 0, &[(0, 100), (STALL, 100), (0, 100), (0, 100), (0, 100)]);
        assert_eq!((points(&ticks), record.caught_up, record.missed), (vec![0, 1, 2, 3, 4], 2, 0));
        assert_eq!(record.lateness.max_ns(), STALL);
    }

    /// A bucket leaks: as many cycles on time as were missed, and it is as if nothing had happened.
    #[test]
    fn a_bucket_that_has_drained_takes_another_stall() {
        let pace = Pace { overrun: Overrun::Stop { bucket: 4 }, ..Pace::default() };
        let stalls = |on_time: usize| {
            let mut script = vec![(0, 100), (0, 3 * PERIOD + 100), (0, 100)];
            script.extend(vec![(0, 100); on_time]);
            script.extend([(0, 3 * PERIOD + 100), (0, 100)]);
            run_at(pace, 0, &script).1.stops
        };
        assert_eq!((stalls(0), stalls(1), stalls(2), stalls(10)), (1, 1, 0, 0));
    }

    /// A degraded loop takes on its rate again once it keeps its time, step by step, and never leaves the grid.
    #[test]
    fn a_degraded_loop_recovers() {
        let mut script = vec![(0, STALL), (0, 3 * STALL), (0, 100)];
        script.extend(vec![(0, 100); 3_000]);
        let pace = Pace { overrun: Overrun::Degrade { divisor_max: 8 }, ..Pace::default() };
        let (ticks, record) = run_at(pace, 0, &script);
        let steps: Vec<u64> = points(&ticks).windows(2).map(|pair| pair[1] - pair[0]).collect();
        assert_eq!((steps[10], steps[steps.len() - 1]), (4, 1), "every fourth, at last every one");
        assert_eq!(record.cycles + record.missed + record.left_out, points(&ticks)[ticks.len() - 1] + 1);
    }

    /// The tail begins as long as allowed and is then as long as the kernel is late; the loop is on time throughout.
    #[test]
    fn the_spin_tail_is_what_the_kernel_needs() {
        let pace = |us| Pace { spin_max: Duration::from_micros(us), ..Pace::default() };
        let script = vec![(40_000, 100); 600];
        let (_, record) = run_at(pace(150), 0, &script);
        assert_eq!((record.lateness.max_ns(), record.missed), (0, 0));
        assert!((40_000..=47_000).contains(&record.spin_tail_ns), "{}", record.spin_tail_ns);
        let (_, record) = run_at(pace(20), 0, &script);
        assert_eq!((record.spin_tail_ns, record.lateness.max_ns()), (20_000, 20_000), "never longer than allowed");
        let (_, record) = run_at(pace(900), 0, &script[..10]);
        assert_eq!(record.spin_tail_ns, PERIOD / 4, "never longer than a quarter of the period");
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
        /// Whatever the loop sleeps and works, and whatever its policy: each cycle stands for a grid point of its own, later than the one before;
        /// and cycles, missed points and those left out together are exactly the points that have passed.
        #[test]
        fn every_grid_point_is_run_once_or_counted(
            start in 0u64..10_000_000_000,
            overrun in prop_oneof![
                Just(Overrun::Skip),
                (0u32..5).prop_map(|in_a_row_max| Overrun::CatchUp { in_a_row_max }),
                (1u32..20).prop_map(|divisor_max| Overrun::Degrade { divisor_max }),
                (1u32..20).prop_map(|bucket| Overrun::Stop { bucket }),
            ],
            script in prop::collection::vec((0u64..4 * PERIOD, 0u64..4 * PERIOD), 1..200),
        ) {
            let (ticks, record) = run_at(Pace { overrun, ..Pace::default() }, start, &script);
            let first = grid().at_or_after(Stamp(start));
            let last = ticks[ticks.len() - 1].now;
            for pair in ticks.windows(2) {
                prop_assert!(pair[1].now > pair[0].now);
                let passed = grid().steps(pair[0].now, pair[1].now) - 1;
                let degrades = matches!(overrun, Overrun::Degrade { .. });
                let accounted = passed == pair[1].missed || degrades && passed > pair[1].missed;
                prop_assert!(accounted, "{:?}", pair);
            }
            for tick in &ticks {
                prop_assert_eq!(tick.now.0 % PERIOD, PHASE);
                prop_assert!(tick.now <= tick.woken);
                let may_be_late = matches!(overrun, Overrun::CatchUp { .. } | Overrun::Degrade { .. });
                prop_assert!(may_be_late || tick.woken.0 - tick.now.0 < PERIOD);
            }
            prop_assert_eq!(record.cycles + record.missed + record.left_out, grid().steps(first, last) + 1);
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
