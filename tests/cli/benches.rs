//! Each bench once, briefly: what it prints can be read, and every figure is one.

use serde_json::Value;

use crate::bench::{Answer, Files};

/// The objects a bench printed: conditions, series, comparisons.
fn objects(answer: &Answer) -> Vec<Value> {
    assert_eq!(answer.code, Some(0), "{answer:?}");
    answer.out.lines().map(|line| serde_json::from_str(line).expect("an object a line")).collect()
}

fn ran(files: &Files, bench: &str, more: &[&str], cases: &[&str]) {
    let brief = ["bench", bench, "--cell", "cells/s471.toml", "--seconds", "0.02", "--rounds", "2", "--json"];
    let answer = files.tandem(&[&brief[..], more].concat());
    let printed = objects(&answer);
    assert_eq!((&printed[0]["event"], &printed[0]["bench"]), (&"conditions".into(), &bench.into()), "{answer:?}");
    assert!(printed[0]["load"][0].is_number() && printed[0]["steal_share"].is_number(), "{answer:?}");
    let (series, rows): (Vec<&Value>, Vec<&Value>) = printed[1..].iter().partition(|line| line["event"] == "series");
    for case in cases {
        let found = series.iter().find(|line| line["case"] == *case);
        let found = found.unwrap_or_else(|| panic!("{bench}: no case {case:?}: {answer:?}"));
        let quantiles = ["p50", "p99", "p99_9", "max"].map(|name| found[name].as_f64().expect("a number"));
        assert!(quantiles.is_sorted() && quantiles[0] > 0.0, "{found}");
        assert!(found["samples"].as_u64().is_some_and(|samples| samples > 0), "{found}");
    }
    assert!(!rows.is_empty(), "{answer:?}");
    for row in rows {
        let [ours, peer] = ["ours", "peer_value"].map(|name| row[name].as_f64());
        assert!(row["bench"] == bench && ours.is_some() && row["unit"] == "us", "{row}");
        assert_eq!(row["peer"].is_null(), peer.is_none(), "{row}");
        if let (Some(ours), Some(peer), Some(ratio)) = (ours, peer, row["ratio"].as_f64()) {
            assert!((ratio - ours / peer).abs() <= 1e-9 * ratio.abs(), "{row}");
        }
    }
}

#[test]
fn jitter_is_measured_beside_a_bare_loop_and_saved() {
    let files = Files::new();
    ran(&files, "jitter", &["--no-cell", "--save", "saved"], &["bare loop", "tandem's loop"]);
    let saved = std::fs::read_to_string(files.path("saved/jitter-bare-loop.hgrm")).expect("saved");
    assert!(saved.contains("Value") && saved.contains("#[Max"), "{saved}");
}

#[test]
fn latency_is_measured_beside_shared_memory_a_futex_and_iceoryx2() {
    let cases = [
        "shared memory, spinning",
        "shared memory, futex",
        "iceoryx2 publish-subscribe, polled",
        "iceoryx2 blackboard, polled",
        "tandem's bus, polled",
    ];
    let absent = std::thread::available_parallelism().is_ok_and(|processors| processors.get() < 2);
    let files = Files::new();
    if !absent {
        ran(&files, "latency", &["--no-cell"], &cases);
    }
}

#[test]
fn the_kernels_are_measured_beside_parry() {
    let cases = [
        "forward kinematics",
        "clearance and separation",
        "parry3d-f64, the same shapes",
        "trajectory to a new target, six joints",
        "control cycle of a cell in lockstep",
        "encoder, one cloud",
    ];
    ran(&Files::new(), "kernels", &[], &cases);
}

#[test]
fn a_bench_of_nothing_is_refused() {
    let files = Files::new();
    for args in [&["bench"][..], &["bench", "jitter", "--seconds", "0"], &["bench", "jitter", "--rounds", "0"]] {
        assert_eq!(files.tandem(args).code, Some(2), "{args:?}");
    }
    let answer = files.tandem(&["bench", "kernels", "--cell", "cells/none.toml"]);
    assert_eq!(
        (answer.code, answer.err.as_str()),
        (Some(3), "cells/none.toml: no such file; name a file that can be read\n")
    );
}
