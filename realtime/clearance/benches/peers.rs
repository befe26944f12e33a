//! How long is one query of the monitor, poses and self pairs included, beside what people use?
//!
//! UR5 and Panda among the 50 obstacles of a reference scene, a person of ten capsules among them, at the
//! reference positions. Peers: parry3d in f64, all pairs sorted by the gaps of their boxes until none can be
//! nearer; coal's dynamic AABB tree (C++ of the PyPI wheel). Both answer one least distance, 0 on overlap, with
//! nearest points; ours answers scene and self, and the person apart from them, with depths.
//! Positions are `anywhere` the reference has them, or those of them that are `free`; where something touches, peers stop
//! at the first contact and ours goes on to the deepest.
#![allow(clippy::disallowed_types, clippy::disallowed_methods, clippy::disallowed_macros, reason = "a bench measures")]

#[path = "../tests/reference/mod.rs"]
mod reference;

use std::cell::RefCell;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use parry3d_f64::bounding_volume::{Aabb, BoundingVolume};
use parry3d_f64::glamx::{DPose3, DQuat, DVec3};
use parry3d_f64::query;
use parry3d_f64::shape::{Ball, Capsule as ParryCapsule, ConvexPolyhedron, Cuboid, Cylinder, Shape};
use reference::{Links, Robot, robots, rows};
use tandem_clearance::Monitor;
use tandem_kinematics::{JOINTS_MAX, LinkPoses};
use tandem_msg::{Capsule, SCENE_OBJECTS_MAX, SceneObject, ShapeKind};
use tandem_peers::{Absent, Bench, Contender, Program, per_call};

/// The same question put to parry.
struct Parry {
    own: Vec<(usize, Box<dyn Shape>)>,
    others: Vec<(Box<dyn Shape>, DPose3, Aabb)>,
    pairs: Vec<[usize; 2]>,
    order: Vec<(f64, usize, usize)>,
}

impl Parry {
    fn of(robot: &Robot, links: Links, pairs: &[[usize; 2]], objects: &[SceneObject], person: &[Capsule]) -> Self {
        let own = robot.capsules.iter().zip(&robot.hulls).map(|(capsule, hull)| {
            let [a, b] = capsule.ends.map(DVec3::from_array);
            let shape: Box<dyn Shape> = match links {
                Links::Capsules => Box::new(ParryCapsule::new(a, b, capsule.radius)),
                Links::Hulls => Box::new(polyhedron(hull)),
            };
            (capsule.link, shape)
        });
        let mut others: Vec<(Box<dyn Shape>, DPose3, Aabb)> = Vec::new();
        let mut add = |shape: Box<dyn Shape>, place: DPose3| {
            let bounds = shape.compute_aabb(&place);
            others.push((shape, place, bounds));
        };
        for object in objects {
            let [a, b, c] = object.size;
            let [x, y, z, w] = object.base_from_object.rotation;
            let translation = DVec3::from_array(object.base_from_object.position);
            let rotation = DQuat::from_xyzw(x, y, z, w);
            let place = DPose3 { rotation, translation };
            // parry's cylinders stand along y.
            let turn = DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2);
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
        Self { own: own.collect(), others, pairs: pairs.to_vec(), order: Vec::new() }
    }

    fn placed(&self, poses: &LinkPoses) -> Vec<(DPose3, Aabb)> {
        let place = |link: usize| {
            let pose = &poses.base_from_link[link];
            let q = pose.rotation.coords;
            let translation = DVec3::from_array(pose.translation.vector.into());
            DPose3 { rotation: DQuat::from_xyzw(q.x, q.y, q.z, q.w), translation }
        };
        self.own.iter().map(|(link, shape)| (place(*link), shape.compute_aabb(&place(*link)))).collect()
    }

