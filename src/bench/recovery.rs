//! `kill -9` of the controller of a live cell: how soon it is known, the arm braked, a successor in command.
//!
//! Each round starts a cell of its own, so that no restart waits for a back-off, and kills at another point of the cycle.

use std::path::Path;
use std::time::{Duration, Instant};

use rustix::event::{PollFd, PollFlags, poll};
use rustix::process::{Pid, PidfdFlags, Signal, pidfd_open, pidfd_send_signal};
use rustix::time::Timespec;
use tandem_bus::Read as _;
use tandem_config::Cell;
use tandem_cycle::{FixedRate, Grid, Monotonic};
use tandem_msg::{Coded as _, JointCommand, JointState, PlantFault, Role, Stamp};

use super::cell::{LiveCell, snapshot};
use super::series::histogram;
use super::{BenchError, Options, Report, Series, loops, respawn};
use crate::lockstep::build_controller;
use crate::roles::service;

const PIDFD: &str = "death seen by a bare pidfd";
const OBITUARY: &str = "death told by iceoryx2's event";
const BRAKED: &str = "last good command to braking";
const BACK: &str = "kill to the successor's first command in force";
const RESPAWN: &str = "bare iceoryx2 respawn, and reading the cell's files";
/// A successor that is not in command by then does not come.
const PATIENCE: Duration = Duration::from_secs(10);
/// Between two looks at the bus.
const LOOK: Duration = Duration::from_micros(100);

/// What one kill led to.
struct Kill {
    seen: Duration,
    braked: Duration,
    back: Duration,
}

pub(super) fn run(options: &Options, report: &mut Report) -> Result<(), BenchError> {
    let Some(file) = &options.cell else {
        report.note("recovery is measured on a live cell, and none was named");
        return Ok(());
    };
    let config = Cell::load(file, None).map_err(BenchError::Config)?;
    let names = [PIDFD, OBITUARY, BRAKED, BACK, RESPAWN];
    // A kill is one duration of each: all of them together are the one round.
    let mut times = names.map(|_| histogram());
    for round in 0..options.rounds {
        let kill = loops::set_up(None, &mut report.conditions, || kill(file, u64::from(round) + 1))??;
        let obituary = respawn::obituary()?;
        let respawned = respawn::respawn()? + reading(file)?;
        for (times, time) in times.iter_mut().zip([kill.seen, obituary, kill.braked, kill.back, respawned]) {
            times.saturating_record(time.as_nanos() as u64);
        }
    }
    let mut all = names.map(Series::new);
    all.iter_mut().zip(times).for_each(|(series, times)| series.add(times));
    let periods = all[2].quantile_ns(0.5) / config.timing.of(Role::Controller).period.as_nanos() as f64;
    report.note(format!(
        "one kill a round; in its median the plant braked {periods:.1} control periods after the last good command; a command is \
         valid for {:?}",
        config.controller.command_validity
    ));
    all.into_iter().for_each(|series| report.add(series));
    report.compare(PIDFD, Some(OBITUARY));
    report.compare(BRAKED, None);
    report.compare(BACK, Some(RESPAWN));
    Ok(())
}

/// What a controller does before it joins the bus.
fn reading(file: &Path) -> Result<Duration, BenchError> {
    let began = Instant::now();
    let cell = Cell::load(file, None).map_err(BenchError::Config)?;
    build_controller(&cell).map_err(|error| BenchError::Refused(error.to_string()))?;
    Ok(began.elapsed())
}

fn kill(file: &Path, seed: u64) -> Result<Kill, BenchError> {
    let cell = LiveCell::start(file, seed)?;
    let statistics = cell.seat().statistics(Role::Controller)?;
    let node = cell.seat().join();
    let mut arm = node.latest::<JointState>(service::ARM_STATE)?;
    let mut command = node.latest::<JointCommand>(service::ARM_COMMAND)?;
    // Both are heard before anything is killed.
    let deadline = loops::now().after(PATIENCE);
    while !(arm.read().header.heard() && command.read().header.heard()) {
        in_time(deadline, "a command")?;
        std::thread::sleep(LOOK);
    }
    let killed_epoch = command.held().header.epoch;
    let pid = i32::try_from(snapshot(&statistics).pid).ok().and_then(Pid::from_raw);
    let failed = |what: &str| BenchError::io(format!("{}: {what}", Role::Controller.name()));
    let pid = pid.ok_or_else(|| BenchError::peer("the controller", "has no process"))?;
    let pidfd = pidfd_open(pid, PidfdFlags::empty()).map_err(|cause| failed("pidfd_open")(cause.into()))?;

    // Anywhere in a period: the seed spreads the kills.
    std::thread::sleep(Duration::from_micros(seed.wrapping_mul(377) % 1_000));
    let killed = loops::now();
    pidfd_send_signal(&pidfd, Signal::KILL).map_err(|cause| failed("kill")(cause.into()))?;
    let mut waiting = [PollFd::new(&pidfd, PollFlags::IN)];
    poll(&mut waiting, Some(&Timespec { tv_sec: 5, tv_nsec: 0 })).map_err(|cause| failed("poll")(cause.into()))?;
    let seen = killed.age_at(loops::now());

    let grid = Grid::new(LOOK, Duration::ZERO).expect("a period a grid can have");
    let mut rate = FixedRate::new(grid, Monotonic);
    let (mut good, mut braked, mut back) = (Stamp(0), None, None);
    while braked.is_none() || back.is_none() {
        let now = rate.wait().woken;
        in_time(deadline, "a successor in command")?;
        let state = arm.read();
        match state.fault.get() {
            Some(PlantFault::None) if braked.is_none() => good = state.command_stamp,
            Some(PlantFault::CommandExpired) => braked = braked.or(Some(good.age_at(state.header.stamp))),
            _ => {}
        }
        // In force, not only published: the brakes are open, and the state answers to a command of after the kill.
        let successor = command.read().header.epoch > killed_epoch;
        let in_force = state.fault.get() == Some(PlantFault::None) && state.command_stamp > killed;
        if successor && in_force && back.is_none() {
            back = Some(killed.age_at(now));
        }
    }
    let (Some(braked), Some(back)) = (braked, back) else { unreachable!("the loop ends with both") };
    Ok(Kill { seen, braked, back })
}

fn in_time(deadline: Stamp, what: &str) -> Result<(), BenchError> {
    if loops::now() < deadline {
        Ok(())
    } else {
        Err(BenchError::peer("the live cell", format!("no {what} within {PATIENCE:?}")))
    }
}
