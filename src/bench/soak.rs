//! A thousand deaths: roles are killed and replaced, cells end by the death of what they cannot be without, and nothing
//! may be left of any of it.
//!
//! In each cell controller and perception are killed in turn, as often as restarts in a row are allowed; at last the
//! plant or the supervisor, with which the cell ends. Nobody cleans up but the cells themselves.

use std::fs::{read_dir, read_to_string};
use std::path::Path;
use std::time::{Duration, Instant};

use rustix::process::{Pid, Signal, kill_process};
use tandem_bus::leftovers;
use tandem_msg::{Coded as _, Role};

use super::cell::{LiveCell, snapshot};
use super::{BenchError, Options, Report, loops};
use crate::live::{dead_cells, running_cells, sweep};

/// Each of the two roles that are replaced dies so often in a cell.
const DEATHS_OF_A_ROLE: u32 = 3;
/// Growth of a process's memory that is none: what its allocator keeps at hand.
const MEMORY_SLACK_KB: f64 = 4_096.0;
/// Between two looks at what a cell holds; the first two that agree count, of at most so many.
const SETTLING: Duration = Duration::from_millis(100);
const LOOKS_MAX: usize = 20;
/// Kills between two words on the progress.
const TOLD_EVERY: u32 = 50;

/// What the supervisor of a cell holds, and what there is of the cell.
#[derive(Clone, Copy)]
struct Holdings {
    descriptors: usize,
    memory_kb: usize,
    shared_names: usize,
    files: usize,
}

impl Holdings {
    /// Once the cell has let go of the dead, which it does beside its work.
    fn settled(cell: &LiveCell) -> Self {
        let mut last = Self::of(cell);
        for _ in 0..LOOKS_MAX {
            std::thread::sleep(SETTLING);
            let before = std::mem::replace(&mut last, Self::of(cell));
            if [before.descriptors, before.shared_names, before.files]
                == [last.descriptors, last.shared_names, last.files]
            {
                break;
            }
        }
        last
    }

    fn of(cell: &LiveCell) -> Self {
        let process = format!("/proc/{}", cell.pid());
        let status = read_to_string(format!("{process}/status")).unwrap_or_default();
        let resident =
            status.lines().find_map(|line| line.strip_prefix("VmRSS:")?.split_whitespace().next()?.parse().ok());
        let running = cell.seat().running();
        Self {
            descriptors: entries(Path::new(&format!("{process}/fd"))),
            memory_kb: resident.unwrap_or(0),
            shared_names: running.instance().shared_memory().len(),
            files: files(running.directory()),
        }
    }

    /// By how much each has grown since.
    fn grown(&self, before: &Self) -> [f64; 4] {
        let pairs = [
            (before.descriptors, self.descriptors),
            (before.memory_kb, self.memory_kb),
            (before.shared_names, self.shared_names),
            (before.files, self.files),
        ];
        pairs.map(|(before, after)| after as f64 - before as f64)
    }
}

/// What there is on this host: names in shared memory of those cells, run directories of all, descriptors of this process.
fn host(cells: &[String]) -> [usize; 3] {
    let names = leftovers().into_iter().filter(|left| cells.contains(&left.instance)).count();
    [names, running_cells().len() + dead_cells().len(), entries(Path::new("/proc/self/fd"))]
}

