//! How long is one query of the monitor, poses included, for each size of the reference scenes?
//!
//! UR5 and Panda as capsules, self pairs included, a person of ten capsules among the obstacles;
//! parry3d-f64 on the same capsules, sorted by bounding boxes, in the same run. Prints one JSON object
//! a case: the least of interleaved batches, microseconds a query, on one core.
#![allow(clippy::disallowed_types, clippy::disallowed_methods, clippy::disallowed_macros, reason = "a bench measures")]

use std::hint::black_box;
use std::path::Path;
use std::time::Instant;

use nalgebra::{Isometry3, Quaternion, Translation3, Unit, UnitQuaternion, Vector3};
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::glamx::{DPose3, DQuat, DVec3};
use parry3d_f64::query;
use parry3d_f64::shape::{Ball, Capsule as ParryCapsule, Cuboid, Cylinder, Shape};
use tandem_clearance::{ArmBody, LinkCapsule, Monitor};
use tandem_kinematics::{Chain, JOINTS_MAX, Joint, JointKind, LinkPoses};
use tandem_msg::{Capsule, Pose, SCENE_OBJECTS_MAX, SceneObject, ShapeKind};

const BATCHES: usize = 40;

fn rows(file: &str) -> Vec<Vec<String>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(file);
    let text = std::fs::read_to_string(&path).expect("reference data is beside the tests");
    text.lines().skip(1).map(|line| line.split(',').map(str::to_owned).collect()).collect()
}

fn numbers(fields: &[String]) -> Vec<f64> {
    fields.iter().map(|field| field.parse().unwrap_or(f64::NAN)).collect()
}

fn pose(n: &[f64]) -> Isometry3<f64> {
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(n[6], n[3], n[4], n[5]));
    Isometry3::from_parts(Translation3::new(n[0], n[1], n[2]), rotation)
}

fn chain(robot: &str) -> Chain {
    let rows = rows(&format!("{robot}_chain.csv"));
    let (tool, joints) = rows.split_last().expect("the tool is the last row");
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
    let joints: Vec<Joint> = joints.iter().map(joint).collect();
    Chain::new(&joints, pose(&numbers(&tool[1..]))).expect("a reference robot is a chain")
}

fn capsules(robot: &str) -> (Vec<String>, Vec<LinkCapsule>) {
    let mut names = Vec::new();
    let mut capsules = Vec::new();
    for row in rows(&format!("{robot}_capsules.csv")) {
        let n = numbers(&row[1..]);
        names.push(row[0].trim_end_matches("_0").to_owned());
        capsules.push(LinkCapsule {
            link: n[0] as usize,
            ends: [[n[1], n[2], n[3]], [n[4], n[5], n[6]]],
            radius: n[7],
            tool: false,
        });
    }
    (names, capsules)
}

fn scene(robot: &str, id: &str) -> (Vec<SceneObject>, Vec<Capsule>) {
    let (mut objects, mut person) = (Vec::new(), Vec::new());
    for row in rows(&format!("{robot}_scenes.csv")).iter().filter(|row| row[0] == id) {
        let n = numbers(&row[4..]);
        if row[2] == "human" {
            person.push(Capsule { ends: [[n[0], n[1], n[2]], [n[3], n[4], n[5]]], radius: n[6], velocity: [0.0; 3] });
            continue;
        }
        let (shape, size, base_from_object) = if row[3] == "capsule" {
            let (a, b) = (Vector3::new(n[0], n[1], n[2]), Vector3::new(n[3], n[4], n[5]));
            let turn = UnitQuaternion::rotation_between(&Vector3::z(), &(b - a)).unwrap_or_default();
            let place = Pose { position: ((a + b) * 0.5).into(), rotation: turn.coords.into() };
            (ShapeKind::Capsule, [n[6], 0.5 * (b - a).norm(), 0.0], place)
        } else {
            let kind = match row[3].as_str() {
                "box" => ShapeKind::Box,
                "cylinder" => ShapeKind::Cylinder,
                _ => ShapeKind::Sphere,
            };
            let place = Pose { position: [n[3], n[4], n[5]], rotation: [n[6], n[7], n[8], n[9]] };
            (kind, [n[0], n[1], n[2]], place)
        };
        let id = objects.len() as u32 + 1;
        objects.push(SceneObject { id, shape: shape.into(), size, base_from_object });
    }
    objects.truncate(SCENE_OBJECTS_MAX);
    (objects, person)
}

