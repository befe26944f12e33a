//! How a person gets somewhere: round the bench on foot, and with both hands to a thing.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use tandem_msg::Stamp;

use super::Person;
use super::figure::{HAND_RADIUS, figure, hands_at_rest};
use super::script::{Deed, Hands};
use crate::plant::parts::{Parts, Place};

/// How fast a person gets going, m/s².
const WALK_ACCELERATION: f64 = 1.5;
/// How fast a hand gets going, m/s².
const HAND_ACCELERATION: f64 = 5.0;
/// From the stand, farther than this on the level is out of reach, metres.
const REACH_LEVEL: f64 = 0.88;
/// Between bench edge and someone standing at it, metres.
const BENCH_GAP: f64 = 0.2;

impl Person {
    /// A ground point from which `there` can be reached: the work stand, or beside the bench.
    pub(super) fn stand_for(&self, there: &Vector3<f64>) -> Vector3<f64> {
        let level = |a: &Vector3<f64>| (a - there).xy().norm();
        if level(&self.model.work) <= REACH_LEVEL {
            return self.model.work;
        }
        let [[x_min, x_max], [y_min, y_max]] = self.model.bench;
        let y = if there.y < (y_min + y_max) / 2.0 { y_min - BENCH_GAP } else { y_max + BENCH_GAP };
        Vector3::new(there.x.clamp(x_min, x_max), y, self.model.work.z)
    }

    /// Sets out for a ground point, round the bench's front corners where it stands in the way.
    pub(super) fn set_out(&mut self, to: Vector3<f64>) {
        let [[_, x_max], [y_min, y_max]] = self.model.bench;
        let from = self.stand.position;
        let beside = |p: &Vector3<f64>| p.x < x_max + BENCH_GAP / 2.0;
        let corner = |p: &Vector3<f64>| {
            let y = if p.y < (y_min + y_max) / 2.0 { y_min - BENCH_GAP } else { y_max + BENCH_GAP };
            Vector3::new(x_max + BENCH_GAP, y, p.z)
        };
        self.path.clear();
        let same_side = beside(&from) && beside(&to) && corner(&from) == corner(&to);
        if beside(&from) && !same_side {
            self.path.push_back(corner(&from));
        }
        if beside(&to) && !same_side {
            self.path.push_back(corner(&to));
        }
        self.path.push_back(to);
    }

    pub(super) fn point_of(&self, hands: Hands, parts: &Parts) -> Vector3<f64> {
        match hands {
            Hands::Part(part) => parts.base_from_part(part).translation.vector,
            Hands::Home(part) => {
                parts.model(part).map_or(self.model.focus, |model| model.base_from_place.translation.vector)
            }
            Hands::Point(point) => point,
            Hands::Rest | Hands::Chest => self.stand.position,
        }
    }

    pub(super) fn heading(&self) -> f64 {
        let ahead = self.model.focus - self.stand.position;
        ahead.y.atan2(ahead.x)
    }

    /// Goals of both hands in the frame of the stand.
    fn hand_goals(&self, parts: &Parts) -> [Vector3<f64>; 2] {
        let chest = [Vector3::new(0.35, 0.10, 1.10), Vector3::new(0.35, -0.10, 1.10)];
        let (pose, half) = match self.goal {
            Hands::Rest => return hands_at_rest(),
            Hands::Chest => return chest,
            Hands::Part(part) => {
                // A part in these very hands cannot be reached for.
                if parts.place(part) == Place::Person {
                    return chest;
                }
                (parts.base_from_part(part), parts.model(part).map_or([0.05; 3], |model| model.half_extents))
            }
            Hands::Home(part) => match parts.model(part) {
                Some(model) => (model.base_from_place, model.half_extents),
                None => return chest,
            },
            Hands::Point(point) => (Isometry3::translation(point.x, point.y, point.z), [0.0; 3]),
        };
        let centre = pose.translation.vector;
        let level = |v: Vector3<f64>| Vector3::new(v.x, v.y, 0.0).try_normalize(1e-6).unwrap_or_else(Vector3::x);
        let near = level(self.stand.position - centre);
        let aside = Vector3::z().cross(&near);
        let extent = |along: &Vector3<f64>| -> f64 {
            let own = pose.rotation.inverse() * along;
            own.x.abs() * half[0] + own.y.abs() * half[1] + own.z.abs() * half[2]
        };
        let touch = centre + near * (extent(&near) + HAND_RADIUS);
        let spread = extent(&aside).clamp(HAND_RADIUS, 0.12);
        // Facing the part, the left hand lies on the far side of `aside`.
        let back = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -self.heading());
        [-1.0, 1.0].map(|side| back * (touch + aside * (side * spread) - self.stand.position))
    }

    pub(super) fn hands_there(&self, parts: &Parts) -> bool {
        let goals = self.hand_goals(parts);
        self.hands.iter().zip(&goals).all(|(hand, goal)| (hand.position - goal).norm() < 0.01)
    }

    pub(super) fn move_body(&mut self, now: Stamp, dt: f64, parts: &Parts) {
        if let Some(&to) = self.path.front() {
            if self.stand.step(&to, self.model.walk_speed, WALK_ACCELERATION, dt) {
                self.path.pop_front();
            }
        } else {
            let here = self.stand.position;
            self.stand.step(&here, self.model.walk_speed, WALK_ACCELERATION, dt);
        }
        let goals = self.hand_goals(parts);
        let busy = matches!(self.deeds.front(), Some(Deed::Work(_)));
        let turn = now.as_secs_f64() * core::f64::consts::TAU;
        let stir = if busy { Vector3::new(0.0, 0.02 * turn.sin(), 0.02 * turn.cos()) } else { Vector3::zeros() };
        for (hand, goal) in self.hands.iter_mut().zip(&goals) {
            hand.step(&(goal + stir), self.model.hand_speed, HAND_ACCELERATION, dt);
        }
        let hands = [self.hands[0].position, self.hands[1].position];
        let body = figure(&self.stand.position, self.heading(), &hands);
        for ((velocity, before), after) in self.velocity.iter_mut().zip(&self.body).zip(&body) {
            // A capsule's ends differ in speed; the separation is owed to the faster.
            let ends = [0, 1].map(|end| (after.ends[end] - before.ends[end]) / dt);
            *velocity = if ends[0].norm_squared() > ends[1].norm_squared() { ends[0] } else { ends[1] };
        }
        self.body = body;
    }
}
