//! How deep idle processors may sleep.

use std::fs::OpenOptions;
use std::io::Write as _;

use rustix::io::Errno;

use super::Notice;

const FILE: &str = "/dev/cpu_dma_latency";

/// Asks that idle processors wake up within `latency_us`. The kernel keeps to it for as long as the file is open,
/// which is as long as the process lives.
pub(super) fn hold(latency_us: u32) -> Result<(), Notice> {
    let refused =
        |cause: std::io::Error| Notice::LatencyNotHeld { cause: Errno::from_io_error(&cause).unwrap_or(Errno::IO) };
    let mut file = OpenOptions::new().write(true).open(FILE).map_err(refused)?;
    file.write_all(&latency_us.to_ne_bytes()).map_err(refused)?;
    core::mem::forget(file);
    Ok(())
}
