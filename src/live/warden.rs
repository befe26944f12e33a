//! Starts the role processes, sees them end, and has others take their places.
//!
//! One thread, which waits on a pidfd of every child, so that a death is noticed
//! when it happens and never in the supervisor's cycle. Between deaths it takes the
//! pulse of the realtime loops: one that is stopped or spins without a cycle is
//! killed within ten of its periods.
//!
//! ```text
//! spawned ──reads, builds, connects──▶ spare ──its turn──▶ running ──▶ dead
//!                                        ▲                              │ the spare's turn comes at once;
//!                                        └───────── another one ◀───────┘ then the dead one's place is cleaned up
//! ```
//! What takes a new process its time has been done when it is needed; one whose turn
//! comes before that goes on as soon as it can. The bus has room for a process and its spare.
//!
//! **Invariant:** a role process never outlives this thread: the kernel kills it
//! when the thread that started it ends (`PR_SET_PDEATHSIG`), whatever the reason.
//! **Invariant:** restarts are bounded: [`RESTARTS_MAX`] in a row, each after a
//! longer pause. The plant is not restarted: it stands for hardware, whose state
//! a new process would not have.

use std::io::Write as _;
use std::os::fd::{AsFd, OwnedFd};
use std::os::unix::process::ExitStatusExt;
use std::process::{Child, ChildStdin, ExitStatus};
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
/// From a turn until the next spare is started: the processors are not taken from who has just begun.
const SPARE_AFTER: Duration = Duration::from_millis(200);
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

/// One role's process, and its successor.
struct Place {
    role: Role,
    running: Option<Running>,
    /// Waits for its turn.
    spare: Option<Running>,
    /// Of the process started last.
    epoch: u64,
    /// Restarts in a row.
    restarts: u32,
    /// Spares that ended before their turn.
    spares_lost: u32,
    start_at: Option<Instant>,
    spare_at: Option<Instant>,
    /// Period of its loop, when it is realtime.
    beat: Option<Duration>,
}

struct Running {
    child: Child,
    epoch: u64,
    /// Where its turn is told; it ends when this is closed before.
    turn: Option<ChildStdin>,
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
            let (running, spare, spare_at) = (None, None, None);
            Place { role, running, spare, epoch: 0, restarts: 0, spares_lost: 0, start_at, spare_at, beat }
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
                if self.places.iter().all(|place| place.processes().next().is_none()) {
                    return;
                }
                if Instant::now() >= patience_ends {
                    self.places.iter().flat_map(Place::processes).for_each(|process| process.signal(Signal::KILL));
                }
            }
        }
    }

    fn start_due(&mut self) {
        let now = Instant::now();
        let due = |at: Option<Instant>| at.is_some_and(|at| at <= now);
        for place in &mut self.places {
            if due(place.start_at) {
                let role = place.role;
                // Without a supervisor nobody needs to know.
                let _ = match place.replace(&self.plan) {
                    Ok(epoch) => self.reports.send(Report::Started { role, epoch }),
                    Err(cause) => {
                        let last_words = format!("its process could not be started: {cause}");
                        let _ = self.reports.send(Report::Lost { role, loss: Loss::NeverReady, last_words });
                        self.reports.send(Report::GivenUp { role })
                    }
                };
            }
            if due(place.spare_at) {
                place.spare_at = None;
                match place.spawn(&self.plan) {
                    Ok(spare) => place.spare = Some(spare),
                    Err(_) => place.spare_lost(),
                }
            }
        }
    }

    /// Until a process ends, an order comes or a start is due.
    fn wait(&self) {
        let beating =
            self.places.iter().any(|place| place.running.as_ref().is_some_and(|running| running.pulse.is_some()));
        let beat = beating.then(|| Instant::now() + BEAT);
        let starts = self.places.iter().flat_map(|place| [place.start_at, place.spare_at]).flatten();
        let due = starts.chain(self.ending).chain(beat).min();
        // Once patience has ended the killed are waited for, without spinning.
        let left = due.map(|at| at.saturating_duration_since(Instant::now()).max(Duration::from_millis(1)));
        let timeout =
            left.map(|left| Timespec { tv_sec: left.as_secs() as i64, tv_nsec: i64::from(left.subsec_nanos()) });
        let mut fds = vec![PollFd::from_borrowed_fd(self.wake.as_fd(), PollFlags::IN)];
        let processes = self.places.iter().flat_map(Place::processes);
        fds.extend(processes.map(|running| PollFd::from_borrowed_fd(running.pidfd.as_fd(), PollFlags::IN)));
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
                        (place.start_at, place.spare_at) = (None, None);
                        // A spare ends when its turn can not come any more.
                        place.spare.iter_mut().for_each(|spare| spare.turn = None);
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
            if !running.silent && pulse.is_lost(statistics, running.epoch, running.child.id(), now) {
                running.silent = true;
                place.signal(Signal::KILL);
            }
        }
    }

    fn reap(&mut self) {
        let mut ended = false;
        for place in &mut self.places {
            if take_ended(&mut place.spare).is_some() && self.ending.is_none() {
                place.spare_lost();
                ended = true;
            }
            let Some((status, dead)) = take_ended(&mut place.running) else { continue };
            ended = true;
            if self.ending.is_some() {
                continue;
            }
            if dead.since.elapsed() >= HEALTHY {
                place.restarts = 0;
            }
            let loss = if dead.silent { Loss::Silent } else { loss_of(status) };
            // A file or setting that was refused will be refused again.
            let refused = loss == Loss::Exited { code: CONFIG_REFUSED };
            let role = place.role;
            let given_up = role == Role::Plant || refused || place.restarts >= RESTARTS_MAX;
            // The successor first; what there is to tell is told after.
            let started = if given_up {
                None
            } else {
                place.start_at = Some(Instant::now() + pause(place.restarts));
                place.restarts += 1;
                if place.restarts == 1 && place.spare.is_some() { place.replace(&self.plan).ok() } else { None }
            };
            let _ = self.reports.send(Report::Lost { role, loss, last_words: dead.words.read() });
            if let Some(epoch) = started {
                let _ = self.reports.send(Report::Started { role, epoch });
            }
            if given_up {
                let _ = self.reports.send(Report::GivenUp { role });
            }
        }
        if ended && self.ending.is_none() {
            self.start_due();
            self.instance.clean_dead(CLEANING);
        }
    }
}

