//! The reference robots: joints, positions, poses and Jacobians of a UR5 and a Panda, as pinocchio
//! 4.1.0 has them of the public package `example-robot-data` 6.0.0. Tests and benches include this by its path.
//!
//! The files in the tree are every third row or so of a larger set. With TANDEM_MOTION_REFERENCE naming a folder, files
//! of the same names are read from there instead.
//!
//! `ROBOT_chain.csv`: a row a joint (pose in the parent, axis, limits), the tool last.
//! `ROBOT_fk.csv`: positions, TCP pose, Jacobian in base axes row by row.

#![allow(dead_code, reason = "who includes this uses some of it")]

use std::path::{Path, PathBuf};

use nalgebra::{Isometry3, Quaternion, Translation3, Unit, UnitQuaternion, Vector3};
use tandem_kinematics::{Chain, JOINTS_MAX, Joint, JointKind};

/// Names and joint counts.
pub(crate) const ROBOTS: [(&str, usize); 2] = [("ur5", 6), ("panda", 7)];

/// The folder of the files.
pub(crate) fn folder() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../kinematics/tests/data"))
}

/// Fields of a file but for its headline.
pub(crate) fn fields(folder: &Path, file: &str) -> Vec<Vec<String>> {
    let larger = std::env::var_os("TANDEM_MOTION_REFERENCE").map(|larger| PathBuf::from(larger).join(file));
    let path = larger.filter(|path| path.is_file()).unwrap_or_else(|| folder.join(file));
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    text.lines().skip(1).map(|line| line.split(',').map(str::to_owned).collect()).collect()
}

/// Numbers of a file but for its headline; what is no number reads as NaN.
pub(crate) fn rows(file: &str) -> Vec<Vec<f64>> {
    let numbers = |row: Vec<String>| row.iter().map(|field| field.parse().unwrap_or(f64::NAN)).collect();
    fields(folder(), file).into_iter().map(numbers).collect()
}

/// A pose of x, y, z, qx, qy, qz, qw.
pub(crate) fn pose(n: &[f64]) -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(n[6], n[3], n[4], n[5]));
    Isometry3::from_parts(Translation3::new(n[0], n[1], n[2]), rotation)
}

/// The joints of a robot and its tool, the joints limited to `beyond` either way.
pub(crate) fn chain_within(robot: &str, beyond: f64) -> Chain {
    let rows = rows(&format!("{robot}_chain.csv"));
    let (tool, joints) = rows.split_last().expect("the tool is the last row");
    let joint = |row: &Vec<f64>| Joint {
        kind: JointKind::Revolute,
        parent_from_joint: pose(&row[1..8]),
        axis: Unit::new_normalize(Vector3::new(row[8], row[9], row[10])),
        position_min: row[11].max(-beyond),
        position_max: row[12].min(beyond),
        velocity_max: row[13],
        acceleration_max: 10.0,
        jerk_max: 100.0,
        effort_max: 100.0,
    };
    let joints: Vec<Joint> = joints.iter().map(joint).collect();
    Chain::new(&joints, pose(&tool[1..8])).expect("a reference robot is a chain")
}

/// A robot, its joints limited to half a turn either way.
pub(crate) fn chain(robot: &str) -> Chain {
    chain_within(robot, std::f64::consts::PI)
}

/// The first `count` numbers as positions of joints.
pub(crate) fn positions(row: &[f64], count: usize) -> [f64; JOINTS_MAX] {
    let mut position = [0.0; JOINTS_MAX];
    position[..count].copy_from_slice(&row[..count]);
    position
}

/// A position within the limits, from eight numbers between 0 and 1.
pub(crate) fn within_limits(chain: &Chain, share: &[f64; JOINTS_MAX]) -> [f64; JOINTS_MAX] {
    let mut position = [0.0; JOINTS_MAX];
    for ((q, joint), share) in position.iter_mut().zip(chain.joints()).zip(share) {
        *q = joint.position_min + (joint.position_max - joint.position_min) * share;
    }
    position
}
