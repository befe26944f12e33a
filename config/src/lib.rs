//! The files of a cell, read and checked: TOML, URDF and JSON become values nobody else can build.
//!
//! [`Cell::load`] reads every file a cell names, checks every value against the
//! one place its bounds are declared, and answers with either a whole cell or all
//! the [`Faults`] of all files at once, each with file, line, column, the value
//! found, what is allowed and what to do.
//!
//! **Invariant:** past `load` nothing here reads a file, and nothing a role asks of
//! a cell can be missing, out of range or not finite.
//!
//! Frames are written `a_from_b`. A TCP's z axis is the direction in which the tool
//! approaches; part, station and fixture frames have z up. SI units, radians.

mod body;
mod camera;
mod cell;
mod controller;
mod fault;
mod human;
mod layout;
mod part_set;
mod perception;
mod plant;
mod policies;
mod pose;
mod product;
mod read;
mod robot;
mod strategy;
mod supervisor;
mod tensors;
mod timing;

pub use body::{Body, Cuboid, FeatureGeometry};
pub use camera::Camera;
pub use cell::{Cell, Store};
pub use fault::{Fault, Faults};
pub use human::Human;
pub use layout::{FixedObject, Layout, RackSlot, Station, id};
pub use part_set::{LabelledPart, PartSet};
pub use perception::Perception;
pub use plant::Plant;
pub use policies::{PolicyCard, PolicyModel};
pub use pose::{isometry_of, pose_of};
pub use product::{Capture, Part, Product};
pub use robot::{Collision, LinkInertia, Robot, RobotOptions};
pub use strategy::{AssemblyMode, Focus, Form, Range, ReferenceRow, Step, StrategyRow, Subject, Verb};
pub use supervisor::{Capability, Supervisor, Timeouts};
pub use tensors::Tensors;
pub use timing::{Overrun, OverrunPolicy, Policy, Realtime, Schedule, Timing};
