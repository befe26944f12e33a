//! The two watches of every cycle: over the protective stop, and over the other roles.

use super::{RoleFault, RoleHealth};
use std::time::Duration;
use tandem_msg::{MotionStatus, Role, Stamp, StopCategory, StopCause, StopState};

/// What is to be done about the protective stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum StopNews {
    /// Nothing.
    Quiet,
    /// The arm is being stopped.
    Began {
        /// Why.
        cause: StopCause,
        /// How.
        category: StopCategory,
    },
    /// Clear the latch: the cause is gone, and it is one that needs no eyes.
    Reset,
    /// Ask a person to look before the latch is cleared.
    Ask,
    /// The arm may move again.
    Ended {
        /// Why it had stopped.
        cause: StopCause,
        /// How long it stood.
        after: Duration,
    },
}

/// Follows the latch of the protective stop.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct StopWatch {
    began: Option<(Stamp, StopCause)>,
    clear_since: Option<Stamp>,
    resets: u32,
    asked: bool,
}

/// What the watch goes by.
#[derive(Clone, Copy, Debug)]
pub(super) struct StopPolicy {
    /// A cause must have been gone this long.
    pub(super) reset_after: Duration,
    /// Resets by rule before a person must look.
    pub(super) resets_max: u32,
    /// A stop that lasts longer than this is looked at.
    pub(super) patience: Duration,
}

/// Causes that lie in what the arm was told and not in the arm or its surroundings: when
/// they are gone, nothing can have been damaged. After the others a person looks first.
fn resets_by_rule(cause: StopCause) -> bool {
    match cause {
        StopCause::None
        | StopCause::Separation
        | StopCause::ArmStale
        | StopCause::HumanStale
        | StopCause::SceneInvalid
        | StopCause::SupervisorStale
        | StopCause::InputInvalid
        | StopCause::PlantBraked
        | StopCause::ForeignWriter => true,
        StopCause::Clearance
        | StopCause::Workspace
        | StopCause::TrackingError
        | StopCause::JointLimit
        | StopCause::Internal => false,
    }
}

impl StopWatch {
    /// Takes one cycle's status into account.
    pub(super) fn update(&mut self, now: Stamp, motion: &MotionStatus, policy: &StopPolicy) -> StopNews {
        let cause = motion.cause.get().unwrap_or(StopCause::Internal);
        let state = motion.stop.get().unwrap_or(StopState::Stopped);
        let Some((since, latched)) = self.began else {
            // Before everything was heard for the first time an arm stands without a cause.
            if state == StopState::Running || cause == StopCause::None {
                return StopNews::Quiet;
            }
            self.began = Some((now, cause));
            self.clear_since = None;
            self.asked = false;
            let category = motion.category.get().unwrap_or(StopCategory::Zero);
            return StopNews::Began { cause, category };
        };
        if state == StopState::Running {
            self.began = None;
            return StopNews::Ended { cause: latched, after: since.age_at(now) };
        }
        let present = state == StopState::Stopping
            || (latched == StopCause::Separation && motion.separation < motion.separation_required);
        if present {
            self.clear_since = None;
        } else {
            self.clear_since.get_or_insert(now);
        }
        let clear = self.clear_since.is_some_and(|at| at.age_at(now) >= policy.reset_after);
        if clear && resets_by_rule(latched) && self.resets < policy.resets_max {
            self.resets += 1;
            self.clear_since = None;
            return StopNews::Reset;
        }
        if (clear || since.age_at(now) > policy.patience) && !self.asked {
            self.asked = true;
            return StopNews::Ask;
        }
        StopNews::Quiet
    }

    /// A person has looked and lets it go on: the count of resets begins anew.
    pub(super) fn seen_by_person(&mut self) {
        self.resets = 0;
        self.asked = false;
        self.clear_since = None;
    }

    /// A new step: its own count of resets.
    pub(super) fn new_step(&mut self) {
        self.resets = 0;
    }
}

/// A change in the health of a role.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RoleNews {
    /// It is gone.
    Lost(Role, RoleFault),
    /// It is back, after this long.
    Back(Role, Duration),
    /// It has been away for longer than it may.
    Overdue(Role, RoleFault),
}

/// Follows the health of the roles.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct RoleWatch {
    lost: [Option<(Stamp, RoleFault)>; 4],
}

impl RoleWatch {
    /// The roles that must be up.
    const WATCHED: [Role; 3] = [Role::Plant, Role::Perception, Role::Controller];

    /// The changes of this cycle, at most one a role.
    pub(super) fn update(
        &mut self,
        now: Stamp,
        roles: &[RoleHealth; 4],
        recovery_max: Duration,
    ) -> impl Iterator<Item = RoleNews> + use<> {
        let mut news = [None; 3];
        for (slot, role) in news.iter_mut().zip(Self::WATCHED) {
            let index = role as usize;
            *slot = match (roles[index], self.lost[index]) {
                (RoleHealth::Lost { fault }, None) => {
                    self.lost[index] = Some((now, fault));
                    Some(RoleNews::Lost(role, fault))
                }
                (RoleHealth::Up, Some((since, _))) => {
                    self.lost[index] = None;
                    Some(RoleNews::Back(role, since.age_at(now)))
                }
                (_, Some((since, fault))) if since.age_at(now) > recovery_max => Some(RoleNews::Overdue(role, fault)),
                _ => None,
            };
        }
        news.into_iter().flatten()
    }

