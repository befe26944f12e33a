//! Every kind of pair against parry3d in f64, on random placements.
//!
//! parry's distances are upper bounds within some 20 µm and 0 on overlap, so ours
//! may lie below them by that much and never above. Its contact test gives the sign.
#![allow(clippy::disallowed_types, clippy::disallowed_macros, reason = "a test may allocate")]

use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};
use parry3d_f64::glamx::{DPose3, DQuat, DVec3};
use parry3d_f64::query;
use parry3d_f64::shape::{Ball, Capsule as ParryCapsule, Cuboid, Cylinder, Shape};
use proptest::prelude::*;
use tandem_clearance::{ArmBody, LinkCapsule, Monitor};
use tandem_kinematics::{Chain, JOINTS_MAX, Joint, JointKind};
use tandem_msg::{AttachedPart, Capsule, Pose, SceneObject, ShapeKind};

/// What parry may be above the truth, metres.
const PARRY: f64 = 3e-5;

fn pose() -> impl Strategy<Value = Isometry3<f64>> {
    let unit = -1.0..1.0_f64;
    ([unit.clone(), unit.clone(), unit.clone()], [unit.clone(), unit.clone(), unit.clone(), unit]).prop_map(|(t, q)| {
        let quaternion = nalgebra::Quaternion::new(q[0] + 1e-3, q[1], q[2], q[3]);
        Isometry3::from_parts(
            Translation3::new(0.4 * t[0], 0.4 * t[1], 0.4 * t[2]),
            UnitQuaternion::from_quaternion(quaternion),
        )
    })
}

fn object() -> impl Strategy<Value = SceneObject> {
    (0..4_u32, [0.01..0.3_f64, 0.01..0.3, 0.01..0.3], pose()).prop_map(|(shape, size, pose)| SceneObject {
        id: 7,
        shape: tandem_msg::Code::from_raw(shape),
        size,
        base_from_object: message(&pose),
    })
}

fn message(pose: &Isometry3<f64>) -> Pose {
    Pose { position: pose.translation.vector.into(), rotation: pose.rotation.coords.into() }
}

fn shape_of(object: &SceneObject) -> (Box<dyn Shape>, DPose3) {
    let [a, b, c] = object.size;
    let Some(kind) = object.shape.get() else { panic!("{object:?} has a shape") };
    let (shape, turn): (Box<dyn Shape>, DQuat) = match kind {
        ShapeKind::Box => (Box::new(Cuboid::new(DVec3::new(a, b, c))), DQuat::IDENTITY),
        // parry's stand along y.
        ShapeKind::Cylinder => (Box::new(Cylinder::new(b, a)), DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2)),
        ShapeKind::Capsule => (Box::new(ParryCapsule::new_z(b, a)), DQuat::IDENTITY),
        ShapeKind::Sphere | ShapeKind::Registered => (Box::new(Ball::new(a)), DQuat::IDENTITY),
    };
    let mut place = parry(&object.base_from_object);
    place.rotation *= turn;
    (shape, place)
}

fn parry(pose: &Pose) -> DPose3 {
    let [x, y, z, w] = pose.rotation;
    DPose3 { rotation: DQuat::from_xyzw(x, y, z, w), translation: DVec3::from_array(pose.position) }
}

/// A chain of one still joint: link 1 and the TCP are where the base is.
fn chain() -> Chain {
    let joint = Joint {
        kind: JointKind::Revolute,
        parent_from_joint: Isometry3::identity(),
        axis: Vector3::z_axis(),
        position_min: -3.0,
        position_max: 3.0,
        velocity_max: 1.0,
        acceleration_max: 1.0,
        jerk_max: 1.0,
        effort_max: 1.0,
    };
    Chain::new(&[joint], Isometry3::identity()).expect("one joint is a chain")
}

fn monitor(capsule: LinkCapsule) -> Monitor {
    Monitor::new(ArmBody::new(&[capsule], &[]).expect("one capsule is an arm"))
}

/// A capsule so far away that only the carried part counts.
const AWAY: LinkCapsule = LinkCapsule { link: 1, ends: [[500.0; 3]; 2], radius: 0.01, tool: true };

