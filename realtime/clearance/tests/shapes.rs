//! Registered hulls and meshes as objects, parts and links, against parry3d in f64 on random placements.
//!
//! Ours are lower bounds within 1e-9 m, parry's upper bounds within some 20 µm and 0 on overlap.
#![allow(clippy::disallowed_types, clippy::disallowed_macros, reason = "a test may allocate")]

use std::sync::{Arc, LazyLock};

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use parry3d_f64::glamx::{DPose3, DQuat, DVec3};
use parry3d_f64::query;
use parry3d_f64::shape::{Capsule as ParryCapsule, ConvexPolyhedron, Cuboid, Cylinder, Shape, TriMesh};
use proptest::prelude::*;
use tandem_clearance::{ArmBody, LinkCapsule, Monitor, Shapes};
use tandem_kinematics::{Chain, JOINTS_MAX, Joint, JointKind, LinkPoses};
use tandem_msg::{AttachedPart, Capsule, Pose, SceneObject, ShapeKind};

/// What parry may be above the truth, metres.
const PARRY: f64 = 3e-5;

type Points = Vec<[f64; 3]>;

fn pose() -> impl Strategy<Value = Isometry3<f64>> {
    let unit = -1.0..1.0_f64;
    ([unit.clone(), unit.clone(), unit.clone()], [unit.clone(), unit.clone(), unit.clone(), unit]).prop_map(|(t, q)| {
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(q[0] + 1e-3, q[1], q[2], q[3]));
        Isometry3::from_parts(Translation3::new(0.4 * t[0], 0.4 * t[1], 0.4 * t[2]), rotation)
    })
}

/// Corners of a solid body: a tetrahedron and what comes on top.
fn points() -> impl Strategy<Value = Points> {
    let coordinate = || -0.15..0.15_f64;
    prop::collection::vec([coordinate(), coordinate(), coordinate()], 0..40).prop_map(|mut points| {
        points.extend([[0.05, 0.05, 0.05], [-0.05, -0.05, 0.05], [-0.05, 0.05, -0.05], [0.05, -0.05, -0.05]]);
        points
    })
}

fn message(pose: &Isometry3<f64>) -> Pose {
    Pose { position: pose.translation.vector.into(), rotation: pose.rotation.coords.into() }
}

fn parry(pose: &Isometry3<f64>) -> DPose3 {
    let q = pose.rotation.coords;
    let translation = DVec3::from_array(pose.translation.vector.into());
    DPose3 { rotation: DQuat::from_xyzw(q.x, q.y, q.z, q.w), translation }
}

fn polyhedron(points: &Points) -> ConvexPolyhedron {
    let points: Vec<DVec3> = points.iter().map(|point| DVec3::from_array(*point)).collect();
    ConvexPolyhedron::from_convex_hull(&points).expect("a solid body")
}

/// Link 1 and the TCP are where the base is.
fn poses() -> LinkPoses {
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
    Chain::new(&[joint], Isometry3::identity()).expect("one joint is a chain").forward(&[0.0; JOINTS_MAX])
}

/// A capsule so far away that only the carried part counts.
const AWAY: LinkCapsule = LinkCapsule { link: 1, ends: [[500.0; 3]; 2], radius: 0.01, tool: true };

/// An arm of one link: a hull in a ball, or with none a capsule far away.
fn monitor(mut shapes: Shapes, link: Option<&Points>) -> Monitor {
    let Some(points) = link else {
        let body = ArmBody::new(&[AWAY], &[]).expect("one capsule is an arm");
        return Monitor::with_shapes(body, Arc::new(shapes)).expect("no hull to check");
    };
    let ball = LinkCapsule { link: 1, ends: [[0.0; 3]; 2], radius: 0.3, tool: false };
    let mut body = ArmBody::new(&[ball], &[]).expect("one capsule is an arm");
    let number = shapes.add_hull(points).expect("points of a solid body");
    body.refine(0, number).expect("the one capsule");
    Monitor::with_shapes(body, Arc::new(shapes)).expect("the hull lies in the ball")
}

fn primitive(kind: u32, size: [f64; 3], pose: &Isometry3<f64>) -> (SceneObject, Box<dyn Shape>, DPose3) {
    let object = |shape: ShapeKind| SceneObject { id: 7, shape: shape.into(), size, base_from_object: message(pose) };
    let [a, b, c] = size;
    let place = parry(pose);
    match kind {
        0 => (object(ShapeKind::Box), Box::new(Cuboid::new(DVec3::new(a, b, c))), place),
        1 => {
            // parry's stand along y.
            let turn = DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2);
            let place = DPose3 { rotation: place.rotation * turn, translation: place.translation };
            (object(ShapeKind::Cylinder), Box::new(Cylinder::new(b, a)), place)
        }
        _ => (object(ShapeKind::Capsule), Box::new(ParryCapsule::new_z(b, a)), place),
    }
}

