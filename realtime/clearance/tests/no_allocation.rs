//! No query allocates, and none panics, whatever the numbers.
#![allow(clippy::disallowed_types, clippy::disallowed_macros, reason = "a test may allocate")]

use std::sync::Arc;

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use proptest::prelude::*;
use tandem_clearance::{ArmBody, LinkCapsule, LinksToPeople, Monitor, Shapes};
use tandem_cycle::guard::{CountingAllocator, counted};
use tandem_kinematics::{Chain, Joint, JointKind, LinkPoses, manipulability};
use tandem_msg::{AttachedPart, Capsule, Code, Pose, SceneObject};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// An arm of `count` joints whose axes turn by a quarter from one to the next; every third slides.
fn chain(count: usize) -> Chain {
    let joint = |index: usize| Joint {
        kind: if index % 3 == 2 { JointKind::Prismatic } else { JointKind::Revolute },
        parent_from_joint: Isometry3::from_parts(
            Vector3::new(0.1, 0.0, 0.2).into(),
            UnitQuaternion::from_euler_angles(1.5, 0.1 * index as f64, 0.0),
        ),
        axis: Vector3::z_axis(),
        position_min: -3.0,
        position_max: 3.0,
        velocity_max: 1.0,
        acceleration_max: 1.0,
        jerk_max: 1.0,
        effort_max: 1.0,
    };
    let joints: Vec<Joint> = (0..count).map(joint).collect();
    Chain::new(&joints, Isometry3::translation(0.0, 0.0, 0.1)).expect("up to eight joints are a chain")
}

fn body(count: usize) -> ArmBody {
    let capsules: Vec<LinkCapsule> = (0..=count)
        .map(|link| LinkCapsule { link, ends: [[0.0; 3], [0.1, 0.0, 0.2]], radius: 0.03, tool: link == count })
        .collect();
    let pairs: Vec<[usize; 2]> = (0..=count).flat_map(|a| (a + 2..=count).map(move |b| [a, b])).collect();
    let mut body = ArmBody::new(&capsules, &pairs).expect("nine capsules are an arm");
    for index in (1..=count).step_by(2) {
        body.refine(index, 1).expect("a capsule of the arm");
    }
    body
}

/// A hull that fits the links' capsules, a mesh that is a solid and one that is not.
fn shapes() -> Shapes {
    let mut shapes = Shapes::new();
    let corners = [[0.0, 0.0, -0.02], [0.0, 0.02, 0.0], [0.02, 0.0, 0.01], [0.1, 0.0, 0.22]];
    shapes.add_hull(&corners).expect("four points are a hull");
    let faces = [[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]];
    shapes.add_mesh(&corners, &faces).expect("a tetrahedron is a mesh");
    shapes.add_mesh(&corners, &faces[..2]).expect("two triangles are a mesh");
    shapes
}

/// Numbers as a faulty peer may send them, mostly of the size of a cell.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![
        30 => -2.0..2.0_f64,
        1 => Just(0.0),
        1 => Just(f64::NAN),
        1 => Just(f64::INFINITY),
        1 => Just(-1e300),
        1 => Just(5e-324),
    ]
}

fn three() -> impl Strategy<Value = [f64; 3]> {
    [number(), number(), number()]
}

fn pose() -> impl Strategy<Value = Pose> {
    (three(), [number(), number(), number(), number()], any::<bool>()).prop_map(|(position, q, sound)| {
        let norm = q.iter().map(|x| x * x).sum::<f64>().sqrt();
        let rotation = if sound { q.map(|x| x / norm) } else { q };
        Pose { position, rotation }
    })
}

fn objects() -> impl Strategy<Value = Vec<SceneObject>> {
    let object =
        (0..6_u32, 1..4_u32, three(), pose()).prop_map(|(shape, number, size, base_from_object)| SceneObject {
            id: 0,
            shape: Code::from_raw(shape),
            size: if shape == 4 { [f64::from(number), 0.0, 0.0] } else { size.map(f64::abs) },
            base_from_object,
        });
    prop::collection::vec(object, 0..12).prop_map(|mut objects| {
        for (index, object) in objects.iter_mut().enumerate() {
            object.id = index as u32 + 1;
        }
        objects
    })
}