fn compare(
    ours: f64,
    shapes: (&dyn Shape, &DPose3),
    others: (&dyn Shape, &DPose3),
    slack: f64,
) -> Result<(), TestCaseError> {
    let theirs = query::distance(shapes.1, shapes.0, others.1, others.0).expect("a pair parry knows").distance;
    prop_assert!(ours <= theirs + 1e-9 || (theirs == 0.0 && ours <= PARRY), "ours {ours} m, parry's {theirs} m");
    if theirs > 0.0 {
        prop_assert!(ours >= theirs - PARRY - slack, "ours {ours} m, parry's {theirs} m");
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 8_000, failure_persistence: None, ..ProptestConfig::default() })]

    /// A capsule of the arm against every shape of a scene.
    #[test]
    fn capsules_agree((a, b, radius, object) in ([-0.4..0.4_f64, -0.4..0.4, -0.4..0.4], [-0.4..0.4_f64, -0.4..0.4, -0.4..0.4], 0.01..0.15_f64, object())) {
        let mut monitor = monitor(LinkCapsule { link: 1, ends: [a, b], radius, tool: false });
        monitor.set_scene(&[object]).expect("a sound object");
        let clearance = monitor.clearance(&chain().forward(&[0.0; JOINTS_MAX]));
        let own = ParryCapsule::new(DVec3::from_array(a), DVec3::from_array(b), radius);
        let (shape, place) = shape_of(&object);
        compare(clearance.distance, (&own, &DPose3::IDENTITY), (&*shape, &place), 0.0)?;
        let [p, q] = [clearance.point_on_arm, clearance.point_on_other].map(Vector3::from);
        prop_assert!(((p - q).norm() - clearance.distance.abs()).abs() < 1e-6, "{clearance:?}");
    }

    /// The carried part against every shape of a scene; against a cylinder ours may be nearer, by no
    /// more than the corner a box adds to it.
    #[test]
    fn carried_parts_agree((half, place, object) in ([0.005..0.2_f64, 0.005..0.2, 0.005..0.2], pose(), object())) {
        let mut monitor = monitor(AWAY);
        monitor.set_scene(&[object]).expect("a sound object");
        let part = AttachedPart { present: 1, half_extents: half, tcp_from_part: message(&place), ..AttachedPart::default() };
        monitor.set_attached(Some(&part));
        let clearance = monitor.clearance(&chain().forward(&[0.0; JOINTS_MAX]));
        let own = Cuboid::new(DVec3::from_array(half));
        let (shape, other) = shape_of(&object);
        let slack = if object.shape.is(ShapeKind::Cylinder) { 0.42 * object.size[0] } else { 0.0 };
        compare(clearance.distance, (&own, &parry(&part.tcp_from_part)), (&*shape, &other), slack)?;
        let [p, q] = [clearance.point_on_arm, clearance.point_on_other].map(Vector3::from);
        prop_assert!(((p - q).norm() - clearance.distance.abs()).abs() < 1e-6, "{clearance:?}");
    }

    /// The carried part against a person, with the direction from the part to the person.
    #[test]
    fn carried_parts_and_people_agree((half, place, a, b, radius) in ([0.005..0.2_f64, 0.005..0.2, 0.005..0.2], pose(), [-0.6..0.6_f64, -0.6..0.6, -0.6..0.6], [-0.6..0.6_f64, -0.6..0.6, -0.6..0.6], 0.01..0.15_f64)) {
        let mut monitor = monitor(AWAY);
        let part = AttachedPart { present: 1, half_extents: half, tcp_from_part: message(&place), ..AttachedPart::default() };
        monitor.set_attached(Some(&part));
        monitor.set_human(&[Capsule { ends: [a, b], radius, velocity: [0.1, 0.2, 0.3] }]);
        let separation = monitor.separation(&chain().forward(&[0.0; JOINTS_MAX]));
        let own = Cuboid::new(DVec3::from_array(half));
        let person = ParryCapsule::new(DVec3::from_array(a), DVec3::from_array(b), radius);
        compare(separation.distance, (&own, &parry(&part.tcp_from_part)), (&person, &DPose3::IDENTITY), 0.0)?;
        prop_assert_eq!(separation.human_velocity, [0.1, 0.2, 0.3]);
        if separation.distance > 1e-6 {
            let direction = Unit::new_normalize(Vector3::from(separation.direction));
            let from = Vector3::from(separation.point_on_arm) + direction.into_inner() * separation.distance;
            // The point reached lies on the person's surface.
            let axis = Vector3::from(b) - Vector3::from(a);
            let share = ((from - Vector3::from(a)).dot(&axis) / axis.norm_squared()).clamp(0.0, 1.0);
            let off = (from - Vector3::from(a) - axis * share).norm() - radius;
            prop_assert!(off.abs() < 1e-6, "{separation:?} ends {off} m off the person");
        }
    }
}
