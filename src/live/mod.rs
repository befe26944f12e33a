//! A live cell: every role a process of its own, on the monotonic clock, over shared memory.
//!
//! ```text
//! tandem run ─┬─ main thread         prints what happens
//!             ├─ supervisor thread   100 Hz: health, the supervisor role      (supervise)
//!             ├─ journal thread      the store; no cycle waits for it         (journal)
//!             ├─ warden thread       starts, watches, replaces processes      (warden, spawn)
//!             ├─ tandem role plant | perception | controller                  (child, shell)
//!             └─ the same, spare: perception and controller that wait for their turn
//! ```
//! The parent starts this same binary again for each role. What a process is
//! called, where the bus lies and which incarnation it is stands on its command
//! line; everything else it reads from the same files, and the hash of these
//! files must agree, or the bus refuses it.
//!
//! **Invariant:** the arm is stopped before a process is asked to end: `Run` is
//! withdrawn first, and when nobody is left to say so the plant brakes by itself.
//! **Invariant:** whatever way [`run`] is left, no process, no shared memory and no
//! run directory of the cell remain. After `kill -9` of the parent the kernel
//! takes the children, and the next run sweeps what is left.
//! **Invariant:** nothing here waits without a limit.

mod child;
mod error;
mod health;
mod journal;
mod pulse;
mod rollcall;
mod rundir;
mod shell;
pub mod signals;
mod spawn;
mod statistics;
mod supervise;
mod warden;

pub(crate) use child::SPARE;
pub use child::{RoleArgs, role};
pub use error::LiveError;
pub use rundir::{base, dead_cells};
pub(crate) use rundir::{prepare_base, sweep};
pub use statistics::{RunningCell, running_cells};
pub use supervise::Ended;

use std::path::Path;
use std::sync::mpsc;
use std::thread;

use tandem_config::Cell;
use tandem_msg::Role;

use crate::strategy::Library;
use crate::strategy::store::Store;
use crate::supervisor::{Event, RunOptions, Supervisor};
use child::CHILDREN;
use rundir::RunDir;
use spawn::Plan;
use supervise::Watch;
use warden::Warden;

/// Runs a cell live until its supervisor ends the run, a signal asks for the end,
/// or a fault leaves no other way. `product` is what the user asked for instead of
/// the product the cell file names; `stops` is the folder in which stops are written down. Events are told in their order, on the calling
/// thread, which may take its time.
///
/// SIGINT, SIGTERM and SIGHUP are taken over for good: the first stops the arm and
/// then the cell, the second ends the cell at once.
///
/// # Errors
/// The cell could not be started, or not be cleaned up; a run that was stopped by
/// a fault is no error but an outcome.
pub fn run(
    cell: &Cell,
    product: Option<&str>,
    library: Library,
    store: &mut Store,
    options: RunOptions,
    stops: Option<&Path>,
    on_event: &mut dyn FnMut(&Event),
) -> Result<Ended, LiveError> {
    signals::listen().map_err(LiveError::Signals)?;
    rundir::sweep();
    let run_dir = RunDir::create(&cell.name)?;
    let plan = Plan {
        cell: cell.file.clone(),
        product: product.map(str::to_owned),
        run: run_dir.path().to_owned(),
        seed: options.seed,
        stops: stops.map(Path::to_owned),
        beats: CHILDREN.map(|role| {
            let realtime = cell.realtime.priority[role as usize].is_some();
            realtime.then(|| cell.timing.of(role).period)
        }),
    };
    let (report, reports) = mpsc::channel();
    let (warden, orders) = Warden::new(plan, run_dir.instance().clone(), report).map_err(LiveError::Threads)?;
    let (events, told) = mpsc::channel();
    let (journal, journal_thread) = journal::open(store);

    let ended = thread::scope(|scope| {
        let journal_handle = scope.spawn(move || journal_thread.run());
        // The supervisor's end of the bus is opened first, so that no role finds it missing.
        let instance = run_dir.instance();
        let supervisor = Supervisor::new(cell, library, options);
        let supervising = scope.spawn(|| {
            let watch = Watch { cell, instance, reports, orders: &orders, journal, events };
            watch.run(supervisor)
        });
        let warding = scope.spawn(move || {
            shell::prefer(cell, Role::Supervisor);
            warden.run();
        });
        // Ends when the supervisor's thread has, and with it the sender.
        told.iter().for_each(|event| on_event(&event));
        let ended = supervising.join();
        orders.shutdown();
        let warded = warding.join();
        let journalled = journal_handle.join();
        let ended = ended.map_err(|_| LiveError::Panicked { thread: "supervisor" })?;
        warded.map_err(|_| LiveError::Panicked { thread: "warden" })?;
        journalled.map_err(|_| LiveError::Panicked { thread: "journal" })?;
        ended
    });
    let removed = run_dir.remove();
    let ended = ended?;
    removed?;
    Ok(ended)
}
