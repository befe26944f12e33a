//! Pitch of a thread, by the periodicity of its profile along the helix.

use std::f64::consts::TAU;

use tandem_msg::Measured;

/// Pitches looked for, in radii of the mean profile.
const PITCH: [f64; 2] = [0.12, 0.55];
const FREQUENCIES: usize = 240;
/// Share of the profile's power the best frequency must explain.
const POWER_MIN: f64 = 0.12;

/// Pitch from points of a threaded wall: height along the axis, angle about it, and distance
/// off the mean wall, metres and radians; and the share of the wall's variance the helix
/// explains. The pitch is zero when no frequency stands out; `None` when too little is seen.
///
/// A right-handed thread of pitch p has the profile f(z/p − φ/2π), so the distances correlate
/// with exp(i(2πz/p − φ)); the best of a range of frequencies is taken and interpolated.
pub(crate) fn pitch(points: &[[f64; 3]], radius: f64) -> Option<(Measured, f64)> {
    if points.len() < 60 {
        return None;
    }
    let mean = points.iter().map(|p| p[2]).sum::<f64>() / points.len() as f64;
    let power: f64 = points.iter().map(|p| (p[2] - mean).powi(2)).sum();
    if power <= 0.0 {
        return None;
    }
    let (low, high) = (1.0 / (PITCH[1] * radius), 1.0 / (PITCH[0] * radius));
    let step = (high - low) / (FREQUENCIES - 1) as f64;
    let mut sums = vec![[0.0_f64; 2]; FREQUENCIES];
    for [z, angle, distance] in points {
        let e = distance - mean;
        // Each frequency turns the last one's phase by the same angle.
        let (mut sin, mut cos) = (TAU * z * low - angle).sin_cos();
        let (turn_sin, turn_cos) = (TAU * z * step).sin_cos();
        for sum in &mut sums {
            sum[0] += e * cos;
            sum[1] += e * sin;
            (cos, sin) = (cos * turn_cos - sin * turn_sin, sin * turn_cos + cos * turn_sin);
        }
    }
    // Share of the variance a sine of that frequency explains.
    let share: Vec<f64> =
        sums.iter().map(|s| 2.0 * (s[0] * s[0] + s[1] * s[1]) / (points.len() as f64 * power)).collect();
    let best = (0..FREQUENCIES).max_by(|&a, &b| share[a].total_cmp(&share[b]).then(b.cmp(&a))).unwrap_or(0);
    // The profile is no sine: where its second harmonic stands out, half its frequency does too.
    let half = (low + step * best as f64) / 2.0;
    let below = ((half - low) / step).round();
    let best = if below >= 2.0 {
        let (from, to) = (below as usize - 2, (below as usize + 3).min(FREQUENCIES));
        let fundamental = (from..to).max_by(|&a, &b| share[a].total_cmp(&share[b])).unwrap_or(best);
        if share[fundamental] > 0.4 * share[best] { fundamental } else { best }
    } else {
        best
    };
    if share[best] < POWER_MIN || best == 0 || best == FREQUENCIES - 1 {
        return Some((Measured::default(), share[best]));
    }
    // Vertex of the parabola through the peak and its neighbours.
    let (before, at, after) = (share[best - 1], share[best], share[best + 1]);
    let bend = before - 2.0 * at + after;
    let shift = if bend < 0.0 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 };
    let frequency = low + step * (best as f64 + shift);
    let value = 1.0 / frequency;
    Some((Measured { value, sigma: (0.25 * step / frequency * value).max(0.005 * value) }, share[best]))
}
