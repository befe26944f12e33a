//! A live cell under test: what it says, which processes it has, what it leaves.

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;
use tempfile::TempDir;

const CELL: &str = "config/cells/s471.toml";
/// A cell that says nothing for this long hangs.
pub(crate) const PATIENCE: Duration = Duration::from_secs(90);

/// Where live cells of one test run; they come one after another.
pub(crate) struct Place {
    directory: TempDir,
    _turn: MutexGuard<'static, ()>,
}

impl Place {
    pub(crate) fn new() -> Self {
        static TURN: Mutex<()> = Mutex::new(());
        let turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
        Self { directory: TempDir::new().expect("a temporary directory"), _turn: turn }
    }

    fn path(&self) -> &Path {
        self.directory.path()
    }

    /// The journal of the cell with that seed.
    pub(crate) fn store(&self, seed: u64) -> String {
        format!("sqlite://{}/journal-{seed}.db", self.path().display())
    }

    /// The binary, in the repository's root, with this place for its run directories.
    pub(crate) fn command(&self) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_tandem"));
        command.current_dir(env!("CARGO_MANIFEST_DIR")).env("XDG_RUNTIME_DIR", self.path());
        command
    }

    /// Starts a cell.
    pub(crate) fn start(&self, seed: u64) -> LiveCell {
        let mut child = self
            .command()
            .args(["run", CELL, "--json", "--seed", &seed.to_string(), "--store", &self.store(seed)])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .expect("the binary starts");
        let (sender, lines) = channel();
        let stdout = child.stdout.take().expect("piped");
        std::thread::spawn(move || {
            for line in BufReader::new(stdout).lines().map_while(Result::ok) {
                let Ok(event) = serde_json::from_str::<Value>(&line) else { continue };
                if sender.send(event).is_err() {
                    return;
                }
            }
        });
        let mut stderr = child.stderr.take().expect("piped");
        let said = std::thread::spawn(move || {
            let mut text = String::new();
            let _ = stderr.read_to_string(&mut text);
            text
        });
        LiveCell { pid: Pid::from_child(&child), child, lines, said: Some(said), heard: Vec::new() }
    }

    /// Run directories that exist.
    pub(crate) fn run_directories(&self) -> Vec<PathBuf> {
        let entries = fs::read_dir(self.path().join("tandem")).into_iter().flatten().flatten();
        entries.map(|entry| entry.path()).collect()
    }

    /// Role processes of cells in this place, spares included, by the run directory on their command line.
    fn processes(&self) -> Vec<(Pid, String)> {
        let here = self.path().display().to_string();
        let entries = fs::read_dir("/proc").expect("readable").flatten();
        entries
            .filter_map(|entry| {
                let pid = Pid::from_raw(entry.file_name().to_str()?.parse().ok()?)?;
                let command = fs::read(entry.path().join("cmdline")).ok()?;
                let words: Vec<_> = command.split(|byte| *byte == 0).map(String::from_utf8_lossy).collect();
                let ours = words.iter().any(|word| word.starts_with(&here));
                (ours && words.get(1).is_some_and(|word| word == "role"))
                    .then(|| (pid, fs::read_to_string(entry.path().join("comm")).unwrap_or_default().trim().to_owned()))
            })
            .collect()
    }

    /// Those whose turn it is bear the name of their role: of this role, or of any.
    pub(crate) fn running(&self, role: Option<&str>) -> Vec<Pid> {
        let named =
            |name: &str| role.map_or(["plant", "perception", "controller"].contains(&name), |role| role == name);
        self.processes().into_iter().filter(|(_, name)| named(name)).map(|(pid, _)| pid).collect()
    }

    /// Waits for the process that stands by for a role.
    pub(crate) fn spare(&self, role: &str) -> Pid {
        let start = Instant::now();
        loop {
            let waits = |pid: &Pid| {
                let command = fs::read(format!("/proc/{}/cmdline", pid.as_raw_nonzero())).unwrap_or_default();
                command.split(|byte| *byte == 0).any(|word| word == role.as_bytes())
            };
            let mut spares = self.processes().into_iter().filter(|(_, name)| name == "spare").map(|(pid, _)| pid);
            if let Some(pid) = spares.find(waits) {
                return pid;
            }
            assert!(start.elapsed() < PATIENCE, "nobody stands by for the {role}");
            std::thread::yield_now();
        }
    }

    /// Waits until every role process here has gone, and says whether they have.
    pub(crate) fn is_deserted(&self) -> bool {
        let start = Instant::now();
        while !self.processes().is_empty() {
            if start.elapsed() > PATIENCE {
                return false;
            }
            std::thread::yield_now();
        }
        true
    }

    /// No process, no run directory; no shared memory of the cell whose supervisor was `pid`.
    pub(crate) fn assert_nothing_is_left(&self, pid: Pid) {
        assert_eq!(self.processes(), [], "role processes");
        assert_eq!(self.run_directories(), Vec::<PathBuf>::new(), "run directories");
        assert_eq!(shared_memory(pid), Vec::<String>::new(), "shared memory");
    }
}

