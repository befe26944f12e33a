//! Help, exit codes and machine-readable output.

use crate::bench::Files;

#[test]
fn usage_errors_have_their_own_exit_code() {
    let files = Files::new();
    for args in
        [&["frobnicate"][..], &["run"], &["run", "cells/s471.toml", "--boxes", "0"], &["run", "x", "--seed", "-1"]]
    {
        let answer = files.tandem(args);
        assert_eq!((answer.code, answer.out.as_str()), (Some(2), ""), "{args:?}: {answer:?}");
        assert!(answer.err.starts_with("error: "), "{args:?}: {answer:?}");
    }
}

#[test]
fn help_names_every_verb_and_the_exit_codes() {
    let answer = Files::new().tandem(&["--help"]);
    assert_eq!(answer.code, Some(0));
    for word in ["run", "check", "doctor", "journal", "train", "130 interrupted"] {
        assert!(answer.out.contains(word), "{word}: {answer:?}");
    }
    assert!(!answer.out.contains("role"), "the hidden verb is shown: {answer:?}");
}

#[test]
fn a_good_cell_passes_the_check() {
    let answer = Files::new().tandem(&["check", "cells/s471.toml"]);
    assert_eq!((answer.code, answer.err.as_str()), (Some(0), ""), "{answer:?}");
    let subjects: Vec<&str> = answer.out.lines().filter_map(|line| line.split_whitespace().nth(1)).collect();
    assert_eq!(subjects, ["files", "product", "robot", "model", "controller", "plant", "store"]);
    assert!(answer.out.lines().all(|line| line.starts_with("ok ")), "{answer:?}");
}

#[test]
fn the_doctor_answers_in_objects_and_looks_at_the_cell_it_is_given() {
    let files = Files::new();
    let answer = files.tandem(&["doctor", "cells/s471.toml", "--json"]);
    let checks: Vec<serde_json::Value> =
        answer.out.lines().map(|line| serde_json::from_str(line).expect("an object a line")).collect();
    assert!(checks.len() >= 30, "{answer:?}");
    for check in &checks {
        assert_eq!(check["event"], "check");
        assert_eq!(check["verdict"] == "ok", check["fix"].is_null(), "a fix for what is not well: {check}");
    }
    for name in ["cell", "model", "database"] {
        let check = checks.iter().find(|check| check["name"] == name).expect("a check of that name");
        assert_eq!(check["verdict"], "ok", "{check}");
    }
}

/// A cell that does not run is bad news, in the exit code too; what depends on its files is unknown then.
#[test]
fn the_doctor_has_bad_news_of_a_spoilt_cell() {
    let files = Files::new();
    files.replace("cells/s471.toml", "walk_speed_m_s = 1.4", "walk_speed_m_s = 14");
    let answer = files.tandem(&["doctor", "cells/s471.toml"]);
    assert_eq!(answer.code, Some(1), "{answer:?}");
    let line = |name: &str| answer.out.lines().find(|line| line.split_whitespace().nth(1) == Some(name));
    assert!(
        line("cell").is_some_and(|line| line.starts_with("BAD") && line.contains("allowed 0.1..=2 m/s")),
        "{answer:?}"
    );
    assert!(line("model").is_some_and(|line| line.starts_with("unknown")), "{answer:?}");
}

/// One box in lockstep as a script sees it: objects only, the summary last, and the journal agrees.
/// Run twice, the lines are the same but for the wall time.
#[test]
fn a_run_speaks_json_and_leaves_its_journal() {
    let files = Files::new();
    let run = || {
        let answer = files.tandem(&["run", "cells/s471.toml", "--lockstep", "--seed", "4", "--json"]);
        assert_eq!(answer.code, Some(0), "{answer:?}");
        let mut lines: Vec<serde_json::Value> =
            answer.out.lines().map(|line| serde_json::from_str(line).expect("an object a line")).collect();
        let summary = lines.last_mut().expect("a run says something");
        assert_eq!(summary["event"], "summary", "{summary}");
        for field in
            ["product", "boxes_requested", "boxes_completed", "steps_done", "steps_failed", "stops", "contacts"]
        {
            assert!(!summary[field].is_null(), "{field}: {summary}");
        }
        assert!(summary["wall_time_s"].take().is_number());
        lines
    };
    let lines = run();
    assert_eq!(lines, run());
    let steps = lines.iter().filter(|line| line["event"] == "step_done").count();
    let journal = files.tandem(&["journal", "show", "--json"]);
    let finished = journal.out.lines().filter(|line| line.contains("\"state\":\"done\"")).count();
    assert_eq!(finished, steps, "{journal:?}");
    let csv = files.tandem(&["journal", "export"]);
    assert!(csv.out.starts_with("serial,step,attempt,part,state,"), "{csv:?}");
    let runs = files.tandem(&["journal", "list"]);
    assert_eq!(runs.out.matches("completed").count(), 2, "{runs:?}");
}
