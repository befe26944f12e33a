//! Memory that is there when it is needed.

use rustix::mm::{MlockAllFlags, mlockall};
use rustix::process::{Resource, getrlimit};

use super::Notice;

/// Stack a cycle may use without a page fault.
const STACK: usize = 256 * 1024;
const PAGE: usize = 4096;

/// Locks what the process has and what it will get. Only when there is no limit:
/// below one, a later allocation could fail where now it is merely slow.
pub(super) fn lock() -> Result<(), Notice> {
    match mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE) {
        Err(cause) => Err(Notice::NotLocked { cause }),
        Ok(()) if unlimited() => Ok(()),
        Ok(()) => {
            // Undone, so that the process runs as if it had never been asked.
            let _ = rustix::mm::munlockall();
            Err(Notice::LockLimited { limit: getrlimit(Resource::Memlock).current.unwrap_or(u64::MAX) })
        }
    }
}

/// Root may lock without limit whatever RLIMIT_MEMLOCK says.
fn unlimited() -> bool {
    rustix::process::geteuid().is_root() || getrlimit(Resource::Memlock).current.is_none()
}

/// Whether the kernel holds memory of this process locked. Reads a file: only while setting up.
pub(super) fn locked_in_force() -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let locked = status.lines().find_map(|line| line.strip_prefix("VmLck:"));
    locked.and_then(|rest| rest.split_whitespace().next()?.parse::<u64>().ok()).is_some_and(|kilobytes| kilobytes > 0)
}

/// Touches the stack ahead of its use; answers how much of it, bytes.
#[inline(never)]
pub(super) fn touch_stack() -> u64 {
    let mut stack = [0_u8; STACK];
    for page in (0..STACK).step_by(PAGE) {
        stack[page] = 1;
    }
    core::hint::black_box(&stack);
    STACK as u64
}
