//! The loop around a role's cycle, the same for all of them.
//!
//! What differs between roles is what a cycle reads, does and writes, and that is
//! a closure. What is the same is here: the grid, the statistics of the loop, and
//! when to leave.

use std::io::{self, Write as _};
use std::time::Duration;

use rustix::process::{Pid, getppid};
use tandem_bus::Instance;
use tandem_config::{Cell, Policy};
use tandem_cycle::setup::{self, Granted, Wish};
use tandem_cycle::stats::Writer;
use tandem_cycle::{Clock, FixedRate, Grid, Monotonic};
use tandem_msg::{Coded, Header, Role, Stamp};

use super::{LiveError, signals, statistics};
use crate::roles::service;

/// Between two looks at who the parent is.
const PARENT_CHECK: Duration = Duration::from_millis(100);

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
    rate: FixedRate<Monotonic, Writer>,
    parent: Option<Pid>,
    check_at: Stamp,
}

impl Shell {
    /// Sets the calling thread up as the cell file asks; says on standard error what the host does not grant.
    pub(super) fn new(cell: &Cell, instance: &Instance, role: Role, epoch: u64) -> Result<Self, LiveError> {
        let schedule = cell.timing.of(role);
        let grid = Grid::new(schedule.period, schedule.phase).map_err(|cause| LiveError::Schedule { role, cause })?;
        let granted = granted(cell, role)?;
        tell(role, &granted);
        let path = statistics::file(instance, role);
        let now = Monotonic.now();
        let record = Writer::create(&path, role, epoch, &grid, service::inputs(role), &granted, now);
        let record = record.map_err(|cause| LiveError::Statistics { path, cause })?;
        Ok(Self { rate: FixedRate::recording_in(record, grid, Monotonic), parent: getppid(), check_at: Stamp(0) })
    }

    /// Waits for the next grid point: the "now" of the cycle.
    pub(super) fn wait(&mut self) -> Stamp {
        self.rate.wait().now
    }

    /// Records how old the inputs were that the cycle at `now` has read, by their headers.
    pub(super) fn heard(&self, now: Stamp, inputs: &[Header]) {
        for (index, header) in inputs.iter().enumerate().filter(|(_, header)| header.heard()) {
            self.rate.recorder().age(index, now.0.saturating_sub(header.stamp.0));
        }
    }

    /// Runs `cycle` on every grid point until there is a reason to leave. It answers with what it has heard.
    pub(super) fn run<const N: usize>(mut self, mut cycle: impl FnMut(Stamp) -> [Header; N]) -> Leaving {
        loop {
            let now = self.wait();
            let heard = cycle(now);
            self.heard(now, &heard);
            if now >= self.check_at {
                self.check_at = now.after(PARENT_CHECK);
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

/// What the host grants the calling thread for its role.
fn granted(cell: &Cell, role: Role) -> Result<Granted, LiveError> {
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
fn tell(role: Role, granted: &Granted) {
    for notice in granted.notices.iter() {
        // Standard error may be closed; `tandem doctor` says the same.
        let _ = match role {
            // A role's own lines are marked by the parent.
            Role::Supervisor => writeln!(io::stderr(), "{}: {notice}", role.name()),
            _ => writeln!(io::stderr(), "{notice}"),
        };
    }
}
