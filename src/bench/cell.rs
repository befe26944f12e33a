//! A live cell that is measured: started as a user would, in a scratch folder, and asked to end afterwards.

#![allow(unsafe_code)]

use std::fs;
use std::io::{BufRead as _, BufReader};
use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use hdrhistogram::Histogram;
use rustix::process::{Pid, Signal, kill_process, set_parent_process_death_signal};
use serde_json::Value;
use tandem_bus::{Identity, Node};
use tandem_config::Cell;
use tandem_cycle::stats::{Reader, Snapshot};
use tandem_msg::{Coded as _, Role};

use super::BenchError;
use super::series::histogram;
use crate::live::{RunningCell, SPARE, running_cells};

/// A cell that has not come so far by then has failed.
const PATIENCE: Duration = Duration::from_secs(60);
/// More boxes than any bench waits for.
const BOXES: &str = "1000";
/// Of perception and controller.
const SPARES: usize = 2;
/// Between two looks at the processes.
const LOOK: Duration = Duration::from_millis(2);
const JOINING: Duration = Duration::from_secs(5);

/// A cell that runs.
pub(super) struct LiveCell {
    child: Child,
    events: Receiver<Value>,
    seat: Seat,
    _scratch: Scratch,
}

/// Where a running cell is found; any thread may have one.
#[derive(Clone)]
pub(super) struct Seat {
    running: RunningCell,
    config_hash: u64,
}

/// A folder of this process, gone with its value.
pub(super) struct Scratch(PathBuf);

impl Scratch {
    pub(super) fn new() -> Result<Self, BenchError> {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let count = COUNT.fetch_add(1, Ordering::Relaxed);
        let folder = std::env::temp_dir().join(format!("tandem-bench-{}-{count}", std::process::id()));
        fs::create_dir_all(&folder).map_err(BenchError::io(folder.display().to_string()))?;
        Ok(Self(folder))
    }

    pub(super) fn path(&self) -> &Path {
        &self.0
    }

    /// A copy of a cell file in which the controller has another period; what lies beside the file is named by its
    /// whole path.
    ///
    /// # Errors
    /// The file cannot be read or the copy not be written.
    pub(super) fn cell_at(&self, file: &Path, period: Duration) -> Result<PathBuf, BenchError> {
        let failed = || BenchError::io(file.display().to_string());
        let folder = file.canonicalize().map_err(failed())?;
        let folder = folder.parent().unwrap_or(Path::new("/"));
        let text = fs::read_to_string(file).map_err(failed())?;
        let mut cell: toml::Table =
            text.parse().map_err(|cause| BenchError::Refused(format!("{}: {cause}", file.display())))?;
        cell.iter_mut().for_each(|(_, value)| name_wholly(value, folder));
        let controller = cell.get_mut("timing").and_then(|timing| timing.get_mut(Role::Controller.name()));
        if let Some(schedule) = controller.and_then(toml::Value::as_table_mut) {
            let period = i64::try_from(period.as_micros()).unwrap_or(i64::MAX);
            schedule.insert("period_us".to_owned(), period.into());
        }
        let copy = self.0.join(file.file_name().unwrap_or_default());
        fs::write(&copy, cell.to_string()).map_err(BenchError::io(copy.display().to_string()))?;
        Ok(copy)
    }
}

/// Puts whole paths in the place of those that lead from `folder` to something.
fn name_wholly(value: &mut toml::Value, folder: &Path) {
    match value {
        toml::Value::String(text) if text.contains('/') && folder.join(&*text).exists() => {
            *text = folder.join(&*text).display().to_string();
        }
        toml::Value::Array(values) => values.iter_mut().for_each(|value| name_wholly(value, folder)),
        toml::Value::Table(table) => table.iter_mut().for_each(|(_, value)| name_wholly(value, folder)),
        _ => {}
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // What cannot be removed lies in the temporary folder, under our name.
        let _ = fs::remove_dir_all(&self.0);
    }
}

