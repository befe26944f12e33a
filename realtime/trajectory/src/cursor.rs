//! Evaluation at times that only go forward, as in a control loop.

use crate::{state::State, trajectory::Trajectory};

/// A place in a trajectory. Asking for the next time looks at the current segment first.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cursor<const N: usize> {
    segments: [u8; N],
}

impl<const N: usize> Default for Cursor<N> {
    fn default() -> Self {
        Cursor { segments: [0; N] }
    }
}

impl<const N: usize> Cursor<N> {
    /// The same as [`Trajectory::at`]. A time before the last one asked for is answered, too, from the
    /// beginning.
    #[inline]
    pub fn at(&mut self, trajectory: &Trajectory<N>, time: f64) -> [State; N] {
        let profiles = trajectory.profiles();
        core::array::from_fn(|joint| profiles[joint].at_from(time, &mut self.segments[joint]))
    }
}
