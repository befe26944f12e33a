//! Starts this same binary again, as one role.

#![allow(unsafe_code)]

use std::collections::VecDeque;
use std::io::{self, BufRead, BufReader, Write};
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Child, ChildStderr, Command, Stdio};
use std::sync::{Arc, Condvar, Mutex, PoisonError};
use std::time::Duration;

use tandem_msg::{Coded, Role};

/// This binary, also when its file was replaced meanwhile.
const SELF: &str = "/proc/self/exe";
/// Lines of standard error that are kept.
const LINES: usize = 12;
/// How long the last line of a process that has ended may be under way.
const UNDER_WAY: Duration = Duration::from_millis(100);

/// What every role process is started with.
#[derive(Clone, Debug)]
pub(super) struct Plan {
    /// The cell file.
    pub(super) cell: PathBuf,
    /// The product, when the user named one.
    pub(super) product: Option<String>,
    /// The run directory.
    pub(super) run: PathBuf,
    /// The run's seed.
    pub(super) seed: u64,
    /// Where the controller's stops are written down, if they are.
    pub(super) stops: Option<PathBuf>,
    /// Period of each realtime role, in the order of `CHILDREN`: it is looked after by its heartbeat.
    pub(super) beats: [Option<Duration>; 3],
}

/// The last lines a process wrote to standard error.
#[derive(Clone, Debug, Default)]
pub(super) struct LastWords(Arc<(Mutex<Words>, Condvar)>);

#[derive(Debug, Default)]
struct Words {
    lines: VecDeque<String>,
    /// There will be no more.
    ended: bool,
}

impl LastWords {
    /// What a process that has ended wrote last; empty when it wrote nothing.
    pub(super) fn read(&self) -> String {
        let (words, ended) = &*self.0;
        let words = words.lock().unwrap_or_else(PoisonError::into_inner);
        // The process is gone, but its last line may still be on its way.
        let waited = ended.wait_timeout_while(words, UNDER_WAY, |words| !words.ended);
        let (words, _) = waited.unwrap_or_else(PoisonError::into_inner);
        words.lines.iter().map(String::as_str).collect::<Vec<_>>().join("\n")
    }

    fn change(&self, change: impl FnOnce(&mut Words)) {
        let (words, ended) = &*self.0;
        change(&mut words.lock().unwrap_or_else(PoisonError::into_inner));
        ended.notify_all();
    }

    fn add(&self, line: String) {
        self.change(|words| {
            if words.lines.len() == LINES {
                words.lines.pop_front();
            }
            words.lines.push_back(line);
        });
    }
}

/// Starts the process of a role, which waits for its turn: a byte on its standard input. It is killed by the kernel when the calling
/// *thread* ends; the terminal's Ctrl-C does not reach it; it inherits no file.
pub(super) fn spawn(plan: &Plan, role: Role, epoch: u64) -> io::Result<(Child, LastWords)> {
    let mut command = Command::new(SELF);
    command.arg0("tandem").args(["role", role.name(), "--cell"]).arg(&plan.cell);
    if let Some(product) = &plan.product {
        command.args(["--product", product]);
    }
    command.arg("--instance").arg(&plan.run);
    command.args(["--epoch", &epoch.to_string(), "--seed", &plan.seed.to_string()]);
    if let Some(stops) = &plan.stops {
        command.arg("--stops").arg(stops);
    }
    // A pool of threads would only take the loops' processors from them.
    command.env("RAYON_NUM_THREADS", "1");
    command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped()).process_group(0);
    let parent = std::process::id();
    // SAFETY: between fork and exec only system calls are made, on plain numbers.
    unsafe { command.pre_exec(move || leash(parent)) };
    let mut child = command.spawn()?;
    let words = LastWords::default();
    if let Some(stderr) = child.stderr.take() {
        let kept = words.clone();
        let name = format!("{} stderr", role.name());
        std::thread::Builder::new().name(name).spawn(move || forward(role, stderr, &kept))?;
    }
    Ok((child, words))
}

/// In the child, before exec: dies with its parent, and takes no file along.
fn leash(parent: u32) -> io::Result<()> {
    let failed = |result: libc::c_long| if result == 0 { Ok(()) } else { Err(io::Error::last_os_error()) };
    // SAFETY: plain numbers only.
    failed(unsafe { libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGKILL) }.into())?;
    // SAFETY: asks for a number.
    if u32::try_from(unsafe { libc::getppid() }) != Ok(parent) {
        // It ended before the kernel knew that we would mind.
        return Err(io::Error::from_raw_os_error(libc::ESRCH));
    }
    // iceoryx2 does not mark its files as closed on exec.
    // SAFETY: plain numbers only; marks descriptors, closes none.
    failed(unsafe { libc::syscall(libc::SYS_close_range, 3, libc::c_uint::MAX, libc::CLOSE_RANGE_CLOEXEC) })
}

fn forward(role: Role, stderr: ChildStderr, kept: &LastWords) {
    let mark = format!("{}: ", role.name());
    for line in BufReader::new(stderr).lines() {
        let Ok(line) = line else { break };
        let words = line.strip_prefix(&mark).unwrap_or(&line);
        // Our own standard error may be closed; the words are kept all the same.
        let _ = writeln!(io::stderr(), "{mark}{words}");
        kept.add(words.to_owned());
    }
    kept.change(|words| words.ended = true);
}