fn registered(number: u32, pose: &Isometry3<f64>) -> SceneObject {
    SceneObject {
        id: 7,
        shape: ShapeKind::Registered.into(),
        size: [f64::from(number), 0.0, 0.0],
        base_from_object: message(pose),
    }
}

/// Ours against parry's distance; parry's contact test alone tells whether they touch.
fn compare(ours: f64, first: (&dyn Shape, &DPose3), second: (&dyn Shape, &DPose3)) -> Result<(), TestCaseError> {
    let theirs = query::distance(first.1, first.0, second.1, second.0).expect("a pair parry knows").distance;
    prop_assert!(ours <= theirs + 1e-9 || (theirs == 0.0 && ours <= PARRY), "ours {ours} m, parry's {theirs} m");
    if theirs > 0.0 {
        prop_assert!(ours >= theirs - PARRY, "ours {ours} m, parry's {theirs} m");
    }
    Ok(())
}

/// A depth is at least the true one: moved out by it, along the answer's points, the bodies are apart.
fn parted(
    clearance: &tandem_clearance::Clearance,
    first: (&dyn Shape, &DPose3),
    second: (&dyn Shape, &DPose3),
) -> Result<(), TestCaseError> {
    let [p, q] = [clearance.point_on_arm, clearance.point_on_other].map(Vector3::from);
    prop_assert!(((p - q).norm() - clearance.distance.abs()).abs() < 1e-7, "{clearance:?}");
    if clearance.distance < 0.0 {
        let out = (q - p) * (1.0 + 1e-3 / (q - p).norm().max(1e-9));
        let moved = DPose3 { translation: first.1.translation + DVec3::from_array(out.into()), ..*first.1 };
        let still = query::distance(&moved, first.0, second.1, second.0).expect("a pair parry knows").distance;
        prop_assert!(still > 0.0, "{clearance:?}: still touching");
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1_000, failure_persistence: None, ..ProptestConfig::default() })]

    /// A link given as a hull against every primitive.
    #[test]
    fn hulls_agree_with_primitives((points, kind, size, place) in (points(), 0..3_u32, [0.01..0.3_f64, 0.01..0.3, 0.01..0.3], pose())) {
        let mut monitor = monitor(Shapes::new(), Some(&points));
        let (object, shape, at) = primitive(kind, size, &place);
        monitor.set_scene(&[object]).expect("a sound object");
        let clearance = monitor.clearance(&poses());
        let own = polyhedron(&points);
        compare(clearance.distance, (&own, &DPose3::IDENTITY), (&*shape, &at))?;
        parted(&clearance, (&own, &DPose3::IDENTITY), (&*shape, &at))?;
        prop_assert_eq!(monitor.is_clear(&poses(), 0.02), clearance.distance > 0.02);
    }

    /// Hull against hull: link, object and part.
    #[test]
    fn hulls_agree_with_hulls((points, others, place) in (points(), points(), pose())) {
        let (own, other) = (polyhedron(&points), polyhedron(&others));
        let mut shapes = Shapes::new();
        let number = shapes.add_hull(&others).expect("points of a solid body");
        let mut monitor = monitor(shapes, Some(&points));
        monitor.set_scene(&[registered(number, &place)]).expect("a registered shape");
        let clearance = monitor.clearance(&poses());
        compare(clearance.distance, (&own, &DPose3::IDENTITY), (&other, &parry(&place)))?;
        parted(&clearance, (&own, &DPose3::IDENTITY), (&other, &parry(&place)))?;

        // The same pair with the object carried and the link as the object.
        let mut shapes = Shapes::new();
        let object = shapes.add_hull(&points).expect("points of a solid body");
        let shape = shapes.add_hull(&others).expect("points of a solid body");
        let mut carrying = self::monitor(shapes, None);
        carrying.set_scene(&[registered(object, &Isometry3::identity())]).expect("a registered shape");
        let part = AttachedPart { present: 1, shape, tcp_from_part: message(&place), ..AttachedPart::default() };
        carrying.set_attached(Some(&part));
        let carried = carrying.clearance(&poses()).distance;
        compare(carried, (&other, &parry(&place)), (&own, &DPose3::IDENTITY))?;
    }

    /// A hull and a person.
    #[test]
    fn hulls_and_people_agree((points, ends, radius) in (points(), [[-0.6..0.6_f64, -0.6..0.6, -0.6..0.6], [-0.6..0.6_f64, -0.6..0.6, -0.6..0.6]], 0.01..0.15_f64)) {
        let mut monitor = monitor(Shapes::new(), Some(&points));
        monitor.set_human(&[Capsule { ends, radius, velocity: [0.0; 3] }]);
        let separation = monitor.separation(&poses());
        let [a, b] = ends.map(DVec3::from_array);
        let person = ParryCapsule::new(a, b, radius);
        compare(separation.distance, (&polyhedron(&points), &DPose3::IDENTITY), (&person, &DPose3::IDENTITY))?;
    }

    /// A mesh that is the surface of a hull is that hull to a capsule, a hull and a carried box outside it, and a contact inside.
    #[test]
    fn solid_meshes_are_solid((points, link, place, half) in (points(), points(), pose(), [0.01..0.1_f64, 0.01..0.1, 0.01..0.1])) {
        let solid = polyhedron(&points);
        let (corners, faces) = solid.to_trimesh();
        let corners: Points = corners.iter().map(|corner| corner.to_array()).collect();
        let mut shapes = Shapes::new();
        let number = shapes.add_mesh(&corners, &faces).expect("a surface");
        let mut monitor = monitor(shapes.clone(), Some(&link));
        monitor.set_scene(&[registered(number, &place)]).expect("a registered shape");
        let clearance = monitor.clearance(&poses());
        compare(clearance.distance, (&polyhedron(&link), &DPose3::IDENTITY), (&solid, &parry(&place)))?;
        parted(&clearance, (&polyhedron(&link), &DPose3::IDENTITY), (&solid, &parry(&place)))?;
        prop_assert_eq!(monitor.is_clear(&poses(), 0.02), clearance.distance > 0.02);

        let capsule = LinkCapsule { link: 1, ends: [link[0], link[1 % link.len()]], radius: 0.02, tool: false };
        let mut thin = Monitor::with_shapes(ArmBody::new(&[capsule], &[]).expect("one capsule is an arm"), Arc::new(shapes.clone())).expect("no hull");
        thin.set_scene(&[registered(number, &place)]).expect("a registered shape");
        let [a, b] = capsule.ends.map(DVec3::from_array);
        compare(thin.clearance(&poses()).distance, (&ParryCapsule::new(a, b, 0.02), &DPose3::IDENTITY), (&solid, &parry(&place)))?;

        let mut carrying = self::monitor(shapes, None);
        carrying.set_scene(&[registered(number, &place)]).expect("a registered shape");
        carrying.set_attached(Some(&AttachedPart { present: 1, half_extents: half, ..AttachedPart::default() }));
        compare(carrying.clearance(&poses()).distance, (&Cuboid::new(DVec3::from_array(half)), &DPose3::IDENTITY), (&solid, &parry(&place)))?;
    }
}

