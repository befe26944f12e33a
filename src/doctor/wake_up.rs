//! A short run of the loop itself.

use std::time::Duration;

use tandem_cycle::setup::{Policy, Wish, acquire};
use tandem_cycle::{FixedRate, Grid, Monotonic};

use super::host::PRIORITY;
use super::{Check, Host, Subject};

const PERIOD: Duration = Duration::from_millis(1);
const CYCLES: u32 = 300;
/// Of a period of 1 ms: what is left must do for the work.
const GOOD: Duration = Duration::from_micros(250);

/// What the doctor tries to obtain: the priority of a loop, and nothing that would outlive the thread it is tried on.
pub(super) const WISH: Wish =
    Wish { policy: Policy::BestEffort, priority: Some(PRIORITY), cpu: None, lock_memory: false, dma_latency_us: None };

/// What a short run of the loop found.
#[derive(Clone, Copy, Debug)]
pub(super) struct WakeUp {
    pub(super) median: Duration,
    pub(super) p99: Duration,
    pub(super) missed: u64,
}

pub(super) fn trial() -> Option<WakeUp> {
    acquire(&WISH).ok()?;
    let mut rate = FixedRate::new(Grid::new(PERIOD, Duration::ZERO).ok()?, Monotonic);
    for _ in 0..CYCLES {
        rate.wait();
    }
    let record = rate.record();
    let quantile = |share| Duration::from_nanos(record.lateness.quantile_ns(share));
    Some(WakeUp { median: quantile(0.5), p99: quantile(0.99), missed: record.missed })
}

pub(super) fn wake_up(host: &Host) -> Check {
    let it = Subject("wake_up", "a loop that wakes late has less time for its cycle");
    let Some(WakeUp { median, p99, missed }) = host.wake_up else {
        return it.unknown("the trial could not be run", "see the process's limits on threads: ulimit -u");
    };
    let found = format!(
        "at 1 kHz: median {} µs, p99 {} µs late, {missed} of {CYCLES} cycles missed",
        median.as_micros(),
        p99.as_micros()
    );
    if p99 <= GOOD && missed == 0 {
        it.ok(found)
    } else {
        it.degraded(found, "mend what is degraded above; then look for what else runs on this machine")
    }
}
