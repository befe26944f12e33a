//! The smallest distance from one cycle to the next.
//!
//! A pair that was `d` apart is still `d − w` apart once no point of its bodies has gone farther than `w`. So
//! each pair keeps the distance it was last found to have, and is looked at again only when what is left of that is
//! no longer above the present smallest one, beginning with the pair that was nearest. The answer is
//! that of [`Monitor::clearance`] to the last bit, whichever way the arm went.

use nalgebra::{UnitQuaternion, Vector3};
use tandem_kinematics::{JOINTS_MAX, LinkPoses};
use tandem_msg::SCENE_OBJECTS_MAX;

use crate::kernel::{Near, Wanted};
use crate::nearest::{keep, keep_own, part_to_arm};
use crate::placed::PlacedArm;
use crate::{Clearance, LINK_CAPSULES_MAX, Monitor, SELF_PAIRS_MAX};

/// Rounding that no bound may rest on, metres.
const ROUNDING: f64 = 1e-9;
/// How far past the smallest distance a pair is worth an exact answer, metres: the nearer it is known to be, the
/// sooner it must be looked at again.
const AHEAD: f64 = 0.02;
const BODIES: usize = LINK_CAPSULES_MAX + 1;

/// What the queries of [`Monitor::track`] leave for the next.
#[derive(Clone, Debug)]
pub(crate) struct Recent {
    known: bool,
    /// Body and object that were nearest.
    pair: (usize, usize),
    bodies: [Trail; BODIES],
    /// Of each body and object: the distance last found, plus how far the body had gone by then.
    objects: [[f64; SCENE_OBJECTS_MAX]; BODIES],
    /// The least of each row.
    rows: [f64; BODIES],
    /// Of the arm's own pairs, plus how far both had gone.
    own: [f64; SELF_PAIRS_MAX],
}

/// Where a body was, and how far any point of it has gone in all, at most.
#[derive(Clone, Copy, Debug)]
struct Trail {
    points: [Vector3<f64>; 2],
    rotation: UnitQuaternion<f64>,
    gone: f64,
}

impl Recent {
    /// Nothing is known.
    pub(crate) fn nothing() -> Self {
        let trail = Trail { points: [Vector3::zeros(); 2], rotation: UnitQuaternion::identity(), gone: 0.0 };
        Self {
            known: false,
            pair: (0, 0),
            bodies: [trail; BODIES],
            objects: [[f64::NEG_INFINITY; SCENE_OBJECTS_MAX]; BODIES],
            rows: [f64::NEG_INFINITY; BODIES],
            own: [f64::NEG_INFINITY; SELF_PAIRS_MAX],
        }
    }

    /// Forgets all, as scene, part or permissions have changed.
    pub(crate) fn forget(&mut self) {
        self.known = false;
    }

    /// Moves every body to where the arm is now.
    fn follow(&mut self, arm: &PlacedArm, poses: &LinkPoses) {
        if !self.known {
            *self = Self { known: true, ..Self::nothing() };
        }
        for (trail, body) in self.bodies.iter_mut().zip(arm.bodies()) {
            let (points, around) = body.extent();
            let pose =
                if body.is_part() { &poses.base_from_tcp } else { &poses.base_from_link[body.link.min(JOINTS_MAX)] };
            let went = (points[0] - trail.points[0]).norm().max((points[1] - trail.points[1]).norm());
            // A turn by the angle a moves what is a metre off by 2 sin(a/2).
            let turned =
                if around > 0.0 { 2.0 * (pose.rotation * trail.rotation.inverse()).imag().norm() } else { 0.0 };
            trail.gone += went + around * turned;
            (trail.points, trail.rotation) = (points, pose.rotation);
        }
    }
}

impl Monitor {
    /// [`Monitor::clearance`] for an arm that has moved little since the last call, which is quicker.
    /// Takes any positions; a change of scene, part or permissions merely makes the next call slower.
    pub fn track(&mut self, poses: &LinkPoses) -> Clearance {
        let sound = self.is_sound();
        let Self { body: arm_body, part, shapes, scene, touch, recent, .. } = self;
        let mut arm = PlacedArm::new(arm_body, part.as_ref(), poses, shapes.as_deref());
        if !arm.place() || !sound {
            recent.forget();
            return Clearance::CONTACT;
        }
        recent.follow(&arm, poses);
        let bodies = arm.bodies();
        let mut best = Clearance::NOTHING;
        let mut nearest = (0, 0);
        // The distance of a pair, or what it is known to be above.
        let mut look = |body: usize, object: usize, best: &mut Clearance| {
            let (moving, obstacle) = (&bodies[body], &scene.all()[object]);
            if moving.tool && touch.contains(&obstacle.id) {
                return f64::INFINITY;
            }
            let gap = scene.squared_gap(object, &moving.centre, &moving.half);
            let apart = gap.sqrt() - moving.radius - scene.around(object);
            // Where boxes overlap there is no telling how deep.
            let wanted = Wanted { limit: best.distance + AHEAD, enough: f64::NEG_INFINITY };
            if gap > 0.0 && apart > wanted.limit {
                return apart;
            }
            let Some(near) = arm.near(moving, obstacle, wanted) else { return wanted.limit };
            let before = best.distance;
            keep(best, &near, moving.link, obstacle.id);
            if best.distance < before {
                nearest = (body, object);
            }
            bound_of(&near)
        };
        let (body, object) = recent.pair;
        if body < bodies.len() && bodies[body].link != 0 && object < scene.all().len() {
            look(body, object, &mut best);
        }
        for index in (0..bodies.len()).rev().filter(|index| bodies[*index].link != 0) {
            let gone = recent.bodies[index].gone;
            if recent.rows[index] - gone - ROUNDING > best.distance {
                continue;
            }
            let mut row = f64::INFINITY;
            for (object, bound) in recent.objects[index].iter_mut().take(scene.all().len()).enumerate() {
                if *bound - gone - ROUNDING <= best.distance {
                    *bound = look(index, object, &mut best) + gone;
                }
                row = if *bound < row { *bound } else { row };
            }
            recent.rows[index] = row;
        }
        recent.pair = nearest;
        for ([a, b], bound) in arm_body.self_pairs().zip(&mut recent.own) {
            let gone = recent.bodies[a].gone + recent.bodies[b].gone;
            if *bound - gone - ROUNDING > best.distance {
                continue;
            }
            let (first, second) = (&bodies[a], &bodies[b]);
            let wanted = Wanted { limit: best.distance + AHEAD, enough: f64::NEG_INFINITY };
            let found = arm.near_each_other(first, second, wanted);
            *bound = found.as_ref().map_or(wanted.limit, bound_of) + gone;
            if let Some(near) = found {
                keep_own(&mut best, &near, first, second);
            }
        }
        part_to_arm(&arm, f64::NEG_INFINITY, &mut best);
        best
    }
}

/// A kernel that came to no number binds nothing.
fn bound_of(near: &Near) -> f64 {
    if near.distance.is_nan() { f64::NEG_INFINITY } else { near.distance }
}
