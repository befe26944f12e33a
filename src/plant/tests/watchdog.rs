//! The drives: what they follow, and what they do when there is nothing to follow.

use super::*;

/// A smooth motion of all joints is followed within 2 mrad, with and without a load of 9 kg.
#[test]
fn a_smooth_motion_is_tracked_within_two_milliradians() {
    let mut rig = Rig::new(1);
    let home = rig.command.position;
    let goal: [f64; JOINTS_MAX] = core::array::from_fn(|joint| {
        home[joint] + if joint < 6 { [0.8, 0.4, -0.6, 0.5, -0.7, 1.0][joint] } else { 0.0 }
    });
    let lag = rig.move_to(&goal, 2.0);
    assert!(lag < 2e-3, "{lag} rad unloaded");
    assert!(rig.out.arm.fault.is(PlantFault::None));
    rig.move_to(&home, 2.0);

    let part = rig.part("battery_module");
    rig.plant.parts.present(&mut rig.plant.world, part, rig.plant.base_from_tcp);
    rig.plant.parts.take_with_tool(&mut rig.plant.world, part, &rig.plant.base_from_tcp.clone());
    rig.cycle();
    let before = rig.out.arm.effort[1];
    rig.cycles(50);
    assert!((rig.out.arm.effort[1] - before).abs() > 20.0, "9 kg are felt: {before} -> {}", rig.out.arm.effort[1]);
    let lag = rig.move_to(&goal, 2.0);
    assert!(lag < 2e-3, "{lag} rad loaded");
}

/// The controller dies in full motion: every joint's speed falls from the cycle in
/// which the command expires, and the arm stands when its brakes say so, on its path.
#[test]
fn an_arm_whose_commands_cease_brakes_and_stands() {
    let mut rig = Rig::new(2);
    rig.cycles(10);
    let start = rig.command.position;
    // Up to 1 rad/s in the first joint, then silence.
    for step in 1..=500 {
        let t = f64::from(step) * 1e-3;
        rig.command.position[0] = start[0] + t * t;
        rig.command.velocity[0] = 2.0 * t;
        rig.cycle();
    }
    let limit = rig.plant.arm.base_from_link().len();
    assert!(limit > 1);
    let mut cycles_to_fault = 0;
    while rig.out.arm.fault.is(PlantFault::None) && cycles_to_fault < 50 {
        rig.silent_cycle();
        cycles_to_fault += 1;
    }
    // Valid for 5 ms from the last command's cycle.
    assert!(rig.out.arm.fault.is(PlantFault::CommandExpired) && cycles_to_fault <= 6, "{cycles_to_fault}");
    assert_eq!(rig.out.arm.command_seq, 0, "it answers to nobody");
    let mut speed = rig.out.arm.velocity[0];
    let mut cycles_to_stand = 0;
    while rig.out.arm.velocity[0].abs() > 1e-3 && cycles_to_stand < 1_000 {
        rig.silent_cycle();
        assert!(rig.out.arm.velocity[0] < speed + 1e-3, "braking only ever slows");
        speed = rig.out.arm.velocity[0];
        cycles_to_stand += 1;
    }
    assert!(cycles_to_stand < 400, "1 rad/s took {cycles_to_stand} ms");
    let stands_at = rig.out.arm.position[0];
    for _ in 0..500 {
        rig.silent_cycle();
    }
    assert!((rig.out.arm.position[0] - stands_at).abs() < 2e-3, "it holds");

    // From elsewhere it stays shut, from here it opens again.
    rig.command.velocity[0] = 0.0;
    rig.command.position[0] = stands_at + 0.1;
    rig.cycles(5);
    assert!(rig.out.arm.fault.is(PlantFault::CommandRefused));
    rig.command.position[0] = stands_at;
    rig.cycles(2);
    assert!(rig.out.arm.fault.is(PlantFault::None));
    assert_eq!(rig.out.arm.command_seq, rig.command.header.seq);
}

/// A controller that is held up for a few periods and then goes on, in place or where it would have been: the arm slows
/// meanwhile, harder with each cycle, and joins it again without a jerk and without a fault.
#[test]
fn an_arm_whose_commands_are_late_slows_down_and_joins_them_again() {
    for (pause, catches_up) in (1..=4).flat_map(|pause| [(pause, false), (pause, true)]) {
        let mut rig = Rig::new(2);
        rig.cycles(10);
        let start = rig.command.position;
        let mut step = 0;
        let mut command = |rig: &mut Rig, steps: u32| {
            step += steps;
            let t = f64::from(step) * 1e-3;
            // To 0.5 rad/s, then on.
            let (position, velocity) = if t < 0.25 { (t * t, 2.0 * t) } else { (t / 2.0 - 0.0625, 0.5) };
            rig.command.position[0] = start[0] + position;
            rig.command.velocity[0] = velocity;
            rig.cycle();
        };
        (0..400).for_each(|_| command(&mut rig, 1));
        let (mut braking, mut speed) = (0.0, rig.out.arm.velocity[0]);
        for late in 1..=pause {
            rig.silent_cycle();
            assert!(rig.out.arm.fault.is(PlantFault::None), "after {late} ms");
            assert!(rig.out.arm.braking >= braking && (rig.out.arm.braking > 0.0) == (late > 1), "after {late} ms");
            assert_eq!(rig.out.arm.command_seq, rig.command.header.seq);
            (braking, speed) = (rig.out.arm.braking, speed.min(rig.out.arm.velocity[0]));
        }
        assert!(pause < 4 || speed < 0.495, "{speed} rad/s after {pause} ms");
        let mut before = rig.out.arm.velocity[0];
        for cycle in 0..250 {
            command(&mut rig, if cycle == 0 && catches_up { pause + 1 } else { 1 });
            assert!(rig.out.arm.fault.is(PlantFault::None) && rig.out.arm.braking == 0.0);
            let now = rig.out.arm.velocity[0];
            assert!((now - before).abs() < 0.03, "{before} to {now} rad/s, {cycle} ms after a pause of {pause} ms");
            before = now;
        }
        let apart = rig.plant.arm.measured().position[0] - rig.command.position[0];
        assert!(apart.abs() < 1e-3, "{apart} rad after a pause of {pause} ms");
    }
}

