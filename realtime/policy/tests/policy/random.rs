//! Numbers that depend on nothing but their place.

use tandem_policy::Shape;

/// A number in -1..1 that depends on nothing but its place.
pub(crate) fn noise(seed: u64, index: usize) -> f32 {
    let mut bits = seed ^ (index as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    ((bits >> 40) as f32 / (1_u64 << 23) as f32) - 1.0
}

/// Numbers of a policy whose sums stay near one.
pub(crate) fn random(shape: &Shape, seed: u64) -> Vec<f32> {
    let count = shape.numbers().expect("a shape");
    (0..count)
        .map(|index| if index < 2 * shape.inputs { noise(seed, index) } else { 0.08 * noise(seed, index) })
        .collect()
}
