//! The queries: one arm, one scene, one carried part, the people in view.

use nalgebra::Vector3;
use tandem_kinematics::{JOINTS_MAX, LinkPoses};
use tandem_msg::{AttachedPart, Capsule, HUMAN_CAPSULES_MAX, SCENE_OBJECTS_MAX, SceneObject};

use crate::kernel::{Near, OrientedBox};
use crate::obstacle::{CarriedBox, FAR, Obstacle, SceneFault, capsule_to_capsule};
use crate::{ArmBody, LINK_CAPSULES_MAX, LinkCapsule};

/// Objects a task may allow the tool to touch.
const TOUCH_MAX: usize = 8;

/// The smallest distance between the arm, or what it carries, and what it must not touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearance {
    /// Signed, metres: below 0 when they overlap; +∞ when there is nothing, −∞ when a number was not finite.
    pub distance: f64,
    /// Link of the arm (0 the base); the carried part counts as the last.
    pub link: usize,
    /// Object, by its id; 0 is the arm itself.
    pub object: u32,
    /// Nearest point of the arm, base frame, metres.
    pub point_on_arm: [f64; 3],
    /// Nearest point of the object, or of the other link.
    pub point_on_other: [f64; 3],
}

/// The smallest distance between the arm, or what it carries, and a person.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Separation {
    /// Signed, metres: +∞ when nobody is in view, −∞ when a number was not finite.
    pub distance: f64,
    /// Link of the arm; the carried part counts as the last.
    pub link: usize,
    /// Capsule of the person, its index.
    pub capsule: usize,
    /// Unit vector from the arm to the person at the nearest points, base axes; zero when unknown.
    pub direction: [f64; 3],
    /// Velocity of that capsule, m/s.
    pub human_velocity: [f64; 3],
    /// Nearest point of the arm, base frame, metres.
    pub point_on_arm: [f64; 3],
}

impl Separation {
    const NOBODY: Self = Self {
        distance: f64::INFINITY,
        link: 0,
        capsule: 0,
        direction: [0.0; 3],
        human_velocity: [0.0; 3],
        point_on_arm: [0.0; 3],
    };
}

/// A capsule of the arm where the arm is.
#[derive(Clone, Copy)]
pub(crate) struct Placed {
    pub(crate) ends: [Vector3<f64>; 2],
    pub(crate) centre: Vector3<f64>,
    /// Half extents of the segment along the base axes.
    pub(crate) half: Vector3<f64>,
    pub(crate) radius: f64,
    pub(crate) link: usize,
    tool: bool,
}

impl Placed {
    pub(crate) const UNUSED: Self = Self {
        ends: [Vector3::new(0.0, 0.0, 0.0); 2],
        centre: Vector3::new(0.0, 0.0, 0.0),
        half: Vector3::new(0.0, 0.0, 0.0),
        radius: 0.0,
        link: 0,
        tool: false,
    };

    #[inline]
    pub(crate) fn of(capsule: &LinkCapsule, poses: &LinkPoses) -> Self {
        let pose = &poses.base_from_link[capsule.link.min(JOINTS_MAX)];
        let ends = capsule.ends.map(|end| pose.rotation * Vector3::from(end) + pose.translation.vector);
        Self {
            ends,
            centre: (ends[0] + ends[1]) * 0.5,
            half: (ends[1] - ends[0]).abs() * 0.5,
            radius: capsule.radius,
            link: capsule.link,
            tool: capsule.tool,
        }
    }
}

/// The arm where it is, with what it carries.
pub(crate) struct PlacedArm {
    capsules: [Placed; LINK_CAPSULES_MAX],
    count: usize,
    part: Option<OrientedBox>,
    last_link: usize,
}

/// Distances of one arm to one scene and to people.
///
/// # Realtime
/// Every method is bounded by the array sizes; none allocates, blocks or panics.
#[derive(Clone, Debug)]
pub struct Monitor {
    body: ArmBody,
    pub(crate) obstacles: [Obstacle; SCENE_OBJECTS_MAX],
    /// Boxes around the obstacles along the base axes: centres and half extents.
    pub(crate) bounds: [(Vector3<f64>, Vector3<f64>); SCENE_OBJECTS_MAX],
    pub(crate) obstacle_count: usize,
    scene_valid: bool,
    human: [Capsule; HUMAN_CAPSULES_MAX],
    human_count: usize,
    human_valid: bool,
    pub(crate) part: Option<CarriedBox>,
    part_valid: bool,
    touch: [u32; TOUCH_MAX],
}