/// The ring below, as shape 1 and as parry's.
static TORUS: LazyLock<(Arc<Shapes>, TriMesh)> = LazyLock::new(|| {
    let (points, triangles) = torus(48, 24);
    let mut shapes = Shapes::new();
    shapes.add_mesh(&points, &triangles).expect("a surface");
    let mesh = TriMesh::new(points.iter().map(|p| DVec3::from_array(*p)).collect(), triangles).expect("a mesh");
    (Arc::new(shapes), mesh)
});

/// A torus of triangles: no hull of it would do.
fn torus(rings: u32, sides: u32) -> (Points, Vec<[u32; 3]>) {
    let angle = |k: u32, count: u32| std::f64::consts::TAU * f64::from(k) / f64::from(count);
    let mut points = Vec::new();
    let mut triangles = Vec::new();
    for ring in 0..rings {
        for side in 0..sides {
            let (around, across) = (angle(ring, rings), angle(side, sides));
            let out = 0.3 + 0.08 * across.cos();
            points.push([out * around.cos(), out * around.sin(), 0.08 * across.sin()]);
            let at = |r: u32, s: u32| (r % rings) * sides + s % sides;
            let [a, b, c, d] = [at(ring, side), at(ring + 1, side), at(ring + 1, side + 1), at(ring, side + 1)];
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    (points, triangles)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1_000, failure_persistence: None, ..ProptestConfig::default() })]

    /// A surface with a hole, against parry's mesh of the same triangles, and inside it against the shape's equation.
    #[test]
    fn hollow_meshes_agree((ends, radius, place) in ([[-0.3..0.3_f64, -0.3..0.3, -0.3..0.3], [-0.3..0.3_f64, -0.3..0.3, -0.3..0.3]], 0.005..0.05_f64, pose())) {
        let (shapes, mesh) = &*TORUS;
        let capsule = LinkCapsule { link: 1, ends, radius, tool: false };
        let body = ArmBody::new(&[capsule], &[]).expect("one capsule is an arm");
        let mut monitor = Monitor::with_shapes(body, shapes.clone()).expect("no hull");
        monitor.set_scene(&[registered(1, &place)]).expect("a registered shape");
        let ours = monitor.clearance(&poses()).distance;
        let middle = place.inverse_transform_point(&((Vector3::from(ends[0]) + Vector3::from(ends[1])) * 0.5).into());
        let inside = (middle.x.hypot(middle.y) - 0.3).hypot(middle.z) < 0.075;
        if inside {
            prop_assert!(ours < 0.0, "{ours} m in the middle of the ring");
        } else {
            let [a, b] = ends.map(DVec3::from_array);
            compare(ours, (&ParryCapsule::new(a, b, radius), &DPose3::IDENTITY), (mesh, &parry(&place)))?;
        }
    }
}

