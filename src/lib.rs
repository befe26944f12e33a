//! Tandem, the workcell controller.
pub mod learning;
pub mod perception;
pub mod plant;
pub mod strategy;
pub mod supervisor;