impl LiveCell {
    /// Starts a cell and waits until its arm moves.
    ///
    /// # Errors
    /// The cell's files are refused, or it does not come up.
    pub(super) fn start(file: &Path, seed: u64) -> Result<Self, BenchError> {
        let cell = Cell::load(file, None).map_err(BenchError::Config)?;
        let scratch = Scratch::new()?;
        let store = format!("sqlite://{}", scratch.0.join("journal.db").display());
        let mut command = Command::new("/proc/self/exe");
        command.arg0("tandem").arg("run").arg(file);
        command.args(["--json", "--boxes", BOXES, "--seed", &seed.to_string(), "--store", &store]);
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null());
        // SAFETY: between fork and exec one system call is made, on plain numbers.
        unsafe {
            // Asked to end in order, when the bench is ended before it has asked itself.
            command.pre_exec(|| Ok(set_parent_process_death_signal(Some(Signal::TERM))?));
        }
        let mut child = command.spawn().map_err(BenchError::io("the live cell"))?;
        let (told, events) = channel();
        if let Some(output) = child.stdout.take() {
            std::thread::spawn(move || {
                let lines = BufReader::new(output).lines().map_while(Result::ok);
                // Ends with the cell, or when nobody listens any more.
                let _ = lines.flat_map(|line| serde_json::from_str(&line)).try_for_each(|event| told.send(event));
            });
        }
        let starting = Starting { child: Some(child), events };
        starting.wait_for("run_started")?;
        let pid = starting.pid();
        let mark = format!("-{pid}-");
        let running = running_cells().into_iter().find(|cell| cell.name().contains(&mark));
        let running = running.ok_or_else(|| BenchError::peer("the live cell", "has no run directory"))?;
        starting.wait_for("action_started")?;
        let (child, events) = starting.into_parts();
        Ok(Self { child, events, seat: Seat { running, config_hash: cell.hash }, _scratch: scratch })
    }

    /// The supervisor's process.
    pub(super) fn pid(&self) -> u32 {
        self.child.id()
    }

    /// Waits for an event of the cell.
    ///
    /// # Errors
    /// It does not come, or the cell ends before.
    pub(super) fn wait_for(&self, event: &str, wanted: impl Fn(&Value) -> bool) -> Result<Value, BenchError> {
        until(&self.events, event, |told| told["event"] == event && wanted(told))
    }

    /// Waits until every role that can be replaced has a spare that is ready.
    ///
    /// # Errors
    /// They do not come up.
    pub(super) fn wait_for_spares(&self) -> Result<(), BenchError> {
        let deadline = Instant::now() + PATIENCE;
        while spares(self.pid()) < SPARES {
            if Instant::now() > deadline {
                return Err(BenchError::peer("the live cell", format!("has no spares within {PATIENCE:?}")));
            }
            std::thread::sleep(LOOK);
        }
        Ok(())
    }

    /// Waits until it has ended by itself.
    ///
    /// # Errors
    /// It does not end.
    pub(super) fn wait_for_end(&mut self) -> Result<(), BenchError> {
        let deadline = Instant::now() + PATIENCE;
        while self.events.recv_timeout(deadline.saturating_duration_since(Instant::now())).is_ok() {}
        match self.child.try_wait() {
            Ok(None) if Instant::now() > deadline => {
                Err(BenchError::peer("the live cell", format!("has not ended within {PATIENCE:?}")))
            }
            _ => Ok(()),
        }
    }

    /// Where it is found.
    pub(super) fn seat(&self) -> &Seat {
        &self.seat
    }
}

impl Seat {
    /// Its place in the host.
    pub(super) fn running(&self) -> &RunningCell {
        &self.running
    }

    /// A place on its bus to listen from.
    pub(super) fn join(&self) -> Node {
        let identity = Identity { role: "bench".to_owned(), epoch: 1, config_hash: self.config_hash };
        Node::new(self.running.instance(), identity, JOINING)
    }

