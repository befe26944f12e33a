//! Starts the role processes, sees them end, and starts them anew.
//!
//! One thread, which waits on a pidfd of every child, so that a death is noticed
//! when it happens and never in the supervisor's cycle. Between deaths it takes the
//! pulse of the realtime loops: one that is stopped or spins without a cycle is
//! killed within ten of its periods. The successor is started before the dead one's
//! place on the bus is cleaned up: there is room for both.
//!
//! **Invariant:** a role process never outlives this thread: the kernel kills it
//! when the thread that started it ends (`PR_SET_PDEATHSIG`), whatever the reason.
//! **Invariant:** restarts are bounded: [`RESTARTS_MAX`] in a row, each after a
//! longer pause. The plant is not restarted: it stands for hardware, whose state
//! a new process would not have.

use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::process::ExitStatusExt;
use std::process::{Child, ExitStatus};
use std::sync::{Arc, mpsc};
use std::time::{Duration, Instant};

use rustix::event::{EventfdFlags, PollFd, PollFlags, Timespec, eventfd, poll};
use rustix::process::{Pid, PidfdFlags, Signal, pidfd_open, pidfd_send_signal};
use tandem_bus::Instance;
use tandem_cycle::stats::Reader;
use tandem_msg::{Coded, Role};

use super::child::CHILDREN;
use super::health::Loss;
use super::pulse::Pulse;
use super::spawn::{LastWords, Plan, spawn};
use super::statistics;

/// Restarts in a row before a role is given up.
const RESTARTS_MAX: u32 = 5;
/// Pause before the second restart in a row; doubled for each further one. The first is immediate.
const PAUSE: Duration = Duration::from_millis(100);
/// A process that has lived this long starts the count anew.
const HEALTHY: Duration = Duration::from_secs(30);
/// How long another cleaner on the bus is waited for.
const CLEANING: Duration = Duration::from_millis(500);
/// Between asking a process to end and killing it.
const GRACE: Duration = Duration::from_secs(2);

/// Between two looks at the heartbeats; no more than that is added to the silence of a loop.
const BEAT: Duration = Duration::from_millis(1);

/// Exit code of a process that refuses its configuration; see [`super::LiveError::exit_code`].
const CONFIG_REFUSED: i32 = 3;

/// What the warden tells the supervisor.
#[derive(Debug)]
pub(super) enum Report {
    /// A role's process was started as that incarnation.
    Started {
        /// The role.
        role: Role,
        /// The incarnation.
        epoch: u64,
    },
    /// A role's process has ended.
    Lost {
        /// The role.
        role: Role,
        /// How.
        loss: Loss,
        /// The last it wrote to standard error.
        last_words: String,
    },
    /// A role will not be started again.
    GivenUp {
        /// The role.
        role: Role,
    },
}

enum Order {
    Kill(Role),
    Shutdown,
}

/// The other end of the warden.
pub(super) struct Orders {
    sender: mpsc::Sender<Order>,
    wake: Arc<OwnedFd>,
}

impl Orders {
    /// Kills a role's process, which then counts as lost.
    pub(super) fn kill(&self, role: Role) {
        self.give(Order::Kill(role));
    }

    /// Asks all processes to end, kills those that do not, and ends the warden.
    pub(super) fn shutdown(&self) {
        self.give(Order::Shutdown);
    }

    fn give(&self, order: Order) {
        // A warden that has ended has nobody left to kill.
        let _ = self.sender.send(order);
        let _ = rustix::io::write(&self.wake, &1_u64.to_ne_bytes());
    }
}

/// One role's process, or its successor to be.
struct Place {
    role: Role,
    running: Option<Running>,
    epoch: u64,
    /// Restarts in a row.
    restarts: u32,
    start_at: Option<Instant>,
    /// Period of its loop, when it is realtime.
    beat: Option<Duration>,
}

struct Running {
    child: Child,
    pidfd: OwnedFd,
    words: LastWords,
    since: Instant,
    /// Where it counts its cycles, once it does.
    statistics: Option<Reader>,
    pulse: Option<Pulse>,
    /// It was killed for its silence.
    silent: bool,
}