    /// Whether all roles are up.
    pub(super) fn all_up(roles: &[RoleHealth; 4]) -> bool {
        Self::WATCHED.iter().all(|role| roles[*role as usize] == RoleHealth::Up)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tandem_msg::Code;

    const POLICY: StopPolicy =
        StopPolicy { reset_after: Duration::from_secs(1), resets_max: 2, patience: Duration::from_secs(60) };

    fn status(stop: StopState, cause: StopCause, separation: f64) -> MotionStatus {
        MotionStatus {
            stop: Code::of(stop),
            cause: Code::of(cause),
            category: Code::of(StopCategory::Two),
            separation,
            separation_required: 0.5,
            ..MotionStatus::default()
        }
    }

    fn at(seconds: f64) -> Stamp {
        Stamp((seconds * 1e9) as u64)
    }

    /// Every cause is either reset by rule after it has been gone for a second, or a person looks.
    #[test]
    fn every_cause_ends_in_a_reset_or_a_question() {
        use tandem_msg::Coded;
        for &cause in StopCause::ALL.iter().filter(|cause| **cause != StopCause::None) {
            let mut watch = StopWatch::default();
            let stopped = status(StopState::Stopped, cause, 1.0);
            let category = StopCategory::Two;
            assert_eq!(watch.update(at(0.0), &stopped, &POLICY), StopNews::Began { cause, category });
            assert_eq!(watch.update(at(0.01), &stopped, &POLICY), StopNews::Quiet);
            let expected = if resets_by_rule(cause) { StopNews::Reset } else { StopNews::Ask };
            assert_eq!(watch.update(at(1.02), &stopped, &POLICY), expected, "{cause}");
            let running = status(StopState::Running, StopCause::None, 1.0);
            let after = Duration::from_millis(1500);
            assert_eq!(watch.update(at(1.5), &running, &POLICY), StopNews::Ended { cause, after });
        }
    }

    #[test]
    fn a_person_who_stays_near_is_waited_for_and_then_asked() {
        let mut watch = StopWatch::default();
        let near = status(StopState::Stopped, StopCause::Separation, 0.3);
        watch.update(at(0.0), &near, &POLICY);
        assert_eq!(watch.update(at(30.0), &near, &POLICY), StopNews::Quiet);
        assert_eq!(watch.update(at(60.5), &near, &POLICY), StopNews::Ask);
        assert_eq!(watch.update(at(61.0), &near, &POLICY), StopNews::Quiet, "asked once");
    }

    #[test]
    fn resets_by_rule_are_counted() {
        let mut watch = StopWatch::default();
        let stopped = status(StopState::Stopped, StopCause::ArmStale, 1.0);
        watch.update(at(0.0), &stopped, &POLICY);
        let news: Vec<_> = (1..800).map(|k| watch.update(at(f64::from(k) * 0.01), &stopped, &POLICY)).collect();
        assert_eq!(news.iter().filter(|news| **news == StopNews::Reset).count(), 2);
        assert_eq!(news.iter().filter(|news| **news == StopNews::Ask).count(), 1);
    }

    #[test]
    fn an_arm_that_was_never_started_is_not_stopped() {
        let mut watch = StopWatch::default();
        assert_eq!(watch.update(at(0.0), &status(StopState::Stopped, StopCause::None, 1.0), &POLICY), StopNews::Quiet);
    }

    #[test]
    fn a_lost_role_is_told_once_and_then_back_or_overdue() {
        let mut watch = RoleWatch::default();
        let mut roles = [RoleHealth::Up; 4];
        let limit = Duration::from_secs(10);
        assert!(watch.update(at(0.0), &roles, limit).next().is_none());
        roles[Role::Controller as usize] = RoleHealth::Lost { fault: RoleFault::Killed };
        let lost: Vec<_> = watch.update(at(1.0), &roles, limit).collect();
        assert_eq!(lost, [RoleNews::Lost(Role::Controller, RoleFault::Killed)]);
        roles[Role::Controller as usize] = RoleHealth::Starting;
        assert!(watch.update(at(2.0), &roles, limit).next().is_none());
        assert!(!RoleWatch::all_up(&roles));
        let mut other = watch;
        roles[Role::Controller as usize] = RoleHealth::Up;
        let back: Vec<_> = watch.update(at(3.0), &roles, limit).collect();
        assert_eq!(back, [RoleNews::Back(Role::Controller, Duration::from_secs(2))]);
        roles[Role::Controller as usize] = RoleHealth::Starting;
        let overdue: Vec<_> = other.update(at(11.5), &roles, limit).collect();
        assert_eq!(overdue, [RoleNews::Overdue(Role::Controller, RoleFault::Killed)]);
    }
}
