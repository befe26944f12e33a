//! Times held more exactly than one double does.
//!
//! A switching time of a 100 s motion is known to 1e-14 s as a double, which a jerk of 1e6 turns
//! into an acceleration off by 1e-8. So switching times carry their rounding along, and durations
//! of segments, being differences of such times, are as exact as when they were computed.

/// A time in seconds: a double a few roundings from it, and what is missing.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Instant {
    pub(crate) time: f64,
    pub(crate) rest: f64,
}

impl Instant {
    pub(crate) fn at(time: f64) -> Self {
        Instant { time, rest: 0.0 }
    }

    /// This time, `duration` later (earlier, if negative).
    pub(crate) fn after(self, duration: f64) -> Self {
        // The error of a sum of two doubles is a double, and this is it.
        let sum = self.time + duration;
        let part = sum - self.time;
        let error = (self.time - (sum - part)) + (duration - part);
        Instant { time: sum, rest: self.rest + error }
    }

    /// The same time with `time`, a rounding away, as its leading part.
    pub(crate) fn read_as(self, time: f64) -> Self {
        Instant { time, rest: self.since(Instant::at(time)) }
    }

    /// The time since `earlier`.
    pub(crate) fn since(self, earlier: Instant) -> f64 {
        (self.time - earlier.time) + (self.rest - earlier.rest)
    }
}
