//! Is the arm's safety what it is said to be? Random scenes, motions and people, by the ten thousands.
//!
//! [`campaign`] runs encounters on all processors. Every one is its seed, so a
//! failure is repeated by running that seed alone.

mod nuisance;
mod person;
mod referee;
mod tracking;
mod trial;
mod walk_in;
mod world;

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};

pub use nuisance::{Behind, crossing, passers_by, withdrawal};
pub use tracking::Fault;
pub use trial::{Arm, Outcome, Terms, encounter};
pub use walk_in::{Sample, WalkIn, walk_in};

/// Sums over encounters.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    /// Encounters.
    pub runs: u64,
    /// Encounters with each fault of the tracking.
    pub faults: BTreeMap<&'static str, u64>,
    /// Cycles with a person there.
    pub cycles: u64,
    /// Those in which the arm moved.
    pub moving: u64,
    /// Encounters in which the moving arm was touched.
    pub contacts: u64,
    /// Those in which it struck: moved towards what it touched.
    pub struck: u64,
    /// Encounters in which somebody had less than the protective separation.
    pub below: u64,
    /// Latched stops.
    pub stops: u64,
    /// Cycles the arm was kept from moving, and those in which an exact monitor would not have kept it.
    pub waiting: u64,
    /// Of those, the needless ones.
    pub needless: u64,
    /// Least distance beyond the protective separation, metres.
    pub spare: Option<f64>,
    /// Least distance to a moving arm, metres.
    pub distance: Option<f64>,
    /// Longest time a stop took beyond what was announced, s.
    pub overrun: f64,
    /// Seeds that failed, the lowest few.
    pub failed: Vec<u64>,
}

/// Failing seeds that are kept.
const FAILED_MAX: usize = 10;

impl Tally {
    fn add(&mut self, seed: u64, outcome: &Outcome) {
        self.runs += 1;
        *self.faults.entry(outcome.fault.name()).or_default() += 1;
        self.cycles += outcome.cycles;
        self.moving += outcome.moving;
        self.contacts += u64::from(outcome.contact);
        self.struck += u64::from(outcome.struck);
        self.below += u64::from(outcome.spare < 0.0);
        self.stops += u64::from(outcome.stops);
        self.waiting += outcome.waiting;
        self.needless += outcome.needless;
        self.overrun = self.overrun.max(outcome.overrun);
        let least = |old: Option<f64>, new: f64| old.map_or(new, |old| old.min(new));
        self.spare = Some(least(self.spare, outcome.spare));
        self.distance = Some(least(self.distance, outcome.distance));
        if outcome.contact || outcome.spare < 0.0 {
            self.failed.push(seed);
        }
    }

    fn merge(&mut self, other: &Self) {
        self.runs += other.runs;
        for (name, count) in &other.faults {
            *self.faults.entry(name).or_default() += count;
        }
        self.cycles += other.cycles;
        self.moving += other.moving;
        self.contacts += other.contacts;
        self.struck += other.struck;
        self.below += other.below;
        self.stops += other.stops;
        self.waiting += other.waiting;
        self.needless += other.needless;
        self.overrun = self.overrun.max(other.overrun);
        let least = |a: Option<f64>, b: Option<f64>| a.into_iter().chain(b).min_by(f64::total_cmp);
        self.spare = least(self.spare, other.spare);
        self.distance = least(self.distance, other.distance);
        self.failed.extend(&other.failed);
        self.failed.sort_unstable();
        self.failed.truncate(FAILED_MAX);
    }
}

/// Runs the encounters of `runs` seeds from `seed` on. `progress` is told how many are done, now and then.
pub fn campaign(arm: &Arm, seed: u64, runs: u64, terms: Terms, progress: &(dyn Fn(u64) + Sync)) -> Tally {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let (next, done) = (AtomicU64::new(0), AtomicU64::new(0));
    let work = || {
        let mut tally = Tally::default();
        loop {
            let run = next.fetch_add(1, Ordering::Relaxed);
            if run >= runs {
                return tally;
            }
            let seed = seed.wrapping_add(run);
            tally.add(seed, &encounter(arm, seed, terms));
            progress(done.fetch_add(1, Ordering::Relaxed) + 1);
        }
    };
    std::thread::scope(|scope| {
        let handles: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        let mut all = Tally::default();
        for handle in handles {
            match handle.join() {
                Ok(tally) => all.merge(&tally),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
        all
    })
}
