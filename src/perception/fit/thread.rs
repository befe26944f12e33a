//! Pitch of a thread, by the periodicity of its profile along the helix.

use std::f64::consts::TAU;

use bumpalo::Bump;
use bumpalo::collections::CollectIn;
use nalgebra::{SMatrix, SVector};
use tandem_msg::Measured;

use super::{List, quantile};

/// Pitches looked for, in radii of the mean profile.
const PITCH: [f64; 2] = [0.10, 0.55];
const FREQUENCIES: usize = 256;
/// Winding from which a pitch is told.
const WINDING_MIN: f64 = 0.06;
/// Points a wall has at least.
const POINTS_MIN: usize = 60;
/// Points of pure noise that would explain as much of the variance by chance as is to be believed.
const CHANCE: f64 = 30.0;
/// Terms of the shape a wall has besides a thread.
const TERMS: usize = 7;
/// Steps of the last search, to either side.
const FINE: usize = 40;

/// What a wall says about a thread.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Wound {
    /// Pitch; zero when no thread stands out.
    pub(crate) pitch: Measured,
    /// How much more of the wall's variance a helix of one hand explains than any of the other, 0 to 1.
    pub(crate) winding: f64,
}

/// Looks for a thread in points of a wall: height along the axis, angle about it, and distance
/// off the mean wall, metres and radians. `None` when too little is seen.
///
/// A thread of pitch p has the profile f(z/p ∓ φ/2π), so the distances correlate with
/// exp(i(2πz/p ∓ φ)). What is not wound, rings, an oval, noise, correlates as much with either
/// hand: only the difference tells of a thread. The best of a range of frequencies is taken and
/// sharpened by its harmonics.
pub(crate) fn wound(points: &[[f64; 3]], radius: f64, room: &Bump) -> Option<Wound> {
    let points = detrended(points, room)?;
    let power: f64 = points.iter().map(|p| p[2] * p[2]).sum();
    if power <= 0.0 {
        return None;
    }
    let count = points.len() as f64;
    let (low, high) = (1.0 / (PITCH[1] * radius), 1.0 / (PITCH[0] * radius));
    let step = (high - low) / (FREQUENCIES - 1) as f64;
    let mut sums = [[[0.0_f64; 2]; FREQUENCIES]; 2];
    for [z, angle, e] in &points {
        let (turn_sin, turn_cos) = (TAU * z * step).sin_cos();
        for (sums, hand) in sums.iter_mut().zip([1.0, -1.0]) {
            // Each frequency turns the last one's phase by the same angle.
            let (mut sin, mut cos) = (TAU * z * low - hand * angle).sin_cos();
            for sum in sums {
                sum[0] += e * cos;
                sum[1] += e * sin;
                (cos, sin) = (cos * turn_cos - sin * turn_sin, sin * turn_cos + cos * turn_sin);
            }
        }
    }
    // Share of the variance a sine of that frequency explains.
    let share = sums.map(|sums| sums.map(|[a, b]| 2.0 * (a * a + b * b) / (count * power)));
    let best = share.map(|s| (0..FREQUENCIES).max_by(|&a, &b| s[a].total_cmp(&s[b]).then(b.cmp(&a))).unwrap_or(0));
    let top = [share[0][best[0]], share[1][best[1]]];
    let side = usize::from(top[1] > top[0]);
    let winding = (top[side] - top[1 - side]) * count / (count + CHANCE);
    let mut out = Wound { pitch: Measured::default(), winding };
    if winding < WINDING_MIN {
        return Some(out);
    }
    // The profile is no sine: where its second harmonic stands out, half its frequency does too.
    let mut frequency = low + step * best[side] as f64;
    let half = (0.5 * frequency - low) / step;
    if half >= 2.0 {
        let near = half as usize - 2..(half as usize + 4).min(FREQUENCIES);
        if let Some(at) = near.max_by(|&a, &b| share[side][a].total_cmp(&share[side][b]))
            && share[side][at] > 0.4 * top[side]
        {
            frequency = low + step * at as f64;
        }
    }
    let hand = if side == 0 { 1.0 } else { -1.0 };
    let explained = |frequency: f64| -> f64 {
        let mut sums = [[0.0_f64; 2]; 3];
        for [z, angle, e] in &points {
            let (sin, cos) = (TAU * z * frequency - hand * angle).sin_cos();
            let (sin2, cos2) = (2.0 * sin * cos, cos * cos - sin * sin);
            let (sin3, cos3) = (sin2 * cos + cos2 * sin, cos2 * cos - sin2 * sin);
            for (sum, (cos, sin)) in sums.iter_mut().zip([(cos, sin), (cos2, sin2), (cos3, sin3)]) {
                sum[0] += e * cos;
                sum[1] += e * sin;
            }
        }
        sums.iter().map(|[a, b]| a * a + b * b).sum()
    };
    let heights = points.iter().fold([f64::MAX, f64::MIN], |h, p| [h[0].min(p[0]), h[1].max(p[0])]);
    let width = 0.5 / (heights[1] - heights[0]).max(1e-9) / FINE as f64;
    let scores: [f64; 2 * FINE + 1] = std::array::from_fn(|k| explained(frequency + width * (k as f64 - FINE as f64)));
    let k = (0..=2 * FINE).max_by(|&a, &b| scores[a].total_cmp(&scores[b]).then(b.cmp(&a))).unwrap_or(FINE);
    let mut shift = k as f64 - FINE as f64;
    if k > 0 && k < 2 * FINE {
        // Vertex of the parabola through the peak and its neighbours.
        let bend = scores[k - 1] - 2.0 * scores[k] + scores[k + 1];
        shift += if bend < 0.0 { (0.5 * (scores[k - 1] - scores[k + 1]) / bend).clamp(-0.5, 0.5) } else { 0.0 };
    }
    frequency += width * shift;
    let value = 1.0 / frequency;
    // Deviation of a sine's frequency in noise (Rife and Boorstyn 1974), and the model's own.
    let ratio = (top[side] / (1.0 - top[side]).max(1e-3) * count).max(1.0);
    let sigma = (0.55 / (heights[1] - heights[0]).max(1e-9) / ratio.sqrt() * value * value).max(0.005 * value);
    out.pitch = Measured { value, sigma };
    Some(out)
}