/// Owns the role processes of one cell.
pub(super) struct Warden {
    plan: Plan,
    instance: Instance,
    places: [Place; 3],
    orders: mpsc::Receiver<Order>,
    wake: Arc<OwnedFd>,
    reports: mpsc::Sender<Report>,
    /// Set once the end was ordered: when patience ends.
    ending: Option<Instant>,
}

impl Warden {
    /// A warden that starts every role once it runs.
    pub(super) fn new(
        plan: Plan,
        instance: Instance,
        reports: mpsc::Sender<Report>,
    ) -> Result<(Self, Orders), std::io::Error> {
        let wake = Arc::new(eventfd(0, EventfdFlags::CLOEXEC | EventfdFlags::NONBLOCK)?);
        let (sender, orders) = mpsc::channel();
        let place = |(role, beat)| {
            let start_at = Some(Instant::now());
            Place { role, running: None, epoch: 0, restarts: 0, start_at, beat }
        };
        let mut beats = plan.beats.into_iter();
        let places = CHILDREN.map(|role| place((role, beats.next().flatten())));
        let told = Orders { sender, wake: Arc::clone(&wake) };
        Ok((Self { plan, instance, places, orders, wake, reports, ending: None }, told))
    }

    /// Watches until the end is ordered and every process has ended.
    pub(super) fn run(mut self) {
        loop {
            self.start_due();
            self.wait();
            self.obey();
            self.reap();
            self.take_pulses();
            if let Some(patience_ends) = self.ending {
                if self.places.iter().all(|place| place.running.is_none()) {
                    return;
                }
                if Instant::now() >= patience_ends {
                    self.places.iter().for_each(|place| place.signal(Signal::KILL));
                }
            }
        }
    }

    fn start_due(&mut self) {
        let now = Instant::now();
        for place in self.places.iter_mut().filter(|place| place.start_at.is_some_and(|at| at <= now)) {
            place.start_at = None;
            place.epoch += 1;
            let role = place.role;
            match spawn(&self.plan, role, place.epoch).and_then(|(child, words)| Running::new(child, words, place.beat))
            {
                Ok(running) => {
                    place.running = Some(running);
                    let _ = self.reports.send(Report::Started { role, epoch: place.epoch });
                }
                Err(cause) => {
                    let last_words = format!("its process could not be started: {cause}");
                    let _ = self.reports.send(Report::Lost { role, loss: Loss::NeverReady, last_words });
                    let _ = self.reports.send(Report::GivenUp { role });
                }
            }
        }
    }

    /// Until a process ends, an order comes or a start is due.
    fn wait(&self) {
        let beating =
            self.places.iter().any(|place| place.running.as_ref().is_some_and(|running| running.pulse.is_some()));
        let beat = beating.then(|| Instant::now() + BEAT);
        let due = self.places.iter().filter_map(|place| place.start_at).chain(self.ending).chain(beat).min();
        // Once patience has ended the killed are waited for, without spinning.
        let left = due.map(|at| at.saturating_duration_since(Instant::now()).max(Duration::from_millis(1)));
        let timeout =
            left.map(|left| Timespec { tv_sec: left.as_secs() as i64, tv_nsec: i64::from(left.subsec_nanos()) });
        let mut fds = vec![PollFd::from_borrowed_fd(self.wake.as_fd(), PollFlags::IN)];
        let running = self.places.iter().filter_map(|place| place.running.as_ref());
        fds.extend(running.map(|running| PollFd::from_borrowed_fd(running.pidfd.as_fd(), PollFlags::IN)));
        // Interrupted or not, everything is looked at again.
        let _ = poll(&mut fds, timeout.as_ref());
        let _ = rustix::io::read(&*self.wake, &mut [0_u8; 8]);
    }

    fn obey(&mut self) {
        while let Ok(order) = self.orders.try_recv() {
            match order {
                Order::Kill(role) => {
                    self.places.iter().filter(|place| place.role == role).for_each(|place| place.signal(Signal::KILL));
                }
                Order::Shutdown if self.ending.is_none() => {
                    self.ending = Some(Instant::now() + GRACE);
                    for place in &mut self.places {
                        place.start_at = None;
                        place.signal(Signal::TERM);
                        // One that was stopped could not obey.
                        place.signal(Signal::CONT);
                    }
                }
                Order::Shutdown => {}
            }
        }
    }

