//! The roles with their ports: what both shells drive.
//!
//! A role knows messages, a shell knows time and processes; between them stands
//! this: which service each role reads and writes. It is the same over shared
//! memory (a live cell) and inside one process (lockstep), so that what is
//! tested in the one runs in the other.

mod controller;
mod perception;
mod plant;
mod ports;
pub mod service;
mod supervisor;

pub use controller::ControllerRole;
pub use perception::PerceptionRole;
pub use plant::{CameraRole, PlantRole};
pub use ports::{MemoryPorts, Ports};
pub use supervisor::{SupervisorRole, Surroundings};
