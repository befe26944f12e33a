//! Scheduler, processor and timers of the calling thread.

#![allow(unsafe_code)]

use rustix::io::Errno;
use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};

use super::Notice;

/// How late a timer may fire, nanoseconds.
const SLACK_NS: libc::c_ulong = 1;

fn errno() -> Errno {
    Errno::from_io_error(&std::io::Error::last_os_error()).unwrap_or(Errno::INVAL)
}

/// Puts the thread under SCHED_FIFO; threads it starts return to the normal scheduler.
pub(super) fn fifo(priority: u8) -> Result<(), Notice> {
    // SAFETY: sched_param is plain numbers, for which zeros are valid.
    let mut parameters: libc::sched_param = unsafe { core::mem::zeroed() };
    parameters.sched_priority = i32::from(priority);
    let policy = libc::SCHED_FIFO | libc::SCHED_RESET_ON_FORK;
    // SAFETY: 0 is the calling thread; the pointer is to a live sched_param.
    if unsafe { libc::sched_setscheduler(0, policy, &parameters) } == 0 {
        Ok(())
    } else {
        Err(Notice::NoFifo { priority, cause: errno() })
    }
}

/// The thread's priority under SCHED_FIFO, if that is its scheduler.
pub(super) fn fifo_in_force() -> Option<u8> {
    // SAFETY: sched_param is plain numbers, for which zeros are valid.
    let mut parameters: libc::sched_param = unsafe { core::mem::zeroed() };
    // SAFETY: 0 is the calling thread; the pointer is to a live sched_param.
    let (policy, read) = unsafe { (libc::sched_getscheduler(0), libc::sched_getparam(0, &mut parameters)) };
    let fifo = policy & !libc::SCHED_RESET_ON_FORK == libc::SCHED_FIFO;
    (policy >= 0 && read == 0 && fifo).then(|| u8::try_from(parameters.sched_priority).unwrap_or(0))
}

/// Binds the thread to one processor.
pub(super) fn bind(cpu: u32) -> Result<(), Notice> {
    let index = cpu as usize;
    if index >= CpuSet::MAX_CPU {
        return Err(Notice::NoSuchCpu { cpu, cause: Errno::INVAL });
    }
    let mut set = CpuSet::new();
    set.set(index);
    sched_setaffinity(None, &set).map_err(|cause| Notice::NoSuchCpu { cpu, cause })
}

/// The processor the thread is bound to, if it is exactly one.
pub(super) fn bound_to() -> Option<u32> {
    let set = sched_getaffinity(None).ok()?;
    let mut allowed = (0..CpuSet::MAX_CPU).filter(|cpu| set.is_set(*cpu));
    match (allowed.next(), allowed.next()) {
        (Some(only), None) => u32::try_from(only).ok(),
        _ => None,
    }
}

/// Lets the thread's timers fire on time. Under SCHED_FIFO the kernel does so anyway.
pub(super) fn tighten_timers() {
    // SAFETY: plain numbers; affects the calling thread only. A refusal is seen when the value is read back.
    unsafe { libc::prctl(libc::PR_SET_TIMERSLACK, SLACK_NS) };
}

/// How late the thread's timers may fire, nanoseconds.
pub(super) fn timer_slack_ns() -> u64 {
    // SAFETY: no pointer is passed.
    u64::try_from(unsafe { libc::prctl(libc::PR_GET_TIMERSLACK) }).unwrap_or(u64::MAX)
}
