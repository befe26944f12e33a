//! What happens to a run when a role dies, or when the user wants the end.

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
    rig.sim.kill(Role::Plant);
    let outcome = rig.finish();
    assert!(matches!(outcome, Outcome::Fault { role: "plant", .. }), "{outcome:?}");
    assert_eq!(outcome.exit_code(), 5);
}

#[test]
fn a_run_that_is_interrupted_ends_with_the_arm_at_rest() {
    let mut rig = carrying(7);
    rig.sim.halt();
    assert_eq!(rig.finish(), Outcome::Interrupted, "{}", rig.tail());
    assert!(rig.sim.joint_speed_max() < 0.01, "{} rad/s", rig.sim.joint_speed_max());
}
