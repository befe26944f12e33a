//! Which limits the arm moves under besides those of its path: shares of the path's speed.
//!
//! | when | the TCP goes no faster than |
//! |---|---|
//! | reduced mode: asked for, or a person within a distance | `reduced_speed_max` |
//! | near the person in a hand-over, or while holding what they work on | what hand and forearm bear, ISO/TS 15066 Annex A |
//! | recovery mode: out of a contact, or back into the joints' range | `recovery_speed_max` |

use core::time::Duration;

use tandem_clearance::pfl;
use tandem_kinematics::Chain;
use tandem_msg::{BodyPart, MotionPhase, SafetyMode, Stamp};

use crate::Params;
use crate::job::Job;
use crate::plan::Leg;

/// How much farther off a person must be for reduced mode to end, metres, and for how long.
const BAND: f64 = 0.1;
const BAND_TIME: Duration = Duration::from_millis(500);

/// The pace of the arm.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pace {
    near: bool,
    far_since: Option<Stamp>,
    reduced: bool,
    recovering: bool,
    /// Shares of the present path's speed.
    reduced_share: f64,
    contact_share: f64,
    recovery_share: f64,
}

impl Pace {
    pub(crate) fn new() -> Self {
        Self {
            near: false,
            far_since: None,
            reduced: false,
            recovering: false,
            reduced_share: 1.0,
            contact_share: 1.0,
            recovery_share: 1.0,
        }
    }

    /// Prepares for a stretch; `recovering` when it leads out of a contact or back into range.
    pub(crate) fn take(&mut self, chain: &Chain, leg: &Leg, job: &Job, params: &Params, recovering: bool) {
        let peak = leg.path.tcp_rate(chain) * leg.limits.velocity;
        let share = |speed: f64| if peak > speed { speed / peak } else { 1.0 };
        let near_person = job.is_with_person() && leg.phase != MotionPhase::Transfer;
        self.recovering = recovering;
        self.reduced_share = share(params.reduced_speed_max);
        self.recovery_share = share(params.recovery_speed_max);
        self.contact_share = if near_person { share(contact_speed(job, params)) } else { 1.0 };
    }

    /// Judges anew whether the mode is reduced. `distance` is that of the nearest person.
    pub(crate) fn update(&mut self, now: Stamp, asked: bool, distance: f64, params: &Params) {
        let within = params.reduced_within;
        // Written so that what is no number is near.
        if within > 0.0 && !(distance >= within) {
            (self.near, self.far_since) = (true, None);
        } else if distance >= within + BAND {
            let since = *self.far_since.get_or_insert(now);
            self.near &= since.age_at(now) < BAND_TIME;
        } else {
            self.far_since = None;
        }
        self.reduced = asked || self.near;
    }

    /// Largest share of the path's speed.
    pub(crate) fn share_max(&self) -> f64 {
        let reduced = if self.reduced { self.reduced_share } else { 1.0 };
        let recovery = if self.recovering { self.recovery_share } else { 1.0 };
        reduced.min(recovery).min(self.contact_share)
    }

    /// Goes back to what is usual when the stretch is over.
    pub(crate) fn recovered(&mut self) {
        self.recovering = false;
    }

    pub(crate) fn mode(&self) -> SafetyMode {
        match (self.recovering, self.reduced) {
            (true, _) => SafetyMode::Recovery,
            (false, true) => SafetyMode::Reduced,
            (false, false) => SafetyMode::Normal,
        }
    }
}

/// What a hand or a forearm between tool and part bears, m/s.
fn contact_speed(job: &Job, params: &Params) -> f64 {
    let part = job.attached();
    let load = if part.present == 1 { part.mass } else { 0.0 };
    [BodyPart::Hand, BodyPart::Forearm]
        .map(|body| pfl::contact_speed_max(body, params.moving_mass, load, true))
        .into_iter()
        .fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By request at once; by a person within the distance at once, and back only after a while well outside it.
    #[test]
    fn reduced_mode_has_a_band_and_a_time() {
        let params = Params { reduced_within: 1.0, ..Params::default() };
        let mut pace = Pace::new();
        let mut at = |ms: u64, asked: bool, distance: f64| {
            pace.update(Stamp(ms * 1_000_000), asked, distance, &params);
            pace.mode() == SafetyMode::Reduced
        };
        assert!(!at(0, false, 1.5));
        assert!(at(1, true, 1.5) && !at(2, false, 1.5));
        assert!(at(3, false, 0.99), "near");
        assert!(at(600, false, 1.05), "within the band");
        assert!(at(601, false, 1.2) && at(1_000, false, 1.2), "not long enough");
        assert!(at(1_001, false, 1.05) && at(1_002, false, 1.2) && at(1_501, false, 1.2), "from the start");
        assert!(!at(1_502, false, 1.2));
        assert!(at(1_503, false, f64::NAN));
    }
}