impl Place {
    /// Its processes: the one that runs and the spare.
    fn processes(&self) -> impl Iterator<Item = &Running> {
        self.running.iter().chain(&self.spare)
    }

    fn signal(&self, signal: Signal) {
        self.running.iter().for_each(|process| process.signal(signal));
    }

    /// The turn of the spare, or, without one, of a process that is started now. Its incarnation.
    fn replace(&mut self, plan: &Plan) -> std::io::Result<u64> {
        self.start_at = None;
        let mut next = match self.spare.take() {
            Some(spare) => spare,
            None => self.spawn(plan)?,
        };
        if let Some(mut turn) = next.turn.take() {
            // One that has just ended is found to have.
            let _ = turn.write_all(&[1]);
        }
        next.since = Instant::now();
        let epoch = next.epoch;
        self.running = Some(next);
        // The plant is not replaced.
        self.spare_at = (self.role != Role::Plant).then(|| Instant::now() + SPARE_AFTER);
        Ok(epoch)
    }

    fn spawn(&mut self, plan: &Plan) -> std::io::Result<Running> {
        self.epoch += 1;
        let (child, words) = spawn(plan, self.role, self.epoch)?;
        Running::new(child, self.epoch, words, self.beat)
    }

    /// A spare ended before its turn, or could not be started: another one, unless too many have.
    fn spare_lost(&mut self) {
        self.spares_lost += 1;
        self.spare_at = (self.spares_lost <= RESTARTS_MAX).then(|| Instant::now() + pause(self.spares_lost));
    }
}

/// The process of that place, if it has ended.
fn take_ended(place: &mut Option<Running>) -> Option<(ExitStatus, Running)> {
    let status = place.as_mut()?.child.try_wait().ok().flatten()?;
    Some((status, place.take()?))
}

impl Running {
    fn signal(&self, signal: Signal) {
        // It may have ended in the meantime.
        let _ = pidfd_send_signal(&self.pidfd, signal);
    }

    fn new(mut child: Child, epoch: u64, words: LastWords, beat: Option<Duration>) -> std::io::Result<Self> {
        let turn = child.stdin.take();
        let pid = Pid::from_child(&child);
        match pidfd_open(pid, PidfdFlags::empty()) {
            Ok(pidfd) => {
                let since = Instant::now();
                let pulse = beat.map(|period| Pulse::new(period, since));
                Ok(Self { child, epoch, turn, pidfd, words, since, statistics: None, pulse, silent: false })
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
