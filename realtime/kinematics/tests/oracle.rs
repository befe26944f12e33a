//! Poses, Jacobians and inverse solutions against outside references.
#![allow(clippy::disallowed_types, clippy::disallowed_macros, reason = "a test may allocate")]

mod reference;

use nalgebra::{Isometry3, Vector3};
use reference::{ROBOTS, chain, pose, positions, rows};
use tandem_kinematics::{Chain, IkFailure, JOINTS_MAX, Joint, JointKind};

fn off_by(chain: &Chain, position: &[f64; JOINTS_MAX], goal: &Isometry3<f64>) -> (f64, f64) {
    let pose = chain.forward(position).base_from_tcp;
    let shift = (pose.translation.vector - goal.translation.vector).norm();
    (shift, pose.rotation.angle_to(&goal.rotation))
}

/// TCP pose and Jacobian agree to 1e-9 on six and on seven joints.
#[test]
fn poses_and_jacobians_agree_with_the_reference() {
    for (robot, count) in ROBOTS {
        let chain = chain(robot);
        let rows = rows(&format!("{robot}_fk.csv"));
        assert!(rows.len() > 100, "{robot}: {} rows", rows.len());
        for (index, row) in rows.iter().enumerate() {
            let position = positions(row, count);
            let (poses, jacobian) = chain.jacobian(&position);
            let (tcp, short) = chain.tcp_jacobian(&position);
            assert!(
                (tcp.to_homogeneous() - poses.base_from_tcp.to_homogeneous()).amax() < 1e-14,
                "{robot} row {index}"
            );
            assert!((short - jacobian).amax() < 1e-14, "{robot} row {index}: {short} {jacobian}");
            let reference = pose(&row[count..count + 7]);
            let (shift, turn) = off_by(&chain, &position, &reference);
            // A rotation error is measured through acos, which halves the digits.
            assert!(shift < 1e-9 && turn < 1e-7, "{robot} row {index}: {shift} m, {turn} rad");
            let difference = poses.base_from_tcp.rotation.to_rotation_matrix().into_inner()
                - reference.rotation.to_rotation_matrix().into_inner();
            assert!(difference.amax() < 1e-9, "{robot} row {index}: {difference}");
            for r in 0..6 {
                for c in 0..count {
                    let expected = row[count + 7 + r * count + c];
                    assert!(
                        (jacobian[(r, c)] - expected).abs() < 1e-9,
                        "{robot} row {index}: J[{r}][{c}] = {}, reference {expected}",
                        jacobian[(r, c)]
                    );
                }
            }
        }
    }
}

/// Every reference pose of the UR5 is solved in closed form from a far seed, each branch exactly,
/// and one branch is the reference position itself.
#[test]
fn the_closed_form_finds_every_branch() {
    let chain = chain("ur5");
    let mut counted = 0;
    for (index, row) in rows("ur5_fk.csv").iter().enumerate() {
        let position = positions(row, 6);
        let goal = chain.forward(&position).base_from_tcp;
        let branches = chain.branches(&goal, &[0.0; JOINTS_MAX]).unwrap_or_else(|e| panic!("row {index}: {e}"));
        counted += branches.as_slice().len();
        for branch in branches.as_slice() {
            let (shift, turn) = off_by(&chain, branch, &goal);
            assert!(shift < 1e-8 && turn < 3e-8, "row {index}: {shift} m, {turn} rad in {branch:?}");
        }
        let found = branches.as_slice().iter().any(|branch| {
            branch
                .iter()
                .zip(&position)
                .all(|(a, b)| (a - b).abs() < 1e-6 || ((a - b).abs() - std::f64::consts::TAU).abs() < 1e-6)
        });
        assert!(found, "row {index}: {position:?} is not among {branches:?}");
        let nearest = chain.inverse(&goal, &position).expect("solved above");
        assert!(nearest.iter().zip(&position).all(|(a, b)| (a - b).abs() < 1e-6), "row {index}: {nearest:?}");
    }
    assert!(counted as f64 / rows("ur5_fk.csv").len() as f64 > 5.0, "{counted} branches");
}

/// The seven-joint arm is solved numerically: all reference poses from a far seed.
#[test]
fn the_numeric_search_solves_reachable_poses() {
    let chain = chain("panda");
    let seed = [0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.8, 0.0];
    let mut failed = 0;
    let rows = rows("panda_fk.csv");
    for row in &rows {
        let goal = pose(&row[7..14]);
        match chain.inverse(&goal, &seed) {
            Ok(solution) => {
                let (shift, turn) = off_by(&chain, &solution, &goal);
                assert!(shift < 1e-7 && turn < 1e-6, "{shift} m, {turn} rad");
                assert!(chain.is_within_limits(&solution, 0.0), "{solution:?}");
            }
            Err(_) => failed += 1,
        }
    }
    assert_eq!(failed, 0, "of {}", rows.len());
}

