//! The supervisor's loop: hears of its roles, runs the supervisor role, brings the run to its end.

use std::sync::mpsc;
use std::time::Duration;

use tandem_bus::{Instance, Node};
use tandem_config::Cell;
use tandem_cycle::stats::{Reader, Snapshot};
use tandem_msg::{Coded, Role, Stamp};

use super::child::join;
use super::journal::Journal;
use super::rollcall::RollCall;
use super::shell::{self, Shell};
use super::warden::{Orders, Report};
use super::{LiveError, signals, statistics};
use crate::roles::{SupervisorRole, Surroundings};
use crate::supervisor::{Event, Outcome, Summary, Supervisor};

/// A measured state older than this does not say that the arm stands.
const FRESH: Duration = Duration::from_millis(250);
/// From the wish to end until the arm stands.
const STANDING: Duration = Duration::from_secs(3);
/// From the wish to end until the journal is durable.
const SETTLING: Duration = Duration::from_secs(10);
/// From a fault nobody can mend, or a signal, until the supervisor role has ended the run by itself.
const YIELDING: Duration = Duration::from_secs(8);
/// A joint slower than this stands, rad/s: the noise of a velocity sensor.
const STANDSTILL: f64 = 0.01;

/// How a live run ended.
#[derive(Clone, Debug)]
pub struct Ended {
    /// What became of it.
    pub outcome: Outcome,
    /// Its numbers.
    pub summary: Summary,
    /// Statistics of the loops at the end.
    pub loops: Vec<Snapshot>,
    /// Role processes that had to be started anew.
    pub restarts: u32,
}

/// What the supervisor's thread works with.
pub(super) struct Watch<'a> {
    pub(super) cell: &'a Cell,
    pub(super) instance: &'a Instance,
    pub(super) reports: mpsc::Receiver<Report>,
    pub(super) orders: &'a Orders,
    pub(super) journal: Journal,
    pub(super) events: mpsc::Sender<Event>,
}

/// What has been decided about the end, and since when.
#[derive(Clone, Debug)]
struct Ending {
    outcome: Outcome,
    since: Stamp,
}

impl Watch<'_> {
    /// Runs until the end.
    pub(super) fn run(mut self, supervisor: Supervisor) -> Result<Ended, LiveError> {
        let node = join(Role::Supervisor, 1, self.cell, self.instance);
        let mut role = SupervisorRole::open(&node, supervisor)?;
        let mut roles = RollCall::new(self.cell);
        let granted = shell::set_up(self.cell, Role::Supervisor)?;
        let mut shell = Shell::new(self.cell, self.instance, Role::Supervisor, 1, &granted)?;
        let mut asked_since = None;
        let mut ending: Option<Ending> = None;
        loop {
            let mut left = None;
            shell.step(|now| {
                left = self.cycle(now, &mut role, &mut roles, &mut asked_since, &mut ending);
                role.heard()
            })?;
            if let Some(outcome) = left {
                let outcome = outcome?;
                return Ok(Ended { outcome, summary: role.summary(), loops: self.loops(), restarts: roles.restarts() });
            }
        }
    }

    /// One cycle; answers when the run is over.
    fn cycle(
        &mut self,
        now: Stamp,
        role: &mut SupervisorRole<Node>,
        roles: &mut RollCall,
        asked_since: &mut Option<Stamp>,
        ending: &mut Option<Ending>,
    ) -> Option<Result<Outcome, LiveError>> {
        let [plant, perception, controller, ..] = role.heard();
        roles.call(now, &self.reports, &[plant, perception, controller], self.orders);
        if let Some(error) = roles.failed_to_start() {
            return Some(Err(error));
        }
        if signals::asked() > 0 {
            asked_since.get_or_insert(now);
        }
        let around = Surroundings {
            roles: roles.surroundings(),
            journal_committed: self.journal.durable(),
            halt: asked_since.is_some() || ending.is_some(),
        };
        let outputs = role.cycle(now, &around);
        for event in outputs.events.drain(..) {
            // Without a listener the run goes on all the same.
            let _ = self.events.send(event);
        }
        self.journal.write(std::mem::take(&mut outputs.journal));
        if let Some(outcome) = outputs.finished.take() {
            ending.get_or_insert(Ending { outcome, since: now });
        } else if ending.is_none() {
            *ending = overdue(now, *asked_since, roles).map(|outcome| Ending { outcome, since: now });
        }
        let end = ending.as_ref()?;
        self.may_leave(now, end, role).then(|| Ok(end.outcome.clone()))
    }

    /// Statistics of the loops, as far as they can be read.
    fn loops(&self) -> Vec<Snapshot> {
        let read = |role: &Role| {
            let mut snapshot = Snapshot::default();
            let reader = Reader::open(&statistics::file(self.instance, *role)).ok()?;
            reader.read(&mut snapshot).ok().map(|()| snapshot)
        };
        Role::ALL.iter().filter_map(read).collect()
    }

    /// Whether the arm stands and the journal is durable, or they have had their time.
    fn may_leave(&self, now: Stamp, end: &Ending, role: &SupervisorRole<Node>) -> bool {
        let waited = end.since.age_at(now);
        let arm = role.arm();
        let fresh = arm.header.heard() && arm.header.stamp.age_at(now) < FRESH;
        let stands = fresh && arm.velocity.iter().all(|velocity| velocity.abs() < STANDSTILL);
        let settled = self.journal.is_settled();
        // The second signal is for those who cannot wait.
        (stands || waited >= STANDING) && (settled || waited >= SETTLING) || signals::asked() > 1
    }
}

/// The outcome the shell decides on when the supervisor role has not, in its time.
fn overdue(now: Stamp, asked_since: Option<Stamp>, roles: &RollCall) -> Option<Outcome> {
    if signals::asked() > 1 || asked_since.is_some_and(|since| since.age_at(now) > YIELDING) {
        return Some(Outcome::Interrupted);
    }
    let (role, fault, since) = roles.gone()?;
    (since.age_at(now) > YIELDING).then_some(Outcome::Fault { role, fault })
}
