//! A root of a monotone function.

/// Halvings that bring any bracket of doubles to neighbours, plus the Newton steps between them.
const STEPS_MAX: usize = 2200;

/// The root of a function with `f(low) < 0 < f(high)` and no other one, given with its slope and a
/// first guess.
///
/// Newton's step when it stays inside the bracket and the bracket keeps shrinking, else the middle.
/// Every second step at most is wasted, so the loop ends within `STEPS_MAX`; three to eight steps
/// are usual.
pub(crate) fn root_between(function: impl Fn(f64) -> (f64, f64), mut low: f64, mut high: f64, mut guess: f64) -> f64 {
    let mut last_step = high - low;
    for _ in 0..STEPS_MAX {
        let (value, slope) = function(guess);
        if value == 0.0 {
            return guess;
        }
        if value < 0.0 {
            low = guess;
        } else {
            high = guess;
        }
        let newton = guess - value / slope;
        let step = (newton - guess).abs();
        let next = if newton > low && newton < high && 2.0 * step <= last_step {
            last_step = step;
            newton
        } else if step <= f64::EPSILON * guess.abs() {
            return guess;
        } else {
            last_step = high - low;
            low + (high - low) / 2.0
        };
        if next == guess || next <= low || next >= high {
            return guess;
        }
        guess = next;
    }
    guess
}