    fn distance(&mut self, poses: &LinkPoses) -> f64 {
        let placed = self.placed(poses);
        let gap = |a: &Aabb, b: &Aabb| {
            let apart = (a.center() - b.center()).abs() - a.half_extents() - b.half_extents();
            apart.max(DVec3::ZERO).length()
        };
        let mut order = std::mem::take(&mut self.order);
        order.clear();
        for (k, (link, _)) in self.own.iter().enumerate() {
            if *link > 0 {
                order.extend(self.others.iter().enumerate().map(|(j, other)| (gap(&placed[k].1, &other.2), k, j)));
            }
        }
        let first_pair = self.others.len();
        let own_pairs = self.pairs.iter().enumerate();
        order.extend(own_pairs.map(|(j, [a, b])| (gap(&placed[*a].1, &placed[*b].1), *a, first_pair + j)));
        order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
        let mut best = f64::INFINITY;
        for &(gap, k, j) in order.iter() {
            if gap >= best {
                break;
            }
            let (at, shape) = (&placed[k].0, &*self.own[k].1);
            let near = if j < first_pair {
                query::closest_points(at, shape, &self.others[j].1, &*self.others[j].0, best)
            } else {
                let other = self.pairs[j - first_pair][1];
                query::closest_points(at, shape, &placed[other].0, &*self.own[other].1, best)
            };
            match near.expect("shapes parry knows") {
                query::ClosestPoints::Intersecting => best = 0.0,
                query::ClosestPoints::WithinMargin(a, b) => best = best.min((a - b).length()),
                query::ClosestPoints::Disjoint => {}
            }
        }
        self.order = order;
        best
    }

    fn is_clear(&self, poses: &LinkPoses) -> bool {
        let placed = self.placed(poses);
        let touch = |a: (&DPose3, &dyn Shape), b: (&DPose3, &dyn Shape)| {
            query::intersection_test(a.0, a.1, b.0, b.1).expect("shapes parry knows").intersecting
        };
        let moving = self.own.iter().zip(&placed).rev().filter(|((link, _), _)| *link > 0);
        for ((_, shape), (at, bounds)) in moving {
            for (other, place, around) in &self.others {
                if bounds.intersects(around) && touch((at, &**shape), (place, &**other)) {
                    return false;
                }
            }
        }
        self.pairs.iter().all(|[a, b]| {
            let (first, second) = (&placed[*a], &placed[*b]);
            !first.1.intersects(&second.1) || !touch((&first.0, &*self.own[*a].1), (&second.0, &*self.own[*b].1))
        })
    }
}

fn polyhedron(hull: &[[f64; 3]]) -> ConvexPolyhedron {
    let points: Vec<DVec3> = hull.iter().map(|point| DVec3::from_array(*point)).collect();
    ConvexPolyhedron::from_convex_hull(&points).expect("a solid link")
}

/// The case as coal's side reads it.
fn write_case(
    robot: &Robot,
    pairs: &[[usize; 2]],
    objects: &[SceneObject],
    person: &[Capsule],
    positions: &[[f64; JOINTS_MAX]],
    monitors: &[Monitor; 2],
) -> Result<PathBuf, Absent> {
    let list = |numbers: &[f64]| numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
    let mut text = String::new();
    let mut line = |words: &[&str]| writeln!(text, "{}", words.join(" ")).expect("a string takes all");
    for joint in robot.chain.joints() {
        let place = &joint.parent_from_joint;
        let (t, q) = (place.translation.vector, place.rotation.coords);
        line(&["joint", &list(t.as_slice()), &list(q.as_slice()), &list(joint.axis.as_slice())]);
    }
    for (capsule, hull) in robot.capsules.iter().zip(&robot.hulls) {
        line(&["link", &capsule.link.to_string(), &list(capsule.ends.as_flattened()), &capsule.radius.to_string()]);
        line(&[&hull.len().to_string(), &list(hull.as_flattened())]);
    }
    pairs.iter().for_each(|[a, b]| line(&["pair", &a.to_string(), &b.to_string()]));
    for object in objects {
        let [a, b, c] = object.size;
        let place = list(&[&object.base_from_object.position[..], &object.base_from_object.rotation[..]].concat());
        match object.shape.get() {
            Some(ShapeKind::Box) => line(&["box", &list(&[a, b, c]), &place]),
            Some(ShapeKind::Cylinder) => line(&["cylinder", &list(&[a, b]), &place]),
            Some(ShapeKind::Capsule) => line(&["rod", &list(&[a, b]), &place]),
            _ => line(&["sphere", &a.to_string(), &place]),
        }
    }
    for capsule in person {
        line(&["capsule", &list(capsule.ends.as_flattened()), &capsule.radius.to_string()]);
    }
    for position in positions {
        let free = monitors.each_ref().map(|monitor| u8::from(least(robot, monitor, position) > 0.0).to_string());
        line(&["at", &free[0], &free[1], &list(&position[..robot.joints])]);
    }
    let file = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("clearance-{}.txt", robot.name));
    std::fs::write(&file, text).map_err(|error| Absent(format!("{}: {error}", file.display())))?;
    Ok(file)
}

