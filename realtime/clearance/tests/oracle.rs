//! Clearance against outside references.
//!
//! `data/*_distance.csv`: coal 3.0.3 at a tolerance of 1e-10, on capsule models of the UR5 and the
//! Panda (public package `example-robot-data` 6.0.0), in scenes of 11 to 50 obstacles with a person
//! among them. `data/*_edges.csv`: straight motions whose both ends are free, with the smallest
//! distance over 401 samples; `through` rows touch on the way.
#![allow(clippy::disallowed_types, clippy::disallowed_macros, reason = "a test may allocate")]

use std::path::Path;

use nalgebra::{Isometry3, Quaternion, Rotation3, Translation3, Unit, UnitQuaternion, Vector3};
use tandem_clearance::{ArmBody, LinkCapsule, Monitor};
use tandem_kinematics::{Chain, JOINTS_MAX, Joint, JointKind};
use tandem_msg::{AttachedPart, Capsule, Pose, SceneObject, ShapeKind};

/// How far an answer may lie from the reference, metres.
const OFF: f64 = 1e-6;

struct Robot {
    joints: usize,
    chain: Chain,
    capsules: Vec<LinkCapsule>,
    names: Vec<String>,
    self_pairs: Vec<[usize; 2]>,
    scene_rows: Vec<Vec<String>>,
}

fn rows(file: &str) -> Vec<Vec<String>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(file);
    let text = std::fs::read_to_string(&path).expect("reference data is beside the test");
    text.lines().skip(1).map(|line| line.split(',').map(str::to_owned).collect()).collect()
}

fn numbers(fields: &[String]) -> Vec<f64> {
    fields.iter().map(|field| field.parse().unwrap_or_else(|_| panic!("{field} is a number"))).collect()
}

fn pose(n: &[f64]) -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(n[6], n[3], n[4], n[5]));
    Isometry3::from_parts(Translation3::new(n[0], n[1], n[2]), rotation)
}

fn robot(name: &'static str, joints: usize) -> Robot {
    let chain = rows(&format!("{name}_chain.csv"));
    let (tool, moving) = chain.split_last().expect("the tool is the last row");
    let joint = |row: &Vec<String>| {
        let n = numbers(&row[1..]);
        Joint {
            kind: JointKind::Revolute,
            parent_from_joint: pose(&n[..7]),
            axis: Unit::new_normalize(Vector3::new(n[7], n[8], n[9])),
            position_min: n[10],
            position_max: n[11],
            velocity_max: n[12],
            acceleration_max: 10.0,
            jerk_max: 100.0,
            effort_max: 100.0,
        }
    };
    let moving: Vec<Joint> = moving.iter().map(joint).collect();
    let mut names = Vec::new();
    let mut capsules = Vec::new();
    for row in rows(&format!("{name}_capsules.csv")) {
        let n = numbers(&row[1..]);
        names.push(row[0].trim_end_matches("_0").to_owned());
        capsules.push(LinkCapsule {
            link: n[0] as usize,
            ends: [[n[1], n[2], n[3]], [n[4], n[5], n[6]]],
            radius: n[7],
            tool: false,
        });
    }
    let link = |name: &String| {
        let index = names.iter().position(|other| other == name).unwrap_or_else(|| panic!("{name} is a link"));
        capsules[index].link
    };
    let self_pairs = rows(&format!("{name}_self_pairs.csv")).iter().map(|row| [link(&row[0]), link(&row[1])]).collect();
    let chain = Chain::new(&moving, pose(&numbers(&tool[1..]))).expect("a reference robot is a chain");
    let scene_rows = rows(&format!("{name}_scenes.csv"));
    Robot { joints, chain, capsules, names, self_pairs, scene_rows }
}

impl Robot {
    fn body(&self, with_self: bool) -> ArmBody {
        ArmBody::new(&self.capsules, if with_self { &self.self_pairs } else { &[] }).expect("a reference robot fits")
    }

    fn position(&self, fields: &[String]) -> [f64; JOINTS_MAX] {
        let mut position = [0.0; JOINTS_MAX];
        position[..self.joints].copy_from_slice(&numbers(&fields[..self.joints]));
        position
    }

    /// The objects of a scene and the person in it.
    fn scene(&self, id: &str) -> (Vec<SceneObject>, Vec<Capsule>) {
        let (mut objects, mut person) = (Vec::new(), Vec::new());
        for row in self.scene_rows.iter().filter(|row| row[0] == id) {
            let n = numbers(&row[4..]);
            if row[2] == "human" {
                person.push(Capsule {
                    ends: [[n[0], n[1], n[2]], [n[3], n[4], n[5]]],
                    radius: n[6],
                    velocity: [0.0; 3],
                });
            } else {
                objects.push(object(&row[3], row[1].parse::<u32>().expect("an id") + 1, &n));
            }
        }
        (objects, person)
    }

