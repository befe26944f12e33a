//! What every message begins with, and how a reader judges it.

use core::time::Duration;

/// Monotonic nanoseconds of one clock: CLOCK_MONOTONIC in a live cell, the
/// virtual clock in lockstep. Comparable only within that clock; "now" is always
/// an argument, read once per cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(transparent)]
pub struct Stamp(pub u64);

impl Stamp {
    /// How long ago this was at `now`; zero if it lies ahead.
    pub fn age_at(self, now: Stamp) -> Duration {
        Duration::from_nanos(now.0.saturating_sub(self.0))
    }

    /// This instant, `later` on; saturates at the end of time.
    #[must_use]
    pub fn after(self, later: Duration) -> Self {
        Self(self.0.saturating_add(u64::try_from(later.as_nanos()).unwrap_or(u64::MAX)))
    }

    /// Seconds since the clock's zero.
    pub fn as_secs_f64(self) -> f64 {
        self.0 as f64 * 1e-9
    }
}

/// The first 32 bytes of every message.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(C)]
pub struct Header {
    /// Counts the writer's publications from 1; 0 means nothing was ever written.
    pub seq: u64,
    /// When the writer's cycle began.
    pub stamp: Stamp,
    /// Incarnation of the writer: grows each time its process is started anew.
    pub epoch: u64,
    /// Hash of the cell's configuration; peers of another cell are refused.
    pub config_hash: u64,
}
const _: () = assert!(size_of::<Header>() == 32);

impl Header {
    /// Whether anything was ever written.
    pub fn heard(&self) -> bool {
        self.seq != 0
    }

    /// The header of the next publication of the same writer.
    #[must_use]
    pub fn next(&self, stamp: Stamp) -> Self {
        Self { seq: self.seq + 1, stamp, ..*self }
    }

    /// Says what is wrong with a sample whose predecessor had the header `last`.
    ///
    /// # Errors
    /// The first [`Suspect`] found, in the order of that enumeration.
    pub fn judge(&self, last: &Header, now: Stamp, freshness: &Freshness) -> Result<(), Suspect> {
        if !self.heard() {
            Err(Suspect::NeverHeard)
        } else if self.config_hash != freshness.config_hash {
            Err(Suspect::ForeignConfig)
        } else if self.epoch < last.epoch {
            Err(Suspect::OldEpoch)
        } else if self.epoch == last.epoch && self.seq < last.seq {
            Err(Suspect::Reordered)
        } else if self.stamp > now.after(freshness.age_max) {
            Err(Suspect::FromTheFuture)
        } else if self.stamp.age_at(now) > freshness.age_max {
            Err(Suspect::Stale)
        } else {
            Ok(())
        }
    }
}

/// What a reader asks of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Freshness {
    /// Oldest acceptable stamp, as an age.
    pub age_max: Duration,
    /// The reader's own configuration hash.
    pub config_hash: u64,
}

/// Why a sample must not be acted on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Suspect {
    /// Nothing was ever written.
    NeverHeard,
    /// The writer runs another configuration.
    ForeignConfig,
    /// Written by a process that has been replaced.
    OldEpoch,
    /// Older than a sample already read.
    Reordered,
    /// Stamped later than the reader's clock allows.
    FromTheFuture,
    /// Older than the reader accepts.
    Stale,
}

/// A message: plain data that may lie in memory shared by several processes.
///
/// # Safety
/// The implementor is `repr(C)` or `repr(transparent)`, holds no pointer or
/// reference, has no padding between or after its fields, and every bit pattern a peer may leave in it is a valid value.
#[allow(unsafe_code)]
pub unsafe trait Message: Copy + Default + Send + Sync + 'static {
    /// Name of the type on the wire.
    const NAME: &'static str;
    /// The header every message begins with.
    fn header(&self) -> &Header;
    /// The header, to be filled in by the writer.
    fn header_mut(&mut self) -> &mut Header;
}

/// Declares a type of this crate a message.
macro_rules! message {
    ($type:ident, $size:literal) => {
        const _: () = assert!(size_of::<$type>() == $size);
        const _: () = assert!(core::mem::offset_of!($type, header) == 0);
        // SAFETY: repr(C), plain numbers only; enumerations travel as `Code`, for
        // which every bit pattern is valid.
        #[allow(unsafe_code)]
        unsafe impl crate::Message for $type {
            const NAME: &'static str = concat!("tandem::", stringify!($type));
            fn header(&self) -> &crate::Header {
                &self.header
            }
            fn header_mut(&mut self) -> &mut crate::Header {
                &mut self.header
            }
        }
    };
}
pub(crate) use message;

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const FRESH: Freshness = Freshness { age_max: Duration::from_millis(20), config_hash: 7 };

    fn header(seq: u64, stamp: u64, epoch: u64) -> Header {
        Header { seq, stamp: Stamp(stamp), epoch, config_hash: 7 }
    }

    #[test]
    fn each_suspicion_has_its_name() {
        let last = header(5, 1_000, 2);
        let now = Stamp(30_000_000);
        let judge = |h: Header| h.judge(&last, now, &FRESH);
        assert_eq!(judge(Header::default()), Err(Suspect::NeverHeard));
        assert_eq!(judge(Header { config_hash: 8, ..header(6, 29_000_000, 2) }), Err(Suspect::ForeignConfig));
        assert_eq!(judge(header(900, 29_000_000, 1)), Err(Suspect::OldEpoch));
        assert_eq!(judge(header(4, 29_000_000, 2)), Err(Suspect::Reordered));
        assert_eq!(judge(header(6, 50_000_001, 2)), Err(Suspect::FromTheFuture));
        assert_eq!(judge(header(6, 9_999_999, 2)), Err(Suspect::Stale));
        assert_eq!(judge(header(6, 10_000_000, 2)), Ok(()));
        assert_eq!(judge(header(1, 29_000_000, 3)), Ok(()), "a new incarnation counts from 1 again");
    }

    proptest! {
        /// A sample of a replaced writer is refused whatever else it says.
        #[test]
        fn an_old_epoch_is_never_accepted(seq in 1u64.., stamp in 0u64..60_000_000, epoch in 0u64..9) {
            let judged = header(seq, stamp, epoch).judge(&header(1, 0, 9), Stamp(30_000_000), &FRESH);
            prop_assert!(judged.is_err());
        }
    }
}
