//! A cycle allocates nothing, whatever it does: planning, moving, acting, stopping, refusing.
#![allow(clippy::disallowed_types, clippy::disallowed_macros, reason = "tests may allocate and print")]

mod cell;

use cell::{Cell, down, task};
use tandem_cycle::guard::{CountingAllocator, counted};
use tandem_msg::*;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

#[test]
fn ten_thousand_cycles_allocate_nothing() {
    let mut cell = Cell::new();
    let mut id = 0;
    let mut phases = std::collections::BTreeSet::new();
    let mut causes = std::collections::BTreeSet::new();
    let (mut moved, mut fetched) = (0, 0);
    for cycle in 0..12_000 {
        if id == 0 || matches!(cell.phase(), MotionPhase::Done | MotionPhase::Failed) {
            id += 1;
            let mut next = match id % 4 {
                0 => task(id, down(3.0, 0.0, 0.2, 0.0)),
                1 => task(id, down(0.95, 0.45, 0.25, 0.0)),
                2 => task(id, down(0.6, 0.3, -0.05, 0.0)),
                _ => task(id, down(0.45, -0.50, 0.25, 0.0)),
            };
            next.action = Code::of(EffectorAction::Screw);
            next.retract = 0.1;
            cell.give(next);
        }
        match cycle {
            3_000 => cell.person_at(3.5, 0.3, [-1.5, 0.0, 0.0]),
            5_000 => cell.human.capsule_count = 0,
            6_000 => cell.human_alive = false,
            6_500 => cell.human_alive = true,
            7_500 => cell.task.reset_count += 1,
            8_500 => cell.drag = 0.2,
            9_000 => cell.drag = 0.0,
            9_500 => cell.task.reset_count += 1,
            10_500 => cell.arm.position[0] = f64::NAN,
            _ => {}
        }
        let ((), calls) = counted(|| {
            cell.step();
            if let Some(stop) = cell.controller.fetch_stop() {
                fetched += 1;
                cell.controller.give_back(stop);
            }
        });
        assert!(calls.is_none(), "cycle {cycle}: {calls:?} {:#?}", cell.status());
        phases.insert(cell.phase());
        causes.insert(cell.cause());
        moved += u64::from(cell.moving());
    }
    // The count means something only if all of this happened on the way.
    for phase in
        [MotionPhase::Planning, MotionPhase::Transfer, MotionPhase::Approach, MotionPhase::Acting, MotionPhase::Retract]
    {
        assert!(phases.contains(&phase), "{phase} never happened: {phases:?}");
    }
    for cause in [StopCause::HumanStale, StopCause::TrackingError, StopCause::InputInvalid] {
        assert!(causes.contains(&cause), "{cause} never happened: {causes:?}");
    }
    assert!(fetched >= 2, "{fetched} stops recorded");
    assert!(moved > 3_000, "{moved} cycles of motion");
}
