//! The reference robots and scenes, as the files in `data` give them.
//!
//! UR5 and Panda of the public package `example-robot-data` 6.0.0: the convex hull of each link's collision
//! mesh, the least capsule around it, and the pairs of links that their SRDF leaves to be checked.
//! Scenes of 11 to 50 obstacles, a person of ten capsules among them. Tests and benches include this by its path.

#![allow(dead_code, reason = "who includes this uses some of it")]

#[path = "../../../kinematics/tests/reference/mod.rs"]
mod kinematics;

use std::path::Path;
use std::sync::Arc;

use kinematics::{chain_within, fields};
use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use tandem_clearance::{ArmBody, LinkCapsule, Monitor, Shapes};
use tandem_kinematics::{Chain, JOINTS_MAX};
use tandem_msg::{Capsule, Pose, SceneObject, ShapeKind};

/// What stands for the links of the arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Links {
    Capsules,
    Hulls,
}

pub(crate) struct Robot {
    pub(crate) name: &'static str,
    pub(crate) joints: usize,
    pub(crate) chain: Chain,
    pub(crate) capsules: Vec<LinkCapsule>,
    /// Of the capsules and hulls, in their order.
    pub(crate) names: Vec<String>,
    pub(crate) hulls: Vec<Vec<[f64; 3]>>,
    pub(crate) self_pairs: Vec<[usize; 2]>,
    pub(crate) scene_rows: Vec<Vec<String>>,
}

/// Fields of a file of these tests but for its headline.
pub(crate) fn rows(file: &str) -> Vec<Vec<String>> {
    fields(Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../clearance/tests/data")), file)
}

pub(crate) fn numbers(fields: &[String]) -> Vec<f64> {
    fields.iter().map(|field| field.parse().unwrap_or_else(|_| panic!("{field} is a number"))).collect()
}

pub(crate) fn robots() -> [Robot; 2] {
    [robot("ur5", 6), robot("panda", 7)]
}

pub(crate) fn robot(name: &'static str, joints: usize) -> Robot {
    let chain = chain_within(name, f64::INFINITY);
    let (mut names, mut capsules) = (Vec::new(), Vec::new());
    for row in rows(&format!("{name}_capsules.csv")) {
        let n = numbers(&row[1..]);
        names.push(row[0].trim_end_matches("_0").to_owned());
        let ends = [[n[1], n[2], n[3]], [n[4], n[5], n[6]]];
        capsules.push(LinkCapsule { link: n[0] as usize, ends, radius: n[7], tool: false });
    }
    let of_link = |name: &String| names.iter().position(|other| other == name).expect("a link of the robot");
    let mut hulls = vec![Vec::new(); names.len()];
    for row in rows(&format!("{name}_hulls.csv")) {
        let n = numbers(&row[1..]);
        hulls[of_link(&row[0])].push([n[0], n[1], n[2]]);
    }
    let pairs = rows(&format!("{name}_self_pairs.csv"));
    let self_pairs = pairs.iter().map(|row| [&row[0], &row[1]].map(|name| capsules[of_link(name)].link)).collect();
    let scene_rows = rows(&format!("{name}_scenes.csv"));
    Robot { name, joints, chain, capsules, names, hulls, self_pairs, scene_rows }
}

impl Robot {
    /// A monitor of the arm alone.
    pub(crate) fn monitor(&self, links: Links, with_self: bool) -> Monitor {
        let pairs: &[[usize; 2]] = if with_self { &self.self_pairs } else { &[] };
        let mut body = ArmBody::new(&self.capsules, pairs).expect("a reference robot fits");
        if links == Links::Capsules {
            return Monitor::new(body);
        }
        let mut shapes = Shapes::new();
        for (index, hull) in self.hulls.iter().enumerate() {
            let number = shapes.add_hull(hull).expect("a reference link is a hull");
            body.refine(index, number).expect("every hull has its capsule");
        }
        Monitor::with_shapes(body, Arc::new(shapes)).expect("hulls lie in their capsules")
    }

    /// The same in a scene, the person apart from it.
    pub(crate) fn monitor_in(&self, scene: &str, links: Links, with_self: bool) -> Monitor {
        let mut monitor = self.monitor(links, with_self);
        let (objects, person) = self.scene(scene);
        monitor.set_scene(&objects).expect("a reference scene is sound");
        monitor.set_human(&person);
        monitor
    }

    pub(crate) fn position(&self, fields: &[String]) -> [f64; JOINTS_MAX] {
        let mut position = [0.0; JOINTS_MAX];
        position[..self.joints].copy_from_slice(&numbers(&fields[..self.joints]));
        position
    }

    /// The objects of a scene, numbered from 1, and the person in it.
    pub(crate) fn scene(&self, id: &str) -> (Vec<SceneObject>, Vec<Capsule>) {
        let (mut objects, mut person) = (Vec::new(), Vec::new());
        for row in self.scene_rows.iter().filter(|row| row[0] == id) {
            let n = numbers(&row[4..]);
            if row[2] == "human" {
                let ends = [[n[0], n[1], n[2]], [n[3], n[4], n[5]]];
                person.push(Capsule { ends, radius: n[6], velocity: [0.0; 3] });
            } else {
                objects.push(object(&row[3], row[1].parse::<u32>().expect("an id") + 1, &n));
            }
        }
        (objects, person)
    }

    /// The whole scene, the person as objects of it.
    pub(crate) fn scene_of_objects(&self, id: &str) -> Vec<SceneObject> {
        let (mut objects, person) = self.scene(id);
        objects.extend(person.iter().enumerate().map(|(index, capsule)| {
            let [a, b] = capsule.ends;
            object("capsule", 500 + index as u32, &[a[0], a[1], a[2], b[0], b[1], b[2], capsule.radius])
        }));
        objects
    }

    /// Whether an obstacle of the reference is one of the person's capsules.
    pub(crate) fn is_person(&self, scene: &str, obstacle: &str) -> bool {
        self.scene_rows.iter().any(|row| row[0] == scene && row[1] == obstacle && row[2] == "human")
    }
}

pub(crate) fn object(shape: &str, id: u32, n: &[f64]) -> SceneObject {
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
