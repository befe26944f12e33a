//! Loops whose lateness is measured, each on a thread of its own, set up as a role's loop is.

use std::thread;
use std::time::Duration;

use hdrhistogram::Histogram;
use rustix::thread::clock_nanosleep_absolute;
use rustix::time::{ClockId, Timespec};
use tandem_cycle::setup::{Granted, Policy, Wish, acquire};
use tandem_cycle::{Clock as _, FixedRate, Grid, Monotonic, Pace, SharedRecord};
use tandem_msg::Stamp;

use super::series::histogram;
use super::{BenchError, Conditions};

/// As the shipped cell's controller.
pub(super) const PRIORITY: u8 = 80;
const NANOS: u64 = 1_000_000_000;
/// Left out at the beginning: caches are cold.
pub(super) const WARM_UP: u64 = 20;

/// What the measured threads ask for.
pub(super) fn wish(cpu: Option<u32>) -> Wish {
    Wish { policy: Policy::BestEffort, priority: Some(PRIORITY), cpu, lock_memory: true, dma_latency_us: None }
}

/// Has idle processors wake up at once while this process lives, as cyclictest does, so that all are measured alike;
/// where that is not permitted, all do without.
pub(super) fn keep_awake() {
    let wish =
        Wish { policy: Policy::BestEffort, priority: None, cpu: None, lock_memory: false, dma_latency_us: Some(0) };
    let _ = acquire(&wish);
}

/// The processor the loops run on: the one asked for, or the last, which gets the fewest interrupts.
pub(super) fn processor(asked: Option<u32>) -> Option<u32> {
    let count = thread::available_parallelism().map_or(1, usize::from);
    asked.or_else(|| u32::try_from(count - 1).ok())
}

/// Another processor than that one; none when there is no other.
pub(super) fn other_processor(cpu: Option<u32>) -> Option<u32> {
    let count = thread::available_parallelism().map_or(1, usize::from) as u32;
    (0..count).find(|other| Some(*other) != cpu)
}

/// Runs something on a thread set up as a role's loop is; notes what was granted.
///
/// # Errors
/// The thread panicked.
pub(super) fn set_up<R: Send>(
    cpu: Option<u32>,
    conditions: &mut Conditions,
    run: impl FnOnce() -> R + Send,
) -> Result<R, BenchError> {
    let (granted, result) = thread::scope(|scope| {
        let thread = scope.spawn(|| {
            let granted =
                acquire(&wish(cpu)).unwrap_or_else(|denied| Granted { notices: denied.0, ..Granted::default() });
            (granted, run())
        });
        thread.join().map_err(|_| BenchError::peer("the measured thread", "has panicked; its message stands above"))
    })?;
    conditions.fifo = granted.priority;
    conditions.memory_locked = granted.locked;
    conditions.cpu = granted.cpu;
    Ok(result)
}

/// Sleeps until absolute deadlines and does nothing else: the least a loop can be. `late` is told of each wake-up,
/// nanoseconds after its deadline.
pub(super) fn bare(period: Duration, time: Duration, mut late: impl FnMut(u64)) {
    let period = period.as_nanos() as u64;
    let mut clock = Monotonic;
    let mut deadline = clock.now().0 + period;
    let cycles = time.as_nanos() as u64 / period;
    for cycle in 0..cycles + WARM_UP {
        let at = Timespec { tv_sec: (deadline / NANOS) as i64, tv_nsec: (deadline % NANOS) as i64 };
        while clock_nanosleep_absolute(ClockId::Monotonic, &at) == Err(rustix::io::Errno::INTR) {}
        let woken = clock.now().0;
        if cycle >= WARM_UP {
            late(woken.saturating_sub(deadline));
        }
        while deadline <= woken {
            deadline += period;
        }
    }
}

/// What a loop of ours showed.
pub(super) struct Kept {
    /// Lateness of each wake-up.
    pub(super) lateness: Histogram<u64>,
    /// Grid points missed.
    pub(super) missed: u64,
    /// How long it spun before each point in the end.
    pub(super) tail: Duration,
}

/// Our loop around a cycle that does nothing.
pub(super) fn fixed_rate(mut rate: FixedRate<Monotonic>, time: Duration, warm_up: u64) -> Kept {
    let mut lateness = histogram();
    let (mut missed, period) = (0, rate.grid().period());
    let cycles = (time.as_nanos() / period.as_nanos()) as u64;
    for cycle in 0..cycles + warm_up {
        let tick = rate.wait();
        if cycle >= warm_up {
            // Of the grid point it was to wake at, not of the last one it slept past.
            lateness.saturating_record(tick.woken.0 - tick.now.0 + tick.missed * period.as_nanos() as u64);
            missed += tick.missed;
        }
    }
    Kept { lateness, missed, tail: Duration::from_nanos(rate.record().spin_tail_ns) }
}

/// As the shipped cell's controller: off the whole milliseconds, at which the kernel's tick comes to a processor that
/// is not idle, as one that spins is not.
const PHASE: Duration = Duration::from_micros(200);

/// A loop at that period, on the grid, that spins at most so long before each point.
pub(super) fn rate(period: Duration, spin_max: Duration) -> FixedRate<Monotonic> {
    let grid = Grid::new(period, PHASE).expect("a period a grid can have");
    FixedRate::recording_in(SharedRecord::default(), grid, Monotonic, Pace { spin_max, ..Pace::default() })
}

/// The time now.
pub(super) fn now() -> Stamp {
    Monotonic.now()
}
