//! The time grid all loops of a cell share.

use core::time::Duration;

use tandem_msg::Stamp;

/// The instants `t` with `t mod period = phase`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    period_ns: u64,
    phase_ns: u64,
}

/// Why no grid can be made of a period and a phase.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GridError {
    /// The period is out of range.
    Period(Duration),
    /// The phase is not below the period.
    Phase {
        /// The phase.
        phase: Duration,
        /// The period.
        period: Duration,
    },
}

impl Grid {
    /// Shortest period: 20 kHz.
    pub const PERIOD_MIN: Duration = Duration::from_micros(50);
    /// Longest period.
    pub const PERIOD_MAX: Duration = Duration::from_secs(10);

    /// # Errors
    /// The period is outside [`Self::PERIOD_MIN`]..=[`Self::PERIOD_MAX`], or the phase is not below it.
    pub fn new(period: Duration, phase: Duration) -> Result<Self, GridError> {
        if period < Self::PERIOD_MIN || period > Self::PERIOD_MAX {
            Err(GridError::Period(period))
        } else if phase >= period {
            Err(GridError::Phase { phase, period })
        } else {
            // Both are at most 10 s.
            Ok(Self { period_ns: period.as_nanos() as u64, phase_ns: phase.as_nanos() as u64 })
        }
    }

    /// Distance between two points.
    pub fn period(&self) -> Duration {
        Duration::from_nanos(self.period_ns)
    }

    /// Offset of the points on the clock, below the period.
    pub fn phase(&self) -> Duration {
        Duration::from_nanos(self.phase_ns)
    }

    /// Each `divisor`-th point of the clock's own grid of that period: some of these points, with the same phase.
    pub(crate) fn every(&self, divisor: u32) -> Self {
        Self { period_ns: self.period_ns * u64::from(divisor), phase_ns: self.phase_ns }
    }

    /// The last point at or before `t`; the very first one if there is none.
    pub fn at_or_before(&self, t: Stamp) -> Stamp {
        let into = t.0.saturating_sub(self.phase_ns);
        Stamp(into - into % self.period_ns + self.phase_ns)
    }

    /// The first point at or after `t`.
    pub fn at_or_after(&self, t: Stamp) -> Stamp {
        let before = self.at_or_before(t);
        if before >= t { before } else { self.next(before) }
    }

    /// The point after the point `point`.
    pub fn next(&self, point: Stamp) -> Stamp {
        Stamp(point.0.saturating_add(self.period_ns))
    }

    /// How many steps lead from one point to a later one.
    pub fn steps(&self, from: Stamp, to: Stamp) -> u64 {
        to.0.saturating_sub(from.0) / self.period_ns
    }
}

impl core::fmt::Display for GridError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            Self::Period(period) => {
                write!(f, "period {period:?}, allowed {:?}..={:?}", Grid::PERIOD_MIN, Grid::PERIOD_MAX)
            }
            Self::Phase { phase, period } => write!(f, "phase {phase:?}, allowed 0..{period:?}"),
        }
    }
}

impl core::error::Error for GridError {}

#[cfg(test)]
#[allow(clippy::disallowed_macros)] // Reason: the test's messages are formatted.
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn periods_and_phases_out_of_range_are_refused() {
        let ms = Duration::from_millis;
        assert_eq!(Grid::new(ms(0), ms(0)), Err(GridError::Period(ms(0))));
        assert_eq!(Grid::new(ms(1), ms(1)), Err(GridError::Phase { phase: ms(1), period: ms(1) }));
        assert!(Grid::new(Duration::from_secs(11), ms(0)).is_err());
        assert_eq!(GridError::Period(ms(0)).to_string(), "period 0ns, allowed 50µs..=10s");
    }

    proptest! {
        /// Around any instant the two neighbours are points of the grid, and no point lies between them.
        #[test]
        fn neighbours_enclose_an_instant(period in 50_000u64..10_000_000, share in 0.0..1.0f64, t in 10_000_000u64..1 << 62) {
            let phase = (period as f64 * share) as u64;
            let grid = Grid::new(Duration::from_nanos(period), Duration::from_nanos(phase)).expect("in range");
            let (before, after) = (grid.at_or_before(Stamp(t)), grid.at_or_after(Stamp(t)));
            prop_assert!(before.0 <= t && t <= after.0);
            prop_assert_eq!(before.0 % period, phase);
            prop_assert_eq!(after.0 % period, phase);
            prop_assert_eq!(grid.steps(before, after), u64::from(before.0 != t));
        }
    }
}
