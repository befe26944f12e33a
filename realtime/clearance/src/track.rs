//! The smallest distance from one cycle to the next.
//!
//! What was nearest mostly still is, so that pair is looked at first. And what was far off is not near
//! yet: the distance of a capsule to the whole scene shrinks by no more than the longer of the ways its ends went, so
//! as long as that bound is above the nearest pair's distance nothing of the scene is looked at for it. The
//! answer is that of [`Monitor::clearance`] to the last bit, whichever way the arm went.

use nalgebra::Vector3;
use tandem_kinematics::LinkPoses;

use crate::monitor::{check, contact, nothing};
use crate::{Clearance, LINK_CAPSULES_MAX, Monitor};

/// Rounding that a bound may not rest on, metres.
const ROUNDING: f64 = 1e-9;

/// What the last query of [`Monitor::track`] left behind.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Recent {
    /// Indices of the body and of the object that were nearest in the scene.
    pair: Option<(usize, usize)>,
    floors: [Floor; LINK_CAPSULES_MAX],
}

/// A capsule was no nearer than this to anything when its ends were there.
#[derive(Clone, Copy, Debug)]
struct Floor {
    ends: [Vector3<f64>; 2],
    distance: f64,
}

impl Recent {
    /// Nothing is known.
    pub(crate) const NOTHING: Self = Self {
        pair: None,
        floors: [Floor { ends: [Vector3::new(0.0, 0.0, 0.0); 2], distance: f64::NEG_INFINITY }; LINK_CAPSULES_MAX],
    };
}

impl Monitor {
    /// [`Monitor::clearance`] for an arm that has moved little since the last call, which is quicker.
    /// Takes any positions; a change of scene, part or permissions merely makes the next call slower.
    pub fn track(&mut self, poses: &LinkPoses) -> Clearance {
        let mut recent = core::mem::replace(&mut self.recent, Recent::NOTHING);
        let mut arm = self.unplaced(poses);
        if !arm.place() || !self.is_sound() {
            return contact();
        }
        let (bodies, scene, enough) = (arm.bodies(), self.scene(), f64::NEG_INFINITY);
        let may_touch = |body: usize, object: usize| bodies[body].tool && self.may_touch(scene.all()[object].id);
        let mut best = nothing();
        let mut nearest = None;
        if let Some((body, object)) = recent.pair
            && body < bodies.len()
        {
            check(&arm, &bodies[body], &scene.all()[object], enough, &mut best);
            nearest = recent.pair;
        }
        for (index, body) in bodies.iter().enumerate().rev().filter(|(_, body)| body.link != 0) {
            // The part has no floor: it turns with the tool, so its ends would not bound its way.
            if let Some(floor) = recent.floors.get(index).filter(|_| !body.is_part()) {
                let went = (body.ends[0] - floor.ends[0]).norm().max((body.ends[1] - floor.ends[1]).norm());
                if floor.distance - went - ROUNDING > best.distance {
                    continue;
                }
            }
            let gaps = scene.squared_gaps(&body.centre, &body.half);
            let mut floor = f64::INFINITY;
            for (object, (gap, obstacle)) in gaps.iter().zip(scene.all()).enumerate() {
                if may_touch(index, object) {
                    continue;
                }
                // Where boxes overlap there is no telling how deep.
                let apart = if *gap > 0.0 { gap.sqrt() } else { f64::NEG_INFINITY };
                let bound = apart - body.radius - scene.around(object);
                floor = floor.min(bound);
                if bound - ROUNDING <= best.distance && recent.pair != Some((index, object)) {
                    let before = best.distance;
                    check(&arm, body, obstacle, enough, &mut best);
                    if best.distance < before {
                        nearest = Some((index, object));
                    }
                }
            }
            if let Some(slot) = recent.floors.get_mut(index) {
                *slot = Floor { ends: body.ends, distance: floor };
            }
        }
        self.arm_to_itself(&arm, enough, &mut best);
        recent.pair = nearest;
        self.recent = recent;
        best
    }
}
