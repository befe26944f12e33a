//! The solver against ruckig's durations, against exact integration, and against itself.

mod cases;
mod check;
mod closed_loop;
mod exact;
mod features;
mod inputs;
mod oracle;
mod raw;
mod sweep;
