//! A person who does everything a cell must survive: comes from any side, turns on the spot, lunges.
//!
//! No part of the body ever goes faster than [`SPEED`], or within [`NEAR`] of the
//! arm faster than [`SPEED_NEAR`]; that is all that is granted to the monitor.

use nalgebra::Vector3;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use tandem_msg::{BodyPart, Capsule, Code, HumanState};

/// Largest speed of any part, m/s.
pub(super) const SPEED: f64 = 1.6;
/// Largest speed of a part near the arm, m/s.
pub(super) const SPEED_NEAR: f64 = 2.0;
/// Distance that is near, metres.
pub(super) const NEAR: f64 = 0.5;

/// Capsules of the body.
pub(super) const PARTS: usize = 10;
const BODY: [BodyPart; PARTS] = [
    BodyPart::Torso,
    BodyPart::Head,
    BodyPart::Leg,
    BodyPart::Leg,
    BodyPart::UpperArm,
    BodyPart::Forearm,
    BodyPart::Hand,
    BodyPart::UpperArm,
    BodyPart::Forearm,
    BodyPart::Hand,
];
const RADIUS: [f64; PARTS] = [0.16, 0.12, 0.09, 0.09, 0.06, 0.05, 0.045, 0.06, 0.05, 0.045];
/// Longest way of a hand from its shoulder, metres.
const ARM: f64 = 0.68;
/// Shoulders of a person at the origin, metres.
const SHOULDERS: [Vector3<f64>; 2] = [Vector3::new(0.0, 0.19, 1.42), Vector3::new(0.0, -0.19, 1.42)];

/// What the person is up to.
#[derive(Clone, Copy)]
enum Mood {
    /// Walks at the arm.
    Approach,
    /// Walks past it.
    Pass(f64),
    /// Stands.
    Pause,
    /// Walks off.
    Retreat,
    /// Throws a hand at it.
    Lunge,
}

/// The person as they are.
pub(super) struct Person {
    random: ChaCha8Rng,
    ground: Vector3<f64>,
    hands: [Vector3<f64>; 2],
    walk: Vector3<f64>,
    reach: Vector3<f64>,
    mood: Mood,
    pace: f64,
    left: u32,
    /// True body, and the velocity of each part.
    pub(super) capsules: [Capsule; PARTS],
    erratic: bool,
}

impl Person {
    /// A person at a ground point, who does whatever comes into their head, or keeps walking past when not `erratic`.
    pub(super) fn new(random: ChaCha8Rng, ground: Vector3<f64>, erratic: bool) -> Self {
        let mut person = Self {
            random,
            ground,
            hands: [Vector3::new(0.0, 0.25, 1.0), Vector3::new(0.0, -0.25, 1.0)],
            walk: Vector3::zeros(),
            reach: Vector3::zeros(),
            mood: Mood::Approach,
            pace: SPEED,
            left: 0,
            capsules: [Capsule::default(); PARTS],
            erratic,
        };
        person.pace = person.between(0.3, SPEED);
        person.left = person.between(200.0, 1_000.0) as u32;
        person.pose(None);
        person
    }

    fn between(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * self.random.random::<f64>()
    }

    /// Walks this way from now on, and nothing else.
    pub(super) fn walk_on(&mut self, velocity: Vector3<f64>) {
        self.walk = velocity;
    }

    /// Lives `dt` seconds. `target` is the point of the arm that is nearest, `distances` those of the body parts.
    pub(super) fn live(&mut self, dt: f64, target: &Vector3<f64>, distances: &[f64; PARTS]) {
        if self.erratic {
            self.decide(target, distances);
        }
        let before = self.capsules;
        self.ground += self.walk * dt;
        for hand in &mut self.hands {
            *hand += self.reach * dt;
        }
        self.pose(Some((&before, dt)));
    }

