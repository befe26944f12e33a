//! What a policy for an arm of six joints is told: the state of Eq. (10), and what it lacks.
//!
//! The paper's state, `(D, D_o, S_r)`, stands first. It says neither where the goal lies nor how the arm
//! stands, so joint positions and vectors follow: to the joint position at the goal, to the goal, to the obstacles,
//! to what of the scene is nearest to the arm, and how that clearance grows with each joint. Units are metres and
//! radians; [`SCALE`] brings each to about one.

use nalgebra::{Matrix3, Vector3};
use tandem_clearance::{Clearance, Monitor};
use tandem_kinematics::{Chain, JOINTS_MAX, LinkPoses};
use tandem_msg::{Capsule, SCENE_OBJECTS_MAX, SceneObject, ShapeKind};

/// Joints a policy moves.
pub const DOF: usize = 6;
/// Obstacles it is told of: those nearest to the straight way from the TCP to the goal.
pub const OBSTACLES: usize = 6;
/// Distances are cut here: what is farther away says nothing, metres.
pub const FAR: f64 = 0.5;
/// Places along the straight way to the goal where obstacles are compared.
const ALONG: usize = 5;

const DISTANCES: usize = 1 + OBSTACLES + 1 + 1;
/// Where S_r stands in an observation.
pub const SAFETY: usize = DISTANCES - 1;
const ARM: usize = 2 * DOF + 2 * 3;
const SEEN: usize = OBSTACLES * 6;
const NEAREST: usize = 1 + 3 + 3 + 1 + DOF;
const PERSON: usize = 3 + 3;
const PART: usize = 3;
/// Places on the straight joint line to the goal that are looked at ahead, as shares of it.
const AHEAD: [f64; 3] = [0.25, 0.5, 0.75];
/// How far ahead on that line the clearance is looked at, rad of the joint that turns most.
const NEXT: [f64; 2] = [0.25, 0.7];
const LOOK: usize = AHEAD.len() * 4 + NEXT.len() * (1 + 3 + DOF);
/// Numbers of an observation.
pub const OBSERVATION: usize = DISTANCES + ARM + SEEN + NEAREST + PERSON + PART + LOOK;

/// What each number is multiplied with before a network sees it.
pub const SCALE: [f32; OBSERVATION] = {
    let mut scale = [1.0; OBSERVATION];
    let mut index = 0;
    // Eq. (10): D reaches two metres, D_o is cut at half a metre.
    while index < DISTANCES {
        scale[index] = if index == 0 || index == DISTANCES - 1 { 1.0 } else { 2.0 };
        index += 1;
    }
    while index < DISTANCES + DOF {
        scale[index] = 0.5;
        index += 1;
    }
    // The way to go in joints matters most where it is short.
    while index < DISTANCES + 2 * DOF {
        scale[index] = 1.0;
        index += 1;
    }
    while index < DISTANCES + ARM {
        scale[index] = 1.5;
        index += 1;
    }
    while index < DISTANCES + ARM + SEEN {
        scale[index] = 2.0;
        index += 1;
    }
    while index < OBSERVATION {
        scale[index] = 3.0;
        index += 1;
    }
    scale
};

/// An obstacle as a policy sees it: the box around it.
#[derive(Clone, Copy, Debug)]
struct Around {
    centre: Vector3<f64>,
    axes: Matrix3<f64>,
    half: Vector3<f64>,
}

impl Around {
    const NONE: Self = Self {
        centre: Vector3::new(0.0, 0.0, 0.0),
        axes: Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        half: Vector3::new(0.0, 0.0, 0.0),
    };

    fn distance(&self, point: &Vector3<f64>) -> f64 {
        let local = self.axes.tr_mul(&(point - self.centre));
        let outside = Vector3::new(
            (local.x.abs() - self.half.x).max(0.0),
            (local.y.abs() - self.half.y).max(0.0),
            (local.z.abs() - self.half.z).max(0.0),
        );
        outside.norm()
    }
}

/// The obstacles of a scene, and the person in it, as a policy sees them.
#[derive(Clone, Debug)]
pub struct Surroundings {
    objects: [Around; SCENE_OBJECTS_MAX],
    count: usize,
    person: [Capsule; tandem_msg::HUMAN_CAPSULES_MAX],
    person_count: usize,
}

impl Default for Surroundings {
    fn default() -> Self {
        Self {
            objects: [Around::NONE; SCENE_OBJECTS_MAX],
            count: 0,
            person: [Capsule::default(); tandem_msg::HUMAN_CAPSULES_MAX],
            person_count: 0,
        }
    }
}

