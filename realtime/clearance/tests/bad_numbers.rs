//! What is not finite is a contact, what may be touched is not, and bad scenes are named.
#![allow(clippy::disallowed_types, clippy::disallowed_macros, reason = "a test may allocate")]

use nalgebra::{Isometry3, Vector3};
use tandem_clearance::{ArmBody, LinkCapsule, Monitor};
use tandem_kinematics::{Chain, JOINTS_MAX, Joint, JointKind, LinkPoses};
use tandem_msg::{AttachedPart, Capsule, Code, Pose, SceneObject, ShapeKind};

/// Two links of 0.5 m along x, turning about z; the second ends in a tool.
fn chain() -> Chain {
    let joint = |x: f64| Joint {
        kind: JointKind::Revolute,
        parent_from_joint: Isometry3::translation(x, 0.0, 0.0),
        axis: Vector3::z_axis(),
        position_min: -3.0,
        position_max: 3.0,
        velocity_max: 1.0,
        acceleration_max: 1.0,
        jerk_max: 1.0,
        effort_max: 1.0,
    };
    Chain::new(&[joint(0.0), joint(0.5)], Isometry3::translation(0.5, 0.0, 0.0)).expect("two joints are a chain")
}

fn monitor() -> Monitor {
    let arm = |link: usize, from: f64, to: f64, tool: bool| LinkCapsule {
        link,
        ends: [[from, 0.0, 0.0], [to, 0.0, 0.0]],
        radius: 0.05,
        tool,
    };
    let capsules = [arm(0, 0.0, 0.0, false), arm(1, 0.1, 0.4, false), arm(2, 0.1, 0.4, false), arm(2, 0.4, 0.5, true)];
    Monitor::new(ArmBody::new(&capsules, &[[0, 2]]).expect("four capsules are an arm"))
}

fn cube(id: u32, at: [f64; 3]) -> SceneObject {
    let base_from_object = Pose { position: at, ..Pose::IDENTITY };
    SceneObject { id, shape: ShapeKind::Box.into(), size: [0.1; 3], base_from_object }
}

fn straight() -> LinkPoses {
    chain().forward(&[0.0; JOINTS_MAX])
}

#[test]
fn an_empty_scene_leaves_the_arm_itself() {
    let clearance = monitor().clearance(&straight());
    assert_eq!((clearance.link, clearance.object), (2, 0));
    assert!((clearance.distance - 0.5).abs() < 1e-12, "{clearance:?}");
    assert_eq!(monitor().separation(&straight()).distance, f64::INFINITY);
}

/// Joint positions, scene, people and part: each alone turns the answer into a contact.
#[test]
fn what_is_not_finite_is_a_contact() {
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300] {
        let mut joints = [0.0; JOINTS_MAX];
        joints[0] = bad;
        let mut monitor = monitor();
        monitor.set_human(&[Capsule { ends: [[2.0; 3]; 2], radius: 0.1, velocity: [0.0; 3] }]);
        if !bad.is_finite() {
            let poses = chain().forward(&joints);
            assert_eq!(monitor.clearance(&poses).distance, f64::NEG_INFINITY, "joint at {bad}");
            assert_eq!(monitor.separation(&poses).distance, f64::NEG_INFINITY, "joint at {bad}");
            assert!(!monitor.is_clear(&poses, -1.0), "joint at {bad}");
            assert!(!monitor.path_is_clear(&chain(), &[0.0; JOINTS_MAX], &joints, 0.0, 1e-3), "joint at {bad}");
        }

        monitor.set_human(&[Capsule { ends: [[bad, 2.0, 2.0], [2.0; 3]], radius: 0.1, velocity: [0.0; 3] }]);
        assert_eq!(monitor.separation(&straight()).distance, f64::NEG_INFINITY, "person at {bad}");
        assert_eq!(monitor.separations(&straight())[0].distance, f64::NEG_INFINITY, "person at {bad}");
        monitor.set_human(&[]);
        assert_eq!(monitor.separation(&straight()).distance, f64::INFINITY);

        assert!(monitor.set_scene(&[cube(3, [bad, 0.0, 0.0])]).is_err(), "object at {bad}");
        assert_eq!(monitor.clearance(&straight()).distance, f64::NEG_INFINITY, "object at {bad}");
        assert_eq!(monitor.set_scene(&[]), Ok(()));
        assert!(monitor.clearance(&straight()).distance > 0.0);

        let part = AttachedPart { present: 1, half_extents: [0.1, bad, 0.1], ..AttachedPart::default() };
        monitor.set_attached(Some(&part));
        assert_eq!(monitor.clearance(&straight()).distance, f64::NEG_INFINITY, "part of {bad}");
        assert_eq!(monitor.separation(&straight()).distance, f64::NEG_INFINITY, "part of {bad}");
        monitor.set_attached(None);
        assert!(monitor.clearance(&straight()).distance > 0.0);
    }
}