/// The same question put to parry: all pairs sorted by the gap of their boxes, until none can be nearer.
struct Peer {
    own: Vec<(usize, ParryCapsule)>,
    others: Vec<(Box<dyn Shape>, DPose3, Aabb)>,
    pairs: Vec<[usize; 2]>,
}

impl Peer {
    fn of(capsules: &[LinkCapsule], pairs: Vec<[usize; 2]>, objects: &[SceneObject], person: &[Capsule]) -> Self {
        let own = capsules
            .iter()
            .map(|c| (c.link, ParryCapsule::new(DVec3::from_array(c.ends[0]), DVec3::from_array(c.ends[1]), c.radius)))
            .collect();
        let mut others: Vec<(Box<dyn Shape>, DPose3, Aabb)> = Vec::new();
        let mut add = |shape: Box<dyn Shape>, place: DPose3| {
            let bounds = shape.compute_aabb(&place);
            others.push((shape, place, bounds));
        };
        for object in objects {
            let [a, b, c] = object.size;
            let [x, y, z, w] = object.base_from_object.rotation;
            let translation = DVec3::from_array(object.base_from_object.position);
            let turn = DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2);
            let rotation = DQuat::from_xyzw(x, y, z, w);
            let place = DPose3 { rotation, translation };
            match object.shape.get() {
                Some(ShapeKind::Box) => add(Box::new(Cuboid::new(DVec3::new(a, b, c))), place),
                Some(ShapeKind::Cylinder) => {
                    add(Box::new(Cylinder::new(b, a)), DPose3 { rotation: rotation * turn, translation });
                }
                Some(ShapeKind::Capsule) => add(Box::new(ParryCapsule::new_z(b, a)), place),
                _ => add(Box::new(Ball::new(a)), place),
            }
        }
        for capsule in person {
            let [a, b] = capsule.ends.map(DVec3::from_array);
            add(Box::new(ParryCapsule::new(a, b, capsule.radius)), DPose3::IDENTITY);
        }
        Self { own, others, pairs }
    }

    fn distance(&self, poses: &LinkPoses, order: &mut Vec<(f64, usize, usize)>) -> f64 {
        let place = |link: usize| {
            let pose = &poses.base_from_link[link];
            let q = pose.rotation.coords;
            DPose3 {
                rotation: DQuat::from_xyzw(q.x, q.y, q.z, q.w),
                translation: DVec3::from_array(pose.translation.vector.into()),
            }
        };
        let placed: Vec<(DPose3, Aabb)> =
            self.own.iter().map(|(link, shape)| (place(*link), shape.compute_aabb(&place(*link)))).collect();
        let gap = |a: &Aabb, b: &Aabb| {
            let apart = (a.center() - b.center()).abs() - a.half_extents() - b.half_extents();
            apart.max(DVec3::ZERO).length()
        };
        order.clear();
        for (k, (link, _)) in self.own.iter().enumerate() {
            if *link > 0 {
                order.extend(self.others.iter().enumerate().map(|(j, other)| (gap(&placed[k].1, &other.2), k, j)));
            }
        }
        let first_pair = self.others.len();
        order.extend(
            self.pairs.iter().enumerate().map(|(j, [a, b])| (gap(&placed[*a].1, &placed[*b].1), *a, first_pair + j)),
        );
        order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let mut best = f64::INFINITY;
        for &(gap, k, j) in order.iter() {
            if gap >= best {
                break;
            }
            let distance = if j < first_pair {
                query::distance(&placed[k].0, &self.own[k].1, &self.others[j].1, &*self.others[j].0)
            } else {
                let b = self.pairs[j - first_pair][1];
                query::distance(&placed[k].0, &self.own[k].1, &placed[b].0, &self.own[b].1)
            };
            best = best.min(distance.expect("shapes parry knows").distance);
        }
        best
    }
}

