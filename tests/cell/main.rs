//! Whole cells in lockstep: the production roles on a virtual clock.

mod assembly;
mod faults;
mod rig;
mod safety;