/// Tool and part may touch what they are allowed to, the rest of the arm may not.
#[test]
fn touch_is_for_tool_and_part_alone() {
    let mut monitor = monitor();
    // Beside the tool, which it touches; the link behind the tool is 5 cm off.
    monitor.set_scene(&[cube(3, [0.98 + 0.1, 0.0, 0.0])]).expect("a sound object");
    let touching = monitor.clearance(&straight());
    assert_eq!((touching.link, touching.object), (2, 3));
    assert!(touching.distance < 0.0, "{touching:?}");
    monitor.set_touch(&[0, 3]);
    let allowed = monitor.clearance(&straight());
    assert_eq!((allowed.link, allowed.object), (2, 3));
    assert!((allowed.distance - 0.03).abs() < 1e-12, "{allowed:?}");
    assert!(monitor.is_clear(&straight(), 0.02));

    let part = AttachedPart { present: 1, half_extents: [0.05; 3], ..AttachedPart::default() };
    monitor.set_attached(Some(&part));
    assert!(monitor.clearance(&straight()).distance > 0.0);
    monitor.set_touch(&[]);
    assert!(monitor.clearance(&straight()).distance < 0.0);
}

/// A part hits the links it does not hang on.
#[test]
fn a_part_is_checked_against_the_arm() {
    let mut monitor = monitor();
    let part = AttachedPart {
        present: 1,
        half_extents: [0.05; 3],
        tcp_from_part: Pose { position: [-0.7, 0.2, 0.0], ..Pose::IDENTITY },
        ..AttachedPart::default()
    };
    monitor.set_attached(Some(&part));
    let clearance = monitor.clearance(&straight());
    assert_eq!((clearance.link, clearance.object), (2, 0));
    // Beside link 1, whose surface is at y = 0.05.
    assert!((clearance.distance - 0.1).abs() < 1e-12, "{clearance:?}");
}

#[test]
fn scenes_that_cannot_be_are_named() {
    let of = |objects: &[SceneObject]| monitor().set_scene(objects).unwrap_err().to_string();
    let good = cube(3, [1.0; 3]);
    assert_eq!(of(&[good; 49]), "the scene has 49 objects, allowed 0..=48");
    assert_eq!(of(&[good, good]), "object 1 of the scene has id = 3, allowed above 0 and used once");
    assert_eq!(of(&[SceneObject { id: 0, ..good }]), "object 0 of the scene has id = 0, allowed above 0 and used once");
    let odd = SceneObject { shape: Code::from_raw(9), ..good };
    assert_eq!(of(&[odd]), "object 3 has shape = 9, which no shape has");
    assert_eq!(
        of(&[SceneObject { size: [0.1, 0.0, 0.1], ..good }]),
        "object 3 has a size that is not finite and above 0 m"
    );
    let bent = Pose { rotation: [0.0, 0.0, 0.0, 2.0], ..Pose::IDENTITY };
    let bent = SceneObject { base_from_object: bent, ..good };
    assert_eq!(of(&[bent]), "object 3 has a pose that is not finite or not of unit rotation");
}