/// Each failure is told apart from the others.
#[test]
fn failures_are_typed() {
    for robot in ["ur5", "panda"] {
        let chain = chain(robot);
        let seed = [0.1, -1.0, 0.2, -1.2, 0.3, 1.4, 0.5, 0.0];
        let goal = chain.forward(&seed).base_from_tcp;
        let far = Isometry3::translation(3.0, 0.0, 0.0) * goal;
        assert_eq!(chain.inverse(&far, &seed), Err(IkFailure::Unreachable), "{robot}");
        let mut broken = goal;
        broken.translation.vector.x = f64::NAN;
        assert_eq!(chain.inverse(&broken, &seed), Err(IkFailure::NotFinite), "{robot}");
        let mut lost = seed;
        lost[2] = f64::INFINITY;
        assert_eq!(chain.inverse(&goal, &lost), Err(IkFailure::NotFinite), "{robot}");
        // Every joint held to a hair's breadth far from the solution.
        let held: Vec<Joint> =
            chain.joints().iter().map(|joint| Joint { position_min: 2.9, position_max: 2.901, ..*joint }).collect();
        let held = Chain::new(&held, *chain.tool()).expect("narrow limits are limits");
        assert_eq!(held.inverse(&goal, &seed), Err(IkFailure::JointLimit), "{robot}");
    }
}

/// A position that is not a number gives poses that say so, and nothing panics.
#[test]
fn what_is_not_finite_shows() {
    let chain = chain("ur5");
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for joint in 0..6 {
            let mut position = [0.3; JOINTS_MAX];
            position[joint] = value;
            assert!(!chain.forward(&position).is_finite(), "joint {joint} at {value}");
        }
    }
    assert!(chain.forward(&[0.3; JOINTS_MAX]).is_finite());
}

/// An arm on a rail has more joints than the task needs: still every pose it can take is solved, within
/// limits, and the same question gets the same answer.
#[test]
fn an_arm_on_a_rail_is_solved() {
    let arm = chain("panda");
    let rail = Joint {
        kind: JointKind::Prismatic,
        parent_from_joint: Isometry3::identity(),
        axis: Vector3::x_axis(),
        position_min: -0.5,
        position_max: 0.5,
        velocity_max: 1.0,
        acceleration_max: 2.0,
        jerk_max: 20.0,
        effort_max: 500.0,
    };
    let joints: Vec<Joint> = [rail].into_iter().chain(arm.joints().iter().copied()).collect();
    let chain = Chain::new(&joints, *arm.tool()).expect("eight joints are a chain");
    let seed = [0.0, 0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.8];
    for (index, row) in rows("panda_fk.csv").iter().enumerate() {
        let mut position = [0.0; JOINTS_MAX];
        position[0] = (index as f64 * 0.37).fract() - 0.5;
        position[1..].copy_from_slice(&row[..7]);
        let goal = chain.forward(&position).base_from_tcp;
        let solution = chain.inverse(&goal, &seed).unwrap_or_else(|failure| panic!("row {index}: {failure}"));
        let (shift, turn) = off_by(&chain, &solution, &goal);
        assert!(shift < 1e-7 && turn < 1e-6, "row {index}: {shift} m, {turn} rad");
        assert!(chain.is_within_limits(&solution, 0.0), "row {index}: {solution:?}");
        assert_eq!(chain.inverse(&goal, &seed), Ok(solution), "row {index}");
    }
}

/// Velocities of points of the arm agree with differences of their positions.
#[test]
fn point_velocities_agree_with_motion() {
    for (robot, count) in ROBOTS {
        let chain = chain(robot);
        for row in rows(&format!("{robot}_fk.csv")).iter().step_by(10) {
            let position = positions(row, count);
            let velocity = core::array::from_fn(|k| if k < count { 0.3 - 0.1 * k as f64 } else { 0.0 });
            let step = 1e-6;
            let later = core::array::from_fn(|k| position[k] + step * velocity[k]);
            let (now, then) = (chain.forward(&position), chain.forward(&later));
            for link in 0..=count {
                let on_link = nalgebra::Point3::new(0.1, -0.2, 0.05);
                let [a, b] = [&now, &then].map(|poses| (poses.base_from_link[link] * on_link).coords);
                let expected = (b - a) / step;
                let found = chain.point_velocity(&now, link, &a, &velocity);
                assert!((found - expected).norm() < 1e-5, "{robot} link {link}: {found} against {expected}");
            }
        }
    }
}
