//! What the controller is told of the person: late, wrong by a few centimetres, frozen, or no number.

use std::collections::VecDeque;

use nalgebra::Vector3;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use tandem_msg::{Header, HumanState, Stamp};

use super::person::{PARTS, Person};

/// Periods between two frames of the error, and how many of them it lasts.
const FRAME: u64 = 10;
const LASTS: f64 = 20.0;
/// Errors are cut at this many standard deviations.
const CUT: f64 = 3.0;

/// What is wrong with the tracking in one trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// Nothing.
    None,
    /// Every sample comes this many periods late.
    Late(u64),
    /// Samples come up to this many periods late, as it happens.
    Jitter(u64),
    /// From this cycle on there are no more samples.
    Killed(u64),
    /// From this cycle on the last picture of the person is repeated under fresh stamps. (A picture of nobody that is
    /// repeated is what a tracker shows of an empty cell; only the sensor itself can tell the two apart.)
    Frozen(u64),
    /// From this cycle on, for so many, a number is not finite.
    Garbage(u64, u64),
    /// Every so many cycles a sample is lost.
    Lost(u64),
}

impl Fault {
    /// One of them, as often as suits.
    pub(super) fn draw(random: &mut ChaCha8Rng) -> Self {
        let mut whole = |from: u64, to: u64| from + (random.random::<f64>() * (to - from + 1) as f64) as u64;
        match whole(0, 9) {
            0 | 1 => Self::None,
            2..=4 => Self::Late(whole(1, 10)),
            5 => Self::Jitter(whole(1, 10)),
            6 => Self::Killed(whole(0, 900)),
            7 => Self::Frozen(whole(1, 900)),
            8 => Self::Garbage(whole(0, 900), whole(1, 50)),
            _ => Self::Lost(whole(2, 10)),
        }
    }

    /// Its name.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Late(_) => "late",
            Self::Jitter(_) => "jitter",
            Self::Killed(_) => "killed",
            Self::Frozen(_) => "frozen",
            Self::Garbage(..) => "garbage",
            Self::Lost(_) => "lost",
        }
    }
}

/// The tracker of one trial.
pub(super) struct Tracking {
    fault: Fault,
    sigma: f64,
    random: ChaCha8Rng,
    error: [Vector3<f64>; PARTS],
    past: VecDeque<HumanState>,
    told: HumanState,
    cycle: u64,
}

impl Tracking {
    pub(super) fn new(fault: Fault, sigma: f64, random: ChaCha8Rng, header: Header) -> Self {
        let told = HumanState { header, position_sigma: sigma, ..HumanState::default() };
        let mut tracking = Self {
            fault,
            sigma,
            random,
            error: [Vector3::zeros(); PARTS],
            past: VecDeque::with_capacity(12),
            told,
            cycle: 0,
        };
        for _ in 0..40 {
            tracking.wander();
        }
        tracking
    }

    fn wander(&mut self) {
        let keep = (-1.0 / LASTS).exp();
        let fresh = self.sigma * (1.0 - keep * keep).sqrt();
        let bound = CUT * self.sigma;
        let random = &mut self.random;
        for error in &mut self.error {
            *error = error.map(|e| {
                let drawn: f64 = StandardNormal.sample(random);
                (e * keep + fresh * drawn).clamp(-bound, bound)
            });
        }
    }

    /// What is told in this cycle; nobody while there is no person.
    pub(super) fn tell(&mut self, now: Stamp, person: Option<&Person>) -> &HumanState {
        let Some(person) = person else {
            self.told.header.stamp = now;
            self.told.header.seq += 1;
            return &self.told;
        };
        if self.cycle.is_multiple_of(FRAME) {
            self.wander();
        }
        let mut fresh = self.told;
        fresh.header.stamp = now;
        person.tell(&mut fresh);
        for (capsule, error) in fresh.capsules.iter_mut().zip(&self.error) {
            for end in &mut capsule.ends {
                for axis in 0..3 {
                    end[axis] += error[axis];
                }
            }
        }
        self.past.push_front(fresh);
        self.past.truncate(11);
        let cycle = self.cycle;
        self.cycle += 1;
        let behind = match self.fault {
            Fault::Late(periods) => periods,
            Fault::Jitter(most) => (self.random.random::<f64>() * (most + 1) as f64) as u64,
            _ => 0,
        };
        let fresh = self.past[(behind as usize).min(self.past.len() - 1)];
        let seq = self.told.header.seq;
        let newer = fresh.header.stamp > self.told.header.stamp;
        match self.fault {
            Fault::Killed(from) if cycle >= from => {}
            Fault::Frozen(from) if cycle >= from => {
                self.told.header.stamp = now;
                self.told.header.seq = seq + 1;
            }
            Fault::Lost(every) if cycle.is_multiple_of(every) => {}
            _ if newer => {
                self.told = fresh;
                self.told.header.seq = seq + 1;
                if let Fault::Garbage(from, lasts) = self.fault
                    && (from..from + lasts).contains(&cycle)
                {
                    let part = (self.random.random::<f64>() * PARTS as f64) as usize % PARTS;
                    let bad = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, f64::MAX][cycle as usize % 4];
                    self.told.capsules[part].ends[cycle as usize / 4 % 2][cycle as usize % 3] = bad;
                }
            }
            _ => {}
        }
        &self.told
    }
}