/// Shared-memory objects of the cell whose supervisor was `pid`.
pub(crate) fn shared_memory(pid: Pid) -> Vec<String> {
    let mark = format!("tandem-s471-{}-", pid.as_raw_nonzero());
    let entries = fs::read_dir("/dev/shm").expect("readable").flatten();
    entries.filter_map(|entry| entry.file_name().into_string().ok()).filter(|name| name.starts_with(&mark)).collect()
}

/// A running cell. Ended when a test gives up on it.
pub(crate) struct LiveCell {
    pub(crate) pid: Pid,
    child: Child,
    lines: Receiver<Value>,
    said: Option<std::thread::JoinHandle<String>>,
    heard: Vec<Value>,
}

/// How a cell ended.
#[derive(Debug)]
pub(crate) struct End {
    pub(crate) status: ExitStatus,
    pub(crate) events: Vec<Value>,
    #[allow(dead_code)] // Reason: part of the message of a test that fails.
    stderr: String,
}

impl End {
    /// The last line.
    pub(crate) fn summary(&self) -> &Value {
        let last = self.events.last().expect("a cell says how it ended");
        assert_eq!(last["event"], "summary", "{self:?}");
        last
    }

    pub(crate) fn of(&self, event: &str) -> Vec<&Value> {
        self.events.iter().filter(|heard| heard["event"] == event).collect()
    }
}

impl LiveCell {
    /// Listens until `wanted` is heard, and answers with that event.
    pub(crate) fn until(&mut self, what: &str, wanted: impl Fn(&Value) -> bool) -> Value {
        loop {
            match self.lines.recv_timeout(PATIENCE) {
                Ok(event) => {
                    self.heard.push(event.clone());
                    if wanted(&event) {
                        return event;
                    }
                }
                Err(RecvTimeoutError::Timeout) => panic!("{what}: silent for {PATIENCE:?} after {:?}", self.heard),
                Err(RecvTimeoutError::Disconnected) => {
                    let said = self.said.take().map(std::thread::JoinHandle::join);
                    panic!("{what}: the cell ended before; it said {said:?} after {:?}", self.heard)
                }
            }
        }
    }

    /// Listens until the event of that name.
    pub(crate) fn until_event(&mut self, name: &str) -> Value {
        self.until(name, |event| event["event"] == name)
    }

    /// Listens until the arm is on its way.
    pub(crate) fn until_moving(&mut self) {
        self.until("the arm moves", |event| event["event"] == "action_started" && event["subject"] == "robot");
    }

    pub(crate) fn signal(&self, signal: Signal) {
        kill_process(self.pid, signal).expect("the cell runs");
    }

    /// Listens to the end.
    pub(crate) fn end(mut self) -> End {
        loop {
            match self.lines.recv_timeout(PATIENCE) {
                Ok(event) => self.heard.push(event),
                Err(RecvTimeoutError::Disconnected) => break,
                Err(RecvTimeoutError::Timeout) => panic!("silent for {PATIENCE:?} after {:?}", self.heard),
            }
        }
        // Its output is closed: it has ended or is about to.
        let status = self.child.wait().expect("it is ours");
        let stderr = self.said.take().and_then(|said| said.join().ok()).unwrap_or_default();
        assert!(!stderr.contains("panicked"), "{stderr}");
        End { status, events: std::mem::take(&mut self.heard), stderr }
    }
}

impl Drop for LiveCell {
    fn drop(&mut self) {
        if matches!(self.child.try_wait(), Ok(Some(_))) {
            return;
        }
        // Asked first, so that a test that failed leaves nothing either. Errors mean that it has ended.
        let _ = kill_process(self.pid, Signal::TERM);
        while self.lines.recv_timeout(PATIENCE).is_ok() {}
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
