//! What a loop found out about itself.

use core::sync::atomic::{AtomicU64, Ordering};
use core::time::Duration;

use crate::histogram::raise;
use crate::overrun::Beginning;
use crate::{Histogram, SharedHistogram};

/// Counts and durations of one loop since its start. Fixed size.
///
/// **Invariant:** `cycles + missed + left_out` is the number of grid points since the first cycle, itself included.
#[derive(Clone, Debug, Default)]
pub struct Record {
    /// Cycles run.
    pub cycles: u64,
    /// Grid points that passed without a cycle.
    pub missed: u64,
    /// Cycles that ended after the grid point that follows them.
    pub overruns: u64,
    /// Cycles that were run after their point had passed, to catch up.
    pub caught_up: u64,
    /// Grid points that a degraded loop left out on purpose.
    pub left_out: u64,
    /// How often the loop was found overloaded and to be left.
    pub stops: u64,
    /// How long it spins before each point, nanoseconds; 0 without a spin tail.
    pub spin_tail_ns: u64,
    /// Last cycle's begin, nanoseconds after its deadline.
    pub lateness_last_ns: u64,
    /// Last cycle's duration, nanoseconds.
    pub busy_last_ns: u64,
    /// Begins of cycles, nanoseconds after their deadlines.
    pub lateness: Histogram,
    /// Wake-ups by the kernel, nanoseconds after the loop wanted to be woken; only of loops with a spin tail.
    pub wakeup: Histogram,
    /// Durations of cycles, nanoseconds.
    pub busy: Histogram,
}

/// A [`Record`] that one loop writes while others read it: relaxed loads and stores, no locked instruction.
#[derive(Default)]
#[repr(C)]
pub struct SharedRecord {
    cycles: AtomicU64,
    missed: AtomicU64,
    overruns: AtomicU64,
    caught_up: AtomicU64,
    left_out: AtomicU64,
    stops: AtomicU64,
    spin_tail_ns: AtomicU64,
    lateness_last_ns: AtomicU64,
    busy_last_ns: AtomicU64,
    lateness: SharedHistogram,
    pub(crate) wakeup: SharedHistogram,
    busy: SharedHistogram,
}

impl SharedRecord {
    pub(crate) fn cycle_began(&self, lateness_ns: u64, begun: &Beginning) {
        raise(&self.cycles, 1);
        raise(&self.missed, begun.missed);
        raise(&self.left_out, begun.left_out);
        raise(&self.caught_up, begun.caught_up.into());
        raise(&self.stops, begun.overloaded.into());
        self.lateness_last_ns.store(lateness_ns, Ordering::Relaxed);
        self.lateness.record(lateness_ns);
    }

    pub(crate) fn cycle_ended(&self, busy_ns: u64, overran: bool) {
        raise(&self.overruns, overran.into());
        self.busy_last_ns.store(busy_ns, Ordering::Relaxed);
        self.busy.record(busy_ns);
    }

    pub(crate) fn spins(&self, tail: Duration) {
        self.spin_tail_ns.store(tail.as_nanos() as u64, Ordering::Relaxed);
    }

    /// Cycles run.
    pub fn cycles(&self) -> u64 {
        self.cycles.load(Ordering::Relaxed)
    }

    /// What has been recorded so far; numbers of a cycle that is just beginning may disagree by that cycle.
    pub fn copy_to(&self, copy: &mut Record) {
        let get = |number: &AtomicU64| number.load(Ordering::Relaxed);
        copy.cycles = get(&self.cycles);
        copy.missed = get(&self.missed);
        copy.overruns = get(&self.overruns);
        copy.caught_up = get(&self.caught_up);
        copy.left_out = get(&self.left_out);
        copy.stops = get(&self.stops);
        copy.spin_tail_ns = get(&self.spin_tail_ns);
        copy.lateness_last_ns = get(&self.lateness_last_ns);
        copy.busy_last_ns = get(&self.busy_last_ns);
        self.lateness.copy_to(&mut copy.lateness);
        self.wakeup.copy_to(&mut copy.wakeup);
        self.busy.copy_to(&mut copy.busy);
    }

    /// Forgets everything.
    pub(crate) fn clear(&self) {
        let numbers = [&self.cycles, &self.missed, &self.overruns, &self.caught_up, &self.left_out, &self.stops];
        let last = [&self.spin_tail_ns, &self.lateness_last_ns, &self.busy_last_ns];
        numbers.into_iter().chain(last).for_each(|number| number.store(0, Ordering::Relaxed));
        [&self.lateness, &self.wakeup, &self.busy].into_iter().for_each(SharedHistogram::clear);
    }
}
