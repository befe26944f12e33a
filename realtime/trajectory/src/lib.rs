//! Jerk-limited online trajectory generation, from any state to any target state.
#![no_std]

#[cfg(any(test, feature = "std"))]
extern crate std;

mod brake;
mod error;
mod extremal;
mod input;
mod instant;
mod profile;
mod reach;
mod root;
mod sqrt;
mod state;
mod straight;
mod swing;
mod task;
mod trajectory;

pub use error::Error;
pub use input::{Input, Interface, Synchronization};
pub use profile::{Profile, Segment};
pub use state::{Limits, State};
pub use trajectory::Trajectory;
