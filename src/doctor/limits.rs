//! What the user of this process is allowed, tried where it can be.

use tandem_cycle::setup::Granted;

use super::host::PRIORITY;
use super::{Check, Host, Subject};

const OPEN_FILES_WANTED: u64 = 1024;
/// A timer that may fire this late is as good as one on time, nanoseconds.
const SLACK_MAX: u64 = 1_000;

pub(super) fn fifo(host: &Host) -> Check {
    let it = Subject("fifo", "without SCHED_FIFO every other program delays the loops, by milliseconds under load");
    match host.granted {
        Some(Granted { priority: Some(priority), .. }) => it.ok(format!("priority {priority} was granted")),
        _ => it.degraded(
            format!("priority {PRIORITY} was refused"),
            format!(
                "add `<user> - rtprio {PRIORITY}` to /etc/security/limits.conf and log in again, or setcap \
                 cap_sys_nice+ep on the binary; in a container: --cap-add SYS_NICE --ulimit rtprio={PRIORITY}"
            ),
        ),
    }
}

pub(super) fn timer_slack(host: &Host) -> Check {
    let it = Subject("timer_slack", "the kernel may fire a timer later than asked, to save wake-ups");
    match host.granted.map(|granted| granted.timer_slack_ns) {
        Some(slack) if slack <= SLACK_MAX => it.ok(format!("{slack} ns were granted")),
        Some(slack) => it.degraded(
            format!("{slack} ns, and it could not be lowered"),
            "start the cell outside of the sandbox that forbids prctl(PR_SET_TIMERSLACK)",
        ),
        None => it.unknown("the trial could not be run", "see the process's limits on threads: ulimit -u"),
    }
}

pub(super) fn memory_lock(host: &Host) -> Check {
    let it = Subject("memory_lock", "memory that is not locked may have to be fetched in the middle of a cycle");
    match host.lockable {
        None => it.ok("without limit"),
        Some(limit) => it.degraded(
            format!("up to {} kB", limit / 1024),
            "add `<user> - memlock unlimited` to /etc/security/limits.conf and log in again; in a container: \
             --ulimit memlock=-1",
        ),
    }
}

pub(super) fn open_files(host: &Host) -> Check {
    let it = Subject("open_files", "every port of a process keeps files of shared memory open");
    match host.open_files {
        Some(limit) if limit < OPEN_FILES_WANTED => it.bad(
            limit.to_string(),
            format!("ulimit -n {OPEN_FILES_WANTED}, or a nofile line in /etc/security/limits.conf"),
        ),
        Some(limit) => it.ok(limit.to_string()),
        None => it.ok("without limit"),
    }
}
