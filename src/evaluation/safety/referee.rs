//! Judges by the truth: who is how near, what was owed to them, and whether the arm stood.
//!
//! It shares with the controller the distance of capsules and nothing else: what
//! is owed is worked out here from the speeds people are granted and the time
//! the stop takes, which the trial checks against the stops that are made.

use nalgebra::Vector3;
use tandem_clearance::{Monitor, Separation};
use tandem_msg::Capsule;

use super::person::{NEAR, PARTS, SPEED, SPEED_NEAR};
use super::world::World;

/// Slower than this towards somebody is not towards them, m/s.
const TOWARDS: f64 = 0.005;

/// How far a person can come in a time, metres.
pub(super) fn reach(time: f64) -> f64 {
    let hurried = NEAR / SPEED_NEAR;
    SPEED_NEAR * time.min(hurried) + SPEED * (time - hurried).max(0.0)
}

/// What was seen in one cycle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    /// True distance of the nearest part, metres.
    pub(super) distance: f64,
    /// A part is touched by the moving arm.
    pub(super) contact: bool,
    /// It is touched by a link that moves towards it.
    pub(super) struck: bool,
    /// Least distance beyond what was owed to a part that the arm moved towards, metres.
    pub(super) spare: f64,
}

pub(super) struct Referee {
    monitor: Monitor,
    /// Distances of the body parts, metres.
    pub(super) distances: [f64; PARTS],
    /// The point of the arm that is nearest to the person.
    pub(super) target: Vector3<f64>,
}

impl Referee {
    pub(super) fn new(monitor: Monitor) -> Self {
        Self { monitor, distances: [f64::INFINITY; PARTS], target: Vector3::zeros() }
    }

    /// Looks at the world as it is.
    pub(super) fn look(&mut self, world: &World, truth: &[Capsule; PARTS]) -> Seen {
        self.monitor.set_human(truth);
        let poses = world.chain.forward(world.position());
        let moving = world.moving();
        let mut seen = Seen { distance: f64::INFINITY, contact: false, struck: false, spare: f64::INFINITY };
        let owed = reach(world.status().stopping_time);
        let all = self.monitor.separations(&poses);
        for (index, part) in all.iter().enumerate().take(PARTS) {
            self.distances[index] = part.distance;
            if part.distance < seen.distance {
                seen.distance = part.distance;
                self.target = part.point_on_arm.into();
            }
            if !moving || part.distance > owed + 0.6 {
                continue;
            }
            let approach = approach(world, &poses, part);
            seen.contact |= part.distance <= 0.0;
            seen.struck |= part.distance <= 0.0 && approach > TOWARDS;
            if approach > TOWARDS {
                // Half the speed over the time of the stop, as when it brakes evenly.
                seen.spare = seen.spare.min(part.distance - owed - 0.5 * approach * world.status().stopping_time);
            }
        }
        seen
    }
}

/// Speed of the arm towards a body part at their nearest points, m/s.
fn approach(world: &World, poses: &tandem_kinematics::LinkPoses, part: &Separation) -> f64 {
    let point = Vector3::from(part.point_on_arm);
    world.chain.point_velocity(poses, part.link, &point, world.velocity()).dot(&Vector3::from(part.direction))
}