    fn monitor(&self, scene: &str, with_self: bool) -> Monitor {
        let mut monitor = Monitor::new(self.body(with_self));
        let (objects, person) = self.scene(scene);
        monitor.set_scene(&objects).expect("a reference scene is sound");
        monitor.set_human(&person);
        monitor
    }
}

fn object(shape: &str, id: u32, n: &[f64]) -> SceneObject {
    if shape == "capsule" {
        let (a, b) = (Vector3::new(n[0], n[1], n[2]), Vector3::new(n[3], n[4], n[5]));
        let turn = Rotation3::rotation_between(&Vector3::z(), &(b - a)).unwrap_or_else(Rotation3::identity);
        let quaternion = UnitQuaternion::from_rotation_matrix(&turn);
        return SceneObject {
            id,
            shape: ShapeKind::Capsule.into(),
            size: [n[6], 0.5 * (b - a).norm(), 0.0],
            base_from_object: Pose { position: ((a + b) * 0.5).into(), rotation: quaternion.coords.into() },
        };
    }
    let kind = match shape {
        "box" => ShapeKind::Box,
        "cylinder" => ShapeKind::Cylinder,
        "sphere" => ShapeKind::Sphere,
        other => panic!("{other} is no shape of the reference"),
    };
    let base_from_object = Pose { position: [n[3], n[4], n[5]], rotation: [n[6], n[7], n[8], n[9]] };
    SceneObject { id, shape: kind.into(), size: [n[0], n[1], n[2]], base_from_object }
}

/// No contact missed; positive distances within 1e-6 m of the reference; names agree
/// with it; the boolean query and the one by body part agree with the others.
#[test]
fn distances_agree_with_the_reference() {
    for (name, joints) in [("ur5", 6), ("panda", 7)] {
        let robot = robot(name, joints);
        let alone = Monitor::new(robot.body(true));
        let (mut compared, mut touching) = (0, 0);
        for row in rows(&format!("{name}_distance.csv")) {
            let case = format!("{name} case {}", row[0]);
            let monitor = robot.monitor(&row[1], false);
            let poses = robot.chain.forward(&robot.position(&row[3..]));
            let reference = &row[3 + joints..];

            let clearance = monitor.clearance(&poses);
            let separation = monitor.separation(&poses);
            let expected: f64 = reference[0].parse().expect("a distance");
            let nearest_is_person = separation.distance < clearance.distance;
            let distance = clearance.distance.min(separation.distance);
            // Depths of the reference are those its penetration search came to: their sign alone binds.
            if expected <= 0.0 {
                touching += 1;
                assert!(distance <= 0.0, "{case}: {distance} m, reference {expected} m");
            } else {
                assert!((distance - expected).abs() <= OFF, "{case}: {distance} m, reference {expected} m");
                let person = robot
                    .scene_rows
                    .iter()
                    .any(|object| object[0] == row[1] && object[1] == reference[2] && object[2] == "human");
                assert_eq!(nearest_is_person, person, "{case}: {clearance:?} {separation:?}");
                let link = if person { separation.link } else { clearance.link };
                let named = robot.names.iter().position(|other| *other == reference[1]).expect("a link");
                assert_eq!(link, robot.capsules[named].link, "{case}");
                if !person {
                    assert_eq!(
                        clearance.object.to_string(),
                        (reference[2].parse::<u32>().expect("an id") + 1).to_string(),
                        "{case}"
                    );
                    let [a, b] = [clearance.point_on_arm, clearance.point_on_other].map(Vector3::from);
                    assert!(((a - b).norm() - distance).abs() < 1e-9, "{case}: {clearance:?}");
                }
            }

            let own = alone.clearance(&poses);
            let expected: f64 = reference[3].parse().expect("a distance");
            if expected <= 0.0 {
                assert!(own.distance <= 0.0, "{case}: self {own:?}, reference {expected} m");
            } else {
                assert!((own.distance - expected).abs() <= OFF, "{case}: self {own:?}, reference {expected} m");
                assert_eq!(own.object, 0, "{case}");
            }

            let both = robot.monitor(&row[1], true);
            let all = both.clearance(&poses);
            assert_eq!(all.distance, clearance.distance.min(own.distance), "{case}: {all:?}");
            for margin in [0.0, 0.01, 0.05] {
                assert_eq!(both.is_clear(&poses, margin), all.distance > margin, "{case}: {all:?}, margin {margin}");
            }
            let parts = monitor.separations(&poses);
            let least = parts.iter().map(|part| part.distance).fold(f64::INFINITY, f64::min);
            assert_eq!(least, separation.distance, "{case}");
            compared += 1;
        }
        assert!(compared > 300 && touching > 50, "{name}: {compared} cases, {touching} in contact");
    }
}

