//! Statistics of a loop in shared memory: written by the loop at the cost of a few
//! stores, read by anybody who may read the file.
//!
//! Each role of a cell has one file. The loop maps it for writing once, at start;
//! a [`Reader`] maps it read-only, so that nothing it does can reach the loop: no
//! lock, no message, no system call on the other side.
//!
//! ```text
//! loop ──relaxed stores──▶ page (a file in /dev/shm) ──relaxed loads──▶ Reader::read(&mut Snapshot)
//! ```
//! The file outlives its writer. A successor counts on under a higher epoch: its
//! record begins anew, and what its predecessors counted stays in [`Earlier`].
//!
//! **Invariant:** one writer at a time, the role's present incarnation.
//! **Invariant:** a [`Snapshot`] is of one incarnation. Within it, numbers that a
//! cycle in progress is just changing may disagree by that cycle.

mod mapping;
mod page;
mod reader;
mod writer;

pub use page::{Earlier, Guarded, INPUTS_MAX, Input, NAME_MAX, Obtained, Text};
pub use reader::{OpenError, ReadError, Reader, Snapshot};
pub use writer::Writer;

#[cfg(test)]
mod tests;
