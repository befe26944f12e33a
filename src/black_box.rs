//! What led to each stop, in files: the controller's record of its last seconds as JSON, one object a line.
//!
//! The first line says which stop, the others are the cycles, oldest first. The files of a run lie in a folder
//! of their own beside its journal.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, TrySendError, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use serde_json::{Value, json};
use tandem_controller::{Controller, Record, StopRecord};
use tandem_msg::Coded;

use crate::strategy::store::{StoreError, state_folder};

/// How often the thread that writes looks for something to write. It must not be woken: that would be a system call
/// of the cycle.
const LOOK: Duration = Duration::from_millis(20);

/// The folder for the files of a run: beside the SQLite database that holds its journal, else among this user's
/// state.
///
/// # Errors
/// This user has no place for state.
pub fn folder(store_url: &str, cell: &str, run: &str) -> Result<PathBuf, StoreError> {
    let file = store_url.strip_prefix("sqlite://").and_then(|rest| rest.split('?').next());
    let beside = match file.filter(|file| !file.is_empty()) {
        Some(file) => Path::new(file).with_extension(""),
        None => state_folder()?.join(cell),
    };
    let mut name = beside.file_name().unwrap_or_default().to_owned();
    name.push("-stops");
    Ok(beside.with_file_name(name).join(run))
}

/// The files in a run's folder, in order.
pub fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut files: Vec<_> = entries.map(|entry| entry.path()).collect();
    files.retain(|path| path.extension().is_some_and(|extension| extension == "jsonl"));
    files.sort();
    files
}

/// Where the stops of one controller go.
#[derive(Clone, Debug)]
pub struct Keeper {
    /// Folder of the run.
    pub folder: PathBuf,
    /// Incarnation of the controller, which counts its own stops.
    pub epoch: u64,
}

impl Keeper {
    /// Writes a stop down; what hinders it is said on standard error and hinders nothing else.
    pub fn keep(&self, stop: &StopRecord) {
        if let Err(error) = write(&self.folder, self.epoch, stop) {
            // Standard error may be closed.
            let _ = writeln!(io::stderr(), "black box: {}: {error}", self.folder.display());
        }
    }

    /// Writes down what a controller still has of its stops when a run ends.
    pub fn keep_last(&self, controller: &mut Controller) {
        while let Some(stop) = controller.last_stops() {
            self.keep(&stop);
        }
    }
}

fn write(folder: &Path, epoch: u64, stop: &StopRecord) -> io::Result<()> {
    fs::DirBuilder::new().recursive(true).mode(0o700).create(folder)?;
    let path = folder.join(format!("stop-{epoch}-{:04}.jsonl", stop.number));
    let mut file = BufWriter::new(File::create(&path)?);
    let head = json!({"stop": stop.number, "epoch": epoch, "cause": stop.cause.name(), "category": stop.category.name(),
        "began_ns": stop.began.0, "period_s": stop.period.as_secs_f64(), "joints": stop.joint_count});
    writeln!(file, "{head}")?;
    for cycle in stop.cycles() {
        writeln!(file, "{}", line(stop, cycle))?;
    }
    file.flush()
}

fn line(stop: &StopRecord, cycle: &Record) -> Value {
    let joints = |values: &[f64]| values[..stop.joint_count.min(values.len())].to_vec();
    let people = &cycle.human[..(cycle.human_count as usize).min(cycle.human.len())];
    let millimetres = |x: f32| (f64::from(x) * 1e3).round() / 1e3;
    let people: Vec<_> = people.iter().map(|ends| ends.map(|end| end.map(millimetres))).collect();
    // The clock counts nanoseconds up, so a time before the stop needs a sign.
    let since = cycle.now.0 as f64 - stop.began.0 as f64;
    json!({
        "t_s": since * 1e-9,
        "stop": cycle.stop.name(),
        "cause": cycle.cause.name(),
        "mode": cycle.mode.name(),
        "task": cycle.task_id,
        "phase": cycle.phase.name(),
        "position_rad": joints(&cycle.measured[0]),
        "velocity_rad_s": joints(&cycle.measured[1]),
        "command_rad": joints(&cycle.commanded[0]),
        "command_rad_s": joints(&cycle.commanded[1]),
        "command_rad_s2": joints(&cycle.commanded[2]),
        "speed": cycle.speed,
        "clearance_m": cycle.clearance,
        "clearance_link": cycle.clearance_pair[0],
        "clearance_object": cycle.clearance_pair[1],
        "separation_m": cycle.separation,
        "separation_required_m": cycle.separation_required,
        "separation_link": cycle.separation_pair[0],
        "separation_body_part": cycle.separation_pair[1],
        "stopping_time_s": cycle.stopping_time,
        "human_age_s": cycle.human_age,
        "human_m": people,
    })
}

/// Takes stops from a realtime loop and has them written by a thread of ordinary priority. Neither side ever waits
/// for the other.
pub struct Clerk {
    keeper: Keeper,
    to_write: SyncSender<Box<StopRecord>>,
    written: Receiver<Box<StopRecord>>,
    thread: JoinHandle<()>,
}

impl Clerk {
    /// Starts the thread.
    ///
    /// # Errors
    /// It cannot be started.
    pub fn start(keeper: Keeper) -> io::Result<Self> {
        // The controller has two records, so neither channel is ever full.
        let (to_write, stops) = sync_channel::<Box<StopRecord>>(2);
        let (back, written) = sync_channel(2);
        let own = keeper.clone();
        let work = move || {
            loop {
                match stops.try_recv() {
                    Ok(stop) => {
                        own.keep(&stop);
                        let _ = back.try_send(stop);
                    }
                    Err(TryRecvError::Empty) => thread::sleep(LOOK),
                    Err(TryRecvError::Disconnected) => return,
                }
            }
        };
        let thread = thread::Builder::new().name("black box".to_owned()).spawn(work)?;
        Ok(Self { keeper, to_write, written, thread })
    }

    /// After the last cycle: everything is written.
    pub fn finish(self, controller: &mut Controller) {
        let Self { keeper, to_write, thread, .. } = self;
        drop(to_write);
        // It does nothing that panics.
        let _ = thread.join();
        keeper.keep_last(controller);
    }

    /// After a cycle: hands over what there is to write, and takes back what is written.
    ///
    /// # Realtime
    /// Two loads where nothing is to be done. Else a box changes hands in a channel that nobody waits at: no lock, no
    /// system call, no allocation.
    pub fn serve(&self, controller: &mut Controller) {
        if let Ok(record) = self.written.try_recv() {
            controller.give_back(record);
        }
        if let Some(record) = controller.fetch_stop()
            && let Err(refused) = self.to_write.try_send(record)
        {
            // Unwritten, since the thread is gone; the next stop is recorded all the same.
            let (TrySendError::Full(record) | TrySendError::Disconnected(record)) = refused;
            controller.give_back(record);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stops_lie_beside_their_journal() {
        let at = |url: &str| folder(url, "s471", "17-a").expect("it has a place").display().to_string();
        assert_eq!(at("sqlite:///var/lib/cell.db"), "/var/lib/cell-stops/17-a");
        assert_eq!(at("sqlite:///var/lib/cell.db?mode=rwc"), "/var/lib/cell-stops/17-a");
    }
}
