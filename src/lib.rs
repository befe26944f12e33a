//! Tandem, a zero-copy realtime controller for human-robot assembly workcells.
//!
//! ARCHITECTURE.md says how the parts hang together; each module's first lines
//! say what it decides and what never happens in it.

pub mod bench;
pub mod black_box;
pub mod cli;
pub mod doctor;
pub mod evaluation;
pub mod learning;
pub mod live;
pub mod lockstep;
pub mod observe;
pub mod perception;
pub mod plant;
pub mod plot;
pub mod recognise;
pub mod roles;
pub mod strategy;
pub mod supervisor;
