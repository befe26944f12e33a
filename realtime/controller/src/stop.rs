//! Protective stop: the one place that decides whether the arm may keep moving.
//!
//! Every cycle [`StopMonitor::update`] is called once with the causes seen in
//! that cycle, and its answer is obeyed in the same cycle.
//!
//! ```text
//! Running --cause--> Stopping --standstill--> Stopped --released, no cause--> Running
//! ```
//!
//! A stop is latched: its first cause stays on record until the stop is
//! released. It is released by a reset that was asked for after the stop began
//! (a reset is not stored from before), or, where the policy says so, by the
//! cause `Separation` being gone for a while. A cause that comes while another
//! is latched can only make the stop stricter.
//!
//! **Invariant:** a cause seen in cycle *n* changes the command of cycle *n*.
//! **Invariant:** no transition leads from `Stopping` to `Running`: an arm that
//! had to stop comes to rest first.

use core::time::Duration;

use tandem_msg::{Coded, Stamp, StopCategory, StopCause, StopState};

/// The causes seen in one cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Causes(u32);

impl Causes {
    pub(crate) fn add(&mut self, cause: StopCause) {
        self.0 |= 1 << cause.code();
    }

    pub(crate) fn remove(&mut self, cause: StopCause) {
        self.0 &= !(1 << cause.code());
    }

    pub(crate) fn has(self, cause: StopCause) -> bool {
        self.0 & (1 << cause.code()) != 0
    }

    /// The strictest cause; among equals the one with the lowest code.
    pub(crate) fn worst(self) -> Option<StopCause> {
        let seen = || StopCause::ALL.iter().copied().filter(|cause| self.has(*cause));
        let strictest = seen().map(category).min()?;
        seen().find(|cause| category(*cause) == strictest)
    }
}

/// How the arm is stopped for a cause (IEC 60204-1).
pub(crate) fn category(cause: StopCause) -> StopCategory {
    match cause {
        // The arm is sound and so is what is known of the cell: it may stay under power.
        StopCause::None | StopCause::Separation | StopCause::Clearance | StopCause::Workspace => StopCategory::Two,
        // What is known of the cell or of the arm is in doubt: brakes once it stands.
        StopCause::ArmStale
        | StopCause::HumanStale
        | StopCause::SceneInvalid
        | StopCause::SupervisorStale
        | StopCause::InputInvalid
        | StopCause::TrackingError
        | StopCause::JointLimit
        | StopCause::PlantBraked
        | StopCause::ForeignWriter => StopCategory::One,
        // The controller is in doubt: no further set-point of its own.
        StopCause::Internal => StopCategory::Zero,
    }
}

/// What a transition depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Facts {
    cause: bool,
    standstill: bool,
    released: bool,
}

/// The state machine, as data: state and facts in, state out.
fn next(state: StopState, facts: Facts) -> StopState {
    match (state, facts) {
        (StopState::Running, Facts { cause: true, .. }) => StopState::Stopping,
        (StopState::Stopping, Facts { standstill: true, .. }) => StopState::Stopped,
        (StopState::Stopped, Facts { cause: false, released: true, .. }) => StopState::Running,
        (state, _) => state,
    }
}

/// What the monitor is told each cycle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Seen {
    pub(crate) causes: Causes,
    pub(crate) standstill: bool,
    /// `MotionTask::reset_count`, when the supervisor may be believed.
    pub(crate) reset_count: Option<u32>,
    /// The supervisor is another incarnation than before: its count starts anew.
    pub(crate) supervisor_restarted: bool,
}

/// State, latched cause and count of stops.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StopMonitor {
    state: StopState,
    cause: StopCause,
    category: StopCategory,
    count: u32,
    reset_seen: u32,
    /// Until everything was heard for the first time the arm stands without a stop being counted.
    armed: bool,
    resume_after_separation: bool,
    resume_delay: Duration,
    clear_since: Option<Stamp>,
}

impl StopMonitor {
    pub(crate) fn new(resume_after_separation: bool, resume_delay: Duration) -> Self {
        Self {
            state: StopState::Stopped,
            cause: StopCause::None,
            category: StopCategory::Two,
            count: 0,
            reset_seen: 0,
            armed: false,
            resume_after_separation,
            resume_delay,
            clear_since: None,
        }
    }

    pub(crate) fn state(&self) -> StopState {
        self.state
    }

    pub(crate) fn running(&self) -> bool {
        self.state == StopState::Running
    }

    pub(crate) fn cause(&self) -> StopCause {
        self.cause
    }

    pub(crate) fn category(&self) -> StopCategory {
        self.category
    }

    pub(crate) fn count(&self) -> u32 {
        self.count
    }

    pub(crate) fn reset_seen(&self) -> u32 {
        self.reset_seen
    }

    /// Whether everything was heard once since start.
    pub(crate) fn armed(&self) -> bool {
        self.armed
    }

