//! Durations by size, in fixed memory.

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

    /// The duration that the share `quantile` (0 to 1) of all does not exceed, nanoseconds.
    pub fn quantile_ns(&self, quantile: f64) -> u64 {
        let rank = (quantile.clamp(0.0, 1.0) * self.total as f64).ceil().max(1.0) as u64;
        let mut seen = 0;
        for (index, count) in self.counts.iter().enumerate() {
            seen += count;
            if seen >= rank && index < BUCKETS - 1 {
                return upper(index).min(self.max_ns);
            }
        }
        self.max_ns
    }
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

        /// Every value lies in a bucket whose upper end is not below it and whose predecessor's is.
        #[test]
        fn buckets_are_in_order(value in 1u64..1 << 36) {
            let index = bucket(value);
            prop_assert!(upper(index) >= value && upper(index - 1) < value);
        }
    }
}