    /// Kills the realtime loops that are stopped or spin.
    fn take_pulses(&mut self) {
        if self.ending.is_some() {
            return;
        }
        let now = Instant::now();
        for place in &mut self.places {
            let Some(running) = &mut place.running else { continue };
            let Some(pulse) = &mut running.pulse else { continue };
            if running.statistics.is_none() {
                running.statistics = Reader::open(&statistics::file(&self.instance, place.role)).ok();
            }
            let Some(statistics) = &running.statistics else { continue };
            if !running.silent && pulse.is_lost(statistics, place.epoch, running.child.id(), now) {
                running.silent = true;
                place.signal(Signal::KILL);
            }
        }
    }

    fn reap(&mut self) {
        for index in 0..self.places.len() {
            let Some((status, dead)) = self.places[index].take_ended() else { continue };
            let role = self.places[index].role;
            if self.ending.is_some() {
                continue;
            }
            let loss = if dead.silent { Loss::Silent } else { loss_of(status) };
            let _ = self.reports.send(Report::Lost { role, loss, last_words: dead.words.read() });
            let place = &mut self.places[index];
            // A file or setting that was refused will be refused again.
            let refused = loss == Loss::Exited { code: CONFIG_REFUSED };
            if role == Role::Plant || refused || place.restarts >= RESTARTS_MAX {
                let _ = self.reports.send(Report::GivenUp { role });
            } else {
                place.start_at = Some(Instant::now() + pause(place.restarts));
                place.restarts += 1;
            }
            self.start_due();
            self.instance.clean_dead(CLEANING);
        }
    }
}

impl Place {
    fn signal(&self, signal: Signal) {
        if let Some(running) = &self.running {
            // It may have ended in the meantime.
            let _ = pidfd_send_signal(&running.pidfd, signal);
        }
    }

    /// The process, if it has ended.
    fn take_ended(&mut self) -> Option<(ExitStatus, Running)> {
        let running = self.running.as_mut()?;
        let status = running.child.try_wait().ok().flatten()?;
        let running = self.running.take()?;
        if running.since.elapsed() >= HEALTHY {
            self.restarts = 0;
        }
        Some((status, running))
    }
}

impl Running {
    fn new(mut child: Child, words: LastWords, beat: Option<Duration>) -> std::io::Result<Self> {
        let pid = Pid::from_child(&child);
        match pidfd_open(pid, PidfdFlags::empty()) {
            Ok(pidfd) => {
                let since = Instant::now();
                let pulse = beat.map(|period| Pulse::new(period, since));
                Ok(Self { child, pidfd, words, since, statistics: None, pulse, silent: false })
            }
            Err(cause) => {
                child.kill()?;
                child.wait()?;
                Err(cause.into())
            }
        }
    }
}

/// Pause before the restart after so many in a row.
fn pause(restarts: u32) -> Duration {
    match restarts {
        0 => Duration::ZERO,
        more => PAUSE * 2_u32.pow(more.min(RESTARTS_MAX) - 1),
    }
}

fn loss_of(status: ExitStatus) -> Loss {
    match (status.signal(), status.code()) {
        (Some(signal), _) => Loss::Killed { signal },
        (None, code) => Loss::Exited { code: code.unwrap_or(-1) },
    }
}

/// The word for a loss, for people.
pub(super) fn describe(role: Role, loss: Loss) -> String {
    let role = role.name();
    match loss {
        Loss::Killed { signal } => format!("{role} was killed by signal {signal}"),
        Loss::Exited { code } => format!("{role} ended by itself with exit code {code}"),
        Loss::Silent => format!("{role} fell silent and was killed"),
        Loss::NeverReady => format!("{role} did not become ready and was killed"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_restart_is_immediate_and_pauses_double() {
        let pauses: Vec<_> = (0..5).map(|restarts| pause(restarts).as_millis()).collect();
        assert_eq!(pauses, [0, 100, 200, 400, 800]);
    }

    #[test]
    fn a_death_is_told_as_it_was() {
        assert_eq!(loss_of(ExitStatus::from_raw(9)), Loss::Killed { signal: 9 });
        assert_eq!(loss_of(ExitStatus::from_raw(3 << 8)), Loss::Exited { code: 3 });
        assert_eq!(describe(Role::Plant, Loss::Killed { signal: 9 }), "plant was killed by signal 9");
    }
}
