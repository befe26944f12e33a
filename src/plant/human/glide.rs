//! A point that goes where it is told with bounded speed and acceleration.

use nalgebra::Vector3;

/// Nearer than this and slow, a point has arrived, metres.
const ARRIVED: f64 = 2e-3;
/// Share of the acceleration that slowing down plans with; the rest keeps it on its path.
const BRAKING_SHARE: f64 = 0.5;

/// Position, m, and velocity, m/s, of a point under way.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Glide {
    pub(super) position: Vector3<f64>,
    pub(super) velocity: Vector3<f64>,
}

impl Glide {
    /// A point at rest.
    pub(super) fn at(position: Vector3<f64>) -> Self {
        Self { position, velocity: Vector3::zeros() }
    }

    /// Moves towards `goal` for `dt` seconds, no faster than `speed` m/s, changing
    /// velocity by no more than `acceleration` m/s². Tells whether it stands there.
    pub(super) fn step(&mut self, goal: &Vector3<f64>, speed: f64, acceleration: f64, dt: f64) -> bool {
        let way = goal - self.position;
        let distance = way.norm();
        if distance < ARRIVED && self.velocity.norm() <= 2.0 * (acceleration * ARRIVED).sqrt() {
            // The last millimetres are taken at a steady pace that cannot overshoot.
            let change = (way / dt).cap_magnitude(0.1) - self.velocity;
            self.velocity += change.cap_magnitude(acceleration * dt);
            if distance < 1e-6 && self.velocity.norm() < 1e-3 {
                self.velocity = Vector3::zeros();
                self.position = *goal;
                return true;
            }
        } else {
            let wanted = speed.min((2.0 * BRAKING_SHARE * acceleration * distance).sqrt());
            let ahead = way.try_normalize(1e-12).unwrap_or_else(Vector3::zeros);
            let change = ahead * wanted - self.velocity;
            self.velocity += change.cap_magnitude(acceleration * dt);
        }
        self.position += self.velocity * dt;
        distance < ARRIVED
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// From rest or in full swing it arrives, keeps its limits all the way, and stays.
    #[test]
    fn it_arrives_within_its_limits() {
        for start in [Vector3::zeros(), Vector3::new(0.0, 1.2, 0.0)] {
            let (goal, dt) = (Vector3::new(0.8, -0.3, 0.2), 1e-3);
            let mut point = Glide { position: Vector3::zeros(), velocity: start };
            let mut arrived_at = None;
            for cycle in 0..5_000 {
                let before = point.velocity;
                let there = point.step(&goal, 1.4, 3.0, dt);
                assert!(point.velocity.norm() <= 1.4 + 1e-9, "cycle {cycle}: {point:?}");
                assert!((point.velocity - before).norm() <= 3.0 * dt + 2e-3, "cycle {cycle}: {point:?}");
                if there && arrived_at.is_none() {
                    arrived_at = Some(cycle);
                }
            }
            assert!(arrived_at.is_some_and(|cycle| cycle < 2_500), "{arrived_at:?}");
            assert!((point.position - goal).norm() < 1e-5 && point.velocity.norm() < 1e-2, "{point:?}");
        }
    }
}
