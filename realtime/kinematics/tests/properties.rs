//! What holds for every chain: random joints, frames and tools, not only the reference robots.
#![allow(clippy::disallowed_types, clippy::disallowed_macros, reason = "a test may allocate")]

use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};
use proptest::prelude::*;
use tandem_kinematics::{Chain, IkFailure, JOINTS_MAX, Joint, JointKind, manipulability};

fn vector(size: f64) -> impl Strategy<Value = Vector3<f64>> {
    [-size..size, -size..size, -size..size].prop_map(Vector3::from)
}

fn direction() -> impl Strategy<Value = Unit<Vector3<f64>>> {
    vector(1.0).prop_filter_map("a vector too short to point", |v| Unit::try_new(v, 0.1))
}

fn rotation() -> impl Strategy<Value = UnitQuaternion<f64>> {
    (direction(), -3.1..3.1).prop_map(|(axis, angle)| UnitQuaternion::from_axis_angle(&axis, angle))
}

fn pose() -> impl Strategy<Value = Isometry3<f64>> {
    (vector(0.6), rotation()).prop_map(|(shift, turn)| Isometry3::from_parts(Translation3::from(shift), turn))
}

fn joint_of(kind: JointKind, parent_from_joint: Isometry3<f64>, axis: Unit<Vector3<f64>>) -> Joint {
    let wide = if kind == JointKind::Revolute { std::f64::consts::PI } else { 0.5 };
    Joint {
        kind,
        parent_from_joint,
        axis,
        position_min: -wide,
        position_max: wide,
        velocity_max: 1.0,
        acceleration_max: 1.0,
        jerk_max: 1.0,
        effort_max: 1.0,
    }
}

/// Any chain. Some axes are exactly parallel or opposed to z, where directions degenerate.
fn chain() -> impl Strategy<Value = Chain> {
    let axis = prop_oneof![direction(), Just(Vector3::z_axis()), Just(-Vector3::z_axis()), Just(Vector3::y_axis())];
    let frame = prop_oneof![pose(), vector(0.5).prop_map(|v| Translation3::from(v).into())];
    let kind = prop_oneof![4 => Just(JointKind::Revolute), 1 => Just(JointKind::Prismatic)];
    let joint = (kind, frame, axis).prop_map(|(kind, frame, axis)| joint_of(kind, frame, axis));
    (prop::collection::vec(joint, 1..=JOINTS_MAX), pose())
        .prop_map(|(joints, tool)| Chain::new(&joints, tool).expect("finite joints are a chain"))
}

fn positions() -> impl Strategy<Value = [f64; JOINTS_MAX]> {
    prop::array::uniform8(-1.0..1.0)
}

/// A six-joint arm with a spherical wrist: axes 2 and 3 parallel, square to 1; offsets, sides, senses and
/// joint frames as they come.
fn industrial_arm() -> impl Strategy<Value = Chain> {
    let lengths = ([-0.4..0.4, 0.2..0.6, 0.2..0.7], prop::array::uniform6(-0.1..0.1));
    (pose(), lengths, prop::array::uniform6(rotation()), prop::array::uniform6(prop::bool::ANY), pose()).prop_map(
        |(base, ([shoulder, upper, fore], small), turns, senses, tool)| {
            let [a, b, c, d, e, f] = small;
            // Axes and points on them, in the base's own frame at position 0.
            let axes = [Vector3::z(), Vector3::y(), Vector3::y(), Vector3::x(), Vector3::y(), Vector3::x()];
            let wrist = Vector3::new(shoulder + fore, a + b, 0.4 + upper + c);
            let points = [
                Vector3::new(0.0, 0.0, f),
                Vector3::new(shoulder, a, 0.4),
                Vector3::new(shoulder + d, b, 0.4 + upper),
                wrist - Vector3::new(e, 0.0, 0.0),
                wrist,
                wrist + Vector3::new(e, 0.0, 0.0),
            ];
            let mut before = Isometry3::identity();
            let joints: Vec<Joint> = (0..6)
                .map(|k| {
                    let frame = base * Isometry3::from_parts(Translation3::from(points[k]), turns[k]);
                    let sense = if senses[k] { 1.0 } else { -1.0 };
                    let axis = Unit::new_normalize(turns[k].inverse() * axes[k] * sense);
                    let joint = joint_of(JointKind::Revolute, before.inverse() * frame, axis);
                    before = frame;
                    joint
                })
                .collect();
            Chain::new(&joints, tool).expect("finite joints are a chain")
        },
    )
}

