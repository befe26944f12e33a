//! Random numbers that are a function of a seed and a count.

/// A sequence of draws.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Draws {
    seed: u64,
    count: u64,
}

impl Draws {
    pub(crate) fn new(seed: u64) -> Self {
        Self { seed: mix(seed), count: 0 }
    }

    fn next(&mut self) -> u64 {
        self.count = self.count.wrapping_add(1);
        // The golden ratio's fraction: multiples of it are spread evenly.
        mix(self.seed.wrapping_add(self.count.wrapping_mul(0x9E37_79B9_7F4A_7C15)))
    }

    /// From 0 up to, not including, 1.
    pub(crate) fn share(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// The finaliser of SplitMix64 (Steele, Lea and Flood, *Fast Splittable Pseudorandom Number Generators*, 2014).
fn mix(value: u64) -> u64 {
    let value = (value ^ (value >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let value = (value ^ (value >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    value ^ (value >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each tenth of the range is drawn about as often, by one seed or by neighbouring ones.
    #[test]
    fn draws_are_even() {
        let counts = |draw: &mut dyn FnMut(u64) -> f64| {
            let mut counts = [0_u32; 10];
            for k in 0..10_000 {
                counts[(draw(k) * 10.0) as usize] += 1;
            }
            counts
        };
        let mut one = Draws::new(7);
        for counts in [counts(&mut |_| one.share()), counts(&mut |k| Draws::new(k).share())] {
            // Five standard deviations.
            assert!(counts.iter().all(|count| count.abs_diff(1_000) < 150), "{counts:?}");
        }
        assert_ne!(Draws::new(1).share(), Draws::new(2).share());
    }
}
