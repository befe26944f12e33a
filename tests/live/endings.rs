//! Cells that are asked to end, and cells that are not asked.

use rustix::process::Signal;

use crate::harness::{Place, shared_memory};

/// SIGTERM and Ctrl-C while the arm moves: the arm is stopped, then the processes; nothing is left.
#[test]
fn a_cell_that_is_asked_to_end_stops_the_arm_and_leaves_nothing() {
    for signal in [Signal::TERM, Signal::INT] {
        let place = Place::new();
        let mut cell = place.start(4);
        let pid = cell.pid;
        cell.until_moving();
        cell.signal(signal);
        let end = cell.end();
        assert_eq!(end.status.code(), Some(130), "{signal:?}: {end:?}");
        assert_eq!(end.summary()["outcome"], "interrupted", "{signal:?}: {end:?}");
        place.assert_nothing_is_left(pid);
    }
}

/// `kill -9` of the supervisor's process: the kernel takes the roles with it, so nobody drives the arm; what could not
/// be removed is removed by the next cell that starts.
#[test]
fn a_killed_supervisor_takes_its_roles_along_and_the_next_cell_cleans_up() {
    let place = Place::new();
    let mut cell = place.start(5);
    let killed = cell.pid;
    cell.until_event("run_started");
    cell.signal(Signal::KILL);
    drop(cell);
    assert!(place.is_deserted(), "{:?}", place.running(None));
    assert_eq!(place.run_directories().len(), 1, "the dead cell's");
    assert!(!shared_memory(killed).is_empty());

    let mut next = place.start(5);
    let pid = next.pid;
    next.until_event("run_started");
    assert_eq!(shared_memory(killed), Vec::<String>::new());
    assert_eq!(place.run_directories().len(), 1, "its own");
    next.signal(Signal::TERM);
    let end = next.end();
    assert_eq!(end.status.code(), Some(130), "{end:?}");
    place.assert_nothing_is_left(pid);
}

/// Two cells on one host at the same time: neither hears the other, and the end of one is not the other's.
#[test]
fn two_cells_run_side_by_side() {
    let place = Place::new();
    let (mut one, mut two) = (place.start(6), place.start(7));
    one.until_event("run_started");
    two.until_event("run_started");
    assert_eq!(place.running(None).len(), 6);
    one.signal(Signal::TERM);
    let one_pid = one.pid;
    assert_eq!(one.end().status.code(), Some(130));
    assert_eq!(shared_memory(one_pid), Vec::<String>::new());
    assert_eq!(place.running(None).len(), 3, "the other's");
    two.until_event("step_started");
    two.signal(Signal::TERM);
    let pid = two.pid;
    assert_eq!(two.end().status.code(), Some(130));
    place.assert_nothing_is_left(pid);
}
