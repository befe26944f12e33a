//! The next set-point: made, checked, and only then sent.

use tandem_msg::{Stamp, StopCategory, StopCause, StopState};

use super::Controller;
use crate::Joints;
use crate::envelope;
use crate::governor::{FAR, Governor};
use crate::inputs::Heard;
use crate::law::{Law, Refused};
use crate::motion::SetPoint;
use crate::stop::{Causes, Seen};

/// An arm that is about to turn off from a blocked path goes on until it would have to stop within this time, s, or
/// length.
const TURNING: f64 = 0.02;
const NEAR: f64 = 0.002;

impl Controller {
    /// Makes the next set-point, checks it, and sends it or the stop that was checked before it.
    pub(super) fn follow(&mut self, now: Stamp, go: bool, heard: &Heard, reset_count: u32, mut causes: Causes) {
        self.motion.slow(self.period);
        self.change_over(now, go);
        let mut next = None;
        let mut choice = 0;
        if let Some(law) = self.motion.law() {
            match self.next_law(&law, go) {
                Ok(law) => {
                    let level = self.check(now, &law, &mut causes);
                    choice = if go { level } else { 0 };
                    next = Some(law);
                }
                Err(Refused) => self.refused = true,
            }
        } else {
            self.guard.measure(&self.chain, &self.motion.set().position);
            self.guard.look_around(&self.chain, FAR, self.known_of_people(now));
            self.margin = self.governor.margin_at_rest(self.guard.people());
            self.stopping_time = 0.0;
            self.governor.watch_at_rest(now, self.guard.people());
        }
        if self.refused {
            causes.add(StopCause::Internal);
        }
        if self.stop.cause() == StopCause::Separation && !self.governor.enough() {
            // The cause lasts until there is room to start again, not only until the arm stands.
            causes.add(StopCause::Separation);
        }
        let before = self.stop.state();
        let cause = self.stop.cause();
        let state = self.stop.update(
            now,
            &Seen {
                causes,
                standstill: self.motion.standstill(),
                reset_count: heard.task.good.then_some(reset_count),
                supervisor_restarted: heard.task.restarted,
            },
        );
        if before == StopState::Stopped && state == StopState::Running && cause != StopCause::Separation {
            // What was planned may be why it stopped.
            if self.motion.law().is_some() {
                self.motion.rest();
                next = None;
            }
            self.plan_anew();
        }
        if state != StopState::Running {
            choice = 0;
            if self.stop.category() == StopCategory::Zero {
                self.leave(now);
                next = None;
            } else if let Some(law) = self.motion.law() {
                next = self.stopped(&law);
            }
        } else if choice == 0
            && next.is_some_and(|law| !law.stopping())
            && let Some(law) = self.motion.law()
        {
            next = self.stopped(&law);
        }
        self.law_level = choice;
        if let Some(law) = next {
            let set = self.motion.set_point(&law.state());
            if self.envelope_fault(&set) == Some(StopCause::Internal) {
                self.command_fault = true;
                self.leave(now);
            } else {
                self.motion.commit(law, &set);
            }
        }
    }

    /// The law one period on, for the level chosen in the cycle before.
    fn next_law(&self, law: &Law, go: bool) -> Result<Law, Refused> {
        let share = if go { self.share() } else { 0.0 };
        let next = law.at_share(share, self.motion.path().length(), self.motion.limits())?;
        Ok(next.advanced(self.period))
    }

    /// A stop from where the law is now, one period on.
    fn stopped(&mut self, law: &Law) -> Option<Law> {
        match law.at_share(0.0, self.motion.path().length(), self.motion.limits()) {
            Ok(stop) => Some(stop.advanced(self.period)),
            Err(Refused) => {
                self.refused = true;
                None
            }
        }
    }

    /// Checks a set-point on the path before it goes out; returns the level for the cycle after.
    fn check(&mut self, now: Stamp, law: &Law, causes: &mut Causes) -> usize {
        let state = law.state();
        let Ok(stop) = Law::stop_from(state, self.motion.limits()) else {
            self.refused = true;
            return 0;
        };
        let moving = state.velocity > 0.0;
        let set = self.motion.set_point(&state);
        match self.envelope_fault(&set) {
            Some(StopCause::Internal) => self.refused = true,
            Some(cause) => causes.add(cause),
            None => {}
        }
        if moving && self.leaves_range(&set.position, &self.motion.path().at(stop.end).position) {
            causes.add(StopCause::JointLimit);
        }

        self.guard.measure(&self.chain, &set.position);
        if moving && !(self.guard.clearance().distance >= self.guard.floor()) {
            causes.add(self.guard.cause_here());
        }
        self.guard.sweep(&self.chain, self.motion.path(), state.position, stop.end);
        let known = self.guard.clear_to() + 1e-9 >= stop.end;
        if moving && !known && self.guard.blocked() {
            causes.add(self.guard.cause_ahead());
        }

        let halt = self.governor.halt(&state, &stop);
        let seen = self.known_of_people(now);
        let horizon = |rate| self.governor.horizon(rate, seen);
        let (way, onward) = self.governor.look_ahead(&halt);
        let way = (state.position, way, onward);
        self.guard.look_along(&self.chain, self.motion.path(), way, horizon, seen);
        self.margin = self.governor.margin(self.guard.people(), &halt);
        self.stopping_time = stop.duration;
        if moving && !(self.margin.spare >= 0.0) {
            causes.add(StopCause::Separation);
        }
        let level = self.governor.choose(now, self.guard.people(), &halt);
        // What is blocked is followed only to turn off from it, as long as there is room to stop a little later.
        let room = self.guard.clear_to() - stop.end;
        let turns_off = self.towards.is_some() && room > TURNING * state.velocity + NEAR;
        if known && (!self.guard.blocked() || turns_off) { level } else { 0 }
    }

    /// What is wrong with sending a set-point after the last one.
    fn envelope_fault(&self, set: &SetPoint) -> Option<StopCause> {
        let fastest = self.params.tcp_speed_max.max(self.params.line_speed_max);
        envelope::fault(&self.chain, self.motion.set(), set, self.period, fastest)
    }

    /// Age (s) and standard deviation (m) of what is known of people.
    pub(super) fn known_of_people(&self, now: Stamp) -> (f64, f64) {
        (self.watch.human_age(now), self.human.position_sigma)
    }

    /// Share of the path's speed in force.
    pub(super) fn share(&self) -> f64 {
        Governor::share(self.law_level).min(self.pace.share_max()).min(self.share_before_change())
    }

    /// Whether a joint is farther outside its range at `then` than at `now`.
    fn leaves_range(&self, now: &Joints, then: &Joints) -> bool {
        self.chain.joints().iter().zip(now.iter().zip(then)).any(|(joint, (now, then))| {
            *then > joint.position_max.max(*now) + 1e-6 || *then < joint.position_min.min(*now) - 1e-6
        })
    }
}
