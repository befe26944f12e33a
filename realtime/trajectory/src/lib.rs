//! Jerk-limited online trajectory generation, from any state to any target state.
#![no_std]

#[cfg(any(test, feature = "std"))]
extern crate std;

mod brake;
mod cursor;
mod error;
mod extrema;
mod extremal;
mod generator;
mod input;
mod instant;
mod profile;
mod reach;
mod root;
mod sqrt;
mod state;
mod stopping;
mod straight;
mod swing;
mod task;
mod trajectory;

pub use cursor::Cursor;
pub use error::Error;
pub use extrema::{Extrema, Reached};
pub use generator::{Generator, Step};
pub use input::{Input, Interface, Synchronization};
pub use profile::{Profile, Segment};
pub use state::{Limits, State};
pub use stopping::Stopping;
pub use trajectory::Trajectory;