/// What was not registered is refused, and what cannot be is named.
#[test]
fn faults_are_named() {
    let mut shapes = Shapes::new();
    let cube: Points = (0..8).map(|k| [k & 1, k >> 1 & 1, k >> 2].map(|bit| 0.2 * f64::from(bit) - 0.1)).collect();
    assert_eq!(shapes.add_hull(&cube[..3]).unwrap_err().to_string(), "the hull has 3 points, allowed 4..=256");
    let lost = shapes.add_hull(&[[0.0; 3], [1.0; 3], [2.0; 3], [f64::NAN; 3]]).unwrap_err();
    assert_eq!(lost.to_string(), "point 3 is not finite or farther off than 10000 m");
    assert_eq!(shapes.add_mesh(&cube, &[]).unwrap_err().to_string(), "the mesh has 0 triangles, allowed 1..=65536");
    let lost = shapes.add_mesh(&cube, &[[0, 1, 8]]).unwrap_err();
    assert_eq!(lost.to_string(), "triangle 0 names a point that is not there");
    let hull = shapes.add_hull(&cube).expect("a cube");
    let surface = shapes.add_mesh(&cube, &[[0, 1, 2]]).expect("a triangle");
    assert_eq!((hull, surface), (1, 2));

    let ball = LinkCapsule { link: 1, ends: [[0.0; 3]; 2], radius: 0.1, tool: false };
    let body = ArmBody::new(&[ball], &[]).expect("one capsule is an arm");
    let with = |shape: u32| {
        let mut body = body;
        body.refine(0, shape).expect("the one capsule");
        Monitor::with_shapes(body, Arc::new(shapes.clone())).map(|_| ()).map_err(|error| error.to_string())
    };
    let outside = with(hull).unwrap_err();
    assert!(outside.starts_with("capsule 0: the hull that stands for it reaches 0.0732"), "{outside}");
    assert_eq!(with(surface).unwrap_err(), "capsule 0: shape 2 stands for it, which is no registered hull");
    assert!(body.clone().refine(1, hull).is_err());

    let mut monitor = Monitor::with_shapes(body, Arc::new(shapes.clone())).expect("no hull");
    for bad in [0.0, 3.0, 1.5, -1.0, f64::NAN, 1e300] {
        let object = SceneObject { size: [bad, 0.0, 0.0], ..registered(1, &Isometry3::identity()) };
        let refused = monitor.set_scene(&[object]).unwrap_err().to_string();
        assert_eq!(refused, "object 7 names a shape that was not registered at start");
        assert_eq!(monitor.clearance(&poses()).distance, f64::NEG_INFINITY);
    }
    monitor.set_scene(&[]).expect("an empty scene");
    for bad in [surface, 3, u32::MAX] {
        monitor.set_attached(Some(&AttachedPart { present: 1, shape: bad, ..AttachedPart::default() }));
        assert_eq!(monitor.clearance(&poses()).distance, f64::NEG_INFINITY, "part of shape {bad}");
    }
    // An arm that knows no shapes takes none.
    assert!(Monitor::new(body).set_scene(&[registered(1, &Isometry3::identity())]).is_err());
}
