//! Where a joint stands if it brakes now.

use crate::{
    error::Error,
    state::{Limits, State},
    trajectory::Trajectory,
};

/// The fastest stop of one joint: what a controller compares with the room that is left.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stopping {
    /// Time until it stands, in seconds.
    pub duration: f64,
    /// Where it stands then.
    pub position: f64,
    /// The lowest and the highest position on the way there, both ends included.
    pub lowest: f64,
    /// See `lowest`.
    pub highest: f64,
}

impl Stopping {
    /// The stop from `start` that [`Trajectory::stop`] makes.
    ///
    /// # Errors
    /// As [`Trajectory::stop`].
    ///
    /// # Realtime
    /// No allocation; closed forms.
    pub fn of(start: &State, limits: &Limits) -> Result<Self, Error> {
        let trajectory = Trajectory::stop(&[*start], &[*limits])?;
        let [profile] = trajectory.profiles();
        let extrema = profile.extrema();
        let duration = trajectory.duration();
        let position = profile.at(duration).position;
        Ok(Stopping { duration, position, lowest: extrema.lowest.position, highest: extrema.highest.position })
    }

    /// Distance covered from `start`, signed.
    #[must_use]
    pub fn distance(&self, start: &State) -> f64 {
        self.position - start.position
    }
}