/// The successor of a controller that died in full motion is heard before the brakes are shut: they shut all the same,
/// and it leads the arm from its standstill only.
#[test]
fn a_successor_leads_from_a_standstill_only() {
    let mut rig = Rig::new(2);
    for step in 1..=300 {
        rig.command.position[0] += 1e-3 * f64::from(step) / 300.0;
        rig.command.velocity[0] = f64::from(step) / 300.0;
        rig.cycle();
    }
    rig.epoch = 2;
    let mut cycles = 0;
    while rig.out.arm.velocity[0].abs() > 1e-3 {
        // It stands where the arm is, and asks for nothing.
        rig.command.position = rig.out.arm.position;
        rig.command.velocity = [0.0; JOINTS_MAX];
        rig.cycle();
        assert!(rig.out.arm.fault.is(PlantFault::CommandRefused), "in cycle {cycles}");
        assert_eq!((rig.out.arm.braking, rig.out.arm.command_seq), (1.0, 0));
        cycles += 1;
        assert!(cycles < 400);
    }
    assert!(cycles > 20, "it was fast: {cycles} ms");
    rig.command.position = rig.out.arm.position;
    rig.cycles(50);
    assert!(rig.out.arm.fault.is(PlantFault::None), "and then it leads");
}

/// Each way a command can be wrong, and what the drives call it.
#[test]
fn a_bad_command_never_moves_the_arm() {
    type Spoil = fn(&mut JointCommand);
    let cases: [(&str, Spoil, PlantFault); 8] = [
        ("not a number", |c| c.position[1] = f64::NAN, PlantFault::CommandRefused),
        ("infinite speed", |c| c.velocity[1] = f64::INFINITY, PlantFault::CommandRefused),
        ("infinite acceleration", |c| c.acceleration[1] = f64::NEG_INFINITY, PlantFault::CommandRefused),
        ("past the joint's end", |c| c.position[1] = 1e3, PlantFault::CommandRefused),
        ("a jump", |c| c.position[1] += 0.2, PlantFault::CommandRefused),
        ("another arm", |c| c.joint_count = 7, PlantFault::CommandRefused),
        ("another cell", |c| c.header.config_hash ^= 1, PlantFault::CommandRefused),
        ("a replaced controller", |c| c.header.epoch = 0, PlantFault::CommandRefused),
    ];
    for (name, spoil, fault) in cases {
        let mut rig = Rig::new(3);
        assert!(rig.out.arm.fault.is(PlantFault::NeverCommanded));
        rig.cycles(10);
        assert!(rig.out.arm.fault.is(PlantFault::None));
        let before = rig.out.arm.position;
        let good = rig.command;
        spoil(&mut rig.command);
        rig.command.effector.id += 1;
        rig.command.effector.action = EffectorAction::Release.into();
        rig.command.valid_until = rig.now.after(Duration::from_secs(1));
        rig.command.header.seq += 1;
        for _ in 0..100 {
            rig.silent_cycle();
            assert_eq!(rig.out.arm.fault.get(), Some(fault), "{name}");
        }
        for (now, before) in rig.out.arm.position.iter().zip(before) {
            assert!((now - before).abs() < 1e-3, "{name}: {now} {before}");
        }
        assert_eq!(rig.out.arm.effector.command_id, 0, "{name}: nor does it move the tool");
        rig.command = JointCommand { header: rig.command.header, ..good };
        rig.cycles(2);
        assert!(rig.out.arm.fault.is(PlantFault::None), "{name}: a good command opens the brakes");
    }
}

/// A controller that asks for the brakes gets them, without a fault.
#[test]
fn brakes_are_applied_when_asked_for() {
    let mut rig = Rig::new(4);
    for _ in 0..300 {
        rig.command.velocity[0] = 0.5;
        rig.command.position[0] += 0.5e-3;
        rig.cycle();
    }
    rig.command.brake = 1;
    rig.cycles(200);
    assert!(rig.out.arm.fault.is(PlantFault::None));
    assert!(rig.out.arm.velocity[0].abs() < 1e-3, "{}", rig.out.arm.velocity[0]);
}
