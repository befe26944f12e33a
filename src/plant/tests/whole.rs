//! The referee, repeatability, and the time a cycle takes.

use super::*;

/// An arm driven through the bench is seen by the referee: once, not once per look.
#[test]
fn the_referee_sees_a_contact_once() {
    let mut rig = Rig::new(16);
    let down = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), core::f64::consts::PI);
    rig.tcp_to(&Isometry3::from_parts(Translation3::new(0.6, 0.3, 0.2), down));
    assert_eq!(rig.out.cell.contacts, 0);
    rig.tcp_to(&Isometry3::from_parts(Translation3::new(0.6, 0.3, -0.03), down));
    assert_eq!(rig.out.cell.contacts, 1);
    rig.cycles(500);
    assert_eq!(rig.out.cell.contacts, 1);
}

/// Two plants with one seed and the same inputs say the same, bit for bit, over
/// 100 000 cycles of motion, handling and walking; nothing of it is not a number.
#[test]
fn the_same_seed_gives_the_same_plant() {
    let run = |seed: u64| {
        let mut rig = Rig::new(seed);
        let home = rig.command.position;
        let mut digest = blake3::Hasher::new();
        for cycle in 0..100_000u32 {
            let t = f64::from(cycle) * 1e-3;
            for (joint, home) in home.iter().enumerate().take(6) {
                let pace = 0.4 + 0.1 * joint as f64;
                rig.command.position[joint] = home + 0.3 * (1.0 - (pace * t).cos());
                rig.command.velocity[joint] = 0.3 * pace * (pace * t).sin();
            }
            if cycle % 8_000 == 0 {
                rig.request.header.seq += 1;
                rig.request.id += 1;
                rig.request.kind = RequestKind::Present.into();
                rig.request.part_index = cycle / 8_000 % 10;
                rig.tell(PromptKind::Assemble, (cycle / 8_000 % 10) as usize, &Isometry3::identity());
            }
            rig.cycle();
            let out = &rig.out;
            let numbers = out.arm.position.iter().chain(&out.arm.velocity).chain(&out.arm.effort);
            let body = out.human.capsules.iter().flat_map(|c| c.ends.iter().flatten().chain(&c.velocity));
            for number in numbers.chain(body) {
                assert!(number.is_finite(), "cycle {cycle}: {out:?}");
                digest.update(&number.to_le_bytes());
            }
            digest.update(format!("{:?} {:?} {}", out.cell, out.operator, out.scan_due).as_bytes());
        }
        digest.finalize()
    };
    assert_eq!(run(7), run(7));
}

/// How long a cycle takes, printed for the record; the bound leaves room for a loaded machine.
#[test]
fn a_cycle_is_short() {
    let mut rig = Rig::new(17);
    rig.tell(PromptKind::Assemble, 1, &Isometry3::identity());
    rig.ask(RequestKind::Present, 1);
    let home = rig.command.position;
    let mut times: Vec<u128> = Vec::with_capacity(20_000);
    for cycle in 0..20_000u32 {
        let t = f64::from(cycle) * 1e-3;
        rig.command.position[0] = home[0] + 0.3 * (1.0 - t.cos());
        rig.command.velocity[0] = 0.3 * t.sin();
        let began = Instant::now();
        rig.cycle();
        times.push(began.elapsed().as_nanos());
    }
    times.sort_unstable();
    let at = |share: f64| times[(share * (times.len() - 1) as f64) as usize] as f64 / 1e3;
    println!("plant cycle: p50 {:.1} us, p99 {:.1} us, max {:.1} us", at(0.5), at(0.99), at(1.0));
    assert!(at(0.5) < 250.0);
}
