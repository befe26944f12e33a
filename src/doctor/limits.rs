//! What the user of this process is allowed, tried where it can be.

use rustix::process::{Resource, getrlimit};
use tandem_cycle::setup::{Granted, Policy, Wish, acquire};

use super::Check;

/// The highest priority the shipped cell asks for.
const PRIORITY: u8 = 80;
const OPEN_FILES_WANTED: u64 = 1024;

/// Tried on a thread of its own, which takes the setting with it.
fn granted(wish: Wish) -> Option<Granted> {
    std::thread::spawn(move || acquire(&wish).ok()).join().ok().flatten()
}

pub(super) fn fifo() -> Check {
    const NAME: &str = "fifo";
    let matters = "without SCHED_FIFO every other program delays the loops, by milliseconds under load";
    let wish = Wish { policy: Policy::BestEffort, priority: Some(PRIORITY), cpu: None, lock_memory: false };
    match granted(wish) {
        Some(Granted { priority: Some(priority), .. }) => {
            Check::ok(NAME, format!("priority {priority} was granted"), matters)
        }
        _ => Check::degraded(
            NAME,
            format!("priority {PRIORITY} was refused"),
            matters,
            format!(
                "add `<user> - rtprio {PRIORITY}` to /etc/security/limits.conf and log in again, or setcap \
                 cap_sys_nice+ep on the binary; in a container: --cap-add SYS_NICE --ulimit rtprio={PRIORITY}"
            ),
        ),
    }
}

pub(super) fn memory_lock() -> Check {
    const NAME: &str = "memory_lock";
    let matters = "memory that is not locked may have to be fetched in the middle of a cycle";
    let root = rustix::process::geteuid().is_root();
    match getrlimit(Resource::Memlock).current {
        _ if root => Check::ok(NAME, "without limit, as root", matters),
        None => Check::ok(NAME, "without limit", matters),
        Some(limit) => Check::degraded(
            NAME,
            format!("up to {} kB", limit / 1024),
            matters,
            "add `<user> - memlock unlimited` to /etc/security/limits.conf and log in again; in a container: \
             --ulimit memlock=-1",
        ),
    }
}

pub(super) fn open_files() -> Check {
    const NAME: &str = "open_files";
    let matters = "every port of a process keeps files of shared memory open";
    match getrlimit(Resource::Nofile).current {
        Some(limit) if limit < OPEN_FILES_WANTED => Check::failed(
            NAME,
            limit.to_string(),
            matters,
            format!("ulimit -n {OPEN_FILES_WANTED}, or a nofile line in /etc/security/limits.conf"),
        ),
        Some(limit) => Check::ok(NAME, limit.to_string(), matters),
        None => Check::ok(NAME, "without limit", matters),
    }
}
