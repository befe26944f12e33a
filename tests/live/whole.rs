//! A whole box, as a newcomer would watch it.

use std::process::Stdio;

use crate::harness::Place;

const SEED: u64 = 1;

/// One box from the first part to the last: exit code 0, every step done and in the journal, no contact, nothing left.
#[test]
fn a_box_is_assembled_and_nothing_is_left() {
    let place = Place::new();
    let cell = place.start(SEED);
    let pid = cell.pid;
    let end = cell.end();
    assert_eq!(end.status.code(), Some(0), "{end:?}");
    let summary = end.summary();
    assert_eq!((&summary["boxes_completed"], &summary["contacts"]), (&1.into(), &0.into()), "{end:?}");
    let steps = end.of("step_done").len();
    assert_eq!(summary["steps_done"], steps, "{end:?}");
    assert!(end.of("fault").is_empty(), "{end:?}");
    place.assert_nothing_is_left(pid);
    assert_eq!(journal_lines(&place), steps, "each step has its line in the journal");
}

/// Lines of the only run's journal.
fn journal_lines(place: &Place) -> usize {
    let ask = |arguments: &[&str]| {
        let mut command = place.command();
        let output = command.arg("journal").args(arguments).args(["--json", "--store", &place.store(SEED)]);
        let output = output.stderr(Stdio::inherit()).output().expect("the binary starts");
        assert!(output.status.success(), "{arguments:?}: {output:?}");
        let text = String::from_utf8(output.stdout).expect("text");
        text.lines().map(|line| serde_json::from_str::<serde_json::Value>(line).expect("JSON")).collect::<Vec<_>>()
    };
    let runs = ask(&["list"]);
    assert_eq!(runs.len(), 1, "{runs:?}");
    let run = runs[0]["run"].as_str().expect("a run has a name");
    ask(&["show", run]).len()
}
