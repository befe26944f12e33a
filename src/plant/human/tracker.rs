//! The body tracker: the person as the cell's sensors see them, with the error such sensors have.

use core::time::Duration;

use nalgebra::Vector3;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use tandem_msg::{Capsule, HumanState, Stamp};

use super::figure::{BODY, CAPSULES, Limb};

/// Time between two frames of the tracker's error.
const FRAME: Duration = Duration::from_millis(10);
/// How long an error of the tracker lasts, seconds: neighbouring frames err alike.
const ERROR_LASTS: f64 = 0.2;
/// Errors are cut at this many standard deviations.
const CUT: f64 = 3.0;

/// Tracks the body: each capsule is seen shifted by an error that wanders slowly.
pub(in crate::plant) struct Tracker {
    sigma: f64,
    random: ChaCha8Rng,
    error: [Vector3<f64>; CAPSULES],
    next_frame: Stamp,
}

impl Tracker {
    /// A tracker whose errors have the standard deviation `sigma` along each axis, metres.
    pub(in crate::plant) fn new(sigma: f64, random: ChaCha8Rng) -> Self {
        Self { sigma, random, error: [Vector3::zeros(); CAPSULES], next_frame: Stamp(0) }
    }

    /// Writes what is seen of a body at `now`.
    pub(in crate::plant) fn track(
        &mut self,
        now: Stamp,
        body: &[Limb; CAPSULES],
        velocity: &[Vector3<f64>; CAPSULES],
        stand: &Vector3<f64>,
        seen: &mut HumanState,
    ) {
        if now >= self.next_frame {
            self.next_frame = now.after(FRAME);
            self.wander();
        }
        seen.capsule_count = CAPSULES as u32;
        seen.position_sigma = self.sigma;
        seen.stand = (*stand).into();
        for (index, limb) in body.iter().enumerate() {
            let error = self.error[index];
            seen.body[index] = BODY[index].into();
            seen.capsules[index] = Capsule {
                ends: limb.ends.map(|end| (end + error).into()),
                radius: limb.radius,
                velocity: velocity[index].into(),
            };
        }
    }

    /// A Gauss–Markov walk with the stationary deviation `sigma`.
    fn wander(&mut self) {
        let keep = (-FRAME.as_secs_f64() / ERROR_LASTS).exp();
        let fresh = self.sigma * (1.0 - keep * keep).sqrt();
        let bound = CUT * self.sigma;
        for error in &mut self.error {
            *error = error.map(|e| {
                let drawn: f64 = StandardNormal.sample(&mut self.random);
                (e * keep + fresh * drawn).clamp(-bound, bound)
            });
        }
    }
}
