//! Durations by size, in fixed memory.
//!
//! A loop writes a [`SharedHistogram`], which may lie in memory other processes
//! read; a reader works with a [`Histogram`], a copy of it.

use core::sync::atomic::{AtomicU64, Ordering};

/// Buckets in each octave: a value is known to 1/32 of itself.
const SUB_BITS: u32 = 5;
const SUB: u64 = 1 << SUB_BITS;
/// Values from 2^36 ns (69 s) on share the last bucket, which speaks for the maximum.
const OCTAVES: u32 = 36;
const BUCKETS: usize = ((OCTAVES - SUB_BITS + 1) as usize) << SUB_BITS;

/// How often each duration occurred, in buckets whose width grows with the duration.
/// Quantiles are exact below 32 ns and at most 1/32 too high above; the maximum is exact.
#[derive(Clone, Debug)]
pub struct Histogram {
    counts: [u64; BUCKETS],
    total: u64,
    max_ns: u64,
}

impl Default for Histogram {
    fn default() -> Self {
        Self { counts: [0; BUCKETS], total: 0, max_ns: 0 }
    }
}

impl Histogram {
    /// Counts one duration, nanoseconds.
    ///
    /// # Realtime
    /// Constant time; allocates nothing.
    pub fn record(&mut self, value_ns: u64) {
        self.counts[bucket(value_ns)] += 1;
        self.total += 1;
        self.max_ns = self.max_ns.max(value_ns);
    }

    /// How many were counted.
    pub fn total(&self) -> u64 {
        self.total
    }

    /// The largest, nanoseconds; 0 when nothing was counted.
    pub fn max_ns(&self) -> u64 {
        self.max_ns
    }

    /// Adds what another one has counted.
    pub fn add(&mut self, other: &Self) {
        for (count, more) in self.counts.iter_mut().zip(&other.counts) {
            *count += more;
        }
        self.total += other.total;
        self.max_ns = self.max_ns.max(other.max_ns);
    }

    /// What was counted since an earlier copy of the same histogram. Unless the maximum has grown
    /// since, the maximum of the answer is known to its bucket only.
    #[must_use]
    pub fn since(&self, earlier: &Self) -> Self {
        let mut since = Self::default();
        let counts = since.counts.iter_mut().zip(self.counts.iter().zip(&earlier.counts)).enumerate();
        let mut last = 0;
        for (index, (count, (now, then))) in counts {
            *count = now.saturating_sub(*then);
            since.total += *count;
            last = if *count > 0 { upper(index) } else { last };
        }
        since.max_ns = if self.max_ns > earlier.max_ns { self.max_ns } else { last.min(self.max_ns) };
        since
    }

    /// The buckets that hold something: largest value, nanoseconds, and count.
    pub fn buckets(&self) -> impl Iterator<Item = (u64, u64)> {
        let held = self.counts.iter().enumerate().filter(|(_, count)| **count > 0);
        held.map(|(index, count)| (if index < BUCKETS - 1 { upper(index) } else { self.max_ns }, *count))
    }

    /// The duration that the share `quantile` (0 to 1) of all does not exceed, nanoseconds.
    pub fn quantile_ns(&self, quantile: f64) -> u64 {
        find(self.counts.iter().copied(), self.total, self.max_ns, quantile)
    }
}

fn find(counts: impl Iterator<Item = u64>, total: u64, max_ns: u64, quantile: f64) -> u64 {
    let rank = (quantile.clamp(0.0, 1.0) * total as f64).ceil().max(1.0) as u64;
    let mut seen = 0;
    for (index, count) in counts.enumerate() {
        seen += count;
        if seen >= rank && index < BUCKETS - 1 {
            return upper(index).min(max_ns);
        }
    }
    max_ns
}

/// A [`Histogram`] that one loop writes while others read it.
#[repr(C)]
pub struct SharedHistogram {
    counts: [AtomicU64; BUCKETS],
    max_ns: AtomicU64,
}

impl Default for SharedHistogram {
    fn default() -> Self {
        Self { counts: [const { AtomicU64::new(0) }; BUCKETS], max_ns: AtomicU64::new(0) }
    }
}

impl SharedHistogram {
    /// Counts one duration, nanoseconds. By the one writer only.
    ///
    /// # Realtime
    /// Constant time: loads and stores, no locked instruction, no system call.
    pub fn record(&self, value_ns: u64) {
        raise(&self.counts[bucket(value_ns)], 1);
        if value_ns > self.max_ns.load(Ordering::Relaxed) {
            self.max_ns.store(value_ns, Ordering::Relaxed);
        }
    }

    /// The largest, nanoseconds; 0 when nothing was counted.
    pub fn max_ns(&self) -> u64 {
        self.max_ns.load(Ordering::Relaxed)
    }

    /// As [`Histogram::quantile_ns`], without a copy. By the one writer only.
    ///
    /// # Realtime
    /// Bounded by the number of buckets.
    pub(crate) fn quantile_ns(&self, quantile: f64) -> u64 {
        let count = |count: &AtomicU64| count.load(Ordering::Relaxed);
        let total = self.counts.iter().map(count).sum();
        find(self.counts.iter().map(count), total, self.max_ns(), quantile)
    }

