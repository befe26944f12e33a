//! Tandem, the workcell controller.
pub mod plant;
