//! How long does one control cycle take? The whole of it: inputs judged, path followed, clearance, braking
//! and separation checked, status written; 40 scene objects and a person of 10 capsules who is near enough to be
//! measured at every look ahead, a carried part.
//!
//! `cargo bench -p tandem-controller --bench cycle`, with `-- --json` one object a row; the tests run it briefly.
#![allow(
    clippy::disallowed_types,
    clippy::disallowed_macros,
    clippy::disallowed_methods,
    reason = "a bench may print, allocate and read the clock"
)]

#[path = "../tests/cell/mod.rs"]
mod cell;

use std::hint::black_box;
use std::time::Instant;

use cell::{Cell, down, task};
use tandem_controller::ControllerInputs;
use tandem_msg::*;

fn report(case: &str, mut samples: Vec<u64>) {
    if samples.is_empty() {
        return;
    }
    samples.sort_unstable();
    let at = |share: f64| samples[((samples.len() - 1) as f64 * share) as usize] as f64 * 1e-3;
    if std::env::args().any(|argument| argument == "--json") {
        println!(
            "{{\"bench\":\"cycle\",\"case\":\"{case}\",\"cycles\":{},\"p50_us\":{:.2},\"p99_us\":{:.2},\"p999_us\":{:.2}}}",
            samples.len(),
            at(0.5),
            at(0.99),
            at(0.999)
        );
        return;
    }
    println!(
        "{case:<12} {:>7} cycles   p50 {:>6.1} us   p99 {:>6.1} us   p99.9 {:>6.1} us   max {:>7.1} us",
        samples.len(),
        at(0.5),
        at(0.99),
        at(0.999),
        at(1.0)
    );
}

fn main() {
    // `cargo bench` says so; as part of the tests a short run shows that the bench still works.
    let short = !std::env::args().any(|argument| argument == "--bench");
    let cycles = if short { 20_000 } else { 200_000 };
    let mut cell = Cell::new();
    while cell.scene.object_count < 40 {
        let index = cell.scene.object_count;
        let along = f64::from(index) * 0.06 - 1.4;
        cell.scene.objects[index as usize] = SceneObject {
            id: 100 + index,
            shape: Code::of([ShapeKind::Box, ShapeKind::Cylinder, ShapeKind::Sphere][index as usize % 3]),
            size: [0.03, 0.04, 0.05],
            base_from_object: Pose { position: [along, -0.75, 0.05], ..Pose::IDENTITY },
        };
        cell.scene.object_count += 1;
    }
    cell.human.capsule_count = 10;
    cell.human.position_sigma = 0.005;
    for (k, capsule) in cell.human.capsules.iter_mut().take(10).enumerate() {
        let z = -0.8 + 0.13 * k as f64;
        *capsule = Capsule { ends: [[1.9, 0.2, z], [1.9, 0.35, z + 0.2]], radius: 0.09, velocity: [0.0; 3] };
    }
    let part = AttachedPart { present: 1, half_extents: [0.06, 0.04, 0.02], ..AttachedPart::default() };
    cell.arm.effector.holding = 1;
    let mut id = 0;
    let (mut moving, mut planning, mut resting) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..cycles {
        if id == 0 || cell.phase() == MotionPhase::Done {
            id += 1;
            let goal = if id % 2 == 1 { down(0.95, 0.45, 0.25, 0.0) } else { down(0.45, -0.50, 0.25, 0.0) };
            cell.give(MotionTask { attached_before: part, attached_after: part, ..task(id, goal) });
        }
        cell.prepare();
        let (arm, human, scene, task) = (cell.arm, cell.human, cell.scene, cell.task);
        let inputs = ControllerInputs { arm: &arm, human: &human, scene: &scene, task: &task };
        let begun = Instant::now();
        cell.controller.cycle(black_box(cell.now), black_box(&inputs), &mut cell.outputs);
        let took = begun.elapsed().as_nanos() as u64;
        cell.follow();
        match cell.phase() {
            MotionPhase::Planning => planning.push(took),
            _ if cell.moving() => moving.push(took),
            _ => resting.push(took),
        }
    }
    report("moving", moving);
    report("planning", planning);
    report("resting", resting);
}
