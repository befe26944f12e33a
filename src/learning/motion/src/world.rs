//! The cell a policy learns in: arm, layout and product from the cell's files, and scenes drawn in it.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use tandem_clearance::Monitor;
use tandem_config::{Cell, Part, id, pose_of};
use tandem_kinematics::{Chain, JOINTS_MAX};
use tandem_msg::{AttachedPart, Capsule, Code, SceneObject, ShapeKind};
use tandem_planner::Planner;
use tandem_policy::{DOF, Destination};

use crate::expert;

/// Joint position, rad.
pub type Joints = [f64; JOINTS_MAX];

/// Clearance that start and goal of a scene keep, and the demonstrations on their way, metres.
pub(crate) const MARGIN_PLANNED: f64 = 0.035;
/// Clearance below which a motion is refused in training, metres: more than a controller asks of a path.
pub const MARGIN: f64 = 0.020;
/// Share of the scenes whose straight joint line must run into something.
const BLOCKED_SHARE: f64 = 0.65;
/// Share of the scenes with a person.
const PERSON_SHARE: f64 = 0.4;
/// Attempts at a scene before other places are drawn.
const ATTEMPTS: u32 = 12;
/// What stands in the way for the time of a scene; they count up from here.
const CLUTTER: u32 = 200;
/// Capsules of the person.
pub(crate) const PERSON: u32 = 300;

/// The four subtasks of Section 3.2.2.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Subtask {
    /// With the empty tool to where a part is taken, or a tool.
    Grasp,
    /// With a part from its station to above its place.
    Transfer,
    /// With a part around the box to close above its place.
    Place,
    /// With the tool to the feature that a part is joined by.
    Assemble,
}

impl Subtask {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Grasp, Self::Transfer, Self::Place, Self::Assemble];

    /// Name in files and on the screen.
    pub fn name(self) -> &'static str {
        match self {
            Self::Grasp => "grasp",
            Self::Transfer => "transfer",
            Self::Place => "place",
            Self::Assemble => "assemble",
        }
    }
}

/// A person at the bench: the trunk stands, a forearm reaches out and comes back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reaching {
    trunk: [[f64; 3]; 2],
    elbow: [f64; 3],
    hand: [[f64; 3]; 2],
    speed: f64,
    phase: f64,
}

impl Reaching {
    /// Where the capsules are at a time, seconds.
    pub(crate) fn at(&self, time: f64) -> [Capsule; 2] {
        let [near, far] = self.hand.map(Vector3::from);
        let length = (far - near).norm().max(1e-3);
        let along = (self.phase + self.speed * time / length).rem_euclid(2.0);
        let (share, sign) = if along < 1.0 { (along, 1.0) } else { (2.0 - along, -1.0) };
        let hand = near.lerp(&far, share);
        let velocity = (far - near) / length * (sign * self.speed);
        [
            Capsule { ends: self.trunk, radius: 0.18, velocity: [0.0; 3] },
            Capsule { ends: [self.elbow, hand.into()], radius: 0.05, velocity: velocity.into() },
        ]
    }

    /// As objects of a scene, with `more` metres around them.
    pub(crate) fn objects(&self, time: f64, more: f64) -> [SceneObject; 2] {
        let capsules = self.at(time);
        core::array::from_fn(|index| {
            let [a, b] = capsules[index].ends.map(Vector3::from);
            let along = b - a;
            let rotation =
                UnitQuaternion::rotation_between(&Vector3::z(), &along).unwrap_or_else(UnitQuaternion::identity);
            SceneObject {
                id: PERSON + index as u32,
                shape: Code::of(ShapeKind::Capsule),
                size: [capsules[index].radius + more, along.norm() / 2.0, 0.0],
                base_from_object: pose_of(&Isometry3::from_parts(Translation3::from((a + b) / 2.0), rotation)),
            }
        })
    }
}

