//! A root of a monotone function.

/// Halvings that bring any bracket of doubles to neighbours, plus the steps between them.
const STEPS_MAX: usize = 2200;

/// A last step this small, relatively, needs no look at where it led.
const LAST_STEP: f64 = 1e-10;

/// The root of a function with `f(low) < 0 < f(high)` and no other one, given with its first two
/// derivatives and a first guess.
///
/// Halley's step when it stays inside the bracket and the bracket keeps shrinking, else the middle.
/// Every second step at most is wasted, so the loop ends within `STEPS_MAX`; two to four steps are
/// usual.
pub(crate) fn root_between(function: impl Fn(f64) -> [f64; 3], mut low: f64, mut high: f64, mut guess: f64) -> f64 {
    let mut last_step = high - low;
    for _ in 0..STEPS_MAX {
        let [value, slope, bend] = function(guess);
        if value == 0.0 {
            return guess;
        }
        if value < 0.0 {
            low = guess;
        } else {
            high = guess;
        }
        let newton = value / slope;
        let turn = newton * bend / slope;
        let halley = newton / (1.0 - (turn / 2.0).clamp(-1.0, 0.5));
        let step = halley.abs();
        let next = guess - halley;
        if next > low && next < high && 2.0 * step <= last_step {
            if step <= LAST_STEP * guess.abs() && turn.abs() <= LAST_STEP {
                return next;
            }
            last_step = step;
            guess = next;
        } else if step <= f64::EPSILON * guess.abs() {
            return guess;
        } else {
            last_step = high - low;
            let middle = low + (high - low) / 2.0;
            if middle <= low || middle >= high {
                return guess;
            }
            guess = middle;
        }
    }
    guess
}
