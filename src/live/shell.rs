//! The loop around a role's cycle, the same for all of them.
//!
//! What differs between roles is what a cycle reads, does and writes, and that is
//! a closure. What is the same is here: the grid, the record of the loop, the
//! report on it ten times a second, and when to leave.

use std::io::{self, Write as _};
use std::time::Duration;

use rustix::process::{Pid, getppid};
use tandem_bus::{Publisher, Write as _};
use tandem_config::{Cell, Policy, Schedule};
use tandem_cycle::setup::{self, Granted, Wish};
use tandem_cycle::{FixedRate, Grid, Monotonic};
use tandem_msg::{Coded, Role, RoleStats, Stamp};

use super::{LiveError, signals};

/// Between two reports.
const REPORT: Duration = Duration::from_millis(100);

/// Why a loop was left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Leaving {
    /// A signal asked for it.
    Asked,
    /// The supervisor's process is gone.
    Orphaned,
}

/// One role's loop.
pub(super) struct Shell {
    role: Role,
    rate: FixedRate<Monotonic>,
    granted: Granted,
    stats: Publisher<RoleStats>,
    report_at: Stamp,
    parent: Option<Pid>,
}

impl Shell {
    /// Sets the calling thread up as the cell file asks; says on standard error what the host does not grant.
    pub(super) fn new(cell: &Cell, role: Role, stats: Publisher<RoleStats>) -> Result<Self, LiveError> {
        let grid = grid(cell.timing.of(role), role)?;
        let granted = granted(cell, role)?;
        tell(role, &granted);
        let rate = FixedRate::new(grid, Monotonic);
        Ok(Self { role, rate, granted, stats, report_at: Stamp(0), parent: getppid() })
    }

    /// Runs `cycle` on every grid point until there is a reason to leave.
    pub(super) fn run(mut self, mut cycle: impl FnMut(Stamp)) -> Leaving {
        loop {
            let now = self.rate.wait().now;
            cycle(now);
            if now >= self.report_at {
                self.report_at = now.after(REPORT);
                // A lost report is followed by the next; the supervisor watches their stamps.
                let _ = self.stats.publish(now, &stats(self.role, &self.rate, &self.granted));
                if getppid() != self.parent {
                    return Leaving::Orphaned;
                }
            }
            if signals::asked() > 0 {
                return Leaving::Asked;
            }
        }
    }
}

/// The grid of a role.
pub(super) fn grid(schedule: Schedule, role: Role) -> Result<Grid, LiveError> {
    Grid::new(schedule.period, schedule.phase).map_err(|cause| LiveError::Schedule { role, cause })
}

/// What the host grants the calling thread for its role.
pub(super) fn granted(cell: &Cell, role: Role) -> Result<Granted, LiveError> {
    let index = role as usize;
    let priority = cell.realtime.priority[index];
    let wish = Wish {
        policy: match cell.realtime.policy {
            Policy::Enforce => setup::Policy::Enforce,
            Policy::BestEffort => setup::Policy::BestEffort,
        },
        priority,
        cpu: cell.realtime.cpu[index].map(u32::from),
        // The supervisor shares its process with the store and the console, which may take their time.
        lock_memory: priority.is_some() && role != Role::Supervisor,
    };
    setup::acquire(&wish).map_err(|denied| LiveError::Denied { role, denied })
}

/// Says on standard error what is degraded, and how to mend it.
pub(super) fn tell(role: Role, granted: &Granted) {
    for notice in granted.notices.iter() {
        // Standard error may be closed; `tandem doctor` says the same.
        let _ = match role {
            // A role's own lines are marked by the parent.
            Role::Supervisor => writeln!(io::stderr(), "{}: {notice}", role.name()),
            _ => writeln!(io::stderr(), "{notice}"),
        };
    }
}

/// The report on a loop.
pub(super) fn stats(role: Role, rate: &FixedRate<Monotonic>, granted: &Granted) -> RoleStats {
    let record = rate.record();
    RoleStats {
        role: role.into(),
        fifo: granted.priority.is_some().into(),
        locked: granted.locked.into(),
        cpu: granted.cpu.unwrap_or(u32::MAX),
        cycles: record.cycles,
        missed: record.missed,
        lateness_ns: [record.lateness_last_ns, record.lateness.max_ns()],
        busy_ns: [record.busy_last_ns, record.busy.max_ns()],
        ..RoleStats::default()
    }
}
