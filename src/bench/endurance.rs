//! A million cycles: whether a cell is at the end as it was at the beginning.
//!
//! In lockstep nothing may be lost or computed twice, at all. Live, a number may be passed over or used again only where
//! a loop has counted a grid point as missed or late; and no loop may ask the system for anything in its cycles.

use std::path::Path;
use std::time::Duration;

use tandem_bus::Read as _;
use tandem_config::Cell;
use tandem_cycle::stats::{Reader, Snapshot};
use tandem_cycle::{FixedRate, Grid, Histogram, Monotonic};
use tandem_msg::{JointCommand, JointState, Role};

use super::cell::{LiveCell, Scratch, converted, snapshot};
use super::rehearsal::{Rehearsal, Rests};
use super::series::histogram;
use super::{BenchError, Options, Report, Series, loops};
use crate::roles::service;

/// The run is looked at in so many parts.
const PARTS: usize = 10;
/// The last part may be so much slower than the first.
const GROWTH_MAX: f64 = 1.1;
/// The share of the system that a cycle may ask for: its wait, and a question to the kernel now and then.
const SYSTEM_CALLS_MAX: f64 = 2.0;

/// More boxes than there is time for.
const BOXES: u32 = 1_000;
const SEED: u64 = 1;
/// What is not heard by then is not there.
const PATIENCE: Duration = Duration::from_secs(5);

/// Which shell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shell {
    /// Processes on the real clock.
    Live,
    /// One process on a virtual clock.
    Lockstep,
}

/// How numbers came, one after another.
#[derive(Clone, Copy, Debug, Default)]
struct Chain {
    last: u64,
    heard: u64,
    lost: u64,
    repeated: u64,
}

impl Chain {
    /// The next number, of which each is `step` above the one before; 0 is none.
    fn take(&mut self, number: u64, step: u64) {
        if self.last > 0 && number > 0 {
            self.heard += 1;
            match number.saturating_sub(self.last) {
                0 => self.repeated += 1,
                ahead => self.lost += (ahead / step).saturating_sub(1),
            }
        }
        self.last = number;
    }
}

/// What to run, and for how long.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Endurance {
    /// In which shell.
    pub shell: Shell,
    /// Cycles of the controller.
    pub cycles: u64,
    /// Period of the controller instead of the cell file's.
    pub period: Option<Duration>,
}

pub(super) fn run(wanted: Endurance, options: &Options, report: &mut Report) -> Result<(), BenchError> {
    let Some(file) = &options.cell else {
        report.note("it is a cell that endures, and none was named");
        return Ok(());
    };
    let scratch = Scratch::new()?;
    let file = match wanted.period {
        Some(period) => &scratch.cell_at(file, period)?,
        None => file,
    };
    let cell = Cell::load(file, None).map_err(BenchError::Config)?;
    match wanted.shell {
        Shell::Live => live(file, &cell, wanted.cycles, options, report),
        Shell::Lockstep => lockstep(file, &cell, wanted.cycles, options, report),
    }
}

/// Commands for each state of the arm: both are published once a cycle.
fn ratio(cell: &Cell) -> u64 {
    let [plant, controller] = [Role::Plant, Role::Controller].map(|role| cell.timing.of(role).period.as_nanos() as u64);
    (plant / controller).max(1)
}

