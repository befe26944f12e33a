//! Products of a vector and a matrix that lies input by input.

use crate::HIDDEN;

/// Rows that are added in one pass over the sums.
const ROWS: usize = 8;

/// `sums += x · matrix`, where `matrix` has a row of `sums.len()` numbers for each of `x`, which are at most [`HIDDEN`].
///
/// A sum is added up in the order of the inputs, whatever the grouping. Rows of zero inputs are
/// not read. A matrix that is too short adds nothing.
#[inline(always)]
pub(crate) fn accumulate(sums: &mut [f32], x: &[f32], matrix: &[f32]) {
    let width = sums.len();
    if width == 0 || x.len() > HIDDEN || matrix.len() < x.len() * width {
        return;
    }
    // Which inputs count, found without a branch: about half do, and none could be foretold.
    let mut active = [0_u16; HIDDEN + 1];
    let mut count = 0;
    for (index, value) in x.iter().enumerate() {
        active[count.min(HIDDEN)] = index as u16;
        count += usize::from(*value != 0.0);
    }
    let row = |index: u16| {
        let index = usize::from(index);
        let value = x.get(index).copied().unwrap_or(0.0);
        (value, matrix.get(index * width..(index + 1) * width).unwrap_or(&[]))
    };
    let (groups, rest) = active.get(..count).unwrap_or(&[]).as_chunks::<ROWS>();
    for group in groups {
        add_rows(sums, &group.map(row));
    }
    for index in rest {
        let (value, weights) = row(*index);
        for (sum, weight) in sums.iter_mut().zip(weights) {
            *sum += value * weight;
        }
    }
}

#[inline(always)]
fn add_rows(sums: &mut [f32], rows: &[(f32, &[f32]); ROWS]) {
    let width = sums.len();
    if rows.iter().any(|(_, weights)| weights.len() != width) {
        return;
    }
    // Slices of one length, so that the loop needs no check and is vectorised.
    let values = rows.map(|(value, _)| value);
    let [a, b, c, d, e, f, g, h] = rows.map(|(_, weights)| &weights[..width]);
    for index in 0..width {
        let mut sum = sums[index];
        sum += values[0] * a[index];
        sum += values[1] * b[index];
        sum += values[2] * c[index];
        sum += values[3] * d[index];
        sum += values[4] * e[index];
        sum += values[5] * f[index];
        sum += values[6] * g[index];
        sum += values[7] * h[index];
        sums[index] = sum;
    }
}

/// Rectifies in place.
#[inline(always)]
pub(crate) fn rectify(values: &mut [f32]) {
    for value in values {
        *value = value.max(0.0);
    }
}
