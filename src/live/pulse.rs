//! Whether a process that lives still does its work.
//!
//! Every loop counts its cycles in shared memory (`statistics`). One that counts no
//! more is either *stopped* (SIGSTOP, a debugger), *spinning* (it uses the processor
//! and gets nowhere), or only *kept waiting* by a busy machine, which is no fault of
//! its own. The kernel tells which: it knows the state of each thread and the
//! processor time it has used. A thread that sleeps for too long may be kept waiting
//! too; that is left to the supervisor, which has more patience ([`super::health`]).

use std::fs;
use std::time::{Duration, Instant};

use tandem_cycle::stats::Reader;

/// Periods are taken to be at least that long.
const PERIOD_MIN: Duration = Duration::from_millis(1);
/// Silence after which a loop is looked into, in periods.
const SUSPECT: u32 = 3;
/// After which one that is stopped is judged: it was at both looks.
const JUDGE_STOPPED: u32 = 6;
/// After which one that runs is: it needs time to use up.
const JUDGE_RUNNING: u32 = 8;
/// Processor time a loop must have used in between to be taken for spinning, in periods.
const SPUN: u32 = 4;

/// What a loop that is silent does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Doing {
    Stopped,
    Running,
    Waiting,
}

/// What the kernel knows of a thread, and of the machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Look {
    doing: Doing,
    /// Processor time it has used.
    used: Duration,
    /// Ticks the machine's host has kept from it.
    stolen: u64,
}

/// Follows one process.
#[derive(Debug)]
pub(super) struct Pulse {
    period: Duration,
    last: (u64, u64),
    since: Instant,
    suspected: Option<Look>,
}

impl Pulse {
    /// Of a loop of that period. A faster one than 1 kHz is given the time of one at 1 kHz: what takes the whole machine
    /// for a millisecond or two is not its fault.
    pub(super) fn new(period: Duration, now: Instant) -> Self {
        Self { period: period.max(PERIOD_MIN), last: (0, 0), since: now, suspected: None }
    }

    /// Whether the process `pid` is to be killed, at `now`: it is stopped, or spins without a cycle.
    /// Before its first cycle nothing is judged.
    pub(super) fn is_lost(&mut self, statistics: &Reader, epoch: u64, pid: u32, now: Instant) -> bool {
        self.judge((statistics.epoch(), statistics.cycles()), epoch, now, || look(pid))
    }

    fn judge(&mut self, beat: (u64, u64), epoch: u64, now: Instant, look: impl FnOnce() -> Option<Look>) -> bool {
        if beat != self.last || beat.0 != epoch || beat.1 == 0 {
            (self.last, self.since, self.suspected) = (beat, now, None);
            return false;
        }
        let silent = now.saturating_duration_since(self.since);
        match self.suspected {
            None if silent >= self.period * SUSPECT => {
                self.suspected = look();
                false
            }
            Some(before) if silent >= self.period * JUDGE_STOPPED => look().is_some_and(|after| match after.doing {
                Doing::Stopped => before.doing == Doing::Stopped,
                Doing::Running => {
                    silent >= self.period * JUDGE_RUNNING
                        && after.used.saturating_sub(before.used) >= self.period * SPUN
                        && after.stolen == before.stolen
                }
                Doing::Waiting => false,
            }),
            _ => false,
        }
    }
}

/// Of the first thread of a process: that is where a role's loop runs.
fn look(pid: u32) -> Option<Look> {
    let stat = fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
    // After the name, which is in parentheses and may hold anything.
    let doing = match stat.rsplit_once(')')?.1.trim_start().chars().next()? {
        'T' => Doing::Stopped,
        'R' => Doing::Running,
        _ => Doing::Waiting,
    };
    let used = fs::read_to_string(format!("/proc/{pid}/schedstat")).ok()?;
    let used = Duration::from_nanos(used.split_whitespace().next()?.parse().ok()?);
    let machine = fs::read_to_string("/proc/stat").ok()?;
    let stolen = machine.lines().next()?.split_whitespace().nth(8).and_then(|ticks| ticks.parse().ok()).unwrap_or(0);
    Some(Look { doing, used, stolen })
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    /// Counts one cycle at 0 ms, then none; looks every millisecond; answers when it is judged.
    fn judged_after(look: impl Fn(u32) -> Look) -> Option<u32> {
        let start = Instant::now();
        let mut pulse = Pulse::new(MS, start);
        (0..200).find(|&ms| pulse.judge((1, 5), 1, start + MS * ms, || Some(look(ms))))
    }

    fn at(doing: Doing, used_ms: u32, stolen: u64) -> Look {
        Look { doing, used: MS * used_ms, stolen }
    }

    #[test]
    fn a_stopped_or_spinning_loop_is_lost_within_ten_periods() {
        assert_eq!(judged_after(|_| at(Doing::Stopped, 0, 0)), Some(JUDGE_STOPPED));
        assert_eq!(judged_after(|ms| at(Doing::Running, ms, 0)), Some(JUDGE_RUNNING));
    }

    #[test]
    fn a_loop_that_is_kept_waiting_is_not_accused() {
        assert_eq!(judged_after(|_| at(Doing::Running, 0, 0)), None, "it gets no processor");
        assert_eq!(judged_after(|_| at(Doing::Waiting, 0, 0)), None, "it sleeps");
        assert_eq!(
            judged_after(|ms| at(Doing::Running, ms, ms.into())),
            None,
            "the machine's host takes the processor"
        );
    }

    #[test]
    fn a_loop_that_counts_on_or_has_not_begun_is_alive() {
        let start = Instant::now();
        let mut pulse = Pulse::new(MS, start);
        let stopped = || Some(at(Doing::Stopped, 0, 0));
        assert!((0..100).all(|ms| !pulse.judge((1, ms.into()), 1, start + MS * ms, stopped)), "it counts");
        assert!((100..200).all(|ms| !pulse.judge((1, 99), 2, start + MS * ms, stopped)), "its predecessor's count");
        assert!((200..300).all(|ms| !pulse.judge((2, 0), 2, start + MS * ms, stopped)), "it has not begun");
    }

    /// The kernel's word on ourselves.
    #[test]
    fn a_process_can_be_looked_into() {
        let look = look(std::process::id()).expect("the kernel tells");
        assert!(look.doing != Doing::Stopped && look.used < Duration::from_secs(86_400), "{look:?}");
    }
}
