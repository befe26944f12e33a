//! How late a loop wakes: cyclictest, a bare loop, ours without and with a spin tail, in turns on one processor; then the
//! controller of a live cell beside a bare loop in the same seconds; then that controller with a reader and without.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use tandem_msg::Role;

use super::cell::{LiveCell, Seat, converted, snapshot};
use super::series::histogram;
use super::{BenchError, Options, Report, Series, cyclictest, loops};
use crate::observe::{ObserveError, Observer};

const PERIOD: Duration = Duration::from_millis(1);
/// Between two looks of the reader.
const LOOK: Duration = Duration::from_millis(10);
const CYCLICTEST: &str = "cyclictest";
const BARE: &str = "bare loop";
const OURS: &str = "tandem's loop";
const SPINNING: &str = "tandem's loop with its spin tail";
/// Cycles until a spin tail is as long as was measured, and some.
const CALIBRATED: u64 = 520;
const CONTROLLER: &str = "controller of a live cell";
const BESIDE: &str = "bare loop beside the cell";
const READ: &str = "the same, read at 100 Hz";
const UNREAD: &str = "the same, not read";

pub(super) fn run(options: &Options, report: &mut Report) -> Result<(), BenchError> {
    report.note(format!(
        "wake-ups after their deadlines; every loop at {} Hz under SCHED_FIFO, its memory locked",
        1.0 / PERIOD.as_secs_f64()
    ));
    taking_turns(options, report)?;
    if let Some(cell) = &options.cell {
        in_a_cell(cell, options, report)?;
    }
    Ok(())
}

fn taking_turns(options: &Options, report: &mut Report) -> Result<(), BenchError> {
    let cpu = loops::processor(options.cpu);
    let [mut peer, mut bare, mut ours, mut spinning] = [CYCLICTEST, BARE, OURS, SPINNING].map(Series::new);
    let (mut missed, mut tails) = ([0; 2], Vec::new());
    let conditions = &mut report.conditions;
    for _ in 0..options.rounds {
        if let Some(round) = cyclictest::run(PERIOD, options.time, cpu)? {
            peer.add(round);
        }
        bare.add(loops::set_up(cpu, conditions, || {
            let mut lateness = histogram();
            loops::bare(PERIOD, options.time, |late| lateness.saturating_record(late));
            lateness
        })?);
        let kept = loops::set_up(cpu, conditions, || {
            loops::fixed_rate(loops::rate(PERIOD, Duration::ZERO), options.time, loops::WARM_UP)
        })?;
        ours.add(kept.lateness);
        // As long as it may be; how long it is, the loop measures.
        let spun = loops::set_up(cpu, conditions, || {
            loops::fixed_rate(loops::rate(PERIOD, PERIOD), options.time, CALIBRATED)
        })?;
        spinning.add(spun.lateness);
        missed = [missed[0] + kept.missed, missed[1] + spun.missed];
        tails.push(spun.tail.as_micros());
    }
    if peer.is_empty() {
        report.note(cyclictest::ABSENT);
    }
    report.note(format!(
        "grid points missed by tandem's loop: {}, with its spin tail of {tails:?} µs: {}",
        missed[0], missed[1]
    ));
    let baseline = if peer.is_empty() { BARE } else { CYCLICTEST };
    [peer, bare, ours, spinning].into_iter().for_each(|series| report.add(series));
    if baseline == CYCLICTEST {
        report.compare(BARE, Some(baseline));
    }
    report.compare(OURS, Some(baseline));
    report.compare(SPINNING, Some(baseline));
    Ok(())
}

/// Both loops of the same period and priority in the same seconds, free to run on any processor; then slices with
/// and without a reader, in turns, of one and the same process.
fn in_a_cell(file: &Path, options: &Options, report: &mut Report) -> Result<(), BenchError> {
    let cell = LiveCell::start(file, 1)?;
    let statistics = cell.seat().statistics(Role::Controller)?;
    let [mut controller, mut beside, mut read, mut unread] = [CONTROLLER, BESIDE, READ, UNREAD].map(Series::new);
    let (first, mut looks) = (snapshot(&statistics), 0);
    for _ in 0..options.rounds {
        let before = snapshot(&statistics);
        // Recorded as the cell's own loops are, so that both are known as exactly.
        let lateness = loops::set_up(None, &mut report.conditions.clone(), || {
            let mut lateness = tandem_cycle::Histogram::default();
            loops::bare(PERIOD, options.time, |late| lateness.record(late));
            lateness
        })?;
        let after = snapshot(&statistics);
        controller.add(converted(&after.record.lateness.since(&before.record.lateness)));
        beside.add(converted(&lateness));

        let before = snapshot(&statistics);
        thread::sleep(options.time);
        let between = snapshot(&statistics);
        looks += reading(cell.seat(), options.time)?;
        let after = snapshot(&statistics);
        unread.add(converted(&between.record.lateness.since(&before.record.lateness)));
        read.add(converted(&after.record.lateness.since(&between.record.lateness)));
    }
    let last = snapshot(&statistics);
    let cycles = last.record.cycles - first.record.cycles;
    report.note(format!(
        "live cell: {cycles} cycles of the controller, {} grid points missed, {} overruns; {looks} looks of the reader",
        last.record.missed - first.record.missed,
        last.record.overruns - first.record.overruns,
    ));
    [controller, beside, read, unread].into_iter().for_each(|series| report.add(series));
    report.compare(CONTROLLER, Some(BESIDE));
    report.compare(READ, Some(UNREAD));
    Ok(())
}

/// Looks at everything `tandem status` shows, a hundred times a second, for that long. How many looks that were.
fn reading(cell: &Seat, time: Duration) -> Result<u64, BenchError> {
    let done = AtomicBool::new(false);
    thread::scope(|scope| {
        let reader = scope.spawn(|| {
            let mut observer = Observer::open(cell.running().clone())?;
            let mut looks = 0;
            while !done.load(Ordering::Relaxed) {
                std::hint::black_box(observer.look(loops::now()));
                looks += 1;
                thread::sleep(LOOK);
            }
            Ok(looks)
        });
        thread::sleep(time);
        done.store(true, Ordering::Relaxed);
        let looks: Result<u64, ObserveError> =
            reader.join().map_err(|_| BenchError::peer("the reader", "has panicked; its message stands above"))?;
        looks.map_err(|error| BenchError::peer("the reader", error.to_string()))
    })
}
