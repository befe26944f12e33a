//! Are the branches that the closed form finds all there are? Six arms of Universal Robots beside
//! `ur_analytic_ik` (C++ of the PyPI wheel): every position it finds for a pose must be among ours.
#![allow(clippy::disallowed_types, clippy::disallowed_macros, reason = "a bench prints")]

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::hint::black_box;

use nalgebra::{Isometry3, Matrix4, Translation3, UnitQuaternion, Vector3};
use tandem_kinematics::{Chain, JOINTS_MAX, Joint, JointKind};
use tandem_peers::{Bench, Contender, Program, per_call};

/// Denavit and Hartenberg's d₁, a₂, a₃, d₄, d₅, d₆ as Universal Robots publishes them, metres.
const ARMS: [(&str, [f64; 6]); 6] = [
    ("ur3", [0.1519, -0.24365, -0.21325, 0.11235, 0.08535, 0.0819]),
    ("ur5", [0.089159, -0.425, -0.39225, 0.10915, 0.09465, 0.0823]),
    ("ur10", [0.1273, -0.612, -0.5723, 0.163941, 0.1157, 0.0922]),
    ("ur3e", [0.15185, -0.24355, -0.2132, 0.13105, 0.08535, 0.0921]),
    ("ur5e", [0.1625, -0.425, -0.3922, 0.1333, 0.0997, 0.0996]),
    ("ur10e", [0.1807, -0.6127, -0.57155, 0.17415, 0.11985, 0.11655]),
];
/// Positions that are asked of each arm.
const POSES: usize = 500;
/// How far apart two positions may be that are the same, rad.
const SAME: f64 = 1e-6;

fn main() {
    let bench = Bench::new("branches");
    let mut peer = bench.program("ur_analytic_ik", || {
        let python = tandem_peers::python("ur-analytic-ik", &["ur-analytic-ik==0.1.0.post3", "numpy"])?;
        Program::start(python.command().arg(concat!(env!("CARGO_MANIFEST_DIR"), "/peers/branches.py")))
    });
    for (arm, [d1, a2, a3, d4, d5, d6]) in ARMS {
        let chain = chain(&[
            (d1, 0.0, FRAC_PI_2),
            (0.0, a2, 0.0),
            (0.0, a3, 0.0),
            (d4, 0.0, FRAC_PI_2),
            (d5, 0.0, -FRAC_PI_2),
            (d6, 0.0, 0.0),
        ]);
        let positions: Vec<_> = (1..=if bench.is_brief() { 50 } else { POSES }).map(position).collect();
        let poses: Vec<_> = positions.iter().map(|position| chain.forward(position).base_from_tcp).collect();
        let (mut ours, mut theirs, mut missed) = (0, 0, 0);
        for (position, pose) in positions.iter().zip(&poses) {
            let found =
                chain.branches(pose, position).unwrap_or_else(|failure| panic!("{arm} {position:?}: {failure}"));
            assert!(found.as_slice().iter().any(|branch| same(branch, position)), "{arm}: {position:?} is not found");
            ours += found.as_slice().len();
            let Some(peer) = peer.as_mut() else { continue };
            let words: Vec<String> = position[..6].iter().map(f64::to_string).collect();
            let answer = peer.line(&format!("{arm} {}", words.join(" ")));
            let numbers: Vec<f64> = answer.split(' ').map(|word| word.parse().expect("a number")).collect();
            let there = Matrix4::from_row_slice(&[&numbers[..12], &[0.0, 0.0, 0.0, 1.0]].concat());
            let off = (there - pose.to_homogeneous()).amax();
            assert!(off < 1e-9, "{arm}: the arms differ by {off}");
            for branch in numbers[12..].chunks_exact(6) {
                theirs += 1;
                missed += usize::from(!found.as_slice().iter().any(|own| same(own, branch)));
            }
        }
        let case = format!("{arm}: branches of {} poses, {missed} of theirs not among ours", positions.len());
        let peer_count = if peer.is_some() { theirs.to_string() } else { "null".to_owned() };
        println!(
            "{{\"bench\":\"branches\",\"case\":\"{case}\",\"ours\":{ours},\"peer\":\"ur_analytic_ik\",\"peer_value\":{peer_count},\"unit\":\"branches\",\"ratio\":null}}"
        );
        assert_eq!(missed, 0, "{case}");
        let each = || {
            let call = |index: u32| chain.branches(black_box(&poses[index as usize]), &positions[0]);
            per_call(poses.len() as u32, |index| black_box(call(index)).is_ok()) / 1e3
        };
        let mut contenders = vec![Contender::new("ours", each)];
        contenders.extend(peer.as_mut().map(|peer| Contender::new("by Python", || peer.round(&format!("{arm} time")))));
        bench.compare(&format!("{arm}: all branches of a pose"), "us", contenders);
    }
}

/// A chain by d, a and α of each joint; each turns half a turn either way.
fn chain(rows: &[(f64, f64, f64)]) -> Chain {
    let mut parent_from_joint = Isometry3::identity();
    let mut joints = Vec::new();
    for (d, a, alpha) in rows {
        joints.push(Joint {
            kind: JointKind::Revolute,
            parent_from_joint,
            axis: Vector3::z_axis(),
            position_min: -PI,
            position_max: PI,
            velocity_max: 3.0,
            acceleration_max: 10.0,
            jerk_max: 100.0,
            effort_max: 100.0,
        });
        let turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), *alpha);
        parent_from_joint = Isometry3::from_parts(Translation3::new(*a, 0.0, *d), turn);
    }
    Chain::new(&joints, parent_from_joint).expect("six joints are a chain")
}

/// Positions spread evenly within half a turn; the same for the same number.
fn position(index: usize) -> [f64; JOINTS_MAX] {
    /// Fractions of a turn whose multiples spread evenly: powers of the inverse of the root of x⁷ = x + 1.
    const STEP: f64 = 0.898_654;
    std::array::from_fn(|joint| {
        let share = (0.5 + index as f64 * STEP.powi(joint as i32 + 1)).fract();
        if joint < 6 { PI * (2.0 * share - 1.0) } else { 0.0 }
    })
}

/// Whether two positions are the same, whole turns aside.
fn same(a: &[f64], b: &[f64]) -> bool {
    let turn = |(a, b): (&f64, &f64)| ((a - b + PI).rem_euclid(TAU) - PI).abs();
    a.iter().zip(b).take(6).map(turn).fold(0.0, f64::max) < SAME
}
