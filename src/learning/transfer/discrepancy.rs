//! Multi-kernel maximum mean discrepancy (Gretton et al. 2012; Long et al. 2015) of two sets of rows.

/// Bandwidths, in mean squared distances.
const BANDWIDTHS: [f32; 5] = [0.25, 0.5, 1.0, 2.0, 4.0];

/// Squared discrepancy of the rows of `a` and `b`, without the terms of a row with itself, and its
/// gradients by both. The bandwidths count as given.
pub(crate) fn discrepancy(a: &[f32], b: &[f32], width: usize) -> (f32, [Vec<f32>; 2]) {
    let rows: Vec<&[f32]> = a.chunks_exact(width).chain(b.chunks_exact(width)).collect();
    let (first, all) = (a.len() / width, rows.len());
    let mut gradients = [vec![0.0; a.len()], vec![0.0; b.len()]];
    if first < 2 || all - first < 2 {
        return (0.0, gradients);
    }
    let squared = |x: &[f32], y: &[f32]| -> f32 { x.iter().zip(y).map(|(x, y)| (x - y) * (x - y)).sum() };
    let mut distances = vec![0.0; all * all];
    let mut sum = 0.0;
    for i in 0..all {
        for j in 0..i {
            let d = squared(rows[i], rows[j]);
            distances[i * all + j] = d;
            sum += d;
        }
    }
    let mean = (sum / (all * (all - 1) / 2) as f32).max(1e-9);
    let share = |n: usize| 2.0 / (n * (n - 1)) as f32;
    let (within, between) = ([share(first), share(all - first)], -2.0 / (first * (all - first)) as f32);
    let mut value = 0.0;
    for i in 0..all {
        for j in 0..i {
            let weight = if i < first {
                within[0]
            } else if j >= first {
                within[1]
            } else {
                between
            };
            let (mut kernel, mut slope) = (0.0, 0.0);
            for bandwidth in BANDWIDTHS {
                let scale = 1.0 / (bandwidth * mean);
                let k = (-distances[i * all + j] * scale).exp() / BANDWIDTHS.len() as f32;
                kernel += k;
                slope -= k * scale;
            }
            value += weight * kernel;
            for (row, other) in [(i, j), (j, i)] {
                let (set, at) = if row < first { (0, row) } else { (1, row - first) };
                let factor = 2.0 * weight * slope;
                let out = &mut gradients[set][at * width..(at + 1) * width];
                for ((g, x), y) in out.iter_mut().zip(rows[row]).zip(rows[other]) {
                    *g += factor * (x - y);
                }
            }
        }
    }
    (value, gradients)
}
