//! The loop around a role's cycle, the same for all of them.
//!
//! What differs between roles is what a cycle reads, does and writes, and that is
//! a closure. What is the same is here: the grid, the statistics of the loop, and
//! when to leave.

use std::io::{self, Write as _};
use std::time::Duration;

use tandem_bus::Instance;
use tandem_config::{Cell, OverrunPolicy, Policy};
use tandem_cycle::guard::{self, Watch};
use tandem_cycle::setup::{self, Granted, Wish};
use tandem_cycle::stats::Writer;
use tandem_cycle::{Clock, FixedRate, Grid, Monotonic, Overrun, Pace, Tick};
use tandem_msg::{Coded, Header, Role, Stamp};

use super::{LiveError, signals, statistics};
use crate::roles::service;

/// One role's loop.
pub(super) struct Shell {
    rate: FixedRate<Monotonic, Writer>,
    role: Role,
    watch: Watch,
}

impl Shell {
    /// The loop of a thread that was set up ([`set_up`]); begins its statistics.
    pub(super) fn new(
        cell: &Cell,
        instance: &Instance,
        role: Role,
        epoch: u64,
        granted: &Granted,
    ) -> Result<Self, LiveError> {
        let schedule = cell.timing.of(role);
        let grid = Grid::new(schedule.period, schedule.phase).map_err(|cause| LiveError::Schedule { role, cause })?;
        let path = statistics::file(instance, role);
        let now = Monotonic.now();
        let record = Writer::create(&path, role, epoch, &grid, service::inputs(role), granted, now);
        let record = record.map_err(|cause| LiveError::Statistics { path, cause })?;
        let pace = Pace { overrun: overrun(schedule.overrun), spin_max: spin_max(cell, role, granted) };
        Ok(Self { role, rate: FixedRate::recording_in(record, grid, Monotonic, pace), watch: Watch::default() })
    }

    /// Waits for the next grid point and runs `cycle` for it, which answers with what it has heard.
    ///
    /// # Errors
    /// The loop cannot keep its time, and the cell file says that it is to be left.
    pub(super) fn step<const N: usize>(&mut self, cycle: impl FnOnce(Stamp) -> [Header; N]) -> Result<(), LiveError> {
        let Tick { now, overloaded, .. } = self.rate.wait();
        let (heard, calls) = guard::counted(|| cycle(now));
        let statistics = self.rate.recorder();
        for (index, header) in heard.iter().enumerate().filter(|(_, header)| header.heard()) {
            statistics.age(index, now.0.saturating_sub(header.stamp.0));
        }
        statistics.guarded(self.watch.cycle(now, calls));
        if overloaded { Err(LiveError::Overloaded { role: self.role }) } else { Ok(()) }
    }

    /// Runs `cycle` on every grid point until a signal asks for the end. When the supervisor is
    /// gone, the kernel ends the process.
    ///
    /// # Errors
    /// As [`Shell::step`].
    pub(super) fn run<const N: usize>(mut self, mut cycle: impl FnMut(Stamp) -> [Header; N]) -> Result<(), LiveError> {
        while signals::asked() == 0 {
            self.step(&mut cycle)?;
        }
        Ok(())
    }
}

fn overrun(asked: tandem_config::Overrun) -> Overrun {
    match asked.policy {
        OverrunPolicy::Skip => Overrun::Skip,
        OverrunPolicy::CatchUp => Overrun::CatchUp { in_a_row_max: asked.limit },
        OverrunPolicy::Degrade => Overrun::Degrade { divisor_max: asked.limit },
        OverrunPolicy::Stop => Overrun::Stop { bucket: asked.limit },
    }
}

/// How long a role may spin. Without SCHED_FIFO others would be run in between all the same; and one processor is
/// left to those that do not spin: those of the highest priority come first.
fn spin_max(cell: &Cell, role: Role, granted: &Granted) -> Duration {
    let spins = |other: &Role| !cell.realtime.spin_max[*other as usize].is_zero();
    let rank = |other: Role| (cell.realtime.priority[other as usize], other);
    let before = Role::ALL.iter().filter(|other| spins(other) && rank(**other) > rank(role)).count();
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    let allowed = granted.priority.is_some() && before + 1 < processors;
    if allowed { cell.realtime.spin_max[role as usize] } else { Duration::ZERO }
}

/// Sets the calling thread up as the cell file asks for that role; says on standard error what the host does not grant.
pub(super) fn set_up(cell: &Cell, role: Role) -> Result<Granted, LiveError> {
    let granted = setup::acquire(&wish(cell, role)).map_err(|denied| LiveError::Denied { role, denied })?;
    tell(role, &granted);
    Ok(granted)
}

/// Lets the calling thread run ahead of ordinary ones at the priority of that role, as far as the host grants it.
/// What is missing is told by the role itself.
pub(super) fn prefer(cell: &Cell, role: Role) {
    let policy = setup::Policy::BestEffort;
    let priority = cell.realtime.priority[role as usize];
    let _ = setup::acquire(&Wish { policy, priority, cpu: None, lock_memory: false, dma_latency_us: None });
}

fn wish(cell: &Cell, role: Role) -> Wish {
    let index = role as usize;
    let priority = cell.realtime.priority[index];
    Wish {
        policy: match cell.realtime.policy {
            Policy::Enforce => setup::Policy::Enforce,
            Policy::BestEffort => setup::Policy::BestEffort,
        },
        priority,
        cpu: cell.realtime.cpu[index].map(u32::from),
        // The supervisor shares its process with the store and the console, which may take their time.
        lock_memory: priority.is_some() && role != Role::Supervisor,
        dma_latency_us: priority.and(cell.realtime.dma_latency_us),
    }
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