/// One task in one scene.
#[derive(Clone, Debug)]
pub struct Scene {
    /// What stands around.
    pub objects: Vec<SceneObject>,
    /// What the arm carries.
    pub attached: Option<AttachedPart>,
    /// The person, if there is one.
    pub person: Option<Reaching>,
    /// Where the arm stands.
    pub start: Joints,
    /// Where it shall go.
    pub destination: Destination,
    /// The straight joint line to the goal touches something.
    pub straight_blocked: bool,
    /// A way around, found by the sampling planner: there is one.
    pub way: Vec<Joints>,
}

/// Arm, layout and product.
#[derive(Clone, Debug)]
pub struct World {
    /// The cell.
    pub cell: Cell,
    /// The arm alone.
    pub monitor: Monitor,
}

impl World {
    /// The world of a cell.
    pub fn new(cell: Cell) -> Self {
        let monitor = cell.robot.monitor();
        Self { cell, monitor }
    }

    /// The arm.
    pub fn chain(&self) -> &Chain {
        &self.cell.robot.chain
    }

    /// A monitor that knows a scene at a time, people with `more` metres around them.
    pub fn monitor_of(&self, scene: &Scene, time: f64, more: f64) -> Monitor {
        let mut monitor = self.monitor.clone();
        let mut objects = scene.objects.clone();
        objects.extend(scene.person.iter().flat_map(|person| person.objects(time, more)));
        monitor.set_scene(&objects).expect("scenes are made sound");
        monitor.set_attached(scene.attached.as_ref());
        monitor
    }

    /// Draws a scene in which there is a way from start to goal.
    pub fn scene(&self, subtask: Subtask, planner: &mut Planner, draws: &mut ChaCha8Rng) -> Scene {
        loop {
            let Some(bare) = self.places(subtask, draws) else { continue };
            let blocked_wanted = draws.random::<f64>() < BLOCKED_SHARE;
            for _ in 0..ATTEMPTS {
                let mut scene = bare.clone();
                self.clutter(&mut scene, blocked_wanted, draws);
                if let Some(scene) = self.accept(scene, blocked_wanted, planner, draws) {
                    return scene;
                }
            }
        }
    }

    /// Start, goal and what the cell itself has standing there.
    fn places(&self, subtask: Subtask, draws: &mut ChaCha8Rng) -> Option<Scene> {
        let (layout, product, policy) = (&self.cell.layout, &self.cell.product, &self.cell.supervisor);
        let index = match draws.random::<f64>() < 0.4 {
            // The battery itself as often as all else.
            true => product.part("battery_module").unwrap_or(0),
            false => draws.random_range(0..product.parts.len()),
        };
        let part = &product.parts[index];
        let at_station = layout.stations[part.station].base_from_station * part.station_from_part;
        let at_place = layout.base_from_fixture * part.fixture_from_part;
        let grasp = |base_from_part: &Isometry3<f64>| base_from_part * part.part_from_grasp;
        let back = |pose: Isometry3<f64>, by: f64| pose * Translation3::new(0.0, 0.0, -by);
        let above_station = back(grasp(&at_station), policy.approach);
        let lifted = back(grasp(&at_station), policy.retract);
        let hover = back(grasp(&at_place), policy.hover);
        let slot = |draws: &mut ChaCha8Rng| {
            let slot = &layout.rack_slots[draws.random_range(0..layout.rack_slots.len())];
            back(slot.base_from_tcp, layout.rack_approach)
        };
        let home = self.cell.robot.home;
        let chain = self.chain();
        let home_pose = chain.forward(&home).base_from_tcp;
        let mut carried = false;
        let (from, to) = match subtask {
            Subtask::Grasp => {
                let from = match draws.random_range(0..4_u32) {
                    0 => home_pose,
                    1 => slot(draws),
                    2 => back(grasp(&at_place), policy.retract),
                    _ => back(layout.base_from_hold, draws.random_range(0.0..0.2)),
                };
                let to = match draws.random_range(0..10_u32) {
                    0..=5 => above_station,
                    6..=8 => slot(draws),
                    _ => home_pose,
                };
                (from, to)
            }
            Subtask::Transfer => {
                carried = true;
                let to = match draws.random_range(0..10_u32) {
                    0..=6 => hover,
                    7 | 8 => layout.base_from_hold,
                    _ => layout.base_from_handover,
                };
                (lifted, to)
            }
            Subtask::Place => {
                carried = true;
                let from = match draws.random_range(0..3_u32) {
                    0 => layout.base_from_hold,
                    1 => layout.base_from_handover,
                    _ => {
                        let aside = [-1.0, 1.0][draws.random_range(0..2_usize)] * draws.random_range(0.25..0.45);
                        Translation3::new(0.0, aside, draws.random_range(0.0..0.15)) * hover
                    }
                };
                (from, back(grasp(&at_place), 0.08))
            }
            Subtask::Assemble => {
                let feature = at_place * part.part_from_feature;
                let down = Isometry3::from_parts(feature.translation, home_pose.rotation);
                let from = match draws.random_range(0..3_u32) {
                    0 => slot(draws),
                    1 => home_pose,
                    _ => lifted,
                };
                (from, back(down, 0.08 + draws.random_range(0.0..0.06)))
            }
        };
        if draws.random::<bool>() && subtask == Subtask::Grasp {
            return self.scene_of(part, index, &to, &from, carried, draws);
        }
        self.scene_of(part, index, &from, &to, carried, draws)
    }

