//! When the physics may sleep: nothing is asked, nothing moves, nothing falls.
//!
//! An arm that holds still costs as much to step as one that moves. Once it has
//! settled on an unchanging set-point the next step would leave it where it is,
//! so the step is left out; the first change wakes it in the same cycle.

use super::arm::Measured;

/// Slower than this a joint has settled, rad/s: a tenth of a microradian a cycle.
const SETTLED: f64 = 1e-4;
/// Settled for so many cycles, the world sleeps.
const CYCLES: u32 = 50;

/// How long everything has been still.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Rest {
    still: u32,
}

impl Rest {
    /// Whether the coming step may be left out.
    pub(super) fn asleep(&mut self, disturbed: bool, measured: &Measured) -> bool {
        let settled = measured.velocity.iter().all(|velocity| velocity.abs() < SETTLED);
        self.still = if disturbed || !settled { 0 } else { self.still.saturating_add(1) };
        self.still > CYCLES
    }

    /// Something has changed that the set-points do not show.
    pub(super) fn wake(&mut self) {
        self.still = 0;
    }
}
