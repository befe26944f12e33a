#![allow(clippy::disallowed_types, clippy::disallowed_macros)] // Reason: files and messages of tests.

use core::borrow::Borrow;
use core::time::Duration;
use std::path::{Path, PathBuf};

use tandem_msg::{Role, Stamp};

use super::*;
use crate::overrun::Beginning;
use crate::setup::Granted;
use crate::{FixedRate, Grid, Monotonic, Pace, SharedRecord};

/// A file of its own for a test, removed at its end.
struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str) -> Self {
        Self(std::env::temp_dir().join(format!("tandem-stats-{}-{name}", std::process::id())))
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
    }
}

fn grid() -> Grid {
    Grid::new(Duration::from_millis(1), Duration::from_micros(200)).expect("in range")
}

fn writer(path: &Path, epoch: u64) -> Writer {
    let granted = Granted { priority: Some(80), ..Granted::default() };
    Writer::create(path, Role::Controller, epoch, &grid(), &["arm/state"], &granted, Stamp(7)).expect("writable")
}

fn begun(missed: u64) -> Beginning {
    Beginning { now: Stamp(0), missed, left_out: 0, caught_up: false, overloaded: false }
}

fn snapshot(reader: &Reader) -> Snapshot {
    let mut snapshot = Snapshot::default();
    reader.read(&mut snapshot).expect("an incarnation is at work");
    snapshot
}

/// What a loop records is what a reader sees, while the loop runs.
#[test]
fn a_reader_sees_what_the_loop_records() {
    let file = Scratch::new("sees");
    let mut rate = FixedRate::recording_in(writer(&file.0, 3), grid(), Monotonic, Pace::default());
    let reader = Reader::open(&file.0).expect("it is there");
    for cycle in 1..=20_u64 {
        rate.wait();
        rate.recorder().age(0, 800_000);
        let seen = snapshot(&reader);
        assert_eq!(
            (seen.record.cycles, seen.record.lateness.total(), seen.record.busy.total()),
            (cycle, cycle, cycle - 1)
        );
        assert_eq!((seen.inputs[0].age.total(), seen.inputs[0].age.max_ns()), (cycle, 800_000));
    }
    let seen = snapshot(&reader);
    assert_eq!(
        (seen.role.get(), seen.epoch, seen.pid, seen.started),
        (Some(Role::Controller), 3, std::process::id(), Stamp(7))
    );
    assert_eq!((seen.period, seen.phase), (Duration::from_millis(1), Duration::from_micros(200)));
    assert_eq!((seen.inputs[0].name.as_str(), seen.inputs[1].name.as_str()), ("arm/state", ""));
    assert_eq!((seen.obtained.priority, seen.obtained.cpu), (Some(80), None));
}

/// A reader keeps its mapping over a restart of the writer, sees the new epoch, and nothing that was counted is lost.
#[test]
fn a_successor_counts_on() {
    let file = Scratch::new("successor");
    let first = writer(&file.0, 1);
    let record: &SharedRecord = first.borrow();
    (0..5).for_each(|_| record.cycle_began(10, &begun(2)));
    first.guarded(&Guarded { cycles: 5, allocations: 1, system_calls: 5, ..Guarded::default() });
    let reader = Reader::open(&file.0).expect("it is there");
    assert_eq!(snapshot(&reader).guarded.system_calls, 5);
    drop(first);
    assert_eq!(snapshot(&reader).record.cycles, 5, "the dead one's record stays readable");

    let second = writer(&file.0, 2);
    let record: &SharedRecord = second.borrow();
    record.cycle_began(10, &begun(0));
    let seen = snapshot(&reader);
    assert_eq!((seen.epoch, seen.record.cycles, seen.record.missed), (2, 1, 0));
    assert_eq!(seen.earlier, Earlier { incarnations: 1, cycles: 5, missed: 10, ..Earlier::default() });
    assert_eq!((seen.guarded.cycles, seen.guarded.allocations), (0, 0));
}

#[test]
fn a_file_of_another_build_is_refused() {
    let file = Scratch::new("foreign");
    assert!(matches!(Reader::open(&file.0), Err(OpenError::Io(_))));
    std::fs::write(&file.0, [1; 100]).expect("writable");
    assert!(matches!(Reader::open(&file.0), Err(OpenError::OtherBuild)));
}

/// Readers that copy without pause while incarnations come and go never see two of them mixed: every incarnation of this
/// test counts only ages of its own epoch.
#[test]
fn a_snapshot_is_of_one_incarnation() {
    let file = Scratch::new("mixed");
    drop(writer(&file.0, 1));
    let reader = Reader::open(&file.0).expect("it is there");
    let done = core::sync::atomic::AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut seen = Snapshot::default();
            while !done.load(core::sync::atomic::Ordering::Relaxed) {
                if reader.read(&mut seen).is_ok() && seen.inputs[0].age.total() > 0 {
                    assert_eq!(seen.inputs[0].age.max_ns(), seen.epoch);
                    assert_eq!(seen.inputs[0].age.buckets().count(), 1);
                }
            }
        });
        for epoch in 2..200 {
            let writer = writer(&file.0, epoch);
            (0..50).for_each(|_| writer.age(0, epoch));
        }
        done.store(true, core::sync::atomic::Ordering::Relaxed);
    });
}

#[test]
fn a_text_that_is_too_long_is_cut_between_letters() {
    let letters: page::Letters<4> = page::Letters::default();
    letters.set("aéü");
    assert_eq!(letters.text().as_str(), "aé");
}
