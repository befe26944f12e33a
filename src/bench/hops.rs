//! From sensor to arm in a live cell, hop by hop, by the stamps of its messages and the statistics of its loops.
//!
//! ```text
//! plant measures ─▶ controller reads ─▶ publishes its command ─▶ plant applies it
//!      stamp       age of arm/state     wake-up + cycle        age of arm/command
//! ```
//! On a time-triggered grid the ages are designed: they follow from the phases in the cell file. What is above the design
//! is delay.

use std::path::Path;
use std::time::Duration;

use tandem_bus::Read as _;
use tandem_config::Cell;
use tandem_cycle::stats::Snapshot;
use tandem_cycle::{FixedRate, Grid, Histogram, Monotonic};
use tandem_msg::{JointState, Role, Stamp};

use super::cell::{LiveCell, Seat, converted, snapshot};
use super::series::histogram;
use super::{BenchError, Options, Report, Series, loops};
use crate::roles::service;

const STATE: &str = "age of arm/state in the controller";
const WAKE: &str = "controller's wake-up";
const CYCLE: &str = "controller's cycle";
const COMMAND: &str = "age of arm/command in the plant";
const WHOLE: &str = "sensor stamp to applied";

pub(super) fn run(file: &Path, options: &Options, report: &mut Report) -> Result<(), BenchError> {
    let config = Cell::load(file, None).map_err(BenchError::Config)?;
    let [plant, controller] = [Role::Plant, Role::Controller].map(|role| config.timing.of(role));
    let grid = |period, phase| Grid::new(period, phase).map_err(|error| BenchError::Refused(error.to_string()));
    let sensing = grid(plant.period, plant.phase)?;
    let (period, phase) = (plant.period.as_nanos() as u64, plant.phase.as_nanos() as u64);
    let ahead = controller.phase.as_nanos() as u64;

    let cell = LiveCell::start(file, 1)?;
    let seat = cell.seat();
    let statistics = [seat.statistics(Role::Plant)?, seat.statistics(Role::Controller)?];
    let mut all = [STATE, WAKE, CYCLE, COMMAND, WHOLE].map(Series::new);
    let mut braking = 0;
    for _ in 0..options.rounds {
        let before = statistics.each_ref().map(snapshot);
        let (whole, without) =
            loops::set_up(None, &mut report.conditions.clone(), || listen(seat, &sensing, options.time))??;
        let [plant, controller] = statistics.each_ref().map(snapshot);
        braking += without;
        let [state, wake, cycle, command, sum] = &mut all;
        state.add(age(service::ARM_STATE, &before[1], &controller));
        wake.add(converted(&controller.record.lateness.since(&before[1].record.lateness)));
        cycle.add(converted(&controller.record.busy.since(&before[1].record.busy)));
        command.add(age(service::ARM_COMMAND, &before[0], &plant));
        sum.add(whole);
    }
    let us = |ns: u64| ns as f64 / 1e3;
    let state = (ahead + period - phase) % period;
    let designed = [(STATE, us(state)), (COMMAND, us(period - state)), (WHOLE, us(period))];
    report.note(format!(
        "live cell: by the grid arm/state is {:.0} µs old in the controller, a command {:.0} µs in the plant; {braking} states \
         without a command",
        us(state),
        us(period - state)
    ));
    all.into_iter().for_each(|series| report.add(series));
    for (case, value) in designed {
        report.compare_with(case, "the grid's design", value);
    }
    report.compare(WAKE, None);
    report.compare(CYCLE, None);
    Ok(())
}

/// Ages of an input that came between two looks.
fn age(input: &str, before: &Snapshot, after: &Snapshot) -> hdrhistogram::Histogram<u64> {
    let at = after.inputs.iter().position(|known| known.name.as_str() == input);
    let ages = at.map(|at| after.inputs[at].age.since(&before.inputs[at].age));
    converted(&ages.unwrap_or_else(Histogram::default))
}

/// Reads each state of the arm as it is published, between the cycles of plant and controller. Of each: from the sensor
/// stamp its command was computed from to the instant it was applied. The second: states with no command in force.
fn listen(cell: &Seat, sensing: &Grid, time: Duration) -> Result<(hdrhistogram::Histogram<u64>, u64), BenchError> {
    let node = cell.join();
    let mut arm = node.latest::<JointState>(service::ARM_STATE)?;
    let mut whole = histogram();
    let (mut last, mut without) = (0, 0);
    // Half a period after the plant.
    let phase = (sensing.phase() + sensing.period() / 2).as_nanos() % sensing.period().as_nanos();
    let grid = Grid::new(sensing.period(), Duration::from_nanos(phase as u64));
    let mut rate = FixedRate::new(grid.map_err(|error| BenchError::Refused(error.to_string()))?, Monotonic);
    let end = loops::now().after(time);
    while rate.wait().now < end {
        let state = arm.read();
        if state.header.seq == last {
            continue;
        }
        last = state.header.seq;
        if state.command_seq == 0 {
            without += 1;
            continue;
        }
        let sensed: Stamp = sensing.at_or_before(state.command_stamp);
        whole.saturating_record(state.header.stamp.0.saturating_sub(sensed.0));
    }
    Ok((whole, without))
}
