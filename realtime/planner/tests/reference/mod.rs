//! The reference robots in their scenes: capsule models of the UR5 and the Panda (public package
//! `example-robot-data` 6.0.0), scenes of 11 to 50 obstacles with a person standing among them.
#![allow(dead_code, unreachable_pub, clippy::disallowed_types, reason = "each test uses its part; tests may allocate")]

use std::path::Path;

use nalgebra::{Isometry3, Quaternion, Translation3, Unit, UnitQuaternion, Vector3};
use tandem_clearance::{ArmBody, LinkCapsule, Monitor};
use tandem_kinematics::{Chain, JOINTS_MAX, Joint, JointKind};
use tandem_msg::{Pose, SCENE_OBJECTS_MAX, SceneObject, ShapeKind};

pub type Joints = [f64; JOINTS_MAX];

/// Rows of a reference file; they are kept beside the tests of the clearance crate.
fn rows(file: &str) -> Vec<Vec<String>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../clearance/tests/data").join(file);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    text.lines().skip(1).map(|line| line.split(',').map(str::to_owned).collect()).collect()
}

fn numbers(fields: &[String]) -> Vec<f64> {
    fields.iter().map(|field| field.parse().unwrap_or_else(|_| panic!("{field} is a number"))).collect()
}

fn pose(n: &[f64]) -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(n[6], n[3], n[4], n[5]));
    Isometry3::from_parts(Translation3::new(n[0], n[1], n[2]), rotation)
}

pub struct Robot {
    pub name: &'static str,
    pub chain: Chain,
    pub body: ArmBody,
    scene_rows: Vec<Vec<String>>,
}

impl Robot {
    pub fn new(name: &'static str) -> Self {
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
        let (mut names, mut capsules) = (Vec::new(), Vec::new());
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
        let pairs: Vec<[usize; 2]> =
            rows(&format!("{name}_self_pairs.csv")).iter().map(|row| [link(&row[0]), link(&row[1])]).collect();
        Self {
            name,
            chain: Chain::new(&moving, pose(&numbers(&tool[1..]))).expect("a reference robot is a chain"),
            body: ArmBody::new(&capsules, &pairs).expect("a reference robot fits"),
            scene_rows: rows(&format!("{name}_scenes.csv")),
        }
    }

    /// Numbers of the scenes that have so many obstacles.
    pub fn scenes(&self, obstacles: usize) -> Vec<String> {
        let mut ids: Vec<String> = self.scene_rows.iter().map(|row| row[0].clone()).collect();
        ids.dedup();
        ids.retain(|id| self.scene_rows.iter().filter(|row| row[0] == *id).count() == obstacles);
        ids
    }

    /// The obstacles of a scene, the person among them as capsules that stand still; of 50 the two that are
    /// farthest from the arm are left out, since a scene has room for 48.
    pub fn objects(&self, scene: &str) -> Vec<SceneObject> {
        let rows = self.scene_rows.iter().filter(|row| row[0] == scene);
        let mut objects: Vec<SceneObject> = rows.map(|row| object(row)).collect();
        let from_base = |object: &SceneObject| Vector3::from(object.base_from_object.position).norm();
        while objects.len() > SCENE_OBJECTS_MAX {
            let farthest =
                (0..objects.len()).max_by(|a, b| from_base(&objects[*a]).total_cmp(&from_base(&objects[*b])));
            objects.remove(farthest.expect("there are some"));
        }
        objects
    }

    pub fn monitor(&self, scene: &str) -> Monitor {
        let mut monitor = Monitor::new(self.body);
        monitor.set_scene(&self.objects(scene)).expect("a reference scene is sound");
        monitor
    }

    /// The next position within half a turn of zero that keeps the margin; `None` when hardly any does.
    pub fn free(&self, monitor: &Monitor, margin: f64, draws: &mut Lehmer) -> Option<Joints> {
        for _ in 0..20_000 {
            let mut position = [0.0; JOINTS_MAX];
            for (slot, joint) in position.iter_mut().zip(self.chain.joints()) {
                let (least, most) =
                    (joint.position_min.max(-std::f64::consts::PI), joint.position_max.min(std::f64::consts::PI));
                *slot = least + (most - least) * draws.share();
            }
            if monitor.is_clear(&self.chain.forward(&position), margin) {
                return Some(position);
            }
        }
        None
    }

    /// Two of them.
    pub fn free_pair(&self, monitor: &Monitor, margin: f64, draws: &mut Lehmer) -> Option<[Joints; 2]> {
        Some([self.free(monitor, margin, draws)?, self.free(monitor, margin, draws)?])
    }
}

fn object(row: &[String]) -> SceneObject {
    let id = row[1].parse::<u32>().expect("an id") + 1;
    let n = numbers(&row[4..]);
    if row[3] == "capsule" {
        let (a, b) = (Vector3::new(n[0], n[1], n[2]), Vector3::new(n[3], n[4], n[5]));
        let turn = UnitQuaternion::rotation_between(&Vector3::z(), &(b - a)).unwrap_or_default();
        return SceneObject {
            id,
            shape: ShapeKind::Capsule.into(),
            size: [n[6], 0.5 * (b - a).norm(), 0.0],
            base_from_object: Pose { position: ((a + b) * 0.5).into(), rotation: turn.coords.into() },
        };
    }
    let shape = match row[3].as_str() {
        "box" => ShapeKind::Box,
        "cylinder" => ShapeKind::Cylinder,
        "sphere" => ShapeKind::Sphere,
        other => panic!("{other} is no shape of the reference"),
    };
    let base_from_object = Pose { position: [n[3], n[4], n[5]], rotation: [n[6], n[7], n[8], n[9]] };
    SceneObject { id, shape: shape.into(), size: [n[0], n[1], n[2]], base_from_object }
}

/// Lehmer's generator with the constants of Park and Miller: enough to draw test cases.
pub struct Lehmer(pub u64);

impl Lehmer {
    pub fn share(&mut self) -> f64 {
        self.0 = self.0 * 48_271 % 0x7FFF_FFFF;
        self.0 as f64 / f64::from(0x7FFF_FFFF)
    }
}