proptest! {
    /// The short way and the long way to the TCP agree, and both with differences of poses.
    #[test]
    fn the_jacobian_is_the_derivative(chain in chain(), q in positions()) {
        let (poses, long) = chain.jacobian(&q);
        let (tcp, short) = chain.tcp_jacobian(&q);
        prop_assert!((tcp.to_homogeneous() - poses.base_from_tcp.to_homogeneous()).amax() < 1e-13);
        prop_assert!((short - long).amax() < 1e-13, "{short} {long}");
        let step = 1e-6;
        for joint in 0..JOINTS_MAX {
            let [before, after] = [-step, step].map(|by| {
                let mut moved = q;
                moved[joint] += by;
                chain.forward(&moved).base_from_tcp
            });
            let linear = (after.translation.vector - before.translation.vector) / (2.0 * step);
            let angular = (after.rotation * before.rotation.inverse()).scaled_axis() / (2.0 * step);
            let column = short.column(joint);
            prop_assert!((column.fixed_rows::<3>(0) - linear).amax() < 1e-7, "joint {joint}: {column} {linear}");
            prop_assert!((column.fixed_rows::<3>(3) - angular).amax() < 1e-7, "joint {joint}: {column} {angular}");
        }
    }

    /// √det(J·Jᵀ) is the product of the singular values.
    #[test]
    fn manipulability_is_the_product_of_singular_values(chain in chain(), q in positions()) {
        let jacobian = chain.tcp_jacobian(&q).1;
        let expected: f64 = jacobian.singular_values().iter().take(6).product();
        prop_assert!((manipulability(&jacobian) - expected).abs() < 1e-7);
    }

    /// Where an arm can be it can be brought: the solution is within limits and reaches the pose.
    #[test]
    fn a_pose_that_was_taken_is_reached(chain in chain(), q in positions()) {
        let count = chain.joint_count();
        let q: [f64; JOINTS_MAX] = std::array::from_fn(|k| if k < count { 0.45 * q[k] } else { 0.0 });
        let goal = chain.forward(&q).base_from_tcp;
        let solution = chain.inverse(&goal, &q);
        let found = solution.map(|solution| chain.forward(&solution).base_from_tcp);
        let reached = found.is_ok_and(|pose| (pose.to_homogeneous() - goal.to_homogeneous()).amax() < 1e-7);
        prop_assert!(reached, "{solution:?}");
    }

    /// With a spherical wrist every branch is exact, the position that was left is among them, and
    /// what the numeric search finds is one of them.
    #[test]
    fn a_spherical_wrist_is_solved_in_all_branches(chain in industrial_arm(), q in prop::array::uniform6(-3.0..3.0_f64)) {
        let mut position = [0.0; JOINTS_MAX];
        position[..6].copy_from_slice(&q);
        let (goal, jacobian) = chain.tcp_jacobian(&position);
        // At a singularity branches meet and are known to fewer digits.
        prop_assume!(manipulability(&jacobian) > 1e-3);
        let branches = chain.branches(&goal, &[0.1; JOINTS_MAX]);
        prop_assert!(branches.is_ok(), "{position:?}: {branches:?}");
        let branches = branches.expect("as asserted");
        let is_among = |wanted: &[f64; JOINTS_MAX]| branches.as_slice().iter().any(|branch| {
            branch.iter().zip(wanted).all(|(a, b)| (0.5 * (a - b)).sin().abs() < 1e-6)
        });
        prop_assert!(branches.as_slice().len() >= 2, "{branches:?}");
        prop_assert!(is_among(&position), "{position:?} not in {branches:?}");
        for branch in branches.as_slice() {
            let off = chain.forward(branch).base_from_tcp.to_homogeneous() - goal.to_homogeneous();
            prop_assert!(off.amax() < 1e-8, "{branch:?}: {off}");
        }
        let searched = chain.search(&goal, &[0.1; JOINTS_MAX]);
        let singular = |q: &[f64; JOINTS_MAX]| manipulability(&chain.tcp_jacobian(q).1) < 1e-4;
        prop_assert!(searched.is_ok_and(|q| is_among(&q) || singular(&q)), "{searched:?} not in {branches:?}");
    }

    /// Goals that are no numbers, and goals far away, are told from each other.
    #[test]
    fn failures_are_typed_for_every_chain(chain in chain(), q in positions(), entry in 0_usize..7) {
        let mut goal = chain.forward(&q).base_from_tcp;
        let far = Translation3::new(60.0, 0.0, 0.0) * goal;
        prop_assert_eq!(chain.inverse(&far, &q), Err(IkFailure::Unreachable));
        match entry {
            0..3 => goal.translation.vector[entry] = f64::NAN,
            _ => goal.rotation = UnitQuaternion::new_unchecked(goal.rotation.into_inner() * f64::INFINITY),
        }
        prop_assert_eq!(chain.inverse(&goal, &q), Err(IkFailure::NotFinite));
    }
}

/// A wrist that is stretched turns joints 4 and 6 about one axis: the seed's joint 4 is kept.
#[test]
fn a_stretched_wrist_keeps_the_seeds_turn() {
    let joint = |axis, x: f64, z: f64| joint_of(JointKind::Revolute, Isometry3::translation(x, 0.0, z), axis);
    let (x, y, z) = (Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis());
    let joints = [
        joint(z, 0.0, 0.1),
        joint(y, 0.0, 0.3),
        joint(y, 0.0, 0.5),
        joint(x, 0.2, 0.0),
        joint(y, 0.3, 0.0),
        joint(x, 0.0, 0.0),
    ];
    let chain = Chain::new(&joints, Isometry3::translation(0.1, 0.0, 0.0)).expect("six joints are a chain");
    let position = [0.3, 0.4, -0.9, 0.8, 0.0, -0.2, 0.0, 0.0];
    let goal = chain.forward(&position).base_from_tcp;
    let mut seed = position;
    seed[3] = 0.5;
    let found = chain.inverse(&goal, &seed).expect("the arm was there");
    let expected = [0.3, 0.4, -0.9, 0.5, 0.0, 0.1, 0.0, 0.0];
    assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{found:?}");
}
