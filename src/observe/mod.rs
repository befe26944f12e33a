//! What a running cell shows to whoever looks: `tandem status`, `tandem top`.
//!
//! An [`Observer`] maps the statistics of the loops read-only and listens to the latest values on the bus. It writes
//! nothing, asks nothing and holds nothing that a role waits for.
//!
//! **Invariant:** nothing an observer does, or fails to do, reaches a cycle of the cell.

mod find;
mod view;

pub use find::{FindError, find};
pub use view::{Age, ArmView, LoopView, MotionView, PerCycle, Quantiles, StepView, View};

use std::path::{Path, PathBuf};
use std::time::Duration;

use tandem_bus::{BusError, Identity, Latest, Node, Read as _};
use tandem_config::Cell;
use tandem_cycle::stats::{Reader, Snapshot};
use tandem_msg::{CellRequest, Coded as _, Feature, JointState, MotionStatus, MotionTask, Prompt, Role, Stamp};

use crate::live::RunningCell;
use crate::roles::service;

/// How long an observer tries to join the bus.
const JOINING: Duration = Duration::from_secs(2);
/// How long the first word of a role is waited for.
const FIRST_WORD: Duration = Duration::from_millis(100);
/// Statistics are copied this often at most, however often is looked: a copy goes through the caches of a processor that
/// a loop runs on.
const COPYING: Duration = Duration::from_millis(100);
/// What is called recent.
const RECENT: Duration = Duration::from_secs(1);

/// Looks at one running cell.
pub struct Observer {
    running: RunningCell,
    cell: Cell,
    loops: [Loop; 4],
    arm: Latest<JointState>,
    status: Latest<MotionStatus>,
    task: Latest<MotionTask>,
    request: Latest<CellRequest>,
    feature: Latest<Feature>,
    prompt: Latest<Prompt>,
    /// Ports live no longer than their node.
    _node: Node,
}

/// One role's loop.
struct Loop {
    role: Role,
    reader: Option<Reader>,
    now: Box<Snapshot>,
    /// An earlier look, to say what is recent.
    then: Box<Snapshot>,
    then_at: Stamp,
    /// What the last copy showed, and when it was taken.
    shown: Option<(Stamp, LoopView)>,
}

/// Why a cell cannot be looked at.
#[derive(Debug, thiserror::Error)]
pub enum ObserveError {
    /// Its processes cannot be asked which cell file they run.
    #[error("{cell}: its supervisor cannot be asked which cell file it runs; is it of another user, or just starting?")]
    NoCellFile {
        /// The instance.
        cell: String,
    },
    /// The files it was started with are refused now.
    #[error("{0}")]
    Config(tandem_config::Faults),
    /// The bus.
    #[error(transparent)]
    Bus(#[from] BusError),
}

impl Observer {
    /// Opens a running cell.
    ///
    /// # Errors
    /// Its cell file cannot be found out or read, or its bus not be joined.
    pub fn open(running: RunningCell) -> Result<Self, ObserveError> {
        let mut loops = Role::ALL.iter().map(|role| Loop::open(*role, &running)).collect::<Vec<_>>().into_iter();
        let loops = std::array::from_fn(|_| loops.next().expect("four roles"));
        let unknown = || ObserveError::NoCellFile { cell: running.name().to_owned() };
        let (file, product) = cell_file(&loops).ok_or_else(unknown)?;
        let cell = Cell::load(&file, product.as_deref()).map_err(ObserveError::Config)?;
        let identity = Identity { role: "observer".to_owned(), epoch: 1, config_hash: cell.hash };
        let node = Node::new(running.instance(), identity, JOINING);
        let mut arm = node.latest(service::ARM_STATE)?;
        let mut status = node.latest(service::STATUS)?;
        // So that the first look sees something. A role that is just starting is seen later.
        arm.wait(FIRST_WORD);
        status.wait(FIRST_WORD);
        Ok(Self {
            arm,
            status,
            task: node.latest(service::TASK)?,
            request: node.latest(service::REQUEST)?,
            feature: node.latest(service::FEATURE)?,
            prompt: node.latest(service::PROMPT)?,
            _node: node,
            running,
            cell,
            loops,
        })
    }

    /// Whether the cell still runs.
    pub fn is_running(&self) -> bool {
        self.running.directory().exists()
    }

    /// Looks at everything.
    pub fn look(&mut self, now: Stamp) -> View {
        let product = &self.cell.product;
        let part = |request: &CellRequest| product.parts.get(request.part_index as usize);
        let request = self.request.read();
        let (task, prompt) = (self.task.read(), self.prompt.read());
        View {
            cell: self.cell.name.clone(),
            instance: self.running.name().to_owned(),
            product: product.name.clone(),
            step: StepView::of(
                request,
                part(request).map(|part| part.label.as_str()),
                task,
                prompt,
                self.feature.read(),
            ),
            motion: MotionView::of(self.status.read(), now),
            arm: ArmView::of(self.arm.read(), now),
            loops: self.loops.iter_mut().filter_map(|one| one.look(now, &self.running)).collect(),
        }
    }
}

impl Loop {
    fn open(role: Role, running: &RunningCell) -> Self {
        let mut one =
            Self { role, reader: None, now: Box::default(), then: Box::default(), then_at: Stamp(0), shown: None };
        one.read(running);
        one
    }

    /// Whether there is something to be seen.
    fn read(&mut self, running: &RunningCell) -> bool {
        if self.reader.is_none() {
            self.reader = running.statistics(self.role).ok();
        }
        self.reader.as_ref().is_some_and(|reader| reader.read(&mut self.now).is_ok())
    }

    fn look(&mut self, now: Stamp, running: &RunningCell) -> Option<LoopView> {
        if self.shown.as_ref().is_none_or(|(at, _)| at.age_at(now) >= COPYING) {
            self.shown = self.copy(now, running).map(|view| (now, view));
        }
        self.shown.as_ref().map(|(_, view)| view.clone())
    }

    fn copy(&mut self, now: Stamp, running: &RunningCell) -> Option<LoopView> {
        if !self.read(running) {
            return None;
        }
        let same = self.then.epoch == self.now.epoch;
        if !same {
            // Since it began.
            *self.then = Snapshot { epoch: self.now.epoch, ..Snapshot::default() };
            self.then_at = self.now.started;
        }
        let view = LoopView::of(self.role, &self.now, &self.then, self.then_at.age_at(now));
        if self.then_at.age_at(now) >= RECENT {
            self.then.clone_from(&self.now);
            self.then_at = now;
        }
        Some(view)
    }
}

/// The cell file and the product on the command line of a role's process.
fn cell_file(loops: &[Loop; 4]) -> Option<(PathBuf, Option<String>)> {
    loops.iter().filter(|one| one.role != Role::Supervisor).find_map(|one| of_process(one.now.pid))
}

fn of_process(pid: u32) -> Option<(PathBuf, Option<String>)> {
    let process = Path::new("/proc").join(pid.to_string());
    let line = std::fs::read(process.join("cmdline")).ok()?;
    let words: Vec<&str> = line.split(|byte| *byte == 0).flat_map(std::str::from_utf8).collect();
    let after = |name: &str| words.windows(2).find(|pair| pair[0] == name).map(|pair| pair[1]);
    // Where the process stands, from which its file is named.
    let folder = std::fs::read_link(process.join("cwd")).ok()?;
    Some((folder.join(after("--cell")?), after("--product").map(str::to_owned)))
}
