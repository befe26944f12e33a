//! How fast a path is followed: a jerk-limited law of one variable, the length.
//!
//! The law always knows two futures: to the end of the path, and to rest as
//! soon as possible. Both stay on the path, so a stop goes only where the path
//! was found clear. Speed scaling is a change of the law's velocity limit.

use tandem_trajectory::{Input, Limits, State, Trajectory};

/// Limits of length per second, squared, cubed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LawLimits {
    pub(crate) velocity: f64,
    pub(crate) acceleration: f64,
    pub(crate) jerk: f64,
}

impl LawLimits {
    fn symmetric(&self) -> Limits {
        Limits::symmetric(self.velocity, self.acceleration, self.jerk)
    }

    /// Whether a law can be made of them.
    pub(crate) fn are_usable(&self) -> bool {
        [self.velocity, self.acceleration, self.jerk].iter().all(|limit| limit.is_finite() && *limit > 0.0)
    }

    pub(crate) fn scaled(&self, speed: f64) -> Self {
        Self { velocity: self.velocity * speed, ..*self }
    }
}

/// What a stop from a state takes.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Stop {
    /// Seconds to standstill.
    pub(crate) duration: f64,
    /// Length at standstill.
    pub(crate) end: f64,
}

/// A law under way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Law {
    trajectory: Trajectory<1>,
    time: f64,
    state: State,
    stopping: bool,
    /// Share of the limit's speed it was made for; 0 when for none.
    share: f64,
}

/// The generator refused: a state or a limit is not a number. An internal fault.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Refused;

impl Law {
    /// To rest at `length`, from any state.
    pub(crate) fn to(length: f64, from: State, limits: &LawLimits) -> Result<Self, Refused> {
        let input = Input::<1> {
            start: [from],
            target: [State::at_rest(length)],
            limits: [limits.symmetric()],
            ..Input::default()
        };
        let trajectory = Trajectory::calculate(&input).map_err(|_| Refused)?;
        Ok(Self { trajectory, time: 0.0, state: from, stopping: false, share: 0.0 })
    }

    /// To rest as soon as possible, from any state.
    pub(crate) fn stop(from: State, limits: &LawLimits) -> Result<Self, Refused> {
        let trajectory = Trajectory::stop(&[from], &[limits.symmetric()]).map_err(|_| Refused)?;
        Ok(Self { trajectory, time: 0.0, state: from, stopping: true, share: 0.0 })
    }

    /// What a stop from a state takes.
    pub(crate) fn stop_from(from: State, limits: &LawLimits) -> Result<Stop, Refused> {
        let law = Self::stop(from, limits)?;
        let duration = law.trajectory.duration();
        Ok(Stop { duration, end: law.trajectory.at(duration)[0].position })
    }

    /// The law that goes on at a share of the limit's speed: to `length`, or to rest at share 0.
    ///
    /// Slowing down begins as the stop does, so that the separation owed falls as fast as it can,
    /// and lets go of the brake in time to meet the new speed from above.
    pub(crate) fn at_share(&self, share: f64, length: f64, limits: &LawLimits) -> Result<Self, Refused> {
        /// Rounding.
        const ABOVE: f64 = 1.0 + 1e-6;
        let State { velocity, acceleration, .. } = self.state;
        let slower = limits.scaled(share);
        let braking = if self.stopping { Ok(*self) } else { Self::stop(self.state, limits) };
        if share <= 0.0 {
            return braking;
        }
        if velocity > slower.velocity * ABOVE {
            // Where the velocity comes to rest when the brake is let go now.
            let settles_at = velocity - acceleration * acceleration / (2.0 * limits.jerk);
            if acceleration > 0.0 || settles_at > slower.velocity {
                return braking;
            }
            let passing = LawLimits { velocity, ..*limits };
            return Self::to(length, self.state, &passing);
        }
        if self.stopping || self.share != share {
            return Ok(Self { share, ..Self::to(length, self.state, &slower)? });
        }
        Ok(*self)
    }

    pub(crate) fn state(&self) -> State {
        self.state
    }

    pub(crate) fn stopping(&self) -> bool {
        self.stopping
    }

    pub(crate) fn duration(&self) -> f64 {
        self.trajectory.duration()
    }

    /// Whether the law has come to its rest.
    pub(crate) fn finished(&self) -> bool {
        self.time >= self.trajectory.duration()
    }

    /// Its state some seconds from now, if nothing changes it.
    pub(crate) fn after(&self, seconds: f64) -> State {
        if self.finished() { self.state } else { self.trajectory.at(self.time + seconds)[0] }
    }

    /// Its state some seconds from now, if it goes over to slower limits at once.
    pub(crate) fn slowed_after(&self, seconds: f64, length: f64, slower: &LawLimits) -> Result<State, Refused> {
        let input = Input::<1> {
            start: [self.state],
            target: [State::at_rest(length)],
            limits: [slower.symmetric()],
            soft_limits: [true],
            ..Input::default()
        };
        Ok(Trajectory::calculate(&input).map_err(|_| Refused)?.at(seconds)[0])
    }

    /// The law one period on.
    pub(crate) fn advanced(&self, period: f64) -> Self {
        let time = self.time + period;
        Self { time, state: self.trajectory.at(time)[0], ..*self }
    }
}
