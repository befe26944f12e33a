//! Products of row-major matrices of `f32`, in panels of columns that stay in the first cache.
//!
//! **Invariant:** the same numbers give the same result on every machine, wide registers or not: sums are
//! taken in the order of the depth, and each multiplication is added with one rounding.

#![allow(clippy::needless_range_loop, reason = "an index here counts in several arrays at once")]
#![allow(unsafe_code, reason = "the kernel compiled for wider vectors is called after the processor was asked")]

/// Columns of a panel.
const LANES: usize = 16;
/// Rows of a register tile.
const ROWS: usize = 6;
/// Greatest depth of a product: units of a layer, or examples of a batch.
pub(crate) const DEPTH_MAX: usize = 384;

/// `c = a · b`, or `c += a · b`; `b` is `depth × width`, `a` has rows of `depth`.
pub(crate) fn product(c: &mut [f32], a: &[f32], b: &[f32], depth: usize, width: usize, add: bool) {
    assert!(depth <= DEPTH_MAX && b.len() == depth * width && a.len() * width == c.len() * depth, "matrices fit");
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma") {
        // SAFETY: the features `wide` is compiled for were detected on this processor.
        return unsafe { wide(c, a, b, depth, width, add) };
    }
    plain(c, a, b, depth, width, add);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn wide(c: &mut [f32], a: &[f32], b: &[f32], depth: usize, width: usize, add: bool) {
    plain(c, a, b, depth, width, add);
}

#[inline(always)]
fn plain(c: &mut [f32], a: &[f32], b: &[f32], depth: usize, width: usize, add: bool) {
    if depth == 0 || width == 0 {
        return;
    }
    let rows = a.len() / depth;
    let mut panel = [[0.0_f32; LANES]; DEPTH_MAX];
    for column in (0..width).step_by(LANES) {
        let lanes = LANES.min(width - column);
        for (to, from) in panel.iter_mut().zip(b.chunks_exact(width)) {
            to[..lanes].copy_from_slice(&from[column..column + lanes]);
            to[lanes..].fill(0.0);
        }
        let panel = &panel[..depth];
        let mut row = 0;
        while row < rows {
            if rows - row >= ROWS {
                tile::<ROWS>(c, a, panel, row, column, lanes, width, add);
                row += ROWS;
            } else if rows - row >= 2 {
                tile::<2>(c, a, panel, row, column, lanes, width, add);
                row += 2;
            } else {
                tile::<1>(c, a, panel, row, column, lanes, width, add);
                row += 1;
            }
        }
    }
}

#[inline(always)]
#[allow(clippy::too_many_arguments)]
fn tile<const R: usize>(
    c: &mut [f32],
    a: &[f32],
    panel: &[[f32; LANES]],
    row: usize,
    column: usize,
    lanes: usize,
    width: usize,
    add: bool,
) {
    let depth = panel.len();
    let rows: [&[f32]; R] = core::array::from_fn(|r| &a[(row + r) * depth..(row + r + 1) * depth]);
    let mut sums = [[0.0_f32; LANES]; R];
    for (k, b) in panel.iter().enumerate() {
        for r in 0..R {
            let x = rows[r][k];
            for lane in 0..LANES {
                sums[r][lane] = x.mul_add(b[lane], sums[r][lane]);
            }
        }
    }
    for (r, sums) in sums.iter().enumerate() {
        let at = (row + r) * width + column;
        for (to, sum) in c[at..at + lanes].iter_mut().zip(sums) {
            *to = if add { *to + sum } else { *sum };
        }
    }
}

/// Writes the transposed of `from`, which has rows of `width`.
pub(crate) fn transpose(from: &[f32], width: usize, to: &mut Vec<f32>) {
    const BLOCK: usize = 16;
    let rows = from.len() / width.max(1);
    to.resize(from.len(), 0.0);
    for top in (0..rows).step_by(BLOCK) {
        for left in (0..width).step_by(BLOCK) {
            for row in top..rows.min(top + BLOCK) {
                for column in left..width.min(left + BLOCK) {
                    to[column * rows + row] = from[row * width + column];
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Sizes that fill tiles and panels and sizes that do not, against the definition in double precision.
    #[test]
    fn products_are_sums_of_products() {
        for (rows, depth, width) in [(1, 1, 1), (7, 5, 3), (128, 84, 256), (13, 256, 17), (64, 256, 1)] {
            let number = |k: usize| ((k * 2_654_435_761) % 1000) as f32 / 500.0 - 1.0;
            let a: Vec<f32> = (0..rows * depth).map(number).collect();
            let b: Vec<f32> = (0..depth * width).map(|k| number(k + 77)).collect();
            let mut c = vec![1.0; rows * width];
            product(&mut c, &a, &b, depth, width, true);
            let mut transposed = Vec::new();
            transpose(&a, depth, &mut transposed);
            for row in 0..rows {
                for column in 0..width {
                    let sum: f64 =
                        (0..depth).map(|k| f64::from(a[row * depth + k]) * f64::from(b[k * width + column])).sum();
                    assert!((f64::from(c[row * width + column]) - 1.0 - sum).abs() < 1e-4);
                }
                assert!((0..depth).all(|k| transposed[k * rows + row] == a[row * depth + k]));
            }
        }
    }
}