/// The points without strays and without what is smooth about the wall: its slope and bend along the axis,
/// and that its section is displaced or oval.
fn detrended<'r>(points: &[[f64; 3]], room: &'r Bump) -> Option<List<'r, [f64; 3]>> {
    let mut sizes: List<'_, f64> = points.iter().map(|p| p[2].abs()).collect_in(room);
    let limit = 4.0 * quantile(&mut sizes, 0.5);
    let mut kept: List<'_, [f64; 3]> = points.iter().copied().filter(|p| p[2].abs() <= limit).collect_in(room);
    if kept.len() < POINTS_MIN {
        return None;
    }
    let span = kept.iter().fold([f64::MAX, f64::MIN], |h, p| [h[0].min(p[0]), h[1].max(p[0])]);
    let (middle, half) = (0.5 * (span[0] + span[1]), (0.5 * (span[1] - span[0])).max(1e-9));
    let row = |[z, angle, _]: &[f64; 3]| {
        let h = (z - middle) / half;
        let (sin, cos) = angle.sin_cos();
        SVector::<f64, TERMS>::from([1.0, h, h * h, cos, sin, cos * cos - sin * sin, 2.0 * sin * cos])
    };
    let mut normal = SMatrix::<f64, TERMS, TERMS>::identity() * (1e-6 * kept.len() as f64);
    let mut right = SVector::<f64, TERMS>::zeros();
    for p in &kept {
        let row = row(p);
        normal += row * row.transpose();
        right += row * p[2];
    }
    let terms = normal.cholesky()?.solve(&right);
    for p in &mut kept {
        p[2] -= terms.dot(&row(p));
    }
    Some(kept)
}