    /// The statistics of a role's loop.
    ///
    /// # Errors
    /// They cannot be read.
    pub(super) fn statistics(&self, role: Role) -> Result<Reader, BenchError> {
        let failed = |cause: &dyn std::fmt::Display| BenchError::peer(role.name(), format!("statistics: {cause}"));
        self.running.statistics(role).map_err(|cause| failed(&cause))
    }
}

impl Drop for LiveCell {
    fn drop(&mut self) {
        end(&mut self.child, &self.events);
    }
}

/// Processes of that parent which wait for their turn.
fn spares(parent: u32) -> usize {
    let entries = fs::read_dir("/proc").into_iter().flatten().flatten();
    let is_spare = |stat: String| {
        let (name, rest) = stat.split_once('(')?.1.rsplit_once(')')?;
        // State, then the parent.
        let of = rest.split_whitespace().nth(1)?.parse::<u32>().ok()?;
        Some(name == SPARE && of == parent)
    };
    // What is no process has no such file.
    let stats = entries.filter_map(|entry| fs::read_to_string(entry.path().join("stat")).ok());
    stats.filter_map(is_spare).filter(|is| *is).count()
}

/// A cell that is coming up; ended when it does not.
struct Starting {
    child: Option<Child>,
    events: Receiver<Value>,
}

impl Starting {
    fn pid(&self) -> u32 {
        self.child.as_ref().map_or(0, Child::id)
    }

    fn wait_for(&self, event: &str) -> Result<Value, BenchError> {
        until(&self.events, event, |told| told["event"] == event)
    }

    fn into_parts(mut self) -> (Child, Receiver<Value>) {
        let child = self.child.take().expect("taken once, here");
        (child, std::mem::replace(&mut self.events, channel().1))
    }
}

impl Drop for Starting {
    fn drop(&mut self) {
        if let Some(child) = &mut self.child {
            end(child, &self.events);
        }
    }
}

fn until(events: &Receiver<Value>, what: &str, mut wanted: impl FnMut(&Value) -> bool) -> Result<Value, BenchError> {
    let deadline = Instant::now() + PATIENCE;
    loop {
        match events.recv_timeout(deadline.saturating_duration_since(Instant::now())) {
            Ok(event) if wanted(&event) => return Ok(event),
            Ok(_) => {}
            Err(RecvTimeoutError::Timeout) => {
                return Err(BenchError::peer("the live cell", format!("no `{what}` within {PATIENCE:?}")));
            }
            Err(RecvTimeoutError::Disconnected) => {
                let hint = "run it by itself to see why: tandem run CELL.toml";
                return Err(BenchError::peer("the live cell", format!("has ended before `{what}`; {hint}")));
            }
        }
    }
}

/// Asks a cell to end and waits until it has.
fn end(child: &mut Child, events: &Receiver<Value>) {
    let pid = i32::try_from(child.id()).ok().and_then(Pid::from_raw);
    let asked = pid.is_some_and(|pid| kill_process(pid, Signal::TERM).is_ok());
    // It closes its output when it has ended; one that does not hangs.
    let deadline = Instant::now() + PATIENCE;
    let ended = asked
        && loop {
            match events.recv_timeout(deadline.saturating_duration_since(Instant::now())) {
                Ok(_) => {}
                Err(silence) => break silence == RecvTimeoutError::Disconnected,
            }
        };
    if !ended {
        let _ = child.kill();
    }
    let _ = child.wait();
}

/// Reads a loop's statistics, waiting out a beginning incarnation.
pub(super) fn snapshot(reader: &Reader) -> Box<Snapshot> {
    let mut snapshot = Box::<Snapshot>::default();
    while reader.read(&mut snapshot).is_err() {
        std::thread::sleep(Duration::from_millis(1));
    }
    snapshot
}

/// A loop's own histogram, as the benches compare them.
pub(super) fn converted(counted: &tandem_cycle::Histogram) -> Histogram<u64> {
    let mut converted = histogram();
    counted.buckets().for_each(|(value, count)| converted.saturating_record_n(value, count));
    converted
}