fn people() -> impl Strategy<Value = Vec<Capsule>> {
    let capsule = (three(), three(), number(), three()).prop_map(|(a, b, radius, velocity)| Capsule {
        ends: [a, b],
        radius: radius.abs(),
        velocity,
    });
    prop::collection::vec(capsule, 0..6)
}

/// Of all links the nearest to a body part is as near as that part, or nearer where a hull counts as its capsule.
fn links_agree(monitor: &Monitor, poses: &LinkPoses, exact: bool) {
    let each = monitor.separations(poses);
    let links = monitor.links_to_people(poses);
    for (part, separation) in each.iter().enumerate().take(monitor.human_count()) {
        let least =
            |table: &LinksToPeople| table.iter().fold(f64::INFINITY, |least, row| row[part].distance.min(least));
        let least = links.as_ref().map_or(f64::NEG_INFINITY, least);
        assert!(least <= separation.distance + 1e-9, "{least} {}", separation.distance);
        assert!(!exact || least >= separation.distance - 1e-9, "{least} {}", separation.distance);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2_000, failure_persistence: None, ..ProptestConfig::default() })]

    /// Kinematics and clearance together, as a cycle calls them: nothing is asked of the allocator, and no
    /// distance is a NaN.
    #[test]
    fn nothing_allocates_or_panics(
        count in 1..=8_usize,
        position in prop::array::uniform8(number()),
        other in prop::array::uniform8(number()),
        objects in objects(),
        people in people(),
        half_extents in three(),
        place in pose(),
        margin in number(),
        shape in 0..3_u32,
    ) {
        let (chain, body, shapes) = (chain(count), body(count), Arc::new(shapes()));
        let part = AttachedPart { present: 1, shape, half_extents, tcp_from_part: place, ..AttachedPart::default() };
        let (distances, calls) = counted(|| {
            let Ok(mut monitor) = Monitor::with_shapes(body, shapes.clone()) else { panic!("the hull fits") };
            let _ = monitor.set_scene(&objects);
            monitor.set_human(&people);
            monitor.set_attached(Some(&part));
            monitor.set_touch(&[1, 2, 0]);
            let (poses, jacobian) = chain.jacobian(&position);
            let lost = manipulability(&jacobian);
            let solved = chain.inverse(&poses.base_from_tcp, &other).is_ok();
            let clear = monitor.is_clear(&poses, margin);
            let path = monitor.path_is_clear(&chain, &position, &other, margin, 0.01);
            let clearance = monitor.clearance(&poses);
            let tracked = [monitor.track(&poses), monitor.track(&poses), monitor.measure(&poses).0];
            let separation = monitor.separation(&poses);
            let each = monitor.separations(&poses);
            core::hint::black_box((lost, solved, clear, path));
            assert!(tracked == [clearance; 3]);
            links_agree(&monitor, &poses, false);
            let mut capsules = Monitor::new(body);
            capsules.set_human(&people);
            capsules.set_attached(Some(&part));
            links_agree(&capsules, &poses, true);
            (clearance.distance, separation.distance, each[0].distance, clear)
        });
        prop_assert!(calls.is_none(), "{calls:?}");
        prop_assert!(!distances.0.is_nan() && !distances.1.is_nan() && !distances.2.is_nan(), "{distances:?}");
        if margin.is_finite() {
            prop_assert_eq!(distances.3, distances.0 > margin);
        }
        if position[..count].iter().any(|q| !q.is_finite()) {
            prop_assert_eq!(distances.0, f64::NEG_INFINITY);
            prop_assert_eq!(distances.1, f64::NEG_INFINITY);
        }
    }
}
