//! What a loop found out about itself.

use core::sync::atomic::{AtomicU64, Ordering};

use crate::histogram::raise;
use crate::{Histogram, SharedHistogram};

/// Counts and durations of one loop since its start. Fixed size.
///
/// **Invariant:** `cycles + missed` is the number of grid points since the first cycle, itself included.
#[derive(Clone, Debug, Default)]
pub struct Record {
    /// Cycles run.
    pub cycles: u64,
    /// Grid points that passed without a cycle.
    pub missed: u64,
    /// Cycles that ended after the grid point that follows them.
    pub overruns: u64,
    /// Last wake-up, nanoseconds after its deadline.
    pub lateness_last_ns: u64,
    /// Last cycle's duration, nanoseconds.
    pub busy_last_ns: u64,
    /// Wake-ups, nanoseconds after their deadlines.
    pub lateness: Histogram,
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
    lateness_last_ns: AtomicU64,
    busy_last_ns: AtomicU64,
    lateness: SharedHistogram,
    busy: SharedHistogram,
}

impl SharedRecord {
    pub(crate) fn cycle_began(&self, lateness_ns: u64, missed: u64) {
        raise(&self.cycles, 1);
        raise(&self.missed, missed);
        self.lateness_last_ns.store(lateness_ns, Ordering::Relaxed);
        self.lateness.record(lateness_ns);
    }

    pub(crate) fn cycle_ended(&self, busy_ns: u64, overran: bool) {
        raise(&self.overruns, u64::from(overran));
        self.busy_last_ns.store(busy_ns, Ordering::Relaxed);
        self.busy.record(busy_ns);
    }

    /// Cycles run.
    pub fn cycles(&self) -> u64 {
        self.cycles.load(Ordering::Relaxed)
    }

    /// Grid points that passed without a cycle.
    pub fn missed(&self) -> u64 {
        self.missed.load(Ordering::Relaxed)
    }

    /// Cycles that ended after the grid point that follows them.
    pub fn overruns(&self) -> u64 {
        self.overruns.load(Ordering::Relaxed)
    }

    /// What has been recorded so far; numbers of a cycle that is just beginning may disagree by that cycle.
    pub fn copy_to(&self, copy: &mut Record) {
        copy.cycles = self.cycles();
        copy.missed = self.missed();
        copy.overruns = self.overruns();
        copy.lateness_last_ns = self.lateness_last_ns.load(Ordering::Relaxed);
        copy.busy_last_ns = self.busy_last_ns.load(Ordering::Relaxed);
        self.lateness.copy_to(&mut copy.lateness);
        self.busy.copy_to(&mut copy.busy);
    }

    /// Forgets everything.
    pub(crate) fn clear(&self) {
        let Self { cycles, missed, overruns, lateness_last_ns, busy_last_ns, lateness, busy } = self;
        for number in [cycles, missed, overruns, lateness_last_ns, busy_last_ns] {
            number.store(0, Ordering::Relaxed);
        }
        lateness.clear();
        busy.clear();
    }
}
