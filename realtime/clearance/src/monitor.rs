//! The queries: one arm, one scene, one carried part, the people in view.

#[allow(clippy::disallowed_types, reason = "shapes are shared out while starting")]
use std::sync::Arc;

use nalgebra::Vector3;
use tandem_kinematics::LinkPoses;
use tandem_msg::{AttachedPart, Capsule, HUMAN_CAPSULES_MAX, SCENE_OBJECTS_MAX, SceneObject};

use crate::nearest::{against, against_itself, check, check_own, may_be_nearer};
use crate::obstacle::{CarriedPart, FAR, Obstacle, SceneFault};
use crate::people::BodyParts;
use crate::placed::PlacedArm;
use crate::shapes::Shapes;
use crate::targets::Targets;
use crate::track::Recent;
use crate::{ArmBody, BodyError, Clearance, Separation};

/// Objects a task may allow the tool to touch.
const TOUCH_MAX: usize = 8;

/// Distances of one arm to one scene and to people.
///
/// # Realtime
/// Every method but [`Monitor::with_shapes`] is bounded by the array sizes; none allocates, blocks or panics.
#[derive(Clone, Debug)]
pub struct Monitor {
    pub(crate) body: ArmBody,
    #[allow(clippy::disallowed_types, reason = "cloned while starting, and freed at the end")]
    pub(crate) shapes: Option<Arc<Shapes>>,
    pub(crate) scene: Targets<SCENE_OBJECTS_MAX>,
    scene_valid: bool,
    people: Targets<HUMAN_CAPSULES_MAX>,
    pub(crate) parts: BodyParts,
    people_valid: bool,
    pub(crate) part: Option<CarriedPart>,
    part_valid: bool,
    pub(crate) touch: [u32; TOUCH_MAX],
    pub(crate) recent: Recent,
}

impl Monitor {
    /// A monitor of an arm in an empty scene, nobody in view, nothing carried. It knows no shapes, so the
    /// arm is its capsules.
    pub fn new(body: ArmBody) -> Self {
        Self {
            body,
            shapes: None,
            scene: Targets::NONE,
            scene_valid: true,
            people: Targets::NONE,
            parts: BodyParts::NONE,
            people_valid: true,
            part: None,
            part_valid: true,
            touch: [0; TOUCH_MAX],
            recent: Recent::nothing(),
        }
    }

    /// The same with the shapes that scenes, parts and the arm's links may refer to.
    ///
    /// # Errors
    /// A hull that stands for a capsule of the arm is not registered, or reaches out of that capsule.
    #[allow(clippy::disallowed_types, reason = "made while starting")]
    pub fn with_shapes(body: ArmBody, shapes: Arc<Shapes>) -> Result<Self, BodyError> {
        body.check_hulls(&shapes)?;
        Ok(Self { shapes: Some(shapes), ..Self::new(body) })
    }

    /// The arm.
    pub fn body(&self) -> &ArmBody {
        &self.body
    }

