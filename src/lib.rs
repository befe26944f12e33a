//! Tandem, the workcell controller.
pub mod strategy;
pub mod supervisor;
