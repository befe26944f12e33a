//! Exit codes, the same for every verb.

/// Done as asked.
pub const OK: u8 = 0;
/// Failed; the cause stands on standard error.
pub const FAILED: u8 = 1;
/// The command line could not be understood.
pub const USAGE: u8 = 2;
/// A configuration file, model, robot or database was refused.
pub const CONFIG: u8 = 3;
/// The cell that was asked for is not running.
pub const NOT_RUNNING: u8 = 4;
/// Stopped by a fault of the cell.
pub const FAULT: u8 = 5;
/// Gave up waiting.
pub const TIMED_OUT: u8 = 6;
/// Ended by Ctrl-C or SIGTERM, after the arm had stopped.
pub const INTERRUPTED: u8 = 130;

/// What `--help` says about them.
pub const HELP: &str = "Exit codes: 0 done, 1 failed, 2 usage, 3 configuration refused, 4 not running, 5 stopped by a fault, \
6 timed out, 130 interrupted (after the arm had stopped)";
