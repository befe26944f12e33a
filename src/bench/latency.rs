//! What a message costs, and how long a cell takes from sensor to arm.

use super::exchange::{Exchange, Way};
use super::{BenchError, Options, Report, Series, hops, loops};

/// A hypervisor moves processors, which changes every way by the same factor, more often than once in a round of seconds:
/// so the ways take turns this many times in one.
const TURNS: u32 = 8;

pub(super) fn run(options: &Options, report: &mut Report) -> Result<(), BenchError> {
    round_trips(options, report)?;
    if let Some(cell) = &options.cell {
        hops::run(cell, options, report)?;
    }
    Ok(())
}

/// All ways in turns, each with the other process of its own.
fn round_trips(options: &Options, report: &mut Report) -> Result<(), BenchError> {
    let cpu = loops::processor(options.cpu);
    if loops::other_processor(cpu).is_none() {
        report.note("round trips need two processors, so they are absent");
        return Ok(());
    }
    report.note("round trips of 96 bytes between two processes, each under SCHED_FIFO on a processor of its own; one clock reading in each");
    let mut all: Vec<(Way, Series)> = Way::ALL.iter().map(|way| (*way, Series::new(way.case()))).collect();
    for _ in 0..options.rounds * TURNS {
        for (way, series) in &mut all {
            series.add(Exchange::new(*way, cpu)?.round(options.time / TURNS, &mut report.conditions)?);
        }
    }
    all.into_iter().for_each(|(_, series)| report.add(series));
    for way in [Way::Futex, Way::Iceoryx, Way::Blackboard] {
        report.compare(way.case(), Some(Way::Raw.case()));
    }
    report.compare(Way::Bus.case(), Some(Way::Iceoryx.case()));
    report.compare(Way::Bus.case(), Some(Way::Raw.case()));
    Ok(())
}
