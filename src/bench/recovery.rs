//! `kill -9` of the roles of a live cell: how soon it is known, the arm slowed, a successor in command.
//!
//! Each round starts a cell of its own, so that no restart waits for a back-off, and strikes at another point of the
//! cycle. It kills the controller, which drives the arm; stops the next one, which is a hang; kills perception, for
//! which the arm pauses; and at last the supervisor, with whom everything ends.

use std::os::fd::OwnedFd;
use std::path::Path;
use std::sync::mpsc::channel;
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, poll};
use rustix::process::{Pid, PidfdFlags, Signal, pidfd_open, pidfd_send_signal};
use rustix::time::Timespec;
use tandem_bus::{Latest, Node, Read as _};
use tandem_config::Cell;
use tandem_cycle::stats::Reader;
use tandem_cycle::{FixedRate, Grid, Monotonic};
use tandem_msg::{JointCommand, JointState, MotionTask, PlantFault, Role, RunMode, Stamp};

use super::cell::{LiveCell, snapshot};
use super::series::histogram;
use super::{BenchError, Conditions, Options, Report, Series, loops, respawn};
use crate::lockstep::build_controller;
use crate::roles::service;

const PIDFD: &str = "death seen by a bare pidfd";
const TURN: &str = "death seen by the warden, a successor's turn begun";
const OBITUARY: &str = "death told by iceoryx2's event";
const SLOWED: &str = "last good command to slowing";
const BACK: &str = "kill to the successor's first command";
const RESPAWN: &str = "bare iceoryx2 respawn, and reading the cell's files";
const FOLLOWS: &str = "kill to the arm following again";
const HANG: &str = "SIGSTOP to its end by the warden's hand";
const PAUSED: &str = "kill of perception to the arm told to pause";
const ORPHANED: &str = "kill of the supervisor to the last command";
const NAMES: [&str; 10] = [PIDFD, TURN, OBITUARY, SLOWED, BACK, RESPAWN, FOLLOWS, HANG, PAUSED, ORPHANED];
/// What does not happen by then does not come.
const PATIENCE: Duration = Duration::from_secs(10);
/// Between two looks at the bus.
const LOOK: Duration = Duration::from_micros(100);
/// After the supervisor's death nobody may speak; so long is listened for one who does.
const AFTERMATH: Duration = Duration::from_millis(200);

/// What one round found, in the order of [`NAMES`]; what could not be told is left out.
type Found = [Option<Duration>; NAMES.len()];

pub(super) fn run(options: &Options, report: &mut Report) -> Result<(), BenchError> {
    let Some(file) = &options.cell else {
        report.note("recovery is measured on a live cell, and none was named");
        return Ok(());
    };
    let config = Cell::load(file, None).map_err(BenchError::Config)?;
    // A strike is one duration of each: all of them together are the one round.
    let mut times = NAMES.map(|_| histogram());
    for round in 0..options.rounds {
        let mut found = loops::set_up(None, &mut report.conditions, || strike(file, u64::from(round) + 1))??;
        found[2] = Some(respawn::obituary()?);
        found[5] = Some(respawn::respawn()? + reading(file)?);
        for (times, time) in times.iter_mut().zip(found) {
            time.iter().for_each(|time| times.saturating_record(time.as_nanos() as u64));
        }
    }
    crate::live::sweep();
    let mut all = NAMES.map(Series::new);
    all.iter_mut().zip(times).for_each(|(series, times)| series.add(times));
    let period = config.timing.of(Role::Controller).period;
    let periods = |series: &Series| series.quantile_ns(0.5) / period.as_nanos() as f64;
    report.note(format!(
        "one strike of each kind a round; at the median the plant slowed the arm {:.1} control periods after the last good \
         command, and a stopped controller was killed after {:.1}; a command is valid for {:?}",
        periods(&all[3]),
        periods(&all[7]),
        config.controller.command_validity
    ));
    all.into_iter().for_each(|series| report.add(series));
    report.compare(TURN, Some(PIDFD));
    report.compare(TURN, Some(OBITUARY));
    report.compare(BACK, Some(RESPAWN));
    for alone in [SLOWED, FOLLOWS, HANG, PAUSED, ORPHANED] {
        report.compare(alone, None);
    }
    Ok(())
}

/// What a controller does before it joins the bus.
fn reading(file: &Path) -> Result<Duration, BenchError> {
    let began = Instant::now();
    let cell = Cell::load(file, None).map_err(BenchError::Config)?;
    build_controller(&cell).map_err(|error| BenchError::Refused(error.to_string()))?;
    Ok(began.elapsed())
}

/// A cell that is listened to.
struct Listener<'a> {
    cell: &'a LiveCell,
    controller: Reader,
    arm: Latest<JointState>,
    command: Latest<JointCommand>,
    task: Latest<MotionTask>,
    rate: FixedRate<Monotonic>,
    /// Ports live no longer than their node.
    _node: Node,
}

fn strike(file: &Path, seed: u64) -> Result<Found, BenchError> {
    let cell = LiveCell::start(file, seed)?;
    let mut listener = Listener::of(&cell)?;
    let mut found = Found::default();
    listener.settle()?;
    // Anywhere in a period: the seed spreads the strikes.
    std::thread::sleep(Duration::from_micros(seed.wrapping_mul(377) % 1_000));
    listener.kill_controller(&mut found)?;
    listener.settle()?;
    found[7] = Some(listener.stop_controller()?);
    listener.settle()?;
    found[8] = listener.kill_perception()?;
    found[9] = Some(listener.kill_supervisor()?);
    Ok(found)
}

