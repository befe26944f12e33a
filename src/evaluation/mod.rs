//! Measuring a cell against what is demanded of it.

pub mod safety;