impl Monitor {
    /// A monitor of an arm in an empty scene, nobody in view, nothing carried.
    pub fn new(body: ArmBody) -> Self {
        Self {
            body,
            obstacles: [Obstacle::UNUSED; SCENE_OBJECTS_MAX],
            bounds: [(Vector3::zeros(), Vector3::zeros()); SCENE_OBJECTS_MAX],
            obstacle_count: 0,
            scene_valid: true,
            human: [Capsule::default(); HUMAN_CAPSULES_MAX],
            human_count: 0,
            human_valid: true,
            part: None,
            part_valid: true,
            touch: [0; TOUCH_MAX],
        }
    }

    /// The arm.
    pub fn body(&self) -> &ArmBody {
        &self.body
    }

    /// Replaces the scene.
    ///
    /// # Errors
    /// The first fault found. The scene is then invalid: clearance is −∞ until one is accepted.
    pub fn set_scene(&mut self, objects: &[SceneObject]) -> Result<(), SceneFault> {
        self.scene_valid = false;
        self.obstacle_count = 0;
        if objects.len() > SCENE_OBJECTS_MAX {
            return Err(SceneFault::TooMany { count: objects.len() });
        }
        for (index, object) in objects.iter().enumerate() {
            if objects[..index].iter().any(|other| other.id == object.id) {
                return Err(SceneFault::Identity { index, id: object.id });
            }
            let obstacle = Obstacle::of(index, object)?;
            self.obstacles[index] = obstacle;
            self.bounds[index] = obstacle.bounds();
        }
        self.obstacle_count = objects.len();
        self.scene_valid = true;
        Ok(())
    }

    /// Replaces the people in view; no capsule means nobody. Too many, or one with a number that is not
    /// finite or a radius not above 0, makes every separation −∞ until good ones are given.
    pub fn set_human(&mut self, capsules: &[Capsule]) {
        let fits = |capsule: &Capsule| {
            capsule.ends.iter().flatten().chain(&capsule.velocity).all(|x| x.abs() <= FAR)
                && capsule.radius > 0.0
                && capsule.radius <= FAR
        };
        self.human_valid = capsules.len() <= HUMAN_CAPSULES_MAX && capsules.iter().all(fits);
        self.human_count = 0;
        if self.human_valid {
            self.human_count = capsules.len();
            self.human[..capsules.len()].copy_from_slice(capsules);
        }
    }

    /// Replaces the carried part; `None`, or one with `present == 0`, is nothing. A part whose numbers
    /// cannot be makes every distance −∞ until a good one is given.
    pub fn set_attached(&mut self, part: Option<&AttachedPart>) {
        let part = part.filter(|part| part.present != 0);
        self.part = part.and_then(CarriedBox::of);
        self.part_valid = part.is_none() || self.part.is_some();
    }

    /// Replaces the objects that tool and carried part may touch; 0 is no object. Those past the eighth
    /// are not allowed.
    pub fn set_touch(&mut self, ids: &[u32]) {
        self.touch = [0; TOUCH_MAX];
        let allowed = ids.iter().filter(|id| **id != 0);
        for (slot, id) in self.touch.iter_mut().zip(allowed) {
            *slot = *id;
        }
    }

    /// The smallest distance to the scene and to the arm itself. The base (link 0) is checked against
    /// the other links only.
    pub fn clearance(&self, poses: &LinkPoses) -> Clearance {
        match self.place(poses) {
            Some(arm) if self.scene_valid => self.nearest(&arm, f64::INFINITY, f64::NEG_INFINITY),
            _ => contact(),
        }
    }

    /// Whether scene and arm itself are more than `margin` metres away. People are not looked at.
    /// Quicker than [`Monitor::clearance`], as it stops at the first pair that is too near.
    pub fn is_clear(&self, poses: &LinkPoses, margin: f64) -> bool {
        match self.place(poses) {
            Some(arm) if self.scene_valid && margin.is_finite() => {
                self.nearest(&arm, margin.next_up(), margin).distance > margin
            }
            _ => false,
        }
    }

    /// The smallest distance to a person.
    pub fn separation(&self, poses: &LinkPoses) -> Separation {
        let Some(arm) = self.place_for_people(poses) else { return lost() };
        let mut best = Separation::NOBODY;
        for capsule in 0..self.human_count {
            let near = self.near_person(&arm, capsule, best.distance);
            if near.distance < best.distance {
                best = near;
            }
        }
        best
    }

