//! The fixed-rate loop: grid, clock, missed cycles, realtime set-up, allocation guard.
//!
//! ```text
//! Grid      the instants t with t mod period = phase
//! FixedRate waits for the next of them, says which it is, counts those that passed unused
//! Record    what it found: lateness, time in the cycle, missed grid points
//! setup     what the host granted: SCHED_FIFO, affinity, locked memory, timer slack
//! guard     counts what a cycle allocates
//! stats     all of this in shared memory, for whoever wants to look
//! ```
//!
//! This crate is where the loop sleeps and reads the clock, so that nothing else
//! under `realtime/` has to.

mod clock;
mod fixed_rate;
mod grid;
pub mod guard;
mod histogram;
mod overrun;
mod record;
pub mod setup;
pub mod stats;

pub use clock::{Clock, Monotonic};
pub use fixed_rate::{FixedRate, Pace, Tick};
pub use grid::{Grid, GridError};
pub use histogram::{Histogram, SharedHistogram};
pub use overrun::Overrun;
pub use record::{Record, SharedRecord};
