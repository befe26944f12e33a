//! A way across that is renewed while the arm follows it: when to look for another one, and when to take it.
//!
//! **Invariant:** the arm changes over only to a path that was swept as a whole with the scene in force, in a cycle in
//! which the stop on the new path owes nobody more than there is.
//! **Invariant:** the law goes on from the state it has; a way it does not fit is dropped.

use core::time::Duration;

use tandem_msg::{MotionPhase, Stamp};
use tandem_trajectory::State;

use super::{Controller, tools};
use crate::job::Stage;
use crate::law::Law;
use crate::plan::{Chance, Leg, Renewed};

/// How far ahead the branch lies, s: by then a way is found, or it is not taken.
const AHEAD: f64 = 0.3;
/// Towards what blocks it the arm goes no faster than this share of its speed, so that it can turn off.
const TOWARDS_BLOCK: f64 = 0.2;
/// Where the new way turns off so sharply that less than this share of the present speed is left, standing is quicker.
const TURN: f64 = 0.25;
/// A way is blocked by a person whom the arm could only pass more slowly than at this level.
const BLOCKED_LEVEL: usize = 1;
/// A new way keeps the separation of this level, so that the arm gets on where it leads past somebody.
const PASS_LEVEL: usize = 4;
/// Rounding of a way that comes no nearer to somebody, metres.
const NEARER: f64 = 0.01;
/// The arm is at the branch within this, length.
const AT: f64 = 1e-9;
/// Rounding of speeds.
const ABOVE: f64 = 1.0 + 1e-6;

impl Controller {
    /// Looks for a better way, a few steps a cycle, while the arm follows one across; `go` while it may move.
    pub(super) fn renew(&mut self, now: Stamp, go: bool) {
        let period = self.params.renewal_period;
        let on_way = match self.job.stage {
            Stage::Leg(index) => self.search.legs().get(index).is_some_and(|leg| leg.phase == MotionPhase::Transfer),
            _ => false,
        };
        if !go || !on_way || period == Duration::ZERO || !self.scene_valid {
            return self.drop_renewal();
        }
        if self.search.is_settled() {
            if self.renewed_at.age_at(now) < period {
                return;
            }
            if !self.begin_renewal(now) {
                return self.drop_renewal();
            }
        } else if self.search.renewed().is_some() {
            return;
        }
        if self.motion.law().is_some_and(|law| law.state().position > self.search.branch() + AT) {
            // The planners were too slow.
            return self.drop_renewal();
        }
        let mut tools = tools!(self, peopled);
        if let Renewed::Judged { blocked } = self.search.renew(&mut tools) {
            self.towards = blocked.then_some(self.towards.unwrap_or(TOWARDS_BLOCK));
            if !self.turn_off(now, blocked) {
                self.drop_renewal();
            }
        } else if self.search.is_settled() {
            self.drop_renewal();
        } else if self.search.renewed().is_some_and(|(leg, chance)| {
            !chance.at_rest() && leg.limits.velocity < TURN * self.motion.limits().velocity
        }) {
            self.stand_first();
        }
    }

    pub(super) fn drop_renewal(&mut self) {
        self.search.drop_renewal();
        self.towards = None;
    }

    /// Gives up a way that the arm does not fit on in motion. What is blocked is left from rest: by another renewal, or
    /// by a new plan where it is an object that blocks it.
    fn stand_first(&mut self) {
        let blocked = self.towards.is_some();
        self.drop_renewal();
        if blocked {
            (self.towards, self.renewed_at) = (Some(0.0), Stamp(0));
        }
    }

    fn begin_renewal(&mut self, now: Stamp) -> bool {
        let (Stage::Leg(leg), Some(law)) = (self.job.stage, self.motion.law()) else { return false };
        if !self.see_people(self.separation(now, BLOCKED_LEVEL)) {
            return false;
        }
        self.renewed_at = now;
        self.search.begin_renewal(&mut tools!(self, peopled), leg, law.state().position)
    }

    /// Where the present way may be left; one that is blocked is left at a lower speed.
    fn chance(&self, blocked: bool) -> Option<Chance> {
        let (Stage::Leg(leg), Some(law)) = (self.job.stage, self.motion.law()) else { return None };
        if !blocked || law.stopping() {
            return Some(Chance { leg, state: law.after(AHEAD) });
        }
        let slower = self.motion.limits().scaled(TOWARDS_BLOCK);
        let state = law.slowed_after(AHEAD, self.motion.path().length(), &slower).ok()?;
        Some(Chance { leg, state })
    }

