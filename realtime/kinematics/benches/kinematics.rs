//! How long are poses, Jacobian and inverse kinematics of six and of seven joints?
//!
//! Reads the reference robots beside the tests; prints one JSON object a case: the least and the
//! median over batches, nanoseconds a call, on one core; what else runs only ever adds.
#![allow(clippy::disallowed_types, clippy::disallowed_methods, clippy::disallowed_macros, reason = "a bench measures")]

use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

use nalgebra::{Isometry3, Quaternion, Translation3, Unit, UnitQuaternion, Vector3};
use tandem_kinematics::{Chain, JOINTS_MAX, Joint, JointKind};

const BATCHES: usize = 200;

fn rows(file: &str) -> Vec<Vec<f64>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(file);
    let text = std::fs::read_to_string(&path).expect("reference data is beside the tests");
    let number = |field: &str| field.parse().unwrap_or(f64::NAN);
    text.lines().skip(1).map(|line| line.split(',').map(number).collect()).collect()
}

fn pose(n: &[f64]) -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(n[6], n[3], n[4], n[5]));
    Isometry3::from_parts(Translation3::new(n[0], n[1], n[2]), rotation)
}

fn chain(robot: &str) -> Chain {
    let rows = rows(&format!("{robot}_chain.csv"));
    let (tool, joints) = rows.split_last().expect("the tool is the last row");
    let joint = |row: &Vec<f64>| Joint {
        kind: JointKind::Revolute,
        parent_from_joint: pose(&row[1..8]),
        axis: Unit::new_normalize(Vector3::new(row[8], row[9], row[10])),
        position_min: row[11],
        position_max: row[12],
        velocity_max: row[13],
        acceleration_max: 10.0,
        jerk_max: 100.0,
        effort_max: 100.0,
    };
    let joints: Vec<Joint> = joints.iter().map(joint).collect();
    Chain::new(&joints, pose(&tool[1..8])).expect("a reference robot is a chain")
}

/// Nanoseconds a call: least and median over batches that go once through the positions.
fn measure(positions: &[[f64; JOINTS_MAX]], mut call: impl FnMut(&[f64; JOINTS_MAX])) -> (f64, f64) {
    let mut batches: Vec<f64> = (0..BATCHES)
        .map(|_| {
            let begin = Instant::now();
            for position in positions {
                call(black_box(position));
            }
            begin.elapsed().as_nanos() as f64 / positions.len() as f64
        })
        .collect();
    batches.sort_by(f64::total_cmp);
    (batches[0], batches[BATCHES / 2])
}

fn main() {
    for (robot, count) in [("ur5", 6), ("panda", 7)] {
        let chain = chain(robot);
        let mut positions: Vec<[f64; JOINTS_MAX]> = Vec::new();
        for row in rows(&format!("{robot}_fk.csv")) {
            let mut position = [0.0; JOINTS_MAX];
            position[..count].copy_from_slice(&row[..count]);
            positions.push(position);
        }
        let report = |case: &str, (least, median): (f64, f64)| {
            println!(
                "{{\"bench\":\"kinematics\",\"case\":\"{robot} {case}\",\"ours\":{least:.0},\"median\":{median:.0},\"unit\":\"ns\"}}"
            );
        };
        report("forward", measure(&positions, |q| _ = black_box(chain.forward(q))));
        report("forward and Jacobian", measure(&positions, |q| _ = black_box(chain.jacobian(q))));
        let near = |q: &[f64; JOINTS_MAX]| {
            let goal = chain.forward(q).base_from_tcp;
            let seed = core::array::from_fn(|k| q[k] + if k % 2 == 0 { 0.2 } else { -0.2 });
            let _ = black_box(chain.inverse(&goal, &seed));
        };
        report("inverse, near seed", measure(&positions, near));
        let far = |q: &[f64; JOINTS_MAX]| {
            let _ = black_box(chain.inverse(&chain.forward(q).base_from_tcp, &[0.0; JOINTS_MAX]));
        };
        report("inverse, far seed", measure(&positions, far));
    }
}
