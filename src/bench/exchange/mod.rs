//! A message of 96 bytes to another process and back, by the ways there are.
//!
//! Both processes are bound to a processor each and run under SCHED_FIFO. They rest every few milliseconds, so that the
//! kernel does not take a spinning realtime thread for a runaway one.

mod ends;
mod lanes;
pub mod peer;

use std::io::{BufRead as _, BufReader};
use std::os::unix::process::CommandExt as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use hdrhistogram::Histogram;
use tandem_bus::Instance;

use super::series::histogram;
use super::{BenchError, Conditions, loops};
use ends::open;

/// How a message goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Way {
    /// Atomics in shared memory, both sides spinning: the least there can be.
    Raw,
    /// The same, both sides sleeping on a futex: what being woken costs.
    Futex,
    /// iceoryx2's publish-subscribe as its own benchmark uses it.
    Iceoryx,
    /// iceoryx2's blackboard.
    Blackboard,
    /// Our bus.
    Bus,
}

impl Way {
    pub(super) const ALL: [Self; 5] = [Self::Raw, Self::Futex, Self::Iceoryx, Self::Blackboard, Self::Bus];

    /// On the command line of the other process.
    fn word(self) -> &'static str {
        match self {
            Self::Raw => "raw",
            Self::Futex => "futex",
            Self::Iceoryx => "iceoryx",
            Self::Blackboard => "blackboard",
            Self::Bus => "bus",
        }
    }

    /// In a table.
    pub(super) fn case(self) -> &'static str {
        match self {
            Self::Raw => "shared memory, spinning",
            Self::Futex => "shared memory, futex",
            Self::Iceoryx => "iceoryx2 publish-subscribe, polled",
            Self::Blackboard => "iceoryx2 blackboard, polled",
            Self::Bus => "tandem's bus, polled",
        }
    }
}

/// Round trips between two rests.
const BURST: u64 = 2_000;
/// How long a rest is; the other side's is shorter, so that it is back first.
const REST: Duration = Duration::from_micros(1_000);
const REST_OF_PEER: Duration = Duration::from_micros(500);
/// Left out at the beginning of each burst: caches are cold, the processors have slept.
const WARM_UP: u64 = 100;
/// The other process has to be ready by then.
const READY: Duration = Duration::from_secs(10);

/// A message with this bit asks the other side to rest after its answer.
const RESTING: u64 = 1 << 62;
/// A message with this bit asks it to end.
const ENDING: u64 = 1 << 63;

/// A place for the services of one exchange, gone with its value.
pub(super) struct Place(Instance);

impl Place {
    pub(super) fn new(name: &str) -> Result<Self, BenchError> {
        let id = format!("bench-{name}-{}", std::process::id());
        let root = std::env::temp_dir().join(format!("tandem-{id}"));
        std::fs::create_dir_all(&root).map_err(BenchError::io(root.display().to_string()))?;
        Ok(Self(Instance::new(&id, &root)?))
    }

    /// The place of another process, by the folder it was told.
    pub(super) fn at(root: &Path) -> Result<Instance, BenchError> {
        let name = root.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        Ok(Instance::new(name.trim_start_matches("tandem-"), root)?)
    }

    pub(super) fn instance(&self) -> &Instance {
        &self.0
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        // What cannot be removed bears our prefix: `tandem doctor` names it.
        let _ = self.0.remove();
    }
}

/// The other process of a bench; killed when dropped.
pub(super) struct Peer(Child);

impl Peer {
    /// Starts this binary again with a task, and waits until it says that it is ready.
    ///
    /// # Errors
    /// It cannot be started, or is not ready in time.
    pub(super) fn start(task: &str, root: &Path, cpu: Option<u32>) -> Result<Self, BenchError> {
        let mut command = Command::new("/proc/self/exe");
        command.arg0("tandem").args(["bench-peer", task]).arg(root);
        if let Some(cpu) = cpu {
            command.args(["--cpu", &cpu.to_string()]);
        }
        command.stdin(Stdio::null()).stdout(Stdio::piped());
        let mut peer = Self(command.spawn().map_err(BenchError::io("the other process"))?);
        let output = peer.0.stdout.take().ok_or_else(|| BenchError::peer("the other process", "has no output"))?;
        let (said, heard) = std::sync::mpsc::channel();
        std::thread::spawn(move || said.send(BufReader::new(output).lines().next()));
        match heard.recv_timeout(READY) {
            Ok(Some(Ok(_))) => Ok(peer),
            _ => Err(BenchError::peer("the other process", format!("is not ready to {task} within {READY:?}"))),
        }
    }

    /// Kills it as `kill -9` does; does not wait.
    pub(super) fn kill(&mut self) {
        // It has ended by itself, then.
        let _ = self.0.kill();
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        self.kill();
        let _ = self.0.wait();
    }
}

/// An exchange that is set up, with its other process waiting.
pub(super) struct Exchange {
    way: Way,
    cpu: Option<u32>,
    root: PathBuf,
    place: Place,
}

impl Exchange {
    pub(super) fn new(way: Way, cpu: Option<u32>) -> Result<Self, BenchError> {
        let place = Place::new(way.word())?;
        Ok(Self { way, cpu, root: place.instance().root().to_owned(), place })
    }

    /// Round trips for that long, nanoseconds each.
    pub(super) fn round(&self, time: Duration, conditions: &mut Conditions) -> Result<Histogram<u64>, BenchError> {
        let other = loops::other_processor(self.cpu);
        loops::set_up(self.cpu, conditions, || {
            // Ports belong to the thread that opens them.
            let mut end = open(self.way, self.place.instance(), true)?;
            let _peer = Peer::start(self.way.word(), &self.root, other)?;
            end.connect()?;
            let mut trips = histogram();
            let began = Instant::now();
            let mut number = 0;
            while began.elapsed() < time {
                let mut before = loops::now();
                for trip in 0..BURST {
                    number += 1;
                    let resting = if trip == BURST - 1 { RESTING } else { 0 };
                    end.send(number | resting)?;
                    let answer = end.receive()?;
                    let after = loops::now();
                    if answer & !RESTING != number {
                        return Err(BenchError::peer(self.way.case(), format!("answered {answer} to {number}")));
                    }
                    if trip >= WARM_UP {
                        trips.saturating_record(after.0 - before.0);
                    }
                    before = after;
                }
                std::thread::sleep(REST);
            }
            end.send(ENDING)?;
            Ok(trips)
        })?
    }
}
