//! A short run of the loop itself.

use std::time::Duration;

use tandem_cycle::setup::{Policy, Wish, acquire};
use tandem_cycle::{FixedRate, Grid, Monotonic, Record};

use super::Check;

const PERIOD: Duration = Duration::from_millis(1);
const CYCLES: u32 = 300;
/// Of a period of 1 ms: what is left must do for the work.
const GOOD: Duration = Duration::from_micros(250);
const PRIORITY: u8 = 80;

pub(super) fn wake_up() -> Check {
    const NAME: &str = "wake_up";
    let matters = "a loop that wakes late has less time for its cycle";
    let Some(record) = std::thread::spawn(trial).join().ok().flatten() else {
        return Check::failed(NAME, "the trial could not be run", matters, "see the process's limits on threads");
    };
    let p99 = Duration::from_nanos(record.lateness.quantile_ns(0.99));
    let found = format!(
        "at 1 kHz: median {} µs, p99 {} µs late, {} of {CYCLES} cycles missed",
        record.lateness.quantile_ns(0.5) / 1_000,
        p99.as_micros(),
        record.missed
    );
    if p99 <= GOOD && record.missed == 0 {
        Check::ok(NAME, found, matters)
    } else {
        let fix = "mend what is degraded above; then look for what else runs on this machine";
        Check::degraded(NAME, found, matters, fix)
    }
}

fn trial() -> Option<Record> {
    let wish = Wish { policy: Policy::BestEffort, priority: Some(PRIORITY), cpu: None, lock_memory: false };
    acquire(&wish).ok()?;
    let mut rate = FixedRate::new(Grid::new(PERIOD, Duration::ZERO).ok()?, Monotonic);
    for _ in 0..CYCLES {
        rate.wait();
    }
    Some(rate.record().clone())
}