impl<'a> Listener<'a> {
    fn of(cell: &'a LiveCell) -> Result<Self, BenchError> {
        let node = cell.seat().join();
        let grid = Grid::new(LOOK, Duration::ZERO).expect("a period a grid can have");
        Ok(Self {
            controller: cell.seat().statistics(Role::Controller)?,
            arm: node.latest(service::ARM_STATE)?,
            command: node.latest(service::ARM_COMMAND)?,
            task: node.latest(service::TASK)?,
            rate: FixedRate::new(grid, Monotonic),
            cell,
            _node: node,
        })
    }

    /// Looks again and again until `reached` answers.
    fn until<T>(
        &mut self,
        what: &str,
        mut reached: impl FnMut(&mut Self, Stamp) -> Option<T>,
    ) -> Result<T, BenchError> {
        let deadline = loops::now().after(PATIENCE);
        loop {
            let now = self.rate.wait().woken;
            if let Some(answer) = reached(self, now) {
                return Ok(answer);
            }
            if now > deadline {
                return Err(BenchError::peer("the live cell", format!("{what} did not happen within {PATIENCE:?}")));
            }
        }
    }

    /// Until the arm follows somebody and all who stand by are ready.
    fn settle(&mut self) -> Result<(), BenchError> {
        self.cell.wait_for_spares()?;
        self.until("the arm follows", |all, _| {
            (all.command.read().header.heard() && all.follows(Stamp(0))).then_some(())
        })
    }

    /// Whether the brakes are open and the arm answers to a command of after `since`.
    fn follows(&mut self, since: Stamp) -> bool {
        let state = self.arm.read();
        state.fault.is(PlantFault::None) && state.command_stamp > since && state.braking == 0.0
    }

    fn kill_controller(&mut self, found: &mut Found) -> Result<(), BenchError> {
        let process = open(snapshot(&self.controller).pid)?;
        let epoch = self.command.read().header.epoch;
        std::thread::scope(|scope| {
            // A thread of the same priority that does nothing but wait for this.
            let (ready, waits) = channel();
            let watched = &process;
            let poller = scope.spawn(move || {
                loops::set_up(None, &mut Conditions::default(), || {
                    let _ = ready.send(());
                    let mut waiting = [PollFd::new(watched, PollFlags::IN)];
                    let _ = poll(&mut waiting, Some(&Timespec { tv_sec: PATIENCE.as_secs() as i64, tv_nsec: 0 }));
                    loops::now()
                })
            });
            waits.recv().map_err(|_| BenchError::peer("the poller", "did not come up"))?;
            std::thread::sleep(LOOK);
            let killed = loops::now();
            send(&process, Signal::KILL)?;
            let (mut slowed, mut back) = (None, None);
            self.until("a successor in command", |all, now| {
                let state = all.arm.read();
                if slowed.is_none() && state.braking > 0.0 && state.fault.is(PlantFault::None) {
                    slowed = Some(state.command_stamp.age_at(state.header.stamp));
                }
                if back.is_none() && all.command.read().header.epoch > epoch {
                    back = Some(killed.age_at(now));
                }
                (back.is_some() && all.follows(killed)).then(|| found[6] = Some(killed.age_at(now)))
            })?;
            let seen = poller.join().map_err(|_| BenchError::peer("the poller", "has panicked"))??;
            found[0] = Some(killed.age_at(seen));
            found[1] = Some(killed.age_at(snapshot(&self.controller).started));
            (found[3], found[4]) = (slowed, back);
            Ok(())
        })
    }

    /// From SIGSTOP to the end of the stopped one, which only the warden can have killed.
    fn stop_controller(&mut self) -> Result<Duration, BenchError> {
        let process = open(snapshot(&self.controller).pid)?;
        let stopped = loops::now();
        send(&process, Signal::STOP)?;
        self.until("the end of the stopped controller", |_, now| {
            let mut ended = [PollFd::new(&process, PollFlags::IN)];
            (poll(&mut ended, Some(&Timespec::default())) == Ok(1)).then(|| stopped.age_at(now))
        })
    }

    /// From a kill to the supervisor's word that the arm is to pause; none when it was not told to run again before.
    fn kill_perception(&mut self) -> Result<Option<Duration>, BenchError> {
        let process = open(snapshot(&self.cell.seat().statistics(Role::Perception)?).pid)?;
        let runs = |task: &MotionTask| matches!(task.run.get(), Some(RunMode::Run | RunMode::Reduced));
        if self.until("the arm runs again", |all, _| runs(all.task.read()).then_some(())).is_err() {
            return Ok(None);
        }
        let killed = loops::now();
        send(&process, Signal::KILL)?;
        let told = self.until("a pause", |all, _| {
            let task = all.task.read();
            (!runs(task)).then_some(task.header.stamp)
        })?;
        Ok(Some(killed.age_at(told)))
    }

    /// From a kill to the last command anybody gave.
    fn kill_supervisor(&mut self) -> Result<Duration, BenchError> {
        let killed = loops::now();
        send(&open(self.cell.pid())?, Signal::KILL)?;
        let mut last = killed;
        self.until("the aftermath", |all, now| {
            last = last.max(all.command.read().header.stamp);
            (now > killed.after(AFTERMATH)).then_some(())
        })?;
        Ok(killed.age_at(last))
    }
}

fn open(pid: u32) -> Result<OwnedFd, BenchError> {
    let pid = i32::try_from(pid).ok().and_then(Pid::from_raw);
    let pid = pid.ok_or_else(|| BenchError::peer("the live cell", "has a role without a process"))?;
    pidfd_open(pid, PidfdFlags::empty()).map_err(|cause| BenchError::io("pidfd_open")(cause.into()))
}

fn send(process: &OwnedFd, signal: Signal) -> Result<(), BenchError> {
    pidfd_send_signal(process, signal).map_err(|cause| BenchError::io("kill")(cause.into()))
}
