//! What is learned before a cell runs.

pub mod encoder;
pub mod transfer;
