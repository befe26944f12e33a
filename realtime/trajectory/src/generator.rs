//! A trajectory kept up to date in a control loop.

use crate::{cursor::Cursor, error::Error, input::Input, state::State, trajectory::Trajectory};

/// What one cycle yields.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Step<const N: usize> {
    /// The states to command now.
    pub states: [State; N],
    /// Whether the target has been reached.
    pub finished: bool,
    /// Whether a new trajectory was calculated in this cycle.
    pub calculated: bool,
}

/// Keeps a trajectory and the time in it, and calculates anew only when the input has changed.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct Generator<const N: usize> {
    /// The input of the current trajectory, with the start the next input is expected to have.
    expected: Input<N>,
    trajectory: Trajectory<N>,
    cursor: Cursor<N>,
    time: f64,
}

impl<const N: usize> Generator<N> {
    /// The trajectory of `input`, at its beginning.
    ///
    /// # Errors
    /// As [`Trajectory::calculate`].
    pub fn new(input: &Input<N>) -> Result<Self, Error> {
        let trajectory = Trajectory::calculate(input)?;
        Ok(Generator { expected: *input, trajectory, cursor: Cursor::default(), time: 0.0 })
    }

    /// Goes on by `period` seconds.
    ///
    /// If `input` starts in the states the last step gave and is the same otherwise, the trajectory
    /// stays; else a new one begins at its start. The caller puts the states of a step into the start
    /// of the next input.
    ///
    /// # Errors
    /// As [`Trajectory::calculate`]; the trajectory so far then stays.
    ///
    /// # Realtime
    /// No allocation; at most one calculation.
    pub fn update(&mut self, input: &Input<N>, period: f64) -> Result<Step<N>, Error> {
        let calculated = *input != self.expected;
        if calculated {
            *self = Self::new(input)?;
        }
        self.time += period;
        let states = self.cursor.at(&self.trajectory, self.time);
        self.expected.start = states;
        Ok(Step { states, finished: self.time >= self.trajectory.duration(), calculated })
    }

    /// The current trajectory.
    #[must_use]
    pub fn trajectory(&self) -> &Trajectory<N> {
        &self.trajectory
    }

    /// The time in the current trajectory, in seconds.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.time
    }
}