    fn decide(&mut self, target: &Vector3<f64>, distances: &[f64; PARTS]) {
        if self.left == 0 {
            let turn = self.between(-1.0, 1.0);
            self.mood = match self.between(0.0, 10.0) as u32 {
                0..=3 => Mood::Approach,
                4 => Mood::Pass(turn.signum()),
                5 => Mood::Pause,
                6 => Mood::Retreat,
                _ => Mood::Lunge,
            };
            self.pace = if self.between(0.0, 1.0) < 0.5 { SPEED } else { self.between(0.1, SPEED) };
            self.left = self.between(40.0, 500.0) as u32;
        }
        self.left -= 1;
        let towards = Vector3::new(target.x - self.ground.x, target.y - self.ground.y, 0.0);
        let towards = towards.try_normalize(1e-6).unwrap_or_else(Vector3::x);
        let nearest = distances.iter().fold(f64::INFINITY, |least, d| least.min(*d));
        // Nobody walks into an arm they already touch.
        let pace = if nearest < 0.01 { 0.0 } else { self.pace };
        self.walk = match self.mood {
            Mood::Approach | Mood::Lunge => towards * pace,
            Mood::Pass(side) => (towards * 0.6 + Vector3::new(-towards.y, towards.x, 0.0) * side * 0.8) * pace,
            Mood::Pause => Vector3::zeros(),
            Mood::Retreat => -towards * self.pace,
        };
        // What the slowest part allows; hands take what is left of it.
        let all = if distances.iter().all(|d| *d <= NEAR) { SPEED_NEAR } else { SPEED };
        let hand = distances[4..].iter().fold(0.0_f64, |most, d| most.max(*d));
        let limit = if hand <= NEAR { SPEED_NEAR } else { all };
        self.reach = Vector3::zeros();
        if matches!(self.mood, Mood::Lunge) && nearest > 0.01 {
            let hands = (self.hands[0] + self.hands[1]) * 0.5 + self.ground;
            let wanted = (target - hands).try_normalize(1e-6).unwrap_or_else(Vector3::x) * limit;
            let reach = wanted - self.walk;
            let mut arms = self.hands.iter().zip(&SHOULDERS);
            let reached = arms.any(|(hand, shoulder)| (hand + reach * 0.002 - shoulder).norm() > ARM);
            if !reached {
                self.reach = reach;
            }
        }
    }

    /// Puts the capsules where the body is; with what was before and a time, their velocities.
    fn pose(&mut self, before: Option<(&[Capsule; PARTS], f64)>) {
        let at = |x: f64, y: f64, z: f64| self.ground + Vector3::new(x, y, z);
        let mut ends = [[Vector3::zeros(); 2]; PARTS];
        ends[0] = [at(0.0, 0.0, 0.97), at(0.0, 0.0, 1.36)];
        ends[1] = [at(0.0, 0.0, 1.60), at(0.0, 0.0, 1.69)];
        ends[2] = [at(0.0, 0.11, 0.10), at(0.0, 0.10, 0.88)];
        ends[3] = [at(0.0, -0.11, 0.10), at(0.0, -0.10, 0.88)];
        for (side, (hand, shoulder)) in self.hands.iter().zip(&SHOULDERS).enumerate() {
            // A hand that crosses over stays at its own shoulder.
            let shoulder = self.ground + shoulder;
            let fingers = self.ground + hand;
            let first = 4 + 3 * side;
            let along = |share: f64| shoulder + (fingers - shoulder) * share;
            ends[first] = [shoulder, along(0.45)];
            ends[first + 1] = [along(0.45), along(0.82)];
            ends[first + 2] = [along(0.82), fingers];
        }
        for (index, ends) in ends.into_iter().enumerate() {
            let mut velocity = Vector3::zeros();
            if let Some((before, dt)) = before {
                let speeds = [0, 1].map(|end| (ends[end] - Vector3::from(before[index].ends[end])) / dt);
                velocity = if speeds[0].norm() > speeds[1].norm() { speeds[0] } else { speeds[1] };
            }
            self.capsules[index] =
                Capsule { ends: ends.map(Into::into), radius: RADIUS[index], velocity: velocity.into() };
        }
    }

    /// The body as a tracker without error would tell it.
    pub(super) fn tell(&self, seen: &mut HumanState) {
        seen.capsule_count = PARTS as u32;
        seen.stand = self.ground.into();
        for (index, part) in BODY.into_iter().enumerate() {
            seen.body[index] = Code::of(part);
            seen.capsules[index] = self.capsules[index];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    /// Whatever comes into their head, for minutes: no part is ever faster than what is granted to the monitor, not even
    /// for one cycle, so a separation undercut is the arm's doing. Hands that cross over are the hard case.
    #[test]
    fn nobody_is_faster_than_granted() {
        const DT: f64 = 1e-3;
        let target = Vector3::new(0.4, 0.3, 0.6);
        let mut crossed = 0;
        for seed in 0..8 {
            let mut person = Person::new(ChaCha8Rng::seed_from_u64(seed), Vector3::new(1.5, 0.0, -0.9), true);
            let mut distances = [1.0; PARTS];
            for cycle in 0..30_000 {
                person.live(DT, &target, &distances);
                for (part, (capsule, distance)) in person.capsules.iter().zip(&mut distances).enumerate() {
                    let granted = if *distance <= NEAR { SPEED_NEAR } else { SPEED };
                    let speed = Vector3::from(capsule.velocity).norm();
                    assert!(speed <= granted + 1e-6, "seed {seed}, cycle {cycle}, part {part}: {speed} m/s");
                    let nearest = capsule.ends.map(|end| (Vector3::from(end) - target).norm());
                    *distance = nearest[0].min(nearest[1]) - capsule.radius;
                }
                crossed += u32::from(person.hands[0].y < 0.0 || person.hands[1].y > 0.0);
            }
        }
        assert!(crossed > 0, "nobody's hand ever crossed over");
    }
}