    fn scene_of(
        &self,
        part: &Part,
        index: usize,
        from: &Isometry3<f64>,
        to: &Isometry3<f64>,
        carried: bool,
        draws: &mut ChaCha8Rng,
    ) -> Option<Scene> {
        let (chain, layout) = (self.chain(), &self.cell.layout);
        let mut around = |pose: &Isometry3<f64>, spread: f64, turn: f64| {
            let mut shift = || draws.random_range(-spread..spread);
            let moved = Translation3::new(shift(), shift(), 0.5 * shift().abs()) * pose;
            moved * UnitQuaternion::from_axis_angle(&Vector3::z_axis(), draws.random_range(-turn..turn))
        };
        let (from, to) = (around(from, 0.05, 0.15), around(to, 0.02, 0.10));
        let attached = carried.then(|| AttachedPart {
            present: 1,
            shape: 0,
            half_extents: part.half_extents,
            tcp_from_part: pose_of(&part.part_from_grasp.inverse()),
            mass: part.mass,
        });
        let mut objects = layout.scene_objects();
        let solid = |id: u32, base_from_part: &Isometry3<f64>, part: &Part| SceneObject {
            id,
            shape: Code::of(ShapeKind::Box),
            size: part.half_extents,
            base_from_object: pose_of(base_from_part),
        };
        for (placed, part) in self.cell.product.parts.iter().enumerate().take(index) {
            objects.push(solid(id::PLACED + placed as u32, &(layout.base_from_fixture * part.fixture_from_part), part));
        }
        if !carried {
            let lies = layout.stations[part.station].base_from_station * part.station_from_part;
            objects.push(solid(id::PRESENTED, &lies, part));
        }
        let mut scene = Scene {
            objects,
            attached,
            person: None,
            start: [0.0; JOINTS_MAX],
            destination: Destination::default(),
            straight_blocked: false,
            way: Vec::new(),
        };
        let monitor = self.monitor_of(&scene, 0.0, 0.0);
        let clear = |seed: &Joints, pose: &Isometry3<f64>| {
            let branches = chain.branches(pose, seed).ok()?;
            let sound =
                |q: &&Joints| chain.is_within_limits(q, 0.05) && monitor.is_clear(&chain.forward(q), MARGIN_PLANNED);
            branches.as_slice().iter().find(sound).copied()
        };
        scene.start = clear(&self.cell.robot.home, &from)?;
        scene.destination = Destination {
            joints: clear(&scene.start, &to)?,
            position: to.translation.vector.into(),
            part: attached.map_or([0.0; 3], |part| part.half_extents),
        };
        let far = scene.start.iter().zip(&scene.destination.joints).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        (far > 0.5).then_some(scene)
    }

