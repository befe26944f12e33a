//! Inputs of random bits: no panic, no allocation, no command that is no number, and what is not finite stops the
//! arm in the cycle it is heard.
#![allow(clippy::disallowed_types, clippy::disallowed_macros, reason = "tests may allocate and print")]

mod cell;

use cell::{Cell, down, task};
use proptest::prelude::*;
use proptest::test_runner::{Config, TestRunner};
use tandem_cycle::guard::{CountingAllocator, counted};
use tandem_msg::*;

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// Numbers of all kinds, from any bits: half of them the troublesome ones.
fn number(bits: u64) -> f64 {
    const TROUBLE: [f64; 8] =
        [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX, f64::MIN_POSITIVE, -0.0, 1e300, -1e9];
    if bits & 1 == 0 { f64::from_bits(bits) } else { TROUBLE[(bits >> 1) as usize % TROUBLE.len()] }
}

/// Overwrites one number of one input.
fn spoil(
    field: u8,
    index: usize,
    bits: u64,
    arm: &mut JointState,
    human: &mut HumanState,
    scene: &mut Scene,
    task: &mut MotionTask,
) {
    let (value, whole) = (number(bits), bits as u32);
    let object = &mut scene.objects[index % SCENE_OBJECTS_MAX];
    let capsule = &mut human.capsules[index % HUMAN_CAPSULES_MAX];
    match field {
        0 => arm.position[index % JOINTS_MAX] = value,
        1 => arm.velocity[index % JOINTS_MAX] = value,
        2 => arm.joint_count = whole,
        3 => arm.fault = Code::from_raw(whole),
        4 => arm.command_stamp = Stamp(bits),
        5 => arm.effector.phase = Code::from_raw(whole),
        6 => arm.header.stamp = Stamp(bits),
        7 => human.capsule_count = whole,
        8 => capsule.ends[index % 2][index % 3] = value,
        9 => capsule.radius = value,
        10 => capsule.velocity[index % 3] = value,
        11 => human.position_sigma = value,
        12 => human.header.stamp = Stamp(bits),
        13 => scene.object_count = whole,
        14 => object.size[index % 3] = value,
        15 => object.base_from_object.position[index % 3] = value,
        16 => object.base_from_object.rotation[index % 4] = value,
        17 => object.shape = Code::from_raw(whole),
        18 => object.id = whole,
        19 => task.base_from_tcp.position[index % 3] = value,
        20 => task.base_from_tcp.rotation[index % 4] = value,
        21 => task.speed = value,
        22 => task.approach = value,
        23 => task.retract = value,
        24 => task.run = Code::from_raw(whole),
        25 => task.attached_before.present = whole,
        26 => task.attached_before.half_extents[index % 3] = value,
        27 => task.attached_before.tcp_from_part.position[index % 3] = value,
        28 => task.attached_before.mass = value,
        29 => task.reset_count = whole,
        30 => task.header.epoch = bits,
        31 => human.header.config_hash = bits,
        32 => scene.version = bits,
        33 => task.scene_version = bits,
        34 => task.value = value,
        _ => task.id = whole,
    }
}

#[test]
fn random_bits_never_move_the_arm() {
    let spoils = prop::collection::vec((0u8..36, 0usize..48, any::<u64>()), 1..6);
    let mut runner = TestRunner::new(Config { cases: 300, ..Config::default() });
    runner
        .run(&(spoils, 0u64..1_500, 1u64..60), |(spoils, after, lasts)| {
            let mut cell = Cell::new();
            cell.person_at(4.0, 0.3, [0.0; 3]);
            cell.give(task(1, down(0.95, 0.50, 0.20, 0.0)));
            cell.run(50 + after);
            for cycle in 0..lasts + 100 {
                cell.prepare();
                let (mut arm, mut human, mut scene, mut task) = (cell.arm, cell.human, cell.scene, cell.task);
                if cycle < lasts {
                    for &(field, index, bits) in &spoils {
                        spoil(field, index, bits, &mut arm, &mut human, &mut scene, &mut task);
                    }
                }
                let now = cell.now;
                let inputs =
                    tandem_controller::ControllerInputs { arm: &arm, human: &human, scene: &scene, task: &task };
                let ((), calls) = counted(|| cell.controller.cycle(now, &inputs, &mut cell.outputs));
                prop_assert!(calls.is_none(), "allocates: {calls:?}");
                let command = cell.outputs.command;
                let numbers = command.position.iter().chain(&command.velocity).chain(&command.acceleration);
                prop_assert!(numbers.clone().all(|x| x.is_finite()), "{command:?}");
                let lost = arm.position[..6].iter().chain(&arm.velocity[..6]).any(|x| !x.is_finite())
                    || human.capsules[..2].iter().any(|capsule| {
                        !capsule.radius.is_finite() || capsule.ends.iter().flatten().any(|x| !x.is_finite())
                    }) && human.capsule_count == 2;
                prop_assert!(!lost || cell.stop() != StopState::Running, "runs on: {:?}", cell.status());
                cell.follow();
            }
            Ok(())
        })
        .unwrap_or_else(|error| panic!("{error}"));
}
