//! Roles that are killed or stopped while the arm moves.

use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

use crate::harness::{LiveCell, Place};

fn only(place: &Place, role: &str) -> Pid {
    let pids = place.running(Some(role));
    assert_eq!(pids.len(), 1, "{role}: {pids:?}");
    pids[0]
}

fn speaks_of<'a>(event: &'a str, role: &'a str) -> impl Fn(&Value) -> bool + 'a {
    move |heard| heard["event"] == event && heard["role"] == role
}

/// Strikes a role while the arm moves; the cell must say what happened to it and have it back.
fn recovers(cell: &mut LiveCell, place: &Place, role: &str, signal: Signal, fault: &str) {
    let (struck, spare) = (only(place, role), place.spare(role));
    kill_process(struck, signal).expect("it runs");
    let told = cell.until("the fault", speaks_of("fault", role));
    assert!(told["fault"].as_str().is_some_and(|word| word.contains(fault)), "{told}");
    cell.until("the recovery", speaks_of("recovered", role));
    assert_ne!(spare, struck);
    assert_eq!(only(place, role), spare, "who stood by has taken its place");
}

/// `kill -9` of controller and perception, one after the other, and a controller that is stopped but not dead: each is
/// reported by name, replaced, and the work goes on; at the end everything is cleaned up.
#[test]
fn a_struck_controller_or_perception_is_replaced_and_the_work_goes_on() {
    let place = Place::new();
    let mut cell = place.start(2);
    let pid = cell.pid;
    cell.until_moving();
    recovers(&mut cell, &place, "controller", Signal::KILL, "killed");
    recovers(&mut cell, &place, "perception", Signal::KILL, "killed");
    recovers(&mut cell, &place, "controller", Signal::STOP, "silent");
    cell.until("work after the recovery", |event| event["event"] == "action_done" && event["subject"] == "robot");
    cell.signal(Signal::TERM);
    let end = cell.end();
    assert_eq!(end.summary()["contacts"], 0, "{end:?}");
    place.assert_nothing_is_left(pid);
}

/// `kill -9` of the plant: the hardware is gone, so the run ends, says so, and exits with the code for a fault.
#[test]
fn a_killed_plant_ends_the_run_with_its_exit_code() {
    let place = Place::new();
    let mut cell = place.start(3);
    let pid = cell.pid;
    cell.until_moving();
    kill_process(only(&place, "plant"), Signal::KILL).expect("it runs");
    cell.until("the fault", speaks_of("fault", "plant"));
    let end = cell.end();
    assert_eq!(end.status.code(), Some(5), "{end:?}");
    assert_eq!(end.summary()["outcome"], "fault", "{end:?}");
    place.assert_nothing_is_left(pid);
}