fn coal(case: Result<PathBuf, Absent>) -> Result<Program, Absent> {
    let python = tandem_peers::python("coal", &["libcoal==3.0.3", "cmeel-eigen==3.4.1"])?;
    let prefix = python.packages()?.join("cmeel.prefix");
    let (include, lib) = (prefix.join("include"), prefix.join("lib").display().to_string());
    let flags = [
        format!("-isystem{}", include.display()),
        format!("-isystem{}", include.join("eigen3").display()),
        // The wheel's library is built for any x86-64, and Eigen's alignment must be the same on both sides.
        "-march=x86-64".into(),
        format!("-L{lib}"),
        format!("-Wl,-rpath,{lib}"),
        "-lcoal".into(),
    ];
    let source = concat!(env!("CARGO_MANIFEST_DIR"), "/peers/coal.cpp");
    let program = tandem_peers::cpp(Path::new(source), &flags)?;
    Program::start(Command::new(program).arg(case?))
}

fn main() {
    let bench = Bench::new("clearance");
    for robot in robots() {
        let cases = rows(&format!("{}_distance.csv", robot.name));
        let positions: Vec<_> = cases.iter().map(|row| robot.position(&row[3..])).collect();
        let positions = &positions[..if bench.is_brief() { 100 } else { positions.len() }];
        let sized = |id: &str| {
            let (objects, person) = robot.scene(id);
            objects.len() + person.len() == 50
        };
        let id = cases.iter().map(|row| &row[1]).find(|id| sized(id)).expect("a scene of 50 obstacles");
        let (objects, person) = robot.scene(id);
        assert!(objects.len() <= SCENE_OBJECTS_MAX && person.len() == 10);
        let monitors = [Links::Capsules, Links::Hulls].map(|links| robot.monitor_in(id, links, true));
        let pairs: Vec<[usize; 2]> = monitors[0].body().self_pairs().collect();
        let coal = bench.program("coal", || coal(write_case(&robot, &pairs, &objects, &person, positions, &monitors)));
        let coal = RefCell::new(coal);
        for links in [Links::Capsules, Links::Hulls] {
            measure(&bench, &robot, id, links, positions, Parry::of(&robot, links, &pairs, &objects, &person), &coal);
        }
    }
}