    /// Has planners look for a way that leaves the present one ahead.
    fn turn_off(&mut self, now: Stamp, blocked: bool) -> bool {
        let Some(chance) = self.chance(blocked) else { return false };
        let [least, wanted] = [BLOCKED_LEVEL, PASS_LEVEL].map(|level| self.separation(now, level));
        if !self.see_people(wanted) {
            return false;
        }
        // An arm that is nearer to somebody already comes no nearer.
        let spare = |length: f64| {
            let position = self.motion.path().at(length).position;
            self.outlook.clearance(&self.chain.forward(&position)) - self.params.path_margin
        };
        let spare = spare(chance.state.position).min(spare(chance.corner()));
        if spare < 0.0 && !self.see_people((wanted + spare - NEARER).max(least + NEARER)) {
            return false;
        }
        self.search.leave_at(&chance)
    }

    /// Separation at which an arm at that level passes somebody, metres.
    fn separation(&self, now: Stamp, level: usize) -> f64 {
        self.governor.passes_at(level, self.known_of_people(now))
    }

    /// Has planners see people with the separation they are owed.
    fn see_people(&mut self, separation: f64) -> bool {
        let count = (self.human.capsule_count as usize).min(self.human.capsules.len());
        separation.is_finite() && self.outlook.with_people(&self.human.capsules[..count], separation)
    }

    /// Share of the path's speed that a way under renewal asks for, so that the arm can go over to it at the branch.
    pub(super) fn share_before_change(&self) -> f64 {
        let present = self.motion.limits().velocity;
        let towards = self.towards.unwrap_or(1.0);
        self.search.renewed().map_or(towards, |(leg, _)| (leg.limits.velocity / present).min(towards))
    }

    /// At the branch: changes over to the way that was found, or drops it where the arm does not fit on it.
    pub(super) fn change_over(&mut self, now: Stamp, go: bool) {
        let Some(law) = self.motion.law() else { return };
        let Some((leg, chance)) = self.search.renewed().map(|(leg, chance)| (*leg, *chance)) else { return };
        let state = law.state();
        let standing = law.finished() && state.velocity == 0.0 && state.acceleration == 0.0;
        let here = State { position: state.position - chance.state.position, ..state };
        let next = here.position + state.velocity * self.period;
        // Where the new way begins at rest the arm has to stand, and where it begins in motion this cycle takes it past
        // the branch.
        let there = if chance.at_rest() { standing || here.position > AT } else { standing || next >= -AT };
        if !there {
            return;
        }
        let fits = if chance.at_rest() {
            here.position.abs() <= AT
        } else {
            next >= -AT
                && here.position <= AT
                && state.velocity <= leg.limits.velocity * ABOVE
                && state.acceleration.abs() <= leg.limits.acceleration * ABOVE
        };
        if !(go && fits && self.owes_nobody(now, &leg, &here)) {
            return if go && !standing { self.stand_first() } else { self.drop_renewal() };
        }
        let taken =
            self.motion.change_over(&leg.path, &leg.limits, here).and_then(|()| self.governor.change_over(&leg.limits));
        if taken.is_err() {
            self.refused = true;
            return;
        }
        self.towards = None;
        if let Some((reason, left)) = self.search.change_over() {
            self.changes += 1;
            self.change_reason = reason;
            self.job.expected = self.job.elapsed(now) + left;
        }
        self.guard.take(&leg, self.job.attached(), true);
        self.pace.take(&self.chain, &leg, &self.job, &self.params, false);
    }

    /// Whether the stop that would follow at once on a new way leaves everybody what they are owed, with the reserve
    /// that there is now.
    fn owes_nobody(&mut self, now: Stamp, leg: &Leg, here: &State) -> bool {
        let Ok(stop) = Law::stop_from(*here, &leg.limits) else { return false };
        let halt = self.governor.halt(here, &stop);
        let seen = self.known_of_people(now);
        let (way, onward) = self.governor.look_ahead(&halt);
        let horizon = |rate| self.governor.horizon(rate, seen);
        self.guard.look_along(&self.chain, &leg.path, (0.0, way, onward), horizon, seen);
        let spare = self.governor.margin(self.guard.people(), &halt).spare;
        // No less than on the present way will do, if that is enough.
        spare >= self.governor.reserve().min(self.margin.spare.max(0.0))
    }
}
