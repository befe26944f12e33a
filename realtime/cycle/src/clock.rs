//! Where the loop gets its time from.

use rustix::thread::clock_nanosleep_absolute;
use rustix::time::{ClockId, Timespec, clock_gettime};
use tandem_msg::Stamp;

/// A clock the loop can wait on.
pub trait Clock {
    /// The time now.
    fn now(&mut self) -> Stamp;
    /// Returns at `deadline` or later; at once when it has passed.
    fn wait_until(&mut self, deadline: Stamp);
    /// Returns at `deadline` or later, without giving up the processor; answers when it is.
    fn spin_until(&mut self, deadline: Stamp) -> Stamp {
        loop {
            let now = self.now();
            if now >= deadline {
                return now;
            }
            core::hint::spin_loop();
        }
    }
}

/// CLOCK_MONOTONIC.
#[derive(Clone, Copy, Debug, Default)]
pub struct Monotonic;

const NANOS: u64 = 1_000_000_000;

impl Clock for Monotonic {
    fn now(&mut self) -> Stamp {
        let now = clock_gettime(ClockId::Monotonic);
        // Neither is negative on this clock.
        Stamp(now.tv_sec as u64 * NANOS + now.tv_nsec as u64)
    }

    fn wait_until(&mut self, deadline: Stamp) {
        let request = Timespec { tv_sec: (deadline.0 / NANOS) as i64, tv_nsec: (deadline.0 % NANOS) as i64 };
        // A signal only sets a flag, which the loop looks at in its next cycle: go on waiting.
        while clock_nanosleep_absolute(ClockId::Monotonic, &request) == Err(rustix::io::Errno::INTR) {}
    }
}
