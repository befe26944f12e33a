//! Square root without the standard library.
//!
//! The square root is the only irrational function the solver needs, and IEEE 754 rounds it
//! correctly, so every target gives the same bits.

/// Correctly rounded square root; NaN for a negative argument.
#[cfg(feature = "std")]
#[inline]
pub(crate) fn sqrt(x: f64) -> f64 {
    x.sqrt()
}

/// Correctly rounded square root; NaN for a negative argument. `core` has none, so it is made
/// digit by digit.
#[cfg(not(feature = "std"))]
pub(crate) fn sqrt(x: f64) -> f64 {
    digits(x)
}

/// The exact integer root of the significand in 57 steps, rounded to nearest even.
#[cfg(any(test, not(feature = "std")))]
fn digits(x: f64) -> f64 {
    if x == 0.0 || x.is_nan() || x == f64::INFINITY {
        return x;
    }
    if x < 0.0 {
        return f64::NAN;
    }
    let bits = x.to_bits();
    let (mut significand, mut exponent) = (bits & ((1 << 52) - 1), (bits >> 52) as i64);
    if exponent == 0 {
        let shift = i64::from(significand.leading_zeros()) - 11;
        significand <<= shift;
        exponent = 1 - shift;
    } else {
        significand |= 1 << 52;
    }
    exponent -= 1075; // x = significand * 2^exponent
    // Scale to an even exponent with 108 or 109 bits, so that the root has 54 or 55.
    let mut wide = u128::from(significand) << 56;
    exponent -= 56;
    if exponent & 1 != 0 {
        wide <<= 1;
        exponent -= 1;
    }
    let (mut root, mut bit) = (0_u128, 1_u128 << 56);
    while bit != 0 {
        let trial = root | bit;
        if trial * trial <= wide {
            root = trial;
        }
        bit >>= 1;
    }
    // The sticky bit below the root decides ties; u64 -> f64 then rounds to nearest even.
    let sticky = u128::from(root * root != wide);
    let wide_root = ((root << 2) | sticky) as u64;
    let exponent = exponent / 2 - 2;
    wide_root as f64 * f64::from_bits(((exponent + 1023) as u64) << 52)
}

#[cfg(test)]
mod tests {
    use super::{digits, sqrt};

    #[test]
    fn the_portable_root_equals_the_instruction() {
        let mut bits = 0x3ff0_0000_0000_0001_u64;
        for _ in 0..20_000 {
            bits = bits.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let x = f64::from_bits(bits & !(1 << 63));
            if x.is_finite() {
                assert_eq!(digits(x).to_bits(), sqrt(x).to_bits(), "{x:e}");
            }
        }
        for x in [0.0, 1.0, 2.0, 4.0, 5e-324, f64::MIN_POSITIVE, f64::MAX, f64::INFINITY] {
            assert_eq!(digits(x).to_bits(), sqrt(x).to_bits(), "{x:e}");
        }
        assert!(digits(-1.0).is_nan() && sqrt(-1.0).is_nan());
    }
}
