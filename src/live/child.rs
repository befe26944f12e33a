//! The main of a role's process.
//!
//! It reads its files, builds its role, opens its ports and sets itself up. Then it waits for its turn: a word on
//! standard input, which comes at once, or, to a spare, when its predecessor has died. Until then it publishes nothing,
//! so that nobody hears of it (`tandem_bus`).

use std::error::Error;
use std::io::{ErrorKind, Read as _};
use std::path::PathBuf;
use std::sync::mpsc;
use std::thread;
use std::time::Duration;

use rustix::thread::set_name;
use tandem_bus::{Identity, Instance, Node};
use tandem_config::Cell;
use tandem_msg::{Coded, Header, Role, Stamp};

use super::shell::{self, Shell};
use super::{LiveError, rundir, signals};
use crate::black_box::{Clerk, Keeper};
use crate::lockstep::build_controller;
use crate::perception::Perception;
use crate::plant::Plant;
use crate::roles::{ControllerRole, PerceptionRole, PlantRole};

/// The roles that are processes of their own.
pub(super) const CHILDREN: [Role; 3] = [Role::Plant, Role::Perception, Role::Controller];
/// How long a process tries to join the bus.
pub(super) const JOINING: Duration = Duration::from_secs(5);
/// What a process that waits for its turn is called in the host's lists.
pub(crate) const SPARE: &str = "spare";

/// What a role's process is started with.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RoleArgs {
    /// Which role.
    pub role: Role,
    /// The cell file.
    pub cell: PathBuf,
    /// The product, when the user named one.
    pub product: Option<String>,
    /// The run directory of the cell, whose last component names the instance.
    pub instance: PathBuf,
    /// The incarnation.
    pub epoch: u64,
    /// The run's seed.
    pub seed: u64,
    /// Where the controller's stops are written down, if they are.
    pub stops: Option<PathBuf>,
}

/// Runs one role until SIGTERM; the kernel kills it when its supervisor is gone.
///
/// # Errors
/// A file, parameter or model is refused, or the bus cannot be joined.
pub fn role(args: &RoleArgs) -> Result<(), LiveError> {
    signals::listen().map_err(LiveError::Signals)?;
    let cell = Cell::load(&args.cell, args.product.as_deref()).map_err(LiveError::Config)?;
    let instance = rundir::instance_at(&args.instance)?;
    match args.role {
        Role::Plant => plant(args, &cell, &instance),
        Role::Perception => perception(args, &cell, &instance),
        Role::Controller => controller(args, &cell, &instance),
        Role::Supervisor => Err(LiveError::NoSuchRole),
    }
}

fn plant(args: &RoleArgs, cell: &Cell, instance: &Instance) -> Result<(), LiveError> {
    let plant = Plant::new(cell, args.seed).map_err(refused(Role::Plant))?;
    let node = join(args.role, args.epoch, cell, instance);
    let (mut role, camera) = PlantRole::open_apart(&node, plant)?;
    thread::scope(|scope| {
        let (ready, opened) = mpsc::channel();
        // Started before the loop is set up, whose processor and priority it must not inherit.
        scope.spawn(move || {
            let Some(camera) = camera else { return };
            // Ports belong to the thread of their node, so the camera has its own.
            let node = join(args.role, args.epoch, cell, instance);
            let (cloud, outcome) = match camera.open(&node) {
                Ok(cloud) => (Some(cloud), Ok(())),
                Err(error) => (None, Err(error)),
            };
            // The loop waits for this word before it begins.
            let _ = ready.send(outcome);
            if let Some(cloud) = cloud {
                camera.run(cloud);
            }
        });
        opened.recv().unwrap_or(Ok(()))?;
        // What the closure owns goes with it, and so the camera ends.
        turn(args, cell, instance, move |now| {
            role.cycle(now);
            role.heard()
        })
    })
}

fn perception(args: &RoleArgs, cell: &Cell, instance: &Instance) -> Result<(), LiveError> {
    let perception = Perception::load(&cell.perception.model).map_err(refused(Role::Perception))?;
    let node = join(args.role, args.epoch, cell, instance);
    let mut role = PerceptionRole::open(&node, perception)?;
    turn(args, cell, instance, move |now| {
        role.cycle(now);
        role.heard()
    })
}

fn controller(args: &RoleArgs, cell: &Cell, instance: &Instance) -> Result<(), LiveError> {
    let controller = build_controller(cell).map_err(refused(Role::Controller))?;
    let node = join(args.role, args.epoch, cell, instance);
    let mut role = ControllerRole::open(&node, controller)?;
    let keeper = args.stops.clone().map(|folder| Keeper { folder, epoch: args.epoch });
    // Started before the loop is set up, whose processor and priority it must not inherit.
    let clerk = keeper.map(Clerk::start).transpose().map_err(LiveError::Threads)?;
    let left = turn(args, cell, instance, |now| {
        role.cycle(now);
        if let Some(clerk) = &clerk {
            clerk.serve(role.controller());
        }
        role.heard()
    });
    if let Some(clerk) = clerk {
        clerk.finish(role.controller());
    }
    left
}

/// Sets the calling thread up, waits for the turn of this process and runs the loop until it is asked to end.
fn turn<const N: usize>(
    args: &RoleArgs,
    cell: &Cell,
    instance: &Instance,
    cycle: impl FnMut(Stamp) -> [Header; N],
) -> Result<(), LiveError> {
    let granted = shell::set_up(cell, args.role)?;
    if !has_come(args.role) {
        return Ok(());
    }
    Shell::new(cell, instance, args.role, args.epoch, &granted)?.run(cycle)
}

/// Waits for the turn of this process; it never comes when standard input ends.
fn has_come(role: Role) -> bool {
    let call = |name: &str| {
        // A name in lists; nothing depends on it.
        let _ = std::ffi::CString::new(name).map(|name| set_name(&name));
    };
    call(SPARE);
    let mut word = [0];
    let come = loop {
        match std::io::stdin().read(&mut word) {
            Err(cause) if cause.kind() == ErrorKind::Interrupted => {}
            read => break read.is_ok_and(|count| count > 0),
        }
    };
    call(role.name());
    come
}

/// A place on the bus for one incarnation of a role.
pub(super) fn join(role: Role, epoch: u64, cell: &Cell, instance: &Instance) -> Node {
    let identity = Identity { role: role.name().to_owned(), epoch, config_hash: cell.hash };
    Node::new(instance, identity, JOINING)
}

fn refused<E: Into<Box<dyn Error + Send + Sync>>>(role: Role) -> impl FnOnce(E) -> LiveError {
    move |cause| LiveError::Build { role, cause: cause.into() }
}