impl Surroundings {
    /// Takes over the objects of a scene; those of no known shape, or registered ones, are left to the clearance monitor.
    pub fn set_scene(&mut self, objects: &[SceneObject]) {
        self.count = 0;
        for (slot, object) in self.objects.iter_mut().zip(objects) {
            let [a, b, c] = object.size;
            let half = match object.shape.get() {
                Some(ShapeKind::Box) => Vector3::new(a, b, c),
                Some(ShapeKind::Cylinder) => Vector3::new(a, a, b),
                Some(ShapeKind::Capsule) => Vector3::new(a, a, a + b),
                Some(ShapeKind::Sphere) => Vector3::new(a, a, a),
                Some(ShapeKind::Registered) | None => Vector3::zeros(),
            };
            let [x, y, z, w] = object.base_from_object.rotation;
            let rotation = nalgebra::UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(w, x, y, z));
            *slot = Around {
                centre: Vector3::from(object.base_from_object.position),
                axes: rotation.to_rotation_matrix().into_inner(),
                half,
            };
            self.count += 1;
        }
    }

    /// Takes over the person's capsules.
    pub fn set_person(&mut self, capsules: &[Capsule]) {
        self.person_count = 0;
        for (slot, capsule) in self.person.iter_mut().zip(capsules) {
            *slot = *capsule;
            self.person_count += 1;
        }
    }

    /// The obstacles nearest to the straight way from `from` to `to`, those at `from` first where two are as near.
    fn ranked(&self, from: &Vector3<f64>, to: &Vector3<f64>) -> ([usize; OBSTACLES], usize) {
        let mut best = [(f64::INFINITY, 0); OBSTACLES];
        let mut count = 0;
        for (index, object) in self.objects.iter().enumerate().take(self.count) {
            let mut least = f64::INFINITY;
            for k in 0..ALONG {
                let point = from.lerp(to, k as f64 / (ALONG - 1) as f64);
                least = least.min(object.distance(&point));
            }
            let rank = least + 0.1 * object.distance(from);
            count = (count + 1).min(OBSTACLES);
            let mut entry = (rank, index);
            for slot in &mut best {
                if entry.0 < slot.0 {
                    core::mem::swap(slot, &mut entry);
                }
            }
        }
        (best.map(|(_, index)| index), count)
    }

    /// Nearest point of the person to a point, with its distance and velocity.
    fn person(&self, point: &Vector3<f64>) -> Option<(f64, Vector3<f64>, [f64; 3])> {
        let mut best: Option<(f64, Vector3<f64>, [f64; 3])> = None;
        for capsule in self.person.iter().take(self.person_count) {
            let [a, b] = capsule.ends.map(Vector3::from);
            let along = b - a;
            let share = ((point - a).dot(&along) / along.norm_squared().max(1e-12)).clamp(0.0, 1.0);
            let axis = a + along * share;
            let away = point - axis;
            let distance = (away.norm() - capsule.radius).max(0.0);
            if best.is_none_or(|best| distance < best.0) {
                let surface = axis + away * (capsule.radius / away.norm().max(1e-9)).min(1.0);
                best = Some((distance, surface, capsule.velocity));
            }
        }
        best
    }
}

/// Where a motion shall lead, and what the arm carries there.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Destination {
    /// Joint position at the goal, rad.
    pub joints: [f64; JOINTS_MAX],
    /// The TCP there, base coordinates, metres.
    pub position: [f64; 3],
    /// Half extents of the carried part, metres; 0 for none.
    pub part: [f64; 3],
}

/// One observation, and the distances of the paper's state in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observation {
    /// What the policy is given.
    pub numbers: [f32; OBSERVATION],
    /// Distance from TCP to goal, metres.
    pub distance: f64,
    /// Distances from TCP to the obstacles, and last to the person, metres; [`FAR`] where there is none.
    pub obstacles: [f64; OBSTACLES + 1],
}

/// Writes numbers one after another.
struct Writer<'a> {
    numbers: &'a mut [f32; OBSERVATION],
    at: usize,
}

impl Writer<'_> {
    #[inline]
    fn put(&mut self, value: f64) {
        if let Some(slot) = self.numbers.get_mut(self.at) {
            *slot = value as f32;
        }
        self.at += 1;
    }

    #[inline]
    fn vector(&mut self, vector: &Vector3<f64>) {
        self.put(vector.x);
        self.put(vector.y);
        self.put(vector.z);
    }
}

