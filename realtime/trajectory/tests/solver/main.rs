//! The solver against ruckig's durations, against exact integration, and against itself.
//!
//! A campaign is the same with more inputs:
//! `TANDEM_CAMPAIGN=1000 cargo test --release -p tandem-trajectory --test solver -- --nocapture`
#![allow(clippy::disallowed_types, clippy::disallowed_macros, reason = "a test may allocate and print")]

mod cases;
mod check;
mod closed_loop;
mod exact;
mod features;
mod inputs;
mod moving;
mod oracle;
mod raw;
mod sweep;
