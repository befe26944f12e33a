//! Tasks carried out by an arm that follows perfectly: they end where they should, keep every
//! limit in every cycle, and keep clear of the scene.

mod cell;

use cell::{BOX_WALL, Cell, down, task};
use tandem_msg::*;

fn assert_at(cell: &Cell, goal: &Pose) {
    let tcp = cell.tcp();
    for axis in 0..3 {
        let error = (tcp.translation.vector[axis] - goal.position[axis]).abs();
        assert!(error < 1e-5, "axis {axis}: {error} m off, {:?}", cell.status());
    }
}

#[test]
fn a_transfer_ends_at_its_goal() {
    let mut cell = Cell::new();
    for (id, goal) in [
        down(0.35, -0.55, 0.20, 0.0),
        down(0.62, 0.0, 0.25, 1.0),
        down(0.95, 0.50, 0.20, -0.5),
        down(0.35, -0.55, 0.20, 2.0),
    ]
    .into_iter()
    .enumerate()
    {
        let end = cell.perform(task(id as u32 + 1, goal));
        assert_eq!(end, MotionPhase::Done, "{:#?}", cell.status());
        assert_at(&cell, &goal);
        let status = cell.status();
        assert!(
            (status.elapsed - status.expected).abs() < 0.35,
            "{} s, expected {} s",
            status.elapsed,
            status.expected
        );
        println!("{:.2} s, clearance {:.3} m", status.elapsed, status.clearance_min);
    }
    cell.assert_limits();
    assert!(cell.findings.clearance_min > 0.0, "{:?}", cell.findings);
    assert_eq!(cell.status().stop_count, 0);
}
