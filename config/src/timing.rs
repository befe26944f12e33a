//! When each role runs, and what is asked of the operating system.

use crate::read::{Bound, Table, bound};
use core::time::Duration;
use tandem_msg::{Coded, Role};

const PERIOD: Bound = bound("period_us", "us", 250.0, 1_000_000.0);
const PHASE: Bound = bound("phase_us", "us", 0.0, 999_999.0);
const LIMIT: Bound = bound("overrun_limit", "", 1.0, 1_000_000.0);
const OVERRUN: &str = "overrun";
const SPIN_MAX: Bound = bound("spin_max_us", "us", 1.0, 1_000.0);
const DMA_LATENCY: Bound = bound("cpu_dma_latency_us", "us", 0.0, 1_000_000.0);
const PRIORITY: Bound = bound("priority", "", 1.0, 98.0);
const CPU: Bound = bound("cpu", "", 0.0, 1023.0);

/// The shared time grid: a role with period P and phase F runs at instants t with t mod P = F.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Schedule {
    /// Spacing of the cycles.
    pub period: Duration,
    /// Offset on the grid, below the period.
    pub phase: Duration,
    /// What is done about grid points that pass while the role is busy.
    pub overrun: Overrun,
}

/// Policies for grid points that pass while a role is busy.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum OverrunPolicy {
    /// They are missed.
    Skip,
    /// They are run late, one after another.
    CatchUp,
    /// They are missed, and the role runs at a fraction of its rate until it keeps its time.
    Degrade,
    /// They are missed, and too many of them end the role's process, which is then started anew.
    Stop,
}

impl Coded for OverrunPolicy {
    const ALL: &'static [Self] = &[Self::Skip, Self::CatchUp, Self::Degrade, Self::Stop];
    fn code(self) -> u32 {
        self as u32
    }
    fn name(self) -> &'static str {
        match self {
            Self::Skip => "skip",
            Self::CatchUp => "catch_up",
            Self::Degrade => "degrade",
            Self::Stop => "stop",
        }
    }
}

/// A policy with its limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Overrun {
    /// What is done.
    pub policy: OverrunPolicy,
    /// `CatchUp`: late cycles in a row at most. `Degrade`: divisor of the rate at most. `Stop`: missed points the
    /// leaky bucket holds. Not used by `Skip`.
    pub limit: u32,
}

impl Overrun {
    const SKIP: Self = Self { policy: OverrunPolicy::Skip, limit: 0 };

    fn read(table: &Table<'_>) -> Self {
        match table.named_if(OVERRUN).unwrap_or(OverrunPolicy::Skip) {
            OverrunPolicy::Skip if table.has(LIMIT.key) => {
                table.refuse(LIMIT.key, "a limit", "none", "nothing is limited when points are skipped: remove it");
                Self::SKIP
            }
            OverrunPolicy::Skip => Self::SKIP,
            policy => Self { policy, limit: table.whole(&LIMIT) },
        }
    }
}

/// The schedule of each role.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Timing {
    /// The hardware, or what stands for it.
    pub plant: Schedule,
    /// The motion controller.
    pub controller: Schedule,
    /// Who decides.
    pub supervisor: Schedule,
    /// Who sees.
    pub perception: Schedule,
}

impl Timing {
    /// The schedule of one role.
    pub fn of(&self, role: Role) -> Schedule {
        match role {
            Role::Supervisor => self.supervisor,
            Role::Plant => self.plant,
            Role::Perception => self.perception,
            Role::Controller => self.controller,
        }
    }

    pub(crate) fn read(cell: &Table<'_>) -> Self {
        let table = cell.table("timing");
        let role = |name: &str| {
            let Some(table) = table.as_ref().and_then(|table| table.table(name)) else {
                return Schedule { period: Duration::from_millis(1), phase: Duration::ZERO, overrun: Overrun::SKIP };
            };
            let (period, phase) = (table.whole(&PERIOD), table.whole(&PHASE));
            if phase >= period {
                let allowed = format!("0..={} us", period - 1);
                table.refuse(PHASE.key, &format!("{phase} us"), &allowed, "keep the phase below period_us");
            }
            Schedule {
                period: Duration::from_micros(period.into()),
                phase: Duration::from_micros(phase.into()),
                overrun: Overrun::read(&table),
            }
        };
        Self {
            plant: role("plant"),
            controller: role("controller"),
            supervisor: role("supervisor"),
            perception: role("perception"),
        }
    }
}

/// What to do when the host grants no realtime scheduling.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Policy {
    /// Take what is granted and say what is not.
    BestEffort,
    /// Refuse to start.
    Enforce,
}

impl Coded for Policy {
    const ALL: &'static [Self] = &[Self::BestEffort, Self::Enforce];
    fn code(self) -> u32 {
        self as u32
    }
    fn name(self) -> &'static str {
        match self {
            Self::BestEffort => "best_effort",
            Self::Enforce => "enforce",
        }
    }
}

/// Scheduling asked of the operating system, indexed by role code where it differs by role.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Realtime {
    /// What to do when it is not granted.
    pub policy: Policy,
    /// SCHED_FIFO priority of each role; `None` is the ordinary scheduler.
    pub priority: [Option<u8>; 4],
    /// Processor each role is pinned to, if any.
    pub cpu: [Option<u16>; 4],
    /// Longest time each role may spin before a grid point instead of sleeping; zero: it sleeps to the end.
    pub spin_max: [Duration; 4],
    /// What `/dev/cpu_dma_latency` is to be held at, microseconds, if at all.
    pub dma_latency_us: Option<u32>,
}

impl Realtime {
    pub(crate) fn read(cell: &Table<'_>) -> Self {
        let mut out = Self {
            policy: Policy::BestEffort,
            priority: [None; 4],
            cpu: [None; 4],
            spin_max: [Duration::ZERO; 4],
            dma_latency_us: None,
        };
        let Some(table) = cell.table("realtime") else {
            return out;
        };
        out.policy = table.named("policy").unwrap_or(Policy::BestEffort);
        out.dma_latency_us = table.has(DMA_LATENCY.key).then(|| table.whole(&DMA_LATENCY));
        for &role in Role::ALL {
            if !table.has(role.name()) {
                continue;
            }
            let Some(table) = table.table(role.name()) else {
                continue;
            };
            let index = role.code() as usize;
            out.priority[index] = table.has(PRIORITY.key).then(|| table.whole(&PRIORITY) as u8);
            out.cpu[index] = table.has(CPU.key).then(|| table.whole(&CPU) as u16);
            if table.has(SPIN_MAX.key) {
                out.spin_max[index] = Duration::from_micros(table.whole(&SPIN_MAX).into());
            }
        }
        out
    }
}
