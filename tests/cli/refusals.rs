//! Each kind of bad input: the whole message, and exit code 3.

use crate::bench::Files;

/// Spoils one text, and asks for the whole message of `tandem check`.
fn refused(file: &str, from: &str, to: &str, message: &str) {
    let files = Files::new();
    files.replace(file, from, to);
    let answer = files.tandem(&["check", "cells/s471.toml"]);
    assert_eq!((answer.code, answer.err.as_str()), (Some(3), message), "{answer:?}");
}

#[test]
fn an_unknown_key_is_named_with_its_place_and_the_one_that_was_meant() {
    refused(
        "cells/s471.toml",
        "plant = { period_us = 1000",
        "plant = { period_ms = 1000",
        "cells/s471.toml:19:9: timing.plant.period_us is missing, allowed 250..=1000000 us; add it\n\
         cells/s471.toml:19:11: unknown key `timing.plant.period_ms`; did you mean `period_us`?\n",
    );
}

/// Two values out of range and one of the wrong kind, in two files: one pass tells all three.
#[test]
fn all_faults_of_all_files_are_told_at_once() {
    let files = Files::new();
    files.replace("cells/s471.toml", "period_us = 1000, phase_us = 200", "period_us = 50, phase_us = 20");
    files.replace("cells/s471.toml", "walk_speed_m_s = 1.4", "walk_speed_m_s = 14");
    files.replace("products/s471.toml", "mass_kg = 6.5", "mass_kg = \"heavy\"");
    let answer = files.tandem(&["check", "cells/s471.toml"]);
    let said: Vec<&str> = answer.err.lines().collect();
    assert_eq!(said.len(), 3, "{answer:?}");
    assert!(
        said[0].ends_with(
            "timing.controller.period_us = 50 us, allowed 250..=1000000 us; choose a value within these bounds"
        ),
        "{said:?}"
    );
    assert!(
        said[1].ends_with("human.walk_speed_m_s = 14 m/s, allowed 0.1..=2 m/s; choose a value within these bounds"),
        "{said:?}"
    );
    assert!(said[2].ends_with("part[0].mass_kg = a string, allowed 0.001..=100 kg; write a number"), "{said:?}");
    assert!(said.iter().all(|line| line.split(':').nth(1).is_some_and(|n| n.parse::<u32>().is_ok())), "{said:?}");
    assert_eq!(answer.code, Some(3));
    assert_eq!(answer.out, "");
}

#[test]
fn a_file_that_is_not_there_is_named_where_it_was_asked_for() {
    let files = Files::new();
    std::fs::remove_file(files.path("products/s471.toml")).expect("the copy is there");
    let answer = files.tandem(&["check", "cells/s471.toml"]);
    assert!(answer.err.contains("products/s471.toml: no such file; name a file that can be read"), "{answer:?}");
    assert_eq!(answer.code, Some(3));
    let answer = files.tandem(&["run", "cells/none.toml"]);
    assert_eq!(answer.err, "cells/none.toml: no such file; name a file that can be read\n");
    assert_eq!(answer.code, Some(3));
}

#[test]
fn a_urdf_that_is_no_chain_is_refused_with_the_joints_that_branch_off() {
    let files = Files::new();
    files.replace("robots/ur10.urdf", "<parent link=\"forearm_link\"", "<parent link=\"base_link\"");
    let answer = files.tandem(&["run", "cells/s471.toml"]);
    assert_eq!(answer.code, Some(3), "{answer:?}");
    assert!(
        answer.err.starts_with("robots/ur10.urdf:") && answer.err.contains("beside the chain to \"tcp\""),
        "{answer:?}"
    );
}

/// One flipped byte in the weights: the run is refused before anything starts.
#[test]
fn a_corrupted_model_is_refused() {
    let files = Files::new();
    let weights = files.path("models/s471/encoder.safetensors");
    let mut bytes = std::fs::read(&weights).expect("the weights are there");
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x10;
    std::fs::write(&weights, bytes).expect("the copy can be written");
    let answer = files.tandem(&["run", "cells/s471.toml", "--lockstep"]);
    assert!(answer.err.starts_with("models/s471/encoder.safetensors: corrupted: BLAKE3 is "), "{answer:?}");
    assert_eq!((answer.code, answer.out.as_str()), (Some(3), ""), "{answer:?}");
}

#[test]
fn a_database_that_cannot_be_opened_is_refused() {
    let files = Files::new();
    let answer = files.tandem(&["run", "cells/s471.toml", "--store", "sqlite:///proc/none/x.db"]);
    assert!(answer.err.starts_with("sqlite:///proc/none/x.db: "), "{answer:?}");
    assert_eq!((answer.code, answer.out.as_str()), (Some(3), ""), "{answer:?}");
}

/// `--json` tells the same as objects.
#[test]
fn faults_are_also_told_as_json() {
    let files = Files::new();
    files.replace("cells/s471.toml", "walk_speed_m_s = 1.4", "walk_speed_m_s = 14");
    let answer = files.tandem(&["check", "cells/s471.toml", "--json"]);
    let line: serde_json::Value = serde_json::from_str(answer.out.trim()).expect("one object");
    assert_eq!(line["event"], "refused", "{line}");
    assert_eq!(line["field"], "human.walk_speed_m_s", "{line}");
    assert!(line["line"].as_u64().is_some_and(|line| line > 0), "{line}");
}
