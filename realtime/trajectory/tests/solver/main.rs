//! The solver against ruckig's durations, against exact integration, and against itself.

mod cases;
mod check;
mod exact;
mod inputs;
mod oracle;
mod sweep;