/// A motion that touches anything on the way is never called clear, one that stays 3 cm off always is.
#[test]
fn nothing_thin_is_stepped_through() {
    for (name, joints) in [("ur5", 6), ("panda", 7)] {
        let robot = robot(name, joints);
        let (mut through, mut free) = (0, 0);
        for row in rows(&format!("{name}_edges.csv")) {
            let mut monitor = Monitor::new(robot.body(true));
            let (mut objects, person) = robot.scene(&row[1]);
            // Paths look at the scene only, so here the person stands in it.
            objects.extend(person.iter().enumerate().map(|(index, capsule)| {
                let [a, b] = capsule.ends;
                object("capsule", 500 + index as u32, &[a[0], a[1], a[2], b[0], b[1], b[2], capsule.radius])
            }));
            if objects.len() > tandem_msg::SCENE_OBJECTS_MAX {
                continue;
            }
            monitor.set_scene(&objects).expect("a reference scene is sound");
            let from = robot.position(&row[3..]);
            let to = robot.position(&row[3 + joints..]);
            let clear = monitor.path_is_clear(&robot.chain, &from, &to, 0.0, 2e-4);
            match row[2].as_str() {
                "through" => {
                    through += 1;
                    assert!(!clear, "{name} edge {} goes through an obstacle", row[0]);
                }
                "free" => {
                    free += 1;
                    assert!(clear, "{name} edge {} is free", row[0]);
                }
                _ => {}
            }
        }
        assert!(through > 20 && free > 10, "{name}: {through} through, {free} free");
    }
}

/// Motions between the reference positions, with a part and without: what is called clear keeps the
/// margin at each of 400 samples; what is not comes nearer than margin and resolution, or so near that a
/// sample may have missed it.
#[test]
fn a_sweep_says_what_samples_say() {
    const SAMPLES: u32 = 400;
    const RESOLUTION: f64 = 0.004;
    let part = AttachedPart {
        present: 1,
        half_extents: [0.08, 0.03, 0.05],
        tcp_from_part: Pose { position: [0.01, 0.0, 0.05], ..Pose::IDENTITY },
        ..AttachedPart::default()
    };
    for (name, joints) in [("ur5", 6), ("panda", 7)] {
        let robot = robot(name, joints);
        let cases = rows(&format!("{name}_distance.csv"));
        let (mut clear, mut blocked) = (0, 0);
        for (index, pair) in cases.windows(2).enumerate() {
            let mut monitor = robot.monitor(&pair[0][1], true);
            monitor.set_attached((index % 2 == 0).then_some(&part));
            let [from, far] = [0, 1].map(|k| robot.position(&pair[k][3..]));
            // Long motions are hardly ever clear.
            let share = [0.5, 0.1, 0.02][index % 3];
            let to: [f64; JOINTS_MAX] = std::array::from_fn(|k| from[k] + share * (far[k] - from[k]));
            let margin = [0.0, 0.02][index / 2 % 2];
            let said = monitor.path_is_clear(&robot.chain, &from, &to, margin, RESOLUTION);
            let mut least = f64::INFINITY;
            for k in 0..=SAMPLES {
                let at = f64::from(k) / f64::from(SAMPLES);
                let position = std::array::from_fn(|k| from[k] + at * (to[k] - from[k]));
                least = least.min(monitor.clearance(&robot.chain.forward(&position)).distance);
            }
            // No point of these arms is farther than 1.3 m from an axis.
            let turn: f64 = from.iter().zip(&to).map(|(a, b)| (a - b).abs()).sum();
            let missed = 1.3 * turn / f64::from(2 * SAMPLES);
            let case = format!("{name}, motion {index}: {said}, samples {least} m, margin {margin} m");
            if said {
                clear += 1;
                assert!(least > margin, "{case}");
            } else {
                blocked += 1;
                assert!(least <= margin + RESOLUTION + missed, "{case}");
            }
        }
        assert!(clear > 60 && blocked > 60, "{name}: {clear} clear, {blocked} not");
    }
}
