//! The hyperbolic tangent from additions, multiplications and divisions alone.

/// From here on the hyperbolic tangent is 1 in single precision.
const SATURATED: f32 = 10.0;

/// Hyperbolic tangent, within one unit in the last place of the exact value, the same bits everywhere.
pub(crate) fn tanh(x: f32) -> f32 {
    if x.abs() >= SATURATED {
        return 1.0_f32.copysign(x);
    }
    // tanh x = (e^2x - 1) / (e^2x + 1); the difference is taken before it can cancel.
    let grown = exp_minus_one(2.0 * f64::from(x));
    (grown / (grown + 2.0)) as f32
}

/// `e^x - 1` for `|x| <= 20`.
fn exp_minus_one(x: f64) -> f64 {
    // x = k ln 2 + r with |r| <= ln 2 / 2.
    let k = (x * core::f64::consts::LOG2_E + if x < 0.0 { -0.5 } else { 0.5 }) as i32;
    let r = x - f64::from(k) * core::f64::consts::LN_2;
    // e^r - 1 = r (1 + r/2 (1 + r/3 (…))): what is left out is below r^13 / 13!.
    let small = r * (2..=12).rev().fold(1.0, |tail, n| 1.0 + r / f64::from(n) * tail);
    let power = f64::from_bits(((1023 + i64::from(k)) as u64) << 52);
    power * small + (power - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the system's own, in double precision.
    #[test]
    fn it_is_the_hyperbolic_tangent() {
        for step in -1_200_000..=1_200_000 {
            let x = step as f32 * 1e-5;
            let exact = f64::from(x).tanh();
            let error = (f64::from(tanh(x)) - exact).abs();
            assert!(error <= exact.abs() * f64::from(f32::EPSILON), "tanh {x} = {}, not {exact}", tanh(x));
        }
        for x in [1e-30_f32, 1e-8, f32::MIN_POSITIVE, 0.0] {
            assert_eq!((tanh(x), tanh(-x)), (x, -x));
        }
        assert_eq!((tanh(f32::INFINITY), tanh(f32::NEG_INFINITY)), (1.0, -1.0));
        assert!(tanh(f32::NAN).is_nan());
    }
}