    /// The smallest distance to each capsule of the person, in their order, for a separation by body
    /// part: the first [`Monitor::human_count`] entries. When a number was not finite, all are −∞.
    pub fn separations(&self, poses: &LinkPoses) -> [Separation; HUMAN_CAPSULES_MAX] {
        let Some(arm) = self.place_for_people(poses) else { return [lost(); HUMAN_CAPSULES_MAX] };
        let mut all = [Separation::NOBODY; HUMAN_CAPSULES_MAX];
        for (capsule, slot) in all.iter_mut().enumerate().take(self.human_count) {
            *slot = self.near_person(&arm, capsule, f64::INFINITY);
        }
        all
    }

    /// Capsules of the people in view.
    pub fn human_count(&self) -> usize {
        self.human_count
    }

    /// Whether scene and part are such that anything can be said at all.
    pub(crate) fn is_sound(&self) -> bool {
        self.scene_valid && self.part_valid
    }

    /// The arm at these poses, or `None` when a number is not finite or absurd.
    fn place(&self, poses: &LinkPoses) -> Option<PlacedArm> {
        let last_link = poses.count.min(JOINTS_MAX);
        let mut arm = PlacedArm { capsules: [Placed::UNUSED; LINK_CAPSULES_MAX], count: 0, part: None, last_link };
        if !self.part_valid {
            return None;
        }
        let mut sound = true;
        for (slot, capsule) in arm.capsules.iter_mut().zip(self.body.capsules()) {
            *slot = Placed::of(capsule, poses);
            sound &= slot.ends.iter().all(|end| end.iter().all(|x| x.abs() <= FAR));
            arm.count += 1;
        }
        let tcp = &poses.base_from_tcp;
        sound &= tcp.translation.vector.iter().all(|x| x.abs() <= FAR);
        sound &= tcp.rotation.coords.iter().all(|x| x.is_finite());
        arm.part = self.part.map(|part| part.at(tcp));
        sound.then_some(arm)
    }

    fn place_for_people(&self, poses: &LinkPoses) -> Option<PlacedArm> {
        if self.human_valid { self.place(poses) } else { None }
    }

    pub(crate) fn may_touch(&self, id: u32) -> bool {
        self.touch.contains(&id)
    }

    /// The nearest of all pairs that are nearer than `limit`; stops early once below `enough`.
    fn nearest(&self, arm: &PlacedArm, limit: f64, enough: f64) -> Clearance {
        let mut best = Clearance { distance: limit, ..nothing() };
        // From the tool inwards: what is nearest is mostly out there, and finding it first spares the rest.
        for capsule in arm.capsules[..arm.count].iter().rev() {
            if capsule.link == 0 {
                continue;
            }
            self.capsule_to_scene(capsule, &mut best);
            if best.distance <= enough {
                return best;
            }
        }
        if let Some(part) = &arm.part {
            self.part_to_scene(part, arm, &mut best);
            part_to_arm(part, arm, &mut best);
        }
        if best.distance > enough {
            self.arm_to_itself(arm, &mut best);
        }
        best
    }

    fn capsule_to_scene(&self, capsule: &Placed, best: &mut Clearance) {
        let count = self.obstacle_count.min(SCENE_OBJECTS_MAX);
        let mut gaps = [0.0; SCENE_OBJECTS_MAX];
        let mut first = (f64::INFINITY, 0);
        for (index, (gap, (centre, half))) in gaps.iter_mut().zip(&self.bounds[..count]).enumerate() {
            *gap = squared_gap(&capsule.centre, &capsule.half, centre, half);
            if *gap < first.0 {
                first = (*gap, index);
            }
        }
        let check = |index: usize, best: &mut Clearance| {
            let obstacle = &self.obstacles[index];
            if capsule.tool && self.may_touch(obstacle.id) {
                return;
            }
            let near = obstacle.near_capsule(&capsule.ends, capsule.radius);
            keep(best, &near, capsule.link, obstacle.id);
        };
        if count > 0 {
            check(first.1, best);
        }
        for (index, gap) in gaps[..count].iter().enumerate() {
            let reach = best.distance + capsule.radius;
            if index != first.1 && reach > 0.0 && *gap < reach * reach {
                check(index, best);
            }
        }
    }

    fn part_to_scene(&self, part: &OrientedBox, arm: &PlacedArm, best: &mut Clearance) {
        let half = part.half_in_base();
        for (obstacle, (centre, bounds)) in self.obstacles.iter().zip(&self.bounds).take(self.obstacle_count) {
            let near_enough = {
                let gap = squared_gap(&part.centre, &half, centre, bounds);
                // Once something overlaps, deeper overlaps still count.
                best.distance > 0.0 && gap < best.distance * best.distance || gap == 0.0
            };
            if !near_enough || self.may_touch(obstacle.id) {
                continue;
            }
            if let Some(near) = obstacle.near_box(part, best.distance) {
                keep(best, &near, arm.last_link, obstacle.id);
            }
        }
    }

