//! Lockstep: all roles of a cell in one process on a virtual clock.
//!
//! The roles run in the order of their instants on the shared grid, and the
//! messages are handed over in memory. Nothing else differs from a live cell:
//! the same roles, the same ports, the same judgement of what they hear. A seed
//! and a commit reproduce a run bit for bit, many times faster than real time.
//!
//! **Invariant:** no clock is read here. Time is the schedule.

mod schedule;

use std::convert::Infallible;
use std::fmt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use tandem_bus::{Identity, SlotReader};
use tandem_config::Cell;
use tandem_controller::{Controller, ParamsError};
use tandem_msg::{Coded, Message, MotionStatus, Role, Stamp};

use crate::black_box::Keeper;
use crate::perception::Perception;
use crate::plant::Plant;
use crate::roles::{ControllerRole, MemoryPorts, PerceptionRole, PlantRole, Ports as _, SupervisorRole, Surroundings};
use crate::strategy::Library;
use crate::strategy::store::Store;
use crate::supervisor::{Event, Outcome, RoleFault, RoleHealth, RunOptions, Summary, Supervisor};
use schedule::Schedule;

/// How long a lost role stays away before the shell starts it anew, as the live shell would.
const RESPAWN: Duration = Duration::from_millis(60);
/// A run that has not ended by then has lost its way; a box takes about two minutes.
const PATIENCE_PER_BOX: Duration = Duration::from_secs(1_800);

/// Why a cell could not be built or run.
#[derive(Debug)]
pub struct SimError(String);

impl SimError {
    /// What a part of the cell said.
    pub(crate) fn of(part: &str, error: &dyn fmt::Display) -> Self {
        Self(format!("{part}: {error}"))
    }
}

impl fmt::Display for SimError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for SimError {}

/// A cell on a virtual clock.
pub struct SimCell {
    cell: Cell,
    ports: MemoryPorts,
    schedule: Schedule,
    plant: PlantRole<MemoryPorts>,
    perception: PerceptionRole<MemoryPorts>,
    controller: ControllerRole<MemoryPorts>,
    supervisor: SupervisorRole<MemoryPorts>,
    epochs: [u64; 4],
    lost: [Option<Loss>; 4],
    around: Surroundings,
    now: Stamp,
    /// Whose turn it was.
    role: Role,
    boxes: u32,
    /// Where stops are written down, if they are.
    stops: Option<PathBuf>,
}

/// A role that does not run.
#[derive(Clone, Copy)]
struct Loss {
    fault: RoleFault,
    /// When it comes back; `None` = never.
    back: Option<Stamp>,
}

impl SimCell {
    /// Builds the roles of a cell.
    ///
    /// # Errors
    /// A role that refuses its files or parameters.
    pub fn new(cell: &Cell, library: Library, options: RunOptions) -> Result<Self, SimError> {
        let failed = SimError::of;
        let ports = MemoryPorts::new(identity(Role::Supervisor, 1, cell.hash));
        let seen_by = |role| ports.seen_by(identity(role, 1, cell.hash));
        let plant = Plant::new(cell, options.seed).map_err(|e| failed("plant", &e))?;
        let perception = Perception::load(&cell.perception.model).map_err(|e| failed("perception", &e))?;
        let controller = build_controller(cell).map_err(|e| failed("controller", &e))?;
        let boxes = options.boxes;
        let supervisor = Supervisor::new(cell, library, options);
        Ok(Self {
            schedule: Schedule::new(&cell.timing),
            plant: opened(PlantRole::open(&seen_by(Role::Plant), plant)),
            perception: opened(PerceptionRole::open(&seen_by(Role::Perception), perception)),
            controller: opened(ControllerRole::open(&seen_by(Role::Controller), controller)),
            supervisor: opened(SupervisorRole::open(&ports, supervisor)),
            ports,
            cell: cell.clone(),
            epochs: [1; 4],
            lost: [None; 4],
            around: Surroundings { roles: [RoleHealth::Up; 4], journal_committed: 0, halt: false },
            now: Stamp::default(),
            role: Role::Supervisor,
            boxes,
            stops: None,
        })
    }

    /// Has stops written down in a folder.
    pub fn keep_stops(&mut self, folder: &Path) {
        self.stops = Some(folder.to_owned());
    }

    /// Kills a role as `kill -9` would; perception and controller come back with a new epoch.
    pub fn kill(&mut self, role: Role) {
        let back = (role != Role::Plant).then(|| self.now.after(RESPAWN));
        self.lost[role.code() as usize] = Some(Loss { fault: RoleFault::Killed, back });
    }

    /// Asks for the end of the run, as Ctrl-C would.
    pub fn halt(&mut self) {
        self.around.halt = true;
    }

    /// The virtual clock.
    pub fn now(&self) -> Stamp {
        self.now
    }

    /// The role whose turn the last step was.
    pub fn role(&self) -> Role {
        self.role
    }

    /// The numbers of the run so far.
    pub fn summary(&self) -> Summary {
        self.supervisor.summary()
    }

    /// The latest value of a service, as every role could read it.
    pub fn listen<M: Message>(&self, service: &str) -> SlotReader<M> {
        opened(self.ports.reader(service))
    }

