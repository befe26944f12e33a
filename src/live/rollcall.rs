//! Who is there: what the warden reports and what is heard, brought together once a cycle.

use std::sync::mpsc;
use std::time::Duration;

use tandem_config::Cell;
use tandem_msg::{Coded, Header, Role, Stamp};

use super::LiveError;
use super::child::CHILDREN;
use super::health::{Health, Loss, Patience, State};
use super::warden::{Orders, Report, describe};
use crate::supervisor::{RoleFault, RoleHealth};

/// Until a role's process has read its files and models and speaks.
const STARTING: Duration = Duration::from_secs(60);
/// Between two values of a role on a millisecond grid.
const SILENCE: Duration = Duration::from_millis(250);
/// Between two values of perception, which thinks while it is silent.
const SILENCE_PERCEPTION: Duration = Duration::from_secs(5);
/// The same for a role on a slow grid, in its periods.
const SILENCE_PERIODS: u32 = 10;

/// The other roles as the supervisor's thread sees them, in the order of [`CHILDREN`].
pub(super) struct RollCall {
    health: [Health; 3],
    /// All have been up at once.
    ready: bool,
    restarts: u32,
    /// What was said at the last loss.
    last_words: String,
    /// A role that will not come back, and when that was heard.
    gone: Option<(Role, Stamp)>,
}

impl RollCall {
    /// Nobody is there yet.
    pub(super) fn new(cell: &Cell) -> Self {
        let period = cell.timing.of(Role::Supervisor).period;
        let health = CHILDREN.map(|role| {
            let silence = if role == Role::Perception { SILENCE_PERCEPTION } else { SILENCE };
            let silence = silence.max(cell.timing.of(role).period * SILENCE_PERIODS);
            Health::new(Patience::new(silence, STARTING, period))
        });
        Self { health, ready: false, restarts: 0, last_words: String::new(), gone: None }
    }

    /// One cycle: takes in what the warden reports and whether the roles' streams
    /// have moved; has those killed that were found silent.
    pub(super) fn call(&mut self, now: Stamp, reports: &mpsc::Receiver<Report>, heard: &[Header; 3], orders: &Orders) {
        for report in reports.try_iter() {
            let lost = matches!(report, Report::Lost { .. });
            self.note(now, report);
            if lost {
                // Its successor may have been started already: the loss is to be seen for a cycle first.
                break;
            }
        }
        for ((role, health), pulse) in CHILDREN.into_iter().zip(&mut self.health).zip(heard) {
            if health.observe(pulse).is_some() {
                orders.kill(role);
            }
        }
        self.ready |= self.health.iter().all(|health| health.state() == State::Up);
    }

    fn note(&mut self, now: Stamp, report: Report) {
        match report {
            Report::Started { role, epoch } => {
                self.restarts += u32::from(epoch > 1);
                self.of(role).started(epoch);
            }
            Report::Lost { role, loss, last_words } => {
                self.of(role).lost(loss);
                self.last_words = last_words;
            }
            Report::GivenUp { role } => {
                self.gone.get_or_insert((role, now));
            }
        }
    }

    fn of(&mut self, role: Role) -> &mut Health {
        let index = CHILDREN.iter().position(|child| *child == role).expect("the warden knows only children");
        &mut self.health[index]
    }

    /// The error of a cell that never came up, if that is what happened.
    pub(super) fn failed_to_start(&self) -> Option<LiveError> {
        if self.ready {
            return None;
        }
        CHILDREN.into_iter().zip(&self.health).find_map(|(role, health)| match health.state() {
            State::Lost(loss) => {
                Some(LiveError::NotReady { what: describe(role, loss), last_words: self.last_words.clone() })
            }
            State::Starting | State::Up => None,
        })
    }

    /// A role that will not come back: its name, what happened, since when that is known.
    pub(super) fn gone(&self) -> Option<(&'static str, String, Stamp)> {
        let (role, since) = self.gone?;
        let index = CHILDREN.iter().position(|child| *child == role)?;
        match self.health[index].state() {
            State::Lost(loss) => Some((role.name(), describe(role, loss), since)),
            State::Starting | State::Up => None,
        }
    }

    /// Health of each role by its code, as the supervisor role wants it.
    pub(super) fn surroundings(&self) -> [RoleHealth; 4] {
        let mut roles = [RoleHealth::Up; 4];
        for (role, health) in CHILDREN.into_iter().zip(&self.health) {
            roles[role as usize] = match health.state() {
                State::Starting => RoleHealth::Starting,
                State::Up => RoleHealth::Up,
                State::Lost(loss) => RoleHealth::Lost { fault: fault(loss) },
            };
        }
        roles
    }

    /// Processes that were started anew.
    pub(super) fn restarts(&self) -> u32 {
        self.restarts
    }
}

/// The supervisor role's word for a loss.
fn fault(loss: Loss) -> RoleFault {
    match loss {
        Loss::Killed { .. } => RoleFault::Killed,
        Loss::Exited { .. } => RoleFault::Exited,
        Loss::Silent => RoleFault::Silent,
        Loss::NeverReady => RoleFault::Unstartable,
    }
}