    /// Puts things in the way, and a person beside it.
    fn clutter(&self, scene: &mut Scene, blocking: bool, draws: &mut ChaCha8Rng) {
        let chain = self.chain();
        let add = |position: [f64; 2], half: [f64; 2], top: f64, yaw: f64, scene: &mut Scene| {
            let id = CLUTTER + scene.objects.len() as u32;
            let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw);
            let at = Isometry3::from_parts(Translation3::new(position[0], position[1], top / 2.0), rotation);
            scene.objects.push(SceneObject {
                id,
                shape: Code::of(ShapeKind::Box),
                size: [half[0], half[1], top / 2.0],
                base_from_object: pose_of(&at),
            });
        };
        if blocking {
            let share = draws.random_range(0.2..0.8);
            let between =
                core::array::from_fn(|k| scene.start[k] + share * (scene.destination.joints[k] - scene.start[k]));
            let tcp = chain.forward(&between).base_from_tcp.translation.vector;
            let aside = [draws.random_range(-0.08..0.08), draws.random_range(-0.08..0.08)];
            let half = [draws.random_range(0.03..0.10), draws.random_range(0.03..0.10)];
            let top = (tcp.z + draws.random_range(-0.05..0.15)).max(0.06);
            add([tcp.x + aside[0], tcp.y + aside[1]], half, top, draws.random_range(-1.5..1.5), scene);
        }
        for _ in 0..draws.random_range(0..3_u32) {
            let position = [draws.random_range(0.15..1.1), draws.random_range(-0.7..0.7)];
            let half = [draws.random_range(0.02..0.08), draws.random_range(0.02..0.08)];
            add(position, half, draws.random_range(0.05..0.35), draws.random_range(-1.5..1.5), scene);
        }
        if draws.random::<f64>() < PERSON_SHARE {
            let y = draws.random_range(-0.4..0.4);
            scene.person = Some(Reaching {
                trunk: [[1.45, y, -0.4], [1.45, y, 0.45]],
                elbow: [1.32, y, 0.30],
                hand: [
                    [1.15, y, 0.25],
                    [
                        draws.random_range(0.75..1.05),
                        y + draws.random_range(-0.25..0.25),
                        draws.random_range(0.15..0.40),
                    ],
                ],
                speed: draws.random_range(0.1..0.4),
                phase: draws.random_range(0.0..2.0),
            });
        }
    }

    /// Start and goal must be clear, whatever the person does, and joined by a way.
    fn accept(
        &self,
        mut scene: Scene,
        blocked_wanted: bool,
        planner: &mut Planner,
        draws: &mut ChaCha8Rng,
    ) -> Option<Scene> {
        let chain = self.chain();
        if let Some(mut person) = scene.person {
            // At the farthest reach.
            person.phase = 1.0;
            person.speed = 0.0;
            let reached = Scene { person: Some(person), ..scene.clone() };
            let monitor = self.monitor_of(&reached, 0.0, 0.05);
            let clear = |q: &Joints| monitor.is_clear(&chain.forward(q), MARGIN_PLANNED);
            if !clear(&scene.start) || !clear(&scene.destination.joints) {
                scene.person = None;
            }
        }
        let monitor = self.monitor_of(&scene, 0.0, 0.0);
        let (start, goal) = (scene.start, scene.destination.joints);
        if ![&start, &goal].iter().all(|q| monitor.is_clear(&chain.forward(q), MARGIN_PLANNED)) {
            return None;
        }
        scene.straight_blocked = !monitor.path_is_clear(chain, &start, &goal, 0.0, 0.002);
        if blocked_wanted && !scene.straight_blocked {
            return None;
        }
        scene.way = expert::way(self, &scene, &start, 0.0, planner, draws.random())?;
        Some(scene)
    }
}

/// Largest difference of a joint.
pub(crate) fn apart(a: &Joints, b: &Joints) -> f64 {
    a.iter().zip(b).take(DOF).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}