    fn arm_to_itself(&self, arm: &PlacedArm, best: &mut Clearance) {
        for [a, b] in self.body.self_pairs() {
            let (first, second) = (&arm.capsules[a], &arm.capsules[b]);
            let reach = best.distance + first.radius + second.radius;
            let gap = squared_gap(&first.centre, &first.half, &second.centre, &second.half);
            if reach > 0.0 && gap < reach * reach {
                let near = capsule_to_capsule(&first.ends, first.radius, &second.ends, second.radius);
                if second.link >= first.link {
                    keep(best, &near.swapped(), second.link, 0);
                } else {
                    keep(best, &near, first.link, 0);
                }
            }
        }
    }

    /// The arm's nearest to one capsule of the person, as far as it is nearer than `limit`.
    fn near_person(&self, arm: &PlacedArm, capsule: usize, limit: f64) -> Separation {
        let person = &self.human[capsule.min(HUMAN_CAPSULES_MAX - 1)];
        let ends = person.ends.map(Vector3::from);
        let centre = (ends[0] + ends[1]) * 0.5;
        let half = (ends[1] - ends[0]).abs() * 0.5;
        let mut best = Clearance { distance: limit, ..nothing() };
        for own in arm.capsules[..arm.count].iter().rev().filter(|own| own.link != 0) {
            let reach = best.distance + own.radius + person.radius;
            let gap = squared_gap(&own.centre, &own.half, &centre, &half);
            if reach > 0.0 && gap < reach * reach {
                let near = capsule_to_capsule(&own.ends, own.radius, &ends, person.radius);
                keep(&mut best, &near, own.link, 0);
            }
        }
        if let Some(part) = &arm.part {
            let near = part.near_segment(&ends).padded(person.radius, 0.0).swapped();
            keep(&mut best, &near, arm.last_link, 0);
        }
        let from = Vector3::from(best.point_on_arm);
        let apart = Vector3::from(best.point_on_other) - from;
        // Overlapping, the points have changed sides.
        let apart = if best.distance < 0.0 { -apart } else { apart };
        let direction = apart.try_normalize(1e-9).or_else(|| (centre - from).try_normalize(1e-9));
        Separation {
            distance: best.distance,
            link: best.link,
            capsule,
            direction: direction.unwrap_or_else(Vector3::zeros).into(),
            human_velocity: person.velocity,
            point_on_arm: best.point_on_arm,
        }
    }
}

/// The part against the links it does not hang on.
fn part_to_arm(part: &OrientedBox, arm: &PlacedArm, best: &mut Clearance) {
    let half = part.half_in_base();
    for capsule in arm.capsules[..arm.count].iter().filter(|capsule| capsule.link < arm.last_link) {
        let reach = best.distance + capsule.radius;
        let gap = squared_gap(&part.centre, &half, &capsule.centre, &capsule.half);
        if reach > 0.0 && gap < reach * reach {
            let near = part.near_segment(&capsule.ends).padded(capsule.radius, 0.0).swapped();
            keep(best, &near, arm.last_link, 0);
        }
    }
}

/// Squared distance of two boxes along the base axes, given by centre and half extents.
#[inline]
pub(crate) fn squared_gap(a: &Vector3<f64>, a_half: &Vector3<f64>, b: &Vector3<f64>, b_half: &Vector3<f64>) -> f64 {
    let mut sum = 0.0;
    for axis in 0..3 {
        let gap = ((a[axis] - b[axis]).abs() - a_half[axis] - b_half[axis]).max(0.0);
        sum += gap * gap;
    }
    sum
}

#[inline]
fn keep(best: &mut Clearance, near: &Near, link: usize, object: u32) {
    // A kernel that came to no number counts as a contact.
    if near.distance < best.distance || near.distance.is_nan() {
        *best = Clearance {
            distance: if near.distance.is_nan() { f64::NEG_INFINITY } else { near.distance },
            link,
            object,
            point_on_arm: near.on_first.into(),
            point_on_other: near.on_second.into(),
        };
    }
}

fn nothing() -> Clearance {
    Clearance { distance: f64::INFINITY, link: 0, object: 0, point_on_arm: [0.0; 3], point_on_other: [0.0; 3] }
}

fn contact() -> Clearance {
    Clearance { distance: f64::NEG_INFINITY, ..nothing() }
}

fn lost() -> Separation {
    Separation { distance: f64::NEG_INFINITY, ..Separation::NOBODY }
}
