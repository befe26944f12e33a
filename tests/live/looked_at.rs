//! A running cell, looked at and measured from outside.

use std::process::Stdio;

use rustix::process::Signal;
use serde_json::Value;

use crate::harness::Place;

/// What a command prints, an object a line.
fn objects(place: &Place, arguments: &[&str]) -> (Option<i32>, Vec<Value>) {
    let output = place.command().args(arguments).stderr(Stdio::inherit()).output().expect("the binary starts");
    let text = String::from_utf8(output.stdout).expect("text");
    let lines = text.lines().map(|line| serde_json::from_str(line).expect("an object a line"));
    (output.status.code(), lines.collect())
}

/// Found by its file, its name or by being the only one; every loop shows its rate, its lateness and its set-up; when it
/// has ended, it is not running.
#[test]
fn a_running_cell_shows_its_loops_its_step_and_its_arm() {
    let place = Place::new();
    let mut cell = place.start(11);
    cell.until_moving();
    for wanted in [&["config/cells/s471.toml"][..], &["s471"], &[]] {
        let (code, seen) = objects(&place, &[&["status", "--json"][..], wanted].concat());
        assert_eq!(code, Some(0), "{wanted:?}");
        let [seen] = seen.as_slice() else { panic!("one object: {seen:?}") };
        assert_eq!((&seen["event"], &seen["product"]), (&"status".into(), &"s471".into()), "{seen}");
        assert_eq!((&seen["step"]["number"], &seen["motion"]["stop"]), (&1.into(), &"running".into()), "{seen}");
        assert_eq!(seen["arm"]["position_rad"].as_array().map(Vec::len), Some(6), "{seen}");
        let loops = seen["loops"].as_array().expect("a list");
        let roles: Vec<&str> = loops.iter().filter_map(|one| one["role"].as_str()).collect();
        assert_eq!(roles, ["supervisor", "plant", "perception", "controller"], "{seen}");
        for one in loops {
            assert!(one["rate_hz"].as_f64().is_some_and(|rate| rate > 0.0), "{one}");
            assert!(one["lateness"]["max_us"].as_f64() >= one["lateness"]["p50_us"].as_f64(), "{one}");
            assert!(one["inputs"].as_array().is_some_and(|inputs| !inputs.is_empty()), "{one}");
        }
    }
    let (code, _) = objects(&place, &["status", "s472"]);
    assert_eq!(code, Some(4), "another cell than the one that runs");
    cell.signal(Signal::TERM);
    cell.end();
    let (code, _) = objects(&place, &["status", "s471"]);
    assert_eq!(code, Some(4), "it has ended");
}

/// The parts of the benches that need a cell, once and briefly: they leave nothing behind.
#[test]
fn the_benches_measure_a_live_cell_and_leave_nothing() {
    let place = Place::new();
    for (bench, cases) in [
        ("jitter", ["controller of a live cell", "bare loop beside the cell", "the same, read at 100 Hz"]),
        ("latency", ["age of arm/state in the controller", "controller's cycle", "sensor stamp to applied"]),
        (
            "recovery",
            [
                "last good command to slowing",
                "kill to the successor's first command",
                "SIGSTOP to its end by the warden's hand",
            ],
        ),
    ] {
        let (code, printed) = objects(&place, &["bench", bench, "--seconds", "0.1", "--rounds", "1", "--json"]);
        assert_eq!(code, Some(0), "{bench}: {printed:?}");
        for case in cases {
            let found = printed.iter().find(|line| line["event"] == "series" && line["case"] == case);
            assert!(
                found.is_some_and(|line| line["samples"].as_u64() > Some(0)),
                "{bench}: no {case:?} in {printed:?}"
            );
        }
        assert!(place.is_deserted(), "{bench}");
        assert_eq!(place.run_directories(), Vec::<std::path::PathBuf>::new(), "{bench}");
    }
}

/// The long ones, briefly: every kind of death once in two cells; some seconds of a cell, live at 4 kHz and in lockstep.
/// What is counted must hold; how late a loop was is the machine's affair.
#[test]
fn what_is_counted_in_a_long_run_holds() {
    let place = Place::new();
    let cases: [(&[&str], &[&str]); 3] = [
        (
            &["bench", "soak", "--kills", "10"],
            &[
                "failed starts, replacements and ends",
                "a supervisor's descriptors, growth",
                "a cell's names in shared memory, growth",
                "a cell's files, growth",
                "run directories, growth in all",
                "descriptors of the bench, growth in all",
            ],
        ),
        (
            &["bench", "endurance", "--cycles", "20000", "--period-us", "250"],
            &[
                "commands published less cycles run",
                "states of the arm published less cycles run",
                "allocations, all warm cycles",
                "page faults, all warm cycles",
                "system calls a cycle",
            ],
        ),
        (
            &["bench", "endurance", "--cycles", "20000", "--lockstep"],
            &[
                "commands, lost",
                "commands, repeated",
                "states of the arm, lost",
                "states of the arm, repeated",
                "commands used twice by the plant",
            ],
        ),
    ];
    for (arguments, counted) in cases {
        let (_, printed) = objects(&place, &[arguments, &["--json"]].concat());
        for what in counted {
            let found = printed.iter().find(|line| line["event"] == "finding" && line["what"] == *what);
            assert!(found.is_some_and(|line| line["holds"] == true), "{arguments:?}: {what}: {printed:?}");
        }
        assert!(place.is_deserted(), "{arguments:?}");
        assert_eq!(place.run_directories(), Vec::<std::path::PathBuf>::new(), "{arguments:?}");
    }
}