    /// Corners of the hull that stands for a capsule of the arm, in the frame of its link, metres, some of
    /// them more than once; none where no hull does.
    pub fn hull_points(&self, capsule: usize) -> impl Iterator<Item = [f64; 3]> + '_ {
        let number = self.body.hulls().get(capsule).copied().unwrap_or(0);
        let hull = self.shapes.as_deref().and_then(|shapes| shapes.hull(number));
        hull.into_iter().flat_map(|hull| hull.points()).map(Into::into)
    }

    /// Replaces the scene.
    ///
    /// # Errors
    /// The first fault found. The scene is then invalid: clearance is −∞ until one is accepted.
    pub fn set_scene(&mut self, objects: &[SceneObject]) -> Result<(), SceneFault> {
        self.recent.forget();
        self.scene_valid = false;
        self.scene.clear();
        if objects.len() > SCENE_OBJECTS_MAX {
            return Err(SceneFault::TooMany { count: objects.len() });
        }
        for (index, object) in objects.iter().enumerate() {
            if objects[..index].iter().any(|other| other.id == object.id) {
                return Err(SceneFault::Identity { index, id: object.id });
            }
            self.scene.push(Obstacle::of(index, object, self.shapes.as_deref())?);
        }
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
        self.people_valid = capsules.len() <= HUMAN_CAPSULES_MAX && capsules.iter().all(fits);
        self.people.clear();
        if self.people_valid {
            for (index, capsule) in capsules.iter().enumerate() {
                self.people.push(Obstacle::of_person(index as u32, capsule));
            }
            self.parts.set(capsules);
        }
    }

    /// Replaces the carried part; `None`, or one with `present == 0`, is nothing. A part whose numbers
    /// cannot be makes every distance −∞ until a good one is given.
    pub fn set_attached(&mut self, part: Option<&AttachedPart>) {
        self.recent.forget();
        let part = part.filter(|part| part.present != 0);
        self.part = part.and_then(|part| CarriedPart::of(part, self.shapes.as_deref()));
        self.part_valid = part.is_none() || self.part.is_some();
    }

    /// Replaces the objects that tool and carried part may touch; 0 is no object. Those past the eighth
    /// are not allowed.
    pub fn set_touch(&mut self, ids: &[u32]) {
        self.recent.forget();
        self.touch = [0; TOUCH_MAX];
        let allowed = ids.iter().filter(|id| **id != 0);
        for (slot, id) in self.touch.iter_mut().zip(allowed) {
            *slot = *id;
        }
    }

    /// The smallest distance to the scene and to the arm itself. The base (link 0) is checked against
    /// the other links only. Of pairs equally near that of the lowest link and object is named.
    pub fn clearance(&self, poses: &LinkPoses) -> Clearance {
        let mut arm = self.unplaced(poses);
        if !arm.place() || !self.is_sound() {
            return Clearance::CONTACT;
        }
        self.nearest(&arm, f64::INFINITY, f64::NEG_INFINITY)
    }

    /// The smallest distance to the scene alone: what the arm's shape always keeps it from itself hides nothing.
    pub fn scene_clearance(&self, poses: &LinkPoses) -> Clearance {
        let mut arm = self.unplaced(poses);
        if !arm.place() || !self.is_sound() {
            return Clearance::CONTACT;
        }
        let mut best = Clearance::NOTHING;
        against(&arm, &self.scene, &self.touch, f64::NEG_INFINITY, &mut best);
        best
    }

    /// [`Monitor::clearance`] and [`Monitor::separation`] at once, which is quicker than one after the other.
    pub fn measure(&self, poses: &LinkPoses) -> (Clearance, Separation) {
        let mut arm = self.unplaced(poses);
        if !arm.place() || !self.part_valid {
            return (Clearance::CONTACT, Separation::LOST);
        }
        let clearance =
            if self.scene_valid { self.nearest(&arm, f64::INFINITY, f64::NEG_INFINITY) } else { Clearance::CONTACT };
        (clearance, if self.people_valid { self.nearest_person(&arm) } else { Separation::LOST })
    }

    /// Whether scene and arm itself are more than `margin` metres away. People are not looked at.
    /// Quicker than [`Monitor::clearance`], as it stops at the first pair that is too near.
    pub fn is_clear(&self, poses: &LinkPoses, margin: f64) -> bool {
        let mut arm = self.unplaced(poses);
        arm.place()
            && self.is_sound()
            && margin.is_finite()
            && self.nearest(&arm, margin.next_up(), margin).distance > margin
    }

    /// The smallest distance to a person.
    pub fn separation(&self, poses: &LinkPoses) -> Separation {
        let mut arm = self.unplaced(poses);
        if !arm.place() || !self.part_valid || !self.people_valid {
            return Separation::LOST;
        }
        self.nearest_person(&arm)
    }

    /// The smallest distance to each capsule of the person, in their order, for a separation by body
    /// part: the first [`Monitor::human_count`] entries. When a number was not finite, all are −∞.
    pub fn separations(&self, poses: &LinkPoses) -> [Separation; HUMAN_CAPSULES_MAX] {
        let mut arm = self.unplaced(poses);
        if !arm.place() || !self.part_valid || !self.people_valid {
            return [Separation::LOST; HUMAN_CAPSULES_MAX];
        }
        let mut all = [Separation::NOBODY; HUMAN_CAPSULES_MAX];
        for (index, (person, slot)) in self.people.all().iter().zip(&mut all).enumerate() {
            let mut best = Clearance::NOTHING;
            for body in arm.bodies().iter().rev().filter(|body| body.link != 0) {
                let gap = self.people.squared_gap(index, &body.centre, &body.half);
                if may_be_nearer(gap, best.distance + body.radius + self.people.around(index)) {
                    check(&arm, body, person, f64::NEG_INFINITY, &mut best);
                }
            }
            *slot = self.separation_of(&best);
        }
        all
    }

    /// Capsules of the people in view.
    pub fn human_count(&self) -> usize {
        self.people.all().len()
    }

    /// Whether scene and part are such that anything can be said at all.
    pub(crate) fn is_sound(&self) -> bool {
        self.scene_valid && self.part_valid
    }

    /// Whether people and part are such that a distance between them can be said.
    pub(crate) fn people_are_sound(&self) -> bool {
        self.part_valid && self.people_valid
    }

    pub(crate) fn people(&self) -> &Targets<HUMAN_CAPSULES_MAX> {
        &self.people
    }

    /// The scene.
    pub(crate) fn scene(&self) -> &Targets<SCENE_OBJECTS_MAX> {
        &self.scene
    }

    pub(crate) fn has_part(&self) -> bool {
        self.part.is_some()
    }

    /// The arm at these poses, its capsules not placed yet.
    pub(crate) fn unplaced<'a>(&'a self, poses: &'a LinkPoses) -> PlacedArm<'a> {
        PlacedArm::new(&self.body, self.part.as_ref(), poses, self.shapes.as_deref())
    }

    pub(crate) fn may_touch(&self, id: u32) -> bool {
        self.touch.contains(&id)
    }

    /// The nearest of all pairs that are nearer than `limit`; stops early once below `enough`.
    fn nearest(&self, arm: &PlacedArm, limit: f64, enough: f64) -> Clearance {
        let mut best = Clearance { distance: limit, ..Clearance::NOTHING };
        against(arm, &self.scene, &self.touch, enough, &mut best);
        if best.distance > enough {
            against_itself(arm, &self.body, enough, &mut best);
        }
        best
    }

    /// Distance of two links, whether the pair is to be checked or not: +∞ when one has no shape, −∞ when a
    /// number was not finite.
    pub fn link_distance(&self, poses: &LinkPoses, links: [usize; 2]) -> f64 {
        let mut arm = self.unplaced(poses);
        if !arm.place() {
            return f64::NEG_INFINITY;
        }
        let mut best = Clearance::NOTHING;
        let of = |link: usize| arm.bodies().iter().filter(move |body| body.link == link && !body.is_part());
        for first in of(links[0]) {
            for second in of(links[1]) {
                check_own(&arm, first, second, f64::NEG_INFINITY, &mut best);
            }
        }
        best.distance
    }

    fn nearest_person(&self, arm: &PlacedArm) -> Separation {
        let mut best = Clearance::NOTHING;
        against(arm, &self.people, &[], f64::NEG_INFINITY, &mut best);
        self.separation_of(&best)
    }

    fn separation_of(&self, best: &Clearance) -> Separation {
        if best.distance == f64::INFINITY {
            return Separation::NOBODY;
        }
        let capsule = (best.object as usize).min(HUMAN_CAPSULES_MAX - 1);
        let from = Vector3::from(best.point_on_arm);
        let apart = Vector3::from(best.point_on_other) - from;
        // Overlapping, the points have changed sides.
        let apart = if best.distance < 0.0 { -apart } else { apart };
        let centre = self.people.all().get(capsule).map_or(from, Obstacle::centre);
        let direction = apart.try_normalize(1e-9).or_else(|| (centre - from).try_normalize(1e-9));
        Separation {
            distance: best.distance,
            link: best.link,
            capsule,
            direction: direction.unwrap_or_else(Vector3::zeros).into(),
            human_velocity: self.parts.velocity(capsule),
            point_on_arm: best.point_on_arm,
        }
    }
}

impl From<ArmBody> for Monitor {
    /// See [`Monitor::new`].
    fn from(body: ArmBody) -> Self {
        Self::new(body)
    }
}