/// The least of all batches: what else runs on the machine only ever adds.
fn least(batches: Vec<f64>) -> f64 {
    batches.into_iter().fold(f64::INFINITY, f64::min)
}

fn main() {
    for (robot, count) in [("ur5", 6), ("panda", 7)] {
        let chain = chain(robot);
        let (names, capsules) = capsules(robot);
        let link = |name: &String| names.iter().position(|other| other == name).map(|at| capsules[at].link);
        let self_pairs: Vec<[usize; 2]> = rows(&format!("{robot}_self_pairs.csv"))
            .iter()
            .filter_map(|row| Some([link(&row[0])?, link(&row[1])?]))
            .collect();
        let body = ArmBody::new(&capsules, &self_pairs).expect("a reference robot fits");
        let cases = rows(&format!("{robot}_distance.csv"));
        let positions: Vec<[f64; JOINTS_MAX]> = cases
            .iter()
            .map(|row| {
                let mut position = [0.0; JOINTS_MAX];
                position[..count].copy_from_slice(&numbers(&row[3..3 + count]));
                position
            })
            .collect();
        for wanted in [11, 21, 31, 50] {
            let all = rows(&format!("{robot}_scenes.csv"));
            let size = |id: &str| all.iter().filter(|row| row[0] == id).count();
            let Some(id) = cases.iter().map(|row| row[1].as_str()).find(|id| size(id) == wanted) else { continue };
            let (objects, person) = scene(robot, id);
            let mut monitor = Monitor::new(body);
            monitor.set_scene(&objects).expect("a reference scene is sound");
            monitor.set_human(&person);
            let peer = Peer::of(&capsules, body.self_pairs().collect(), &objects, &person);
            let mut order = Vec::new();
            let (mut distance, mut clear, mut parry, mut worst) = (Vec::new(), Vec::new(), Vec::new(), 0.0_f64);
            let per_call = |begin: Instant| begin.elapsed().as_nanos() as f64 / 1e3 / positions.len() as f64;
            for _ in 0..BATCHES {
                let begin = Instant::now();
                for position in &positions {
                    let poses = chain.forward(black_box(position));
                    black_box((monitor.clearance(&poses), monitor.separation(&poses)));
                }
                distance.push(per_call(begin));
                let begin = Instant::now();
                for position in &positions {
                    black_box(monitor.is_clear(&chain.forward(black_box(position)), 0.0));
                }
                clear.push(per_call(begin));
                let begin = Instant::now();
                for position in &positions {
                    black_box(peer.distance(&chain.forward(black_box(position)), &mut order));
                }
                parry.push(per_call(begin));
            }
            for position in &positions {
                let poses = chain.forward(position);
                let ours = monitor.clearance(&poses).distance.min(monitor.separation(&poses).distance).max(0.0);
                worst = worst.max((ours - peer.distance(&poses, &mut order)).abs());
            }
            let (distance, clear, parry) = (least(distance), least(clear), least(parry));
            let case = format!("{robot}, {wanted} obstacles");
            println!(
                "{{\"bench\":\"clearance_query\",\"case\":\"{case}\",\"ours\":{distance:.2},\"peer\":\"parry3d-f64\",\
                 \"peer_value\":{parry:.2},\"unit\":\"us\",\"ratio\":{:.3},\"is_clear\":{clear:.2},\"differs_m\":{worst:.1e}}}",
                distance / parry
            );
        }
    }
}
