//! Sine and cosine of all joints at once.
//!
//! One loop without branches that the compiler turns into vector instructions: several times faster
//! than a call of the C library a joint, and with the same bits on every machine, which the
//! C library does not promise.

use crate::JOINTS_MAX;

/// Angles past this (rad) go the slow way: there what is missing of π/2 would begin to show.
const LIMIT: f64 = 1e5;
/// Added and taken away again it rounds to an integer, which stands in the low bits meanwhile: 1.5·2⁵².
const ROUNDING: f64 = 6_755_399_441_055_744.0;
/// π/2 in two parts of 33 bits, so that their products with integers below 2²⁰ are exact (Cody and
/// Waite); 2·10⁻²¹ is missing.
const HALF_PI: [f64; 2] = [1.570_796_326_734_125_6, 6.077_100_506_303_966e-11];
/// sin r ≈ r + r³·P(r²) on |r| ≤ π/4: the minimax coefficients of FreeBSD's `k_sin.c`.
const SIN: [f64; 6] = [
    -1.666_666_666_666_663_2e-1,
    8.333_333_333_322_49e-3,
    -1.984_126_982_985_795e-4,
    2.755_731_370_707_006_8e-6,
    -2.505_076_025_340_686_3e-8,
    1.589_690_995_211_55e-10,
];
/// cos r ≈ 1 − r²/2 + r⁴·P(r²), likewise of `k_cos.c`.
const COS: [f64; 6] = [
    4.166_666_666_666_66e-2,
    -1.388_888_888_887_411e-3,
    2.480_158_728_947_673e-5,
    -2.755_731_435_139_066_3e-7,
    2.087_572_321_298_175e-9,
    -1.135_964_755_778_819_5e-11,
];

/// Sines and cosines of angles in rad, to about one unit in the last place; what is not finite
/// gives what is no number.
///
/// # Realtime
/// Bounded; no allocation, no panic.
#[inline(always)]
pub(crate) fn sin_cos(angles: &[f64; JOINTS_MAX]) -> ([f64; JOINTS_MAX], [f64; JOINTS_MAX]) {
    let (mut sines, mut cosines) = ([0.0; JOINTS_MAX], [0.0; JOINTS_MAX]);
    for ((&angle, sine), cosine) in angles.iter().zip(&mut sines).zip(&mut cosines) {
        let shifted = angle * core::f64::consts::FRAC_2_PI + ROUNDING;
        let quarters = shifted - ROUNDING;
        let r = (angle - quarters * HALF_PI[0]) - quarters * HALF_PI[1];
        let z = r * r;
        let sin = r + r * z * polynomial(&SIN, z);
        let cos = 1.0 - (0.5 * z - z * z * polynomial(&COS, z));
        // Quarter turn by quarter turn the two swap places, and signs.
        let quarter = shifted.to_bits();
        let swap = (sin.to_bits() ^ cos.to_bits()) & (quarter & 1).wrapping_neg();
        *sine = f64::from_bits(sin.to_bits() ^ swap ^ ((quarter & 2) << 62));
        *cosine = f64::from_bits(cos.to_bits() ^ swap ^ (((quarter + 1) & 2) << 62));
    }
    if angles.iter().any(|angle| angle.abs() > LIMIT) {
        far(angles, &mut sines, &mut cosines);
    }
    (sines, cosines)
}

#[inline]
fn polynomial(coefficients: &[f64; 6], z: f64) -> f64 {
    let [a, b, c, d, e, f] = *coefficients;
    // Not Horner's order but Estrin's: half as deep, so that less waits for the result before it.
    let square = z * z;
    (a + z * b) + square * ((c + z * d) + square * (e + z * f))
}

#[cold]
fn far(angles: &[f64; JOINTS_MAX], sines: &mut [f64; JOINTS_MAX], cosines: &mut [f64; JOINTS_MAX]) {
    for ((angle, sine), cosine) in angles.iter().zip(sines).zip(cosines) {
        if angle.abs() > LIMIT {
            (*sine, *cosine) = angle.sin_cos();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn agrees(angle: f64) {
        let (sines, cosines) = sin_cos(&[angle; JOINTS_MAX]);
        for lane in 0..JOINTS_MAX {
            let (sine, cosine) = (sines[lane] - angle.sin(), cosines[lane] - angle.cos());
            assert!(sine.abs() < 3e-16 && cosine.abs() < 3e-16, "{angle}: off by {sine:e} and {cosine:e}");
        }
    }

    /// Every quarter turn's edge, both sides of the limit, both zeros.
    #[test]
    fn edges_agree_with_the_library() {
        for quarter in -40..=40 {
            for off in [-1e-9, 0.0, 1e-9, core::f64::consts::FRAC_PI_4] {
                agrees(f64::from(quarter) * core::f64::consts::FRAC_PI_2 + off);
            }
        }
        for angle in [-0.0, f64::MIN_POSITIVE, 0.999 * LIMIT, -0.999 * LIMIT, 1.001 * LIMIT, -1e15, f64::MAX] {
            agrees(angle);
        }
    }

    #[test]
    fn what_is_not_finite_shows() {
        for angle in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            let (sines, cosines) = sin_cos(&[angle; JOINTS_MAX]);
            assert!(sines.iter().chain(&cosines).all(|x| x.is_nan()), "{angle}: {sines:?} {cosines:?}");
        }
    }

    proptest! {
        /// Any angle a joint can stand at, and far beyond.
        #[test]
        fn angles_agree_with_the_library(angle in -1e5..1e5, small in -7.0..7.0) {
            agrees(angle);
            agrees(small);
        }
    }
}