fn live(file: &Path, cell: &Cell, cycles: u64, options: &Options, report: &mut Report) -> Result<(), BenchError> {
    let running = LiveCell::start(file, SEED)?;
    let seat = running.seat();
    let statistics = [Role::Controller, Role::Plant].map(|role| seat.statistics(role));
    let [controller, plant] = statistics;
    let (controller, plant) = (controller?, plant?);
    let schedule = cell.timing.of(Role::Plant);
    let grid = |phase: Duration| {
        let phase = Duration::from_nanos((phase.as_nanos() % schedule.period.as_nanos()) as u64);
        Grid::new(schedule.period, phase).map_err(|error| BenchError::Refused(error.to_string()))
    };
    // Between the cycles of the plant.
    let grid = grid(schedule.phase + schedule.period / 2)?;
    let (first, first_of_plant) = (snapshot(&controller), snapshot(&plant));
    let mut parts = vec![first.clone()];
    let heard = loops::set_up(None, &mut report.conditions, || {
        let node = seat.join();
        let mut arm = node.latest::<JointState>(service::ARM_STATE)?;
        let (mut states, mut applied) = (Chain::default(), Chain::default());
        let mut rate = FixedRate::new(grid, Monotonic);
        for part in 1..=PARTS as u64 {
            let end = first.record.cycles + cycles * part / PARTS as u64;
            while controller.cycles() < end {
                rate.wait();
                if controller.epoch() != first.epoch {
                    return Ok(None);
                }
                let state = arm.read();
                // A state that was not heard says nothing about the command it answered to.
                let follows = state.header.seq == states.last + 1;
                states.take(state.header.seq, 1);
                if follows {
                    applied.take(state.command_seq, ratio(cell));
                } else {
                    applied.last = state.command_seq;
                }
            }
            parts.push(snapshot(&controller));
            (options.tell)(&format!("{part} of {PARTS}: {} cycles", controller.cycles() - first.record.cycles));
        }
        Ok::<_, BenchError>(Some((states, applied)))
    })??;
    let Some((states, applied)) = heard else {
        let told = running.wait_for("fault", |_| true)?;
        return Err(BenchError::peer("the live cell", format!("did not endure: {told}")));
    };
    // A number is published a cycle, from the first on: what was published and what was counted is the same.
    let node = seat.join();
    let mut command = node.latest::<JointCommand>(service::ARM_COMMAND)?;
    let mut arm = node.latest::<JointState>(service::ARM_STATE)?;
    command.wait(PATIENCE);
    arm.wait(PATIENCE);
    let unpublished = |seq: u64, reader: &Reader, before: u64| {
        // Between the two readings some cycles pass.
        let passed = [before, reader.cycles()];
        if passed[0].saturating_sub(1) <= seq && seq <= passed[1] { 0.0 } else { passed[1] as f64 - seq as f64 }
    };
    let before = [controller.cycles(), plant.cycles()];
    let commands = unpublished(command.read().header.seq, &controller, before[0]);
    let measured = unpublished(arm.read().header.seq, &plant, before[1]);
    let (last, last_of_plant) = (snapshot(&controller), snapshot(&plant));
    report.finding("commands published less cycles run", commands, Some(0.0), "");
    report.finding("states of the arm published less cycles run", measured, Some(0.0), "");
    let late = passed_over(&first, &last) + passed_over(&first_of_plant, &last_of_plant);
    report.finding("grid points missed and cycles late, both loops", late as f64, None, "");
    report.finding("commands passed over by the plant", applied.lost as f64, Some(late as f64), "");
    report.finding("commands used twice by the plant", applied.repeated as f64, Some(late as f64), "");
    report.finding("states heard", states.heard as f64, None, "");
    guarded(&last, report);
    deciles(&parts, report);
    for (who, first, last) in [("controller", &first, &last), ("plant", &first_of_plant, &last_of_plant)] {
        report.note(explained(who, first, last));
    }
    Ok(())
}

/// Where a number may have been passed over: grid points missed, and cycles that woke too late for those who wait for them.
fn passed_over(before: &Snapshot, after: &Snapshot) -> u64 {
    let late = |snapshot: &Snapshot| {
        let slack = snapshot.period.as_nanos() as u64 / 2;
        snapshot.record.lateness.buckets().filter(|(value, _)| *value > slack).map(|(_, count)| count).sum::<u64>()
    };
    let counted = |snapshot: &Snapshot| snapshot.record.missed + snapshot.record.overruns + late(snapshot);
    counted(after) - counted(before)
}

/// The grid points a loop has missed, and of what: a wake-up more than a period late is the machine's doing, a cycle longer
/// than a period the role's.
fn explained(who: &str, before: &Snapshot, after: &Snapshot) -> String {
    let lateness = after.record.lateness.since(&before.record.lateness);
    let period = after.period.as_nanos() as u64;
    let overslept: u64 = lateness.buckets().filter(|(value, _)| *value > period).map(|(_, count)| count).sum();
    format!(
        "{who}: {} cycles at {} Hz, {} grid points missed: in {overslept} wake-ups more than a period late, the latest by \
         {:.1} ms, and {} cycles longer than a period",
        after.record.cycles - before.record.cycles,
        1.0 / after.period.as_secs_f64(),
        after.record.missed - before.record.missed,
        lateness.max_ns() as f64 / 1e6,
        after.record.overruns - before.record.overruns,
    )
}

