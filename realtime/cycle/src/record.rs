//! What a loop found out about itself.

use crate::Histogram;

/// Counts and durations of one loop since its start. Fixed size.
///
/// **Invariant:** `cycles + missed` is the number of grid points since the first cycle, itself included.
#[derive(Clone, Debug, Default)]
pub struct Record {
    /// Cycles run.
    pub cycles: u64,
    /// Grid points that passed without a cycle.
    pub missed: u64,
    /// Cycles that ended after the grid point that follows them.
    pub overruns: u64,
    /// Last wake-up, nanoseconds after its deadline.
    pub lateness_last_ns: u64,
    /// Last cycle's duration, nanoseconds.
    pub busy_last_ns: u64,
    /// Wake-ups, nanoseconds after their deadlines.
    pub lateness: Histogram,
    /// Durations of cycles, nanoseconds.
    pub busy: Histogram,
}