    /// Carries out the transition of this cycle and returns the state to obey.
    pub(crate) fn update(&mut self, now: Stamp, seen: &Seen) -> StopState {
        if seen.supervisor_restarted {
            self.reset_seen = seen.reset_count.unwrap_or(self.reset_seen);
        }
        let worst = seen.causes.worst();
        self.clear_since = match worst {
            Some(_) => None,
            None => self.clear_since.or(Some(now)),
        };
        if !self.armed {
            // Not a stop: nothing has moved yet. The first moment without a cause arms the monitor.
            self.cause = worst.unwrap_or(StopCause::None);
            if worst.is_none() {
                self.armed = true;
                self.state = StopState::Running;
                self.reset_seen = seen.reset_count.unwrap_or(0);
            }
            return self.state;
        }
        if let Some(worst) = worst {
            if self.state == StopState::Running {
                self.cause = worst;
                self.category = category(worst);
                self.count = self.count.saturating_add(1);
                // A reset from before the stop does not release it.
                self.reset_seen = seen.reset_count.unwrap_or(self.reset_seen);
            } else {
                self.category = self.category.min(category(worst));
            }
        }
        let reset = seen.reset_count.is_some_and(|count| count > self.reset_seen);
        let by_itself = self.resume_after_separation
            && self.cause == StopCause::Separation
            && self.category == StopCategory::Two
            && self.clear_since.is_some_and(|since| since.age_at(now) >= self.resume_delay);
        let facts = Facts { cause: worst.is_some(), standstill: seen.standstill, released: reset || by_itself };
        let before = self.state;
        self.state = next(before, facts);
        if before == StopState::Stopped && self.state == StopState::Running {
            self.cause = StopCause::None;
            self.category = StopCategory::Two;
            if reset {
                self.reset_seen = seen.reset_count.unwrap_or(self.reset_seen);
            }
        }
        self.state
    }
}

#[cfg(test)]
#[allow(clippy::disallowed_types, clippy::disallowed_macros, reason = "a test may allocate")]
mod explored;

#[cfg(test)]
mod tests {
    use super::*;

    const DELAY: Duration = Duration::from_millis(5);

    fn seen(cause: Option<StopCause>, standstill: bool, reset_count: u32) -> Seen {
        let mut causes = Causes::default();
        if let Some(cause) = cause {
            causes.add(cause);
        }
        Seen { causes, standstill, reset_count: Some(reset_count), supervisor_restarted: false }
    }

    fn armed() -> StopMonitor {
        let mut monitor = StopMonitor::new(true, DELAY);
        assert_eq!(monitor.update(Stamp(0), &seen(None, true, 3)), StopState::Running);
        monitor
    }

    /// All 24 transitions, written out as the picture in the header has them.
    #[test]
    fn the_whole_transition_table() {
        for state in [StopState::Running, StopState::Stopping, StopState::Stopped] {
            for bits in 0..8 {
                let facts = Facts { cause: bits & 1 != 0, standstill: bits & 2 != 0, released: bits & 4 != 0 };
                let expected = match state {
                    StopState::Running if facts.cause => StopState::Stopping,
                    StopState::Stopping if facts.standstill => StopState::Stopped,
                    StopState::Stopped if facts.released && !facts.cause => StopState::Running,
                    same => same,
                };
                assert_eq!(next(state, facts), expected, "{state} {facts:?}");
            }
        }
    }

    /// Every cause latches, survives its own end and a reset from before, and goes with a reset after it.
    #[test]
    fn every_cause_latches_until_it_is_reset() {
        for &cause in StopCause::ALL.iter().filter(|cause| **cause != StopCause::None) {
            let mut monitor = armed();
            let mut now = 0;
            let mut step = |monitor: &mut StopMonitor, seen: Seen| {
                now += 1_000_000;
                monitor.update(Stamp(now), &seen)
            };
            assert_eq!(step(&mut monitor, seen(Some(cause), false, 4)), StopState::Stopping, "{cause}");
            assert_eq!((monitor.cause(), monitor.category()), (cause, category(cause)));
            assert_eq!(step(&mut monitor, seen(None, false, 4)), StopState::Stopping, "{cause}: still moving");
            assert_eq!(step(&mut monitor, seen(None, true, 4)), StopState::Stopped, "{cause}");
            assert_eq!(step(&mut monitor, seen(None, true, 4)), StopState::Stopped, "{cause}: the old reset");
            assert_eq!(step(&mut monitor, seen(Some(cause), true, 5)), StopState::Stopped, "{cause}: not gone");
            assert_eq!(step(&mut monitor, seen(None, true, 5)), StopState::Running, "{cause}");
            assert_eq!((monitor.cause(), monitor.count(), monitor.reset_seen()), (StopCause::None, 1, 5));
        }
    }

    /// Separation alone ends by itself, and only after the delay; a stricter cause on top takes that away.
    #[test]
    fn only_separation_resumes_by_itself() {
        for (also, expected) in [(None, StopState::Running), (Some(StopCause::ArmStale), StopState::Stopped)] {
            let mut monitor = armed();
            monitor.update(Stamp(1_000_000), &seen(Some(StopCause::Separation), false, 3));
            monitor.update(Stamp(2_000_000), &seen(also, true, 3));
            assert_eq!(monitor.update(Stamp(3_000_000), &seen(None, true, 3)), StopState::Stopped);
            assert_eq!(monitor.cause(), StopCause::Separation);
            assert_eq!(monitor.update(Stamp(20_000_000), &seen(None, true, 3)), expected);
        }
    }

    /// Before everything was heard the arm stands, the missing input is named, and no stop is counted.
    #[test]
    fn silence_at_start_is_no_stop() {
        let mut monitor = StopMonitor::new(true, DELAY);
        assert_eq!(monitor.update(Stamp(0), &seen(Some(StopCause::ArmStale), true, 0)), StopState::Stopped);
        assert_eq!((monitor.cause(), monitor.count()), (StopCause::ArmStale, 0));
        assert_eq!(monitor.update(Stamp(1), &seen(None, true, 9)), StopState::Running);
        assert_eq!(monitor.reset_seen(), 9);
    }

    #[test]
    fn the_strictest_cause_leads() {
        let mut causes = Causes::default();
        assert_eq!(causes.worst(), None);
        causes.add(StopCause::Separation);
        causes.add(StopCause::HumanStale);
        assert_eq!(causes.worst(), Some(StopCause::HumanStale));
        causes.add(StopCause::Internal);
        assert_eq!(causes.worst(), Some(StopCause::Internal));
    }
}