/// The state of the environment.
///
/// `safety` is S_r: 1 while all is free, -1 after a motion that was refused.
///
/// # Realtime
/// Two clearance queries, five forward solutions, and what is bounded by the objects of a scene; no allocation.
#[allow(clippy::too_many_arguments, reason = "all that there is to see")]
pub fn observe(
    chain: &Chain,
    monitor: &Monitor,
    surroundings: &Surroundings,
    destination: &Destination,
    joints: &[f64; JOINTS_MAX],
    poses: &LinkPoses,
    clearance: &Clearance,
    safety: f64,
) -> Observation {
    let tcp = poses.base_from_tcp.translation.vector;
    let goal = Vector3::from(destination.position);
    // Eq. (11): from the end effector to the target.
    let distance = (tcp - goal).norm();
    let (ranked, count) = surroundings.ranked(&tcp, &goal);
    // Eq. (12): from the end effector to each obstacle, here to its surface and not to its centre.
    let mut obstacles = [FAR; OBSTACLES + 1];
    for (slot, index) in obstacles.iter_mut().zip(&ranked[..count]) {
        *slot = surroundings.objects[*index].distance(&tcp).min(FAR);
    }
    let person = surroundings.person(&tcp);
    obstacles[OBSTACLES] = person.map_or(FAR, |(distance, ..)| distance.min(FAR));

    let mut numbers = [0.0; OBSERVATION];
    let mut out = Writer { numbers: &mut numbers, at: 0 };
    // Eq. (10): s_t = (D, D_o, S_r).
    out.put(distance);
    for distance in obstacles {
        out.put(distance);
    }
    out.put(safety);
    // What the paper's state lacks.
    for joint in joints.iter().take(DOF) {
        out.put(*joint);
    }
    for (at, to) in joints.iter().zip(&destination.joints).take(DOF) {
        out.put(to - at);
    }
    out.vector(&(goal - tcp));
    out.vector(&tcp);
    for (slot, index) in ranked.iter().enumerate() {
        if slot < count {
            let object = &surroundings.objects[*index];
            let across = object.axes.abs() * object.half;
            out.vector(&cut(&(object.centre - tcp)));
            out.vector(&cut(&across));
        } else {
            out.vector(&Vector3::repeat(FAR));
            out.vector(&Vector3::zeros());
        }
    }
    let on_arm = Vector3::from(clearance.point_on_arm);
    let away = Vector3::from(clearance.point_on_other) - on_arm;
    let sound = clearance.distance.is_finite();
    out.put(if sound { clearance.distance.clamp(-0.1, FAR) } else { FAR });
    out.vector(&if sound { cut(&away) } else { Vector3::repeat(FAR) });
    out.vector(&if sound { on_arm - tcp } else { Vector3::zeros() });
    out.put(clearance.link as f64 / DOF as f64);
    slopes(chain, poses, clearance).into_iter().for_each(|slope| out.put(slope));
    match person {
        Some((_, point, velocity)) => {
            out.vector(&cut(&(point - tcp)));
            out.vector(&Vector3::from(velocity));
        }
        None => {
            out.vector(&Vector3::repeat(FAR));
            out.vector(&Vector3::zeros());
        }
    }
    out.vector(&Vector3::from(destination.part));
    // Where the straight joint line leads: what the arm would do if nothing were in its way.
    let on_line = |share: f64| -> [f64; JOINTS_MAX] {
        core::array::from_fn(|k| joints[k] + share * (destination.joints[k] - joints[k]))
    };
    for share in AHEAD {
        let place = chain.forward(&on_line(share)).base_from_tcp.translation.vector;
        let near = ranked.iter().take(count).map(|index| surroundings.objects[*index].distance(&place));
        out.vector(&(place - tcp));
        out.put(near.fold(FAR, f64::min));
    }
    let turn = joints.iter().zip(&destination.joints).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    for ahead in NEXT {
        let poses = chain.forward(&on_line((ahead / turn.max(ahead)).min(1.0)));
        let next = monitor.scene_clearance(&poses);
        let sound = next.distance.is_finite();
        out.put(if sound { next.distance.clamp(-0.1, FAR) } else { FAR });
        out.vector(&if sound { cut(&(Vector3::from(next.point_on_other) - tcp)) } else { Vector3::repeat(FAR) });
        slopes(chain, &poses, &next).into_iter().for_each(|slope| out.put(slope));
    }
    Observation { numbers, distance, obstacles }
}

/// How the clearance grows with each joint, metres a rad; nothing where nothing is near.
pub fn slopes(chain: &Chain, poses: &LinkPoses, clearance: &Clearance) -> [f64; DOF] {
    let [on_arm, on_other] = [clearance.point_on_arm, clearance.point_on_other].map(Vector3::from);
    // Overlapping, the points have changed sides.
    let away = (on_arm - on_other) * clearance.distance.signum();
    let mut slopes = [0.0; DOF];
    let Some(away) = away.try_normalize(1e-9).filter(|_| clearance.distance < FAR) else { return slopes };
    for (index, (slope, joint)) in slopes.iter_mut().zip(chain.joints()).enumerate().take(clearance.link) {
        let pose = &poses.base_from_link[index + 1];
        let axis = pose.rotation * joint.axis.into_inner();
        *slope = away.dot(&axis.cross(&(on_arm - pose.translation.vector)));
    }
    slopes
}

/// Each coordinate cut at a metre: what is farther away counts as that far.
fn cut(vector: &Vector3<f64>) -> Vector3<f64> {
    vector.map(|x| x.clamp(-1.0, 1.0))
}