/// What the controller's thread asked of the system, a cycle.
fn guarded(last: &Snapshot, report: &mut Report) {
    let guarded = &last.guarded;
    let share = |count: u64| count as f64 / guarded.cycles.max(1) as f64;
    report.finding("allocations, all warm cycles", guarded.allocations as f64, Some(0.0), "");
    report.finding("page faults, all warm cycles", (guarded.minor_faults + guarded.major_faults) as f64, Some(0.0), "");
    report.finding("system calls a cycle", share(guarded.system_calls), Some(SYSTEM_CALLS_MAX), "");
    report.finding("preemptions a cycle", share(guarded.preemptions), None, "");
}

/// Lateness and time of each tenth, and the last beside the first.
fn deciles(parts: &[Box<Snapshot>], report: &mut Report) {
    let pairs: Vec<_> = parts.windows(2).map(|pair| (&pair[0].record, &pair[1].record)).collect();
    let (Some(first), Some(last)) = (pairs.first(), pairs.last()) else { return };
    let mut compared = |what: &str, of: fn(&tandem_cycle::Record) -> &Histogram| {
        let p99 =
            |pair: &(&tandem_cycle::Record, &tandem_cycle::Record)| of(pair.1).since(of(pair.0)).quantile_ns(0.99);
        let mut series = Series::new(format!("{what}, a tenth"));
        pairs.iter().for_each(|pair| series.add(converted(&of(pair.1).since(of(pair.0)))));
        report.add(series);
        let grown = p99(last) as f64 / p99(first).max(1) as f64;
        report.finding(format!("{what}, p99 of the last tenth by the first's"), grown, Some(GROWTH_MAX), "");
    };
    compared("controller's wake-up", |record| &record.lateness);
    compared("controller's cycle", |record| &record.busy);
}

fn lockstep(file: &Path, cell: &Cell, cycles: u64, options: &Options, report: &mut Report) -> Result<(), BenchError> {
    let run = Rehearsal::new(file, cell, BOXES, SEED)?;
    let mut parts = Vec::new();
    let (mut states, mut commands, mut applied) = (Chain::default(), Chain::default(), Chain::default());
    loops::set_up(loops::processor(options.cpu), &mut report.conditions, || {
        let mut sim = run.cell(cell, BOXES, SEED)?;
        let mut state = sim.listen::<JointState>(service::ARM_STATE);
        let mut command = sim.listen::<JointCommand>(service::ARM_COMMAND);
        let mut rests = Rests::begin();
        for part in 1..=PARTS as u64 {
            let mut times = histogram();
            while times.len() < cycles * part / PARTS as u64 - cycles * (part - 1) / PARTS as u64 {
                let before = loops::now();
                let outcome = sim.step(run.store(), &mut |_| {}).map_err(|error| run.refused(&error))?;
                let after = loops::now();
                match sim.role() {
                    Role::Controller => {
                        times.saturating_record(after.0 - before.0);
                        commands.take(command.read().header.seq, 1);
                    }
                    Role::Plant => {
                        states.take(state.read().header.seq, 1);
                        applied.take(state.held().command_seq, ratio(cell));
                    }
                    _ => {}
                }
                if outcome.is_some() {
                    return Err(BenchError::peer("the cell", "has ended before its cycles were run"));
                }
                rests.take();
            }
            parts.push(times);
            (options.tell)(&format!("{part} of {PARTS}: {:.0} s of the cell", sim.now().as_secs_f64()));
        }
        Ok(())
    })??;
    for (what, chain) in [("commands", commands), ("states of the arm", states)] {
        report.finding(format!("{what}, heard"), chain.heard as f64, None, "");
        report.finding(format!("{what}, lost"), chain.lost as f64, Some(0.0), "");
        report.finding(format!("{what}, repeated"), chain.repeated as f64, Some(0.0), "");
    }
    report.finding("commands passed over by the plant", applied.lost as f64, Some(0.0), "");
    report.finding("commands used twice by the plant", applied.repeated as f64, Some(0.0), "");
    let p99 = |part: &hdrhistogram::Histogram<u64>| part.value_at_quantile(0.99) as f64;
    if let (Some(first), Some(last)) = (parts.first(), parts.last()) {
        report.finding(
            "controller's cycle, p99 of the last tenth by the first's",
            p99(last) / p99(first),
            Some(GROWTH_MAX),
            "",
        );
    }
    let mut series = Series::new("controller's cycle, a tenth");
    parts.into_iter().for_each(|part| series.add(part));
    report.add(series);
    Ok(())
}