pub(super) fn run(kills: u32, options: &Options, report: &mut Report) -> Result<(), BenchError> {
    let Some(file) = &options.cell else {
        report.note("roles are killed in a live cell, and none was named");
        return Ok(());
    };
    let began = Instant::now();
    sweep();
    let before = host(&[]);
    // What the loops are granted.
    loops::set_up(None, &mut report.conditions, || ())?;
    let (mut cells, mut by_role, mut failures, mut grown) = (Vec::new(), [0; 4], Vec::new(), Vec::new());
    let done = |by_role: &[u32; 4]| by_role.iter().sum::<u32>();
    let mut told = 0;
    while done(&by_role) < kills && failures.is_empty() {
        let left = kills - done(&by_role);
        match one_cell(file, &mut cells, left, &mut by_role) {
            Ok(found) => grown.push(found),
            // Not one more after that: it is to be looked into.
            Err(error) => failures.push(error.to_string()),
        }
        if done(&by_role) >= told + TOLD_EVERY {
            told = done(&by_role);
            (options.tell)(&format!(
                "{told} of {kills} kills in {} cells, {:.0} s",
                cells.len(),
                began.elapsed().as_secs_f64()
            ));
        }
    }
    // What the last one has left is swept when the next one starts, as always.
    drop(LiveCell::start(file, cells.len() as u64 + 1)?);
    let after = host(&cells);
    let of = |role: Role| by_role[role as usize];
    report.note(format!(
        "{} cells in {:.0} s; killed: controller {}, perception {}, plant {}, supervisor {}",
        cells.len(),
        began.elapsed().as_secs_f64(),
        of(Role::Controller),
        of(Role::Perception),
        of(Role::Plant),
        of(Role::Supervisor)
    ));
    report.finding("kills", done(&by_role).into(), None, "");
    report.finding("failed starts, replacements and ends", failures.len() as f64, Some(0.0), "");
    let most = |index: usize| grown.iter().map(|grown: &[f64; 4]| grown[index]).fold(0.0, f64::max);
    report.finding("a supervisor's descriptors, growth", most(0), Some(0.0), "");
    report.finding("a supervisor's memory, growth", most(1), Some(MEMORY_SLACK_KB), "kB");
    report.finding("a cell's names in shared memory, growth", most(2), Some(0.0), "");
    report.finding("a cell's files, growth", most(3), Some(0.0), "");
    for (index, what) in
        ["names of these cells in shared memory", "run directories", "descriptors of the bench"].into_iter().enumerate()
    {
        report.finding(format!("{what}, growth in all"), after[index] as f64 - before[index] as f64, Some(0.0), "");
    }
    failures.into_iter().for_each(|failure| report.note(failure));
    Ok(())
}

/// One cell from its start to its end; kills at most so many. By how much its holdings have grown over the replacements.
fn one_cell(file: &Path, cells: &mut Vec<String>, left: u32, by_role: &mut [u32; 4]) -> Result<[f64; 4], BenchError> {
    let seed = cells.len() as u64 + 1;
    let mut cell = LiveCell::start(file, seed)?;
    cells.push(cell.seat().running().name().to_owned());
    cell.wait_for_spares()?;
    let before = Holdings::settled(&cell);
    let replaced = [Role::Controller, Role::Perception].into_iter().cycle();
    for role in replaced.take((2 * DEATHS_OF_A_ROLE).min(left - 1) as usize) {
        kill(&cell, role, by_role)?;
        cell.wait_for("recovered", |told| told["role"] == role.name())?;
        cell.wait_for_spares()?;
    }
    let grown = Holdings::settled(&cell).grown(&before);
    kill(&cell, if seed.is_multiple_of(2) { Role::Plant } else { Role::Supervisor }, by_role)?;
    cell.wait_for_end()?;
    Ok(grown)
}

fn kill(cell: &LiveCell, role: Role, by_role: &mut [u32; 4]) -> Result<(), BenchError> {
    let pid = match role {
        Role::Supervisor => cell.pid(),
        _ => snapshot(&cell.seat().statistics(role)?).pid,
    };
    let pid = i32::try_from(pid).ok().and_then(Pid::from_raw);
    let pid = pid.ok_or_else(|| BenchError::peer(role.name(), "has no process"))?;
    kill_process(pid, Signal::KILL).map_err(|cause| BenchError::io(format!("kill {}", role.name()))(cause.into()))?;
    by_role[role as usize] += 1;
    Ok(())
}

fn entries(folder: &Path) -> usize {
    read_dir(folder).into_iter().flatten().flatten().count()
}

/// All files below a folder.
fn files(folder: &Path) -> usize {
    let below = |entry: std::fs::DirEntry| {
        if entry.file_type().is_ok_and(|kind| kind.is_dir()) { files(&entry.path()) } else { 1 }
    };
    read_dir(folder).into_iter().flatten().flatten().map(below).sum()
}
