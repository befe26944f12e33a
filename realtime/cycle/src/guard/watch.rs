//! What a loop asks of the system, cycle by cycle, once it is warm.

use core::time::Duration;
use std::io;

use tandem_msg::Stamp;

use super::Calls;
use crate::stats::Guarded;

/// Until the loop has been everywhere it goes.
const WARM_UP: Duration = Duration::from_secs(1);
/// Between two questions to the kernel.
const ASK: Duration = Duration::from_secs(1);
/// A cycle's wait for its grid point.
const WAITING: u64 = 1;

/// What the kernel counts for one thread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Usage {
    /// Page faults that needed no disk.
    pub minor_faults: u64,
    /// Page faults that waited for a disk.
    pub major_faults: u64,
    /// How often the thread gave up the processor by itself.
    pub switches: u64,
    /// How often it was taken off the processor.
    pub preemptions: u64,
}

impl Usage {
    /// Of the calling thread, since it began. One system call.
    ///
    /// # Errors
    /// What the kernel says.
    pub fn of_this_thread() -> io::Result<Self> {
        // SAFETY: rusage is plain numbers, for which zeros are valid.
        let mut usage: libc::rusage = unsafe { core::mem::zeroed() };
        // SAFETY: the pointer is to a live rusage.
        if unsafe { libc::getrusage(libc::RUSAGE_THREAD, &mut usage) } != 0 {
            return Err(io::Error::last_os_error());
        }
        // None of them is ever negative.
        let count = |number: libc::c_long| number as u64;
        Ok(Self {
            minor_faults: count(usage.ru_minflt),
            major_faults: count(usage.ru_majflt),
            switches: count(usage.ru_nvcsw),
            preemptions: count(usage.ru_nivcsw),
        })
    }
}

/// Sums up what a loop asks of the system, from the end of its warm-up on.
#[derive(Clone, Debug, Default)]
pub struct Watch {
    /// When the first cycle was seen, and what the kernel had counted when the loop was warm.
    began: Option<Stamp>,
    warm: Option<Usage>,
    ask_at: Stamp,
    guarded: Guarded,
}

impl Watch {
    /// Takes in one cycle: the instant it stood for and what it asked of the allocator. Answers with the sums.
    ///
    /// # Realtime
    /// One system call a second: what the kernel has counted meanwhile. Allocates nothing.
    pub fn cycle(&mut self, now: Stamp, calls: Calls) -> &Guarded {
        let began = *self.began.get_or_insert(now);
        if began.age_at(now) < WARM_UP {
            return &self.guarded;
        }
        let mut system_calls = WAITING;
        if now >= self.ask_at {
            self.ask_at = now.after(ASK);
            system_calls += 1;
            if let Ok(usage) = Usage::of_this_thread() {
                let warm = *self.warm.get_or_insert(usage);
                self.guarded.minor_faults = usage.minor_faults - warm.minor_faults;
                self.guarded.major_faults = usage.major_faults - warm.major_faults;
                self.guarded.switches = usage.switches - warm.switches;
                self.guarded.preemptions = usage.preemptions - warm.preemptions;
            }
        }
        self.guarded.cycles += 1;
        self.guarded.allocations += calls.allocations + calls.releases;
        self.guarded.system_calls += system_calls;
        &self.guarded
    }
}

#[cfg(test)]
#[allow(clippy::disallowed_types, clippy::disallowed_macros)] // Reason: the test makes page faults.
mod tests {
    use super::*;

    /// Nothing counts before the loop is warm; then every cycle does, and what the kernel saw between two questions.
    #[test]
    fn what_happens_after_the_warm_up_counts() {
        let mut watch = Watch::default();
        let busy = Calls { allocations: 2, releases: 1 };
        assert_eq!(*watch.cycle(Stamp(0), busy), Guarded::default());
        let at = |seconds: u64| Stamp(seconds * 1_000_000_000);
        assert_eq!(watch.cycle(at(1), busy).cycles, 1);
        let fresh = vec![1_u8; 4 << 20];
        core::hint::black_box(&fresh);
        let found = *watch.cycle(at(2), Calls::default());
        assert_eq!((found.cycles, found.allocations, found.system_calls), (2, 3, 4));
        assert!(found.minor_faults > 0, "{found:?}");
    }
}
