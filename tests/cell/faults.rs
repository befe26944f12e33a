//! What happens to a run when a role dies, or when the user wants the end.

use std::path::Path;

use serde_json::Value;
use tandem::black_box::files;
use tandem::supervisor::{EventKind, Outcome};
use tandem_msg::Role;

use crate::rig::Rig;

/// Runs until the arm is on its way with a part.
fn carrying(seed: u64) -> Rig {
    let mut rig = Rig::new(1, seed);
    let moving = |kind: &EventKind| matches!(kind, EventKind::ActionStarted { subtask: "transfer", .. });
    assert_eq!(rig.run_until(moving), None, "{}", rig.tail());
    rig
}

fn faults(rig: &Rig) -> Vec<&'static str> {
    let role = |kind: &EventKind| if let EventKind::Fault { role, .. } = kind { Some(*role) } else { None };
    rig.events.iter().filter_map(|event| role(&event.kind)).collect()
}

/// The controller dies with a part in the tool: the plant brakes, a new controller takes over from the
/// measured state, the box is completed and nothing was touched.
#[test]
fn a_run_survives_the_death_of_its_controller() {
    for seed in 1..=4 {
        let mut rig = carrying(seed);
        rig.sim.kill(Role::Controller);
        assert_eq!(rig.finish(), Outcome::Completed, "seed {seed}: {}", rig.tail());
        assert_eq!(faults(&rig), ["controller"], "seed {seed}");
        assert_eq!(rig.summary().contacts, 0, "seed {seed}");
    }
}

#[test]
fn a_run_survives_the_death_of_perception() {
    let mut rig = Rig::new(1, 5);
    assert_eq!(rig.run_until(|kind| matches!(kind, EventKind::StepStarted { step: 2, .. })), None);
    rig.sim.kill(Role::Perception);
    assert_eq!(rig.finish(), Outcome::Completed, "{}", rig.tail());
    assert_eq!(faults(&rig), ["perception"]);
}

/// The plant stands for hardware: nothing can take its place, and the run says so.
#[test]
fn the_death_of_the_plant_ends_the_run_as_a_fault() {
    let mut rig = carrying(6);
    let folder = tempfile::tempdir().expect("a temporary folder");
    rig.sim.keep_stops(folder.path());
    rig.sim.kill(Role::Plant);
    let outcome = rig.finish();
    assert!(matches!(outcome, Outcome::Fault { role: "plant", .. }), "{outcome:?}");
    assert_eq!(outcome.exit_code(), 5);
    the_stop_is_kept(folder.path());
}

/// The file of a stop for want of the arm's state: two seconds of a moving arm before it, a stopping one after.
fn the_stop_is_kept(folder: &Path) {
    let [file] = &files(folder)[..] else { panic!("{:?}", files(folder)) };
    let text = std::fs::read_to_string(file).expect("it was just written");
    let lines: Vec<Value> = text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let (head, cycles) = lines.split_first().expect("a head");
    assert_eq!((head["cause"].as_str(), head["category"].as_str()), (Some("arm_stale"), Some("1")), "{head}");
    let times: Vec<f64> = cycles.iter().filter_map(|cycle| cycle["t_s"].as_f64()).collect();
    assert!(times.len() == cycles.len() && times.len() > 2_000, "{}", times.len());
    assert!(times.windows(2).all(|pair| (pair[1] - pair[0] - 0.001).abs() < 1e-9), "a gap");
    for cycle in cycles {
        let before = cycle["t_s"].as_f64().is_some_and(|time| time < 0.0);
        assert_eq!(before, cycle["stop"] == "running", "{cycle}");
        assert_eq!(cycle["command_rad"].as_array().map(Vec::len), Some(6), "{cycle}");
        assert!(cycle["human_m"].as_array().is_some_and(|people| !people.is_empty()), "{cycle}");
    }
    let moving = |cycle: &&Value| cycle["command_rad_s"].as_array().is_some_and(|all| all.iter().any(|v| *v != 0.0));
    assert!(cycles.iter().filter(moving).count() > 100, "the arm was on its way");
}

#[test]
fn a_run_that_is_interrupted_ends_with_the_arm_at_rest() {
    let mut rig = carrying(7);
    rig.sim.halt();
    assert_eq!(rig.finish(), Outcome::Interrupted, "{}", rig.tail());
    assert!(rig.sim.joint_speed_max() < 0.01, "{} rad/s", rig.sim.joint_speed_max());
}
