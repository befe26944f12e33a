//! Every link of the arm against every part of a person.

use nalgebra::Vector3;
use tandem_kinematics::{JOINTS_MAX, LinkPoses};
use tandem_msg::{Capsule, HUMAN_CAPSULES_MAX};

use crate::Monitor;
use crate::kernel::{Segments, Wanted};

/// The people in view, laid out for vector code.
#[derive(Clone, Debug)]
pub(crate) struct BodyParts {
    segments: Segments<HUMAN_CAPSULES_MAX>,
    radius: [f64; HUMAN_CAPSULES_MAX],
    velocity: [[f64; 3]; HUMAN_CAPSULES_MAX],
}

impl BodyParts {
    pub(crate) const NONE: Self =
        Self { segments: Segments::NONE, radius: [0.0; HUMAN_CAPSULES_MAX], velocity: [[0.0; 3]; HUMAN_CAPSULES_MAX] };

    /// Replaces them all; those past the last slot are left out.
    pub(crate) fn set(&mut self, capsules: &[Capsule]) {
        self.segments.clear();
        for (index, capsule) in capsules.iter().take(HUMAN_CAPSULES_MAX).enumerate() {
            self.segments.push(&capsule.ends.map(Vector3::from));
            self.radius[index] = capsule.radius;
            self.velocity[index] = capsule.velocity;
        }
    }

    pub(crate) fn velocity(&self, index: usize) -> [f64; 3] {
        self.velocity[index % HUMAN_CAPSULES_MAX]
    }
}

/// A link of the arm and a part of a person.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearness {
    /// Signed, metres: +∞ for a link without geometry, −∞ when it came to no number.
    pub distance: f64,
    /// Speed of the body part towards the link at their nearest points, m/s.
    pub closing: f64,
}

/// Row: link, from 1 on, less 1; the carried part counts as the last link. Column: index of the person's capsule.
pub type LinksToPeople = [[Nearness; HUMAN_CAPSULES_MAX]; JOINTS_MAX];

impl Monitor {
    /// Speed of a part of a person, by the index of its capsule, m/s.
    pub fn human_speed(&self, capsule: usize) -> f64 {
        Vector3::from(self.parts.velocity(capsule)).norm()
    }

    /// How near each link is to each of the [`Monitor::human_count`] parts of a person. A link with a hull counts as
    /// the capsule around it. `None` when a number was not finite.
    pub fn links_to_people(&self, poses: &LinkPoses) -> Option<LinksToPeople> {
        const NOWHERE: Nearness = Nearness { distance: f64::INFINITY, closing: f64::NEG_INFINITY };
        let mut arm = self.unplaced(poses);
        if !arm.place() || !self.people_are_sound() {
            return None;
        }
        let mut table = [[NOWHERE; HUMAN_CAPSULES_MAX]; JOINTS_MAX];
        for body in arm.bodies().iter().filter(|body| body.link != 0) {
            let row = &mut table[(body.link - 1).min(JOINTS_MAX - 1)];
            if body.is_part() {
                for (nearness, person) in row.iter_mut().zip(self.people().all()) {
                    let wanted = Wanted { limit: nearness.distance, enough: f64::NEG_INFINITY };
                    let Some(near) = arm.near(body, person, wanted) else { continue };
                    let velocity = self.parts.velocity(person.id as usize);
                    let sign = if near.distance < 0.0 { -1.0 } else { 1.0 };
                    let way = (near.on_second - near.on_first) * sign;
                    nearness.take(near.distance, closing(&way.into(), way.norm(), &velocity));
                }
                continue;
            }
            let (ways, lengths) = self.parts.segments.ways_from(&body.ends);
            for (index, nearness) in row.iter_mut().enumerate().take(self.human_count()) {
                let distance = lengths[index] - body.radius - self.parts.radius[index];
                let way = [ways[0][index], ways[1][index], ways[2][index]];
                nearness.take(distance, closing(&way, lengths[index], &self.parts.velocity[index]));
            }
        }
        Some(table)
    }
}

impl Nearness {
    /// Keeps the nearer; what is no number is nearest.
    #[inline]
    fn take(&mut self, distance: f64, closing: f64) {
        let distance = if distance.is_nan() { f64::NEG_INFINITY } else { distance };
        if distance < self.distance {
            *self = Self { distance, closing };
        }
    }
}

/// Speed of a body part towards the arm, from the way between the two, m/s.
#[inline]
fn closing(way: &[f64; 3], length: f64, velocity: &[f64; 3]) -> f64 {
    let dot = |a: &[f64; 3], b: &[f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    if length > 1e-9 {
        -dot(way, velocity) / length
    } else {
        // No direction: as if straight at it.
        dot(velocity, velocity).sqrt()
    }
}
