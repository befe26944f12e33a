//! Live cells: real processes of the real binary, killed, stopped and asked to end.
//!
//! One cell at a time, each in a run directory of its own. A watchdog ends what
//! hangs; nothing here waits for a time to pass, only for something to happen.
//! Bounds in time are generous: what is slow on a busy machine is not wrong.

mod endings;
mod faults;
mod harness;
mod looked_at;
mod whole;
