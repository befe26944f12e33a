//! Tandem, the workcell controller.
pub mod plant;
pub mod strategy;
pub mod supervisor;