    /// Runs until `until` says so (`None`), or the supervisor ends the run. Events go to
    /// `on_event`; journal entries to the store, durable before the next cycle of the supervisor.
    ///
    /// # Errors
    /// A role that could not be started anew, or a run that has lost its way.
    pub fn run(
        &mut self,
        store: &Store,
        on_event: &mut dyn FnMut(&Event),
        mut until: impl FnMut(&Self) -> bool,
    ) -> Result<Option<Outcome>, SimError> {
        let patience = Stamp::default().after(PATIENCE_PER_BOX * self.boxes.max(1));
        while !until(self) {
            if let Some(outcome) = self.step(store, on_event)? {
                return Ok(Some(outcome));
            }
            if self.now > patience {
                let waited = self.now.as_secs_f64();
                return Err(SimError(format!("the run has not ended after {waited:.0} s of cell time")));
            }
        }
        Ok(None)
    }

    /// What the controller told everyone in its last cycle.
    pub fn motion(&self) -> &MotionStatus {
        self.controller.status()
    }

    /// Fastest joint as measured, rad/s.
    pub fn joint_speed_max(&self) -> f64 {
        self.supervisor.arm().velocity.iter().fold(0.0, |fastest, velocity| fastest.max(velocity.abs()))
    }

    /// Runs the next role of the schedule; an outcome ends the run.
    ///
    /// # Errors
    /// A role that could not be started anew.
    pub fn step(&mut self, store: &Store, on_event: &mut dyn FnMut(&Event)) -> Result<Option<Outcome>, SimError> {
        let (role, now) = self.schedule.advance();
        (self.now, self.role) = (now, role);
        if let Some(loss) = self.lost[role.code() as usize] {
            match loss.back {
                Some(back) if back <= now => self.restart(role)?,
                _ => return Ok(None),
            }
        }
        match role {
            Role::Plant => self.plant.cycle(now),
            Role::Controller => {
                self.controller.cycle(now);
                self.keep_stop();
            }
            Role::Perception => self.perception.cycle(now),
            Role::Supervisor => {
                let outcome = self.supervise(now, store, on_event);
                if let Some(keeper) = self.keeper().filter(|_| outcome.is_some()) {
                    keeper.keep_last(self.controller.controller());
                }
                return Ok(outcome);
            }
        }
        Ok(None)
    }

    fn keeper(&self) -> Option<Keeper> {
        let epoch = self.epochs[Role::Controller.code() as usize];
        self.stops.clone().map(|folder| Keeper { folder, epoch })
    }

    fn keep_stop(&mut self) {
        let Some(stop) = self.controller.controller().fetch_stop() else { return };
        if let Some(keeper) = self.keeper() {
            keeper.keep(&stop);
        }
        self.controller.controller().give_back(stop);
    }

    fn supervise(&mut self, now: Stamp, store: &Store, on_event: &mut dyn FnMut(&Event)) -> Option<Outcome> {
        for (health, lost) in self.around.roles.iter_mut().zip(&self.lost) {
            *health = lost.map_or(RoleHealth::Up, |loss| RoleHealth::Lost { fault: loss.fault });
        }
        let outputs = self.supervisor.cycle(now, &self.around);
        outputs.events.drain(..).for_each(|event| on_event(&event));
        if let Some(last) = outputs.journal.last().map(|entry| entry.seq)
            && store.append(&outputs.journal).is_ok()
        {
            // What is not durable is offered again by the supervisor, which waits for it.
            self.around.journal_committed = last;
        }
        outputs.journal.clear();
        outputs.finished.take()
    }

    /// Starts a lost role anew, with a higher epoch.
    fn restart(&mut self, role: Role) -> Result<(), SimError> {
        let index = role.code() as usize;
        self.lost[index] = None;
        self.epochs[index] += 1;
        let ports = self.ports.seen_by(identity(role, self.epochs[index], self.cell.hash));
        match role {
            Role::Controller => {
                let controller = build_controller(&self.cell).map_err(|e| SimError::of("controller", &e))?;
                self.controller = opened(ControllerRole::open(&ports, controller));
            }
            Role::Perception => {
                let perception = Perception::load(&self.cell.perception.model)
                    .map_err(|error| SimError(format!("perception: {error}")))?;
                self.perception = opened(PerceptionRole::open(&ports, perception));
            }
            Role::Plant | Role::Supervisor => {}
        }
        Ok(())
    }
}

/// The controller of a cell.
///
/// # Errors
/// Parameters it refuses.
pub fn build_controller(cell: &Cell) -> Result<Controller, ParamsError> {
    let mut controller = Controller::new(cell.robot.chain, cell.robot.monitor(), cell.controller)?;
    controller.set_policies(cell.policies.clone());
    Ok(controller)
}

fn identity(role: Role, epoch: u64, config_hash: u64) -> Identity {
    Identity { role: role.name().to_owned(), epoch, config_hash }
}

/// Ports inside one process always open.
fn opened<T>(result: Result<T, Infallible>) -> T {
    match result {
        Ok(role) => role,
        Err(never) => match never {},
    }
}