fn measure(
    bench: &Bench,
    robot: &Robot,
    scene: &str,
    links: Links,
    anywhere: &[[f64; JOINTS_MAX]],
    parry: Parry,
    coal: &RefCell<Option<Program>>,
) {
    let monitor = robot.monitor_in(scene, links, true);
    let chain = &robot.chain;
    let (name, parry) = (format!("{links:?}").to_lowercase(), RefCell::new(parry));
    let from_coal = |question: &str, place: &str| {
        let has = coal.borrow().is_some();
        let question = format!("{question} {place} {name}");
        let answer = move || coal.borrow_mut().as_mut().map_or(f64::NAN, |coal| coal.round(&question)) / 1e3;
        has.then(|| Contender::new("coal AABB tree", answer))
    };
    let least = |position: &[f64; JOINTS_MAX]| least(robot, &monitor, position);
    let free: Vec<_> = anywhere.iter().filter(|position| least(position) > 0.0).copied().collect();
    for (place, positions) in [("free", &free[..]), ("anywhere", anywhere)] {
        // The answers first: all agree on the mean.
        let mean = |call: &mut dyn FnMut(&[f64; JOINTS_MAX]) -> f64| {
            positions.iter().map(|position| call(position).max(0.0)).sum::<f64>() / positions.len() as f64
        };
        let agrees = |ours: f64, theirs: f64, peer: &str| {
            let case = format!("{} {name}, {place}", robot.name);
            assert!((ours - theirs).abs() < 2e-5, "{case}: mean distance {ours} m, {peer}'s {theirs} m");
        };
        let ours = mean(&mut |position| least(position));
        agrees(ours, mean(&mut |position| parry.borrow_mut().distance(&chain.forward(position))), "parry");
        if let Some(coal) = coal.borrow_mut().as_mut() {
            agrees(ours, coal.round(&format!("mean {place} {name}")), "coal");
        }
        let mut contenders = vec![
            Contender::new("ours", || each(positions, least)),
            Contender::new("parry3d-f64", || {
                each(positions, |position| parry.borrow_mut().distance(&chain.forward(position)))
            }),
        ];
        contenders.extend(from_coal("distance", place));
        let case = format!("{}, 50 obstacles, {name}, {place} ({}): least distance", robot.name, positions.len());
        bench.compare(&case, "us", contenders);
    }

    // A cycle apart: every joint at up to 0.5 rad/s, the same monitor with what it remembers and without.
    let step = |from: &[f64; JOINTS_MAX], k: u32| -> [f64; JOINTS_MAX] {
        std::array::from_fn(|joint| from[joint] + 5e-4 * f64::from(k) * (1.7 * joint as f64).cos())
    };
    let followed: Vec<_> = free.iter().take(30).flat_map(|from| (0..50).map(|k| step(from, k))).collect();
    let tracking = RefCell::new(monitor.clone());
    let contenders = vec![
        Contender::new("ours", || each(&followed, |position| tracking.borrow_mut().track(&chain.forward(position)))),
        Contender::new("ours, not remembering", || {
            each(&followed, |position| monitor.clearance(&chain.forward(position)))
        }),
    ];
    bench.compare(&format!("{}, 40 obstacles, {name}: a millisecond on", robot.name), "us", contenders);

    // The person is an obstacle like any other here.
    let mut whole = robot.monitor(links, true);
    let mut objects = robot.scene_of_objects(scene);
    objects.truncate(SCENE_OBJECTS_MAX);
    whole.set_scene(&objects).expect("a reference scene is sound");
    for (place, positions) in [("free", &free[..]), ("anywhere", anywhere)] {
        let mut contenders = vec![
            Contender::new("ours", || each(positions, |position| whole.is_clear(&chain.forward(position), 0.0))),
            Contender::new("parry3d-f64", || {
                each(positions, |position| parry.borrow().is_clear(&chain.forward(position)))
            }),
        ];
        contenders.extend(from_coal("clear", place));
        bench.compare(&format!("{}, 50 obstacles, {name}, {place}: is clear", robot.name), "us", contenders);
    }
}

fn least(robot: &Robot, monitor: &Monitor, position: &[f64; JOINTS_MAX]) -> f64 {
    let (clearance, separation) = monitor.measure(&robot.chain.forward(position));
    clearance.distance.min(separation.distance)
}

/// Microseconds a position.
fn each<T>(positions: &[[f64; JOINTS_MAX]], mut call: impl FnMut(&[f64; JOINTS_MAX]) -> T) -> f64 {
    per_call(positions.len() as u32, |index| call(&positions[index as usize])) / 1e3
}