    /// What has been counted so far; a duration that is just being counted may be missing.
    pub fn copy_to(&self, copy: &mut Histogram) {
        copy.total = 0;
        for (to, from) in copy.counts.iter_mut().zip(&self.counts) {
            *to = from.load(Ordering::Relaxed);
            copy.total += *to;
        }
        copy.max_ns = self.max_ns.load(Ordering::Relaxed);
    }

    /// Forgets everything. By the one writer only.
    pub fn clear(&self) {
        self.counts.iter().chain([&self.max_ns]).for_each(|count| count.store(0, Ordering::Relaxed));
    }
}

/// Adds to a number that only the caller writes.
pub(crate) fn raise(number: &AtomicU64, by: u64) {
    number.store(number.load(Ordering::Relaxed).wrapping_add(by), Ordering::Relaxed);
}

/// Below 32 each value has its own bucket; above, 32 buckets an octave.
fn bucket(value: u64) -> usize {
    if value < SUB {
        return value as usize;
    }
    let octave = value.ilog2();
    if octave >= OCTAVES {
        return BUCKETS - 1;
    }
    let shift = octave - SUB_BITS;
    (((shift + 1) as usize) << SUB_BITS) + ((value >> shift) - SUB) as usize
}

/// The largest value of a bucket.
fn upper(index: usize) -> u64 {
    let index = index as u64;
    if index < SUB {
        return index;
    }
    let shift = (index >> SUB_BITS) - 1;
    (((index & (SUB - 1)) + SUB + 1) << shift) - 1
}

#[cfg(test)]
#[allow(clippy::disallowed_types, clippy::disallowed_macros)] // Reason: the test keeps every value to compare with.
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn an_empty_histogram_answers_zero() {
        let empty = Histogram::default();
        assert_eq!((empty.quantile_ns(0.5), empty.max_ns(), empty.total()), (0, 0, 0));
    }

    #[test]
    fn a_value_past_the_last_octave_is_counted() {
        let mut histogram = Histogram::default();
        histogram.record(u64::MAX);
        assert_eq!((histogram.total(), histogram.max_ns()), (1, u64::MAX));
        assert!(histogram.quantile_ns(1.0) >= 1 << 36);
    }

    proptest! {
        /// A quantile is never below the true one and at most 1/32 above it.
        #[test]
        fn quantiles_are_close_from_above(mut values in prop::collection::vec(0u64..1 << 36, 1..200), q in 0.0..=1.0f64) {
            let mut histogram = Histogram::default();
            for &value in &values {
                histogram.record(value);
            }
            values.sort_unstable();
            let rank = ((q * values.len() as f64).ceil() as usize).max(1);
            let exact = values[rank - 1];
            let found = histogram.quantile_ns(q);
            prop_assert!(found >= exact && found - exact <= exact / 32, "{found} for {exact}");
            prop_assert_eq!(histogram.quantile_ns(1.0), values[values.len() - 1]);
        }

        /// What is read of a shared histogram is what a plain one would hold, and two halves make the whole.
        #[test]
        fn a_shared_one_counts_the_same(values in prop::collection::vec(any::<u64>().prop_map(|v| v >> (v % 64)), 1..200), at in 0usize..200) {
            let (mut plain, mut copy, mut sum) = (Histogram::default(), Histogram::default(), Histogram::default());
            values.iter().for_each(|value| plain.record(*value));
            for half in [&values[..at.min(values.len())], &values[at.min(values.len())..]] {
                let shared = SharedHistogram::default();
                half.iter().for_each(|value| shared.record(*value));
                shared.copy_to(&mut copy);
                sum.add(&copy);
            }
            prop_assert_eq!((sum.total(), sum.max_ns()), (plain.total(), plain.max_ns()));
            prop_assert!(sum.buckets().eq(plain.buckets()));
            prop_assert_eq!(sum.buckets().map(|(_, count)| count).sum::<u64>(), values.len() as u64);
        }

        /// What came since an earlier copy is what was recorded since.
        #[test]
        fn two_copies_tell_what_came_between(before in prop::collection::vec(0u64..1 << 36, 0..99), after in prop::collection::vec(0u64..1 << 36, 0..99)) {
            let (mut whole, mut part) = (Histogram::default(), Histogram::default());
            before.iter().for_each(|value| whole.record(*value));
            let earlier = whole.clone();
            for value in &after {
                whole.record(*value);
                part.record(*value);
            }
            let since = whole.since(&earlier);
            prop_assert_eq!(since.total(), after.len() as u64);
            prop_assert!(since.counts == part.counts);
            let max = since.max_ns();
            prop_assert!(max >= part.max_ns() && max - part.max_ns() <= part.max_ns() / 32, "{max} for {}", part.max_ns());
        }

        /// Every value lies in a bucket whose upper end is not below it and whose predecessor's is.
        #[test]
        fn buckets_are_in_order(value in 1u64..1 << 36) {
            let index = bucket(value);
            prop_assert!(upper(index) >= value && upper(index - 1) < value);
        }
    }
}
