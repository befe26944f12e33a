//! Dense kernels on rows × columns of `f32`, written so that they compile to vector instructions.
//!
//! The network's products are tall and thin, thousands of rows by some ten to a few hundred
//! columns. Weights are laid out once in panels of [`LANES`] columns; a product then keeps
//! a tile of rows × one panel in registers and hands each finished row of the tile to its
//! `finish`, which adds the bias, cuts at zero or pools, before anything goes to memory.
//!
//! **Invariant:** the same numbers give the same result on every machine, wide registers or
//! not: sums are taken in one order and multiply-adds round once.
//! **Invariant:** nothing here allocates but [`Panels::new`].

/// Columns of a panel.
pub(crate) const LANES: usize = 16;
/// Rows of a register tile.
const ROWS: usize = 6;
/// Rows of a block of [`accumulate_transposed`]: it stays in the second-level cache.
const BLOCK: usize = 128;

/// Compiles a function twice, for the plainest processor and for AVX2 with FMA, and calls what
/// this machine has.
macro_rules! widest {
    ($(#[$doc:meta])* fn $name:ident $(<$f:ident: $bound:path>)? ($($arg:ident: $type:ty),* $(,)?) $body:block) => {
        $(#[$doc])*
        #[allow(unsafe_code, clippy::too_many_arguments)]
        pub(crate) fn $name $(<$f: $bound>)? ($($arg: $type),*) {
            #[inline(always)]
            #[allow(clippy::too_many_arguments)]
            fn plain $(<$f: $bound>)? ($($arg: $type),*) $body

            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2,fma")]
            fn wide $(<$f: $bound>)? ($($arg: $type),*) {
                plain($($arg),*);
            }

            #[cfg(target_arch = "x86_64")]
            if std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma") {
                // SAFETY: the features `wide` is compiled for were detected on this processor.
                return unsafe { wide($($arg),*) };
            }
            plain($($arg),*);
        }
    };
}
pub(crate) use widest;

/// What becomes of a finished row of a tile: its row, first column, and [`LANES`] sums.
pub(crate) trait Finish {
    /// Takes the sums; columns past the width are zero.
    fn row(&mut self, row: usize, column: usize, sums: &[f32; LANES]);
}

impl<F: FnMut(usize, usize, &[f32; LANES])> Finish for F {
    #[inline(always)]
    fn row(&mut self, row: usize, column: usize, sums: &[f32; LANES]) {
        self(row, column, sums);
    }
}

/// A matrix depth × width in panels of [`LANES`] columns, the last filled up with zeros.
#[derive(Clone, Debug, Default)]
pub(crate) struct Panels {
    depth: usize,
    width: usize,
    numbers: Vec<f32>,
}

impl Panels {
    /// Panels of a row-major matrix.
    pub(crate) fn new(matrix: &[f32], depth: usize, width: usize) -> Self {
        let mut out = Self::default();
        out.fill(matrix, depth, width);
        out
    }

    /// The same in place; allocates only when it grows.
    pub(crate) fn fill(&mut self, matrix: &[f32], depth: usize, width: usize) {
        self.shape(depth, width);
        for (p, panel) in self.numbers.chunks_exact_mut(depth * LANES).enumerate() {
            for (row, to) in matrix.chunks_exact(width).zip(panel.chunks_exact_mut(LANES)) {
                let from = &row[p * LANES..width.min((p + 1) * LANES)];
                to[..from.len()].copy_from_slice(from);
                to[from.len()..].fill(0.0);
            }
        }
    }

    /// Panels of the transposed of a row-major matrix width × depth.
    pub(crate) fn fill_transposed(&mut self, matrix: &[f32], depth: usize, width: usize) {
        self.shape(depth, width);
        for (p, panel) in self.numbers.chunks_exact_mut(depth * LANES).enumerate() {
            for (k, to) in panel.chunks_exact_mut(LANES).enumerate() {
                for (l, to) in to.iter_mut().enumerate() {
                    let column = p * LANES + l;
                    *to = if column < width { matrix[column * depth + k] } else { 0.0 };
                }
            }
        }
    }

    fn shape(&mut self, depth: usize, width: usize) {
        (self.depth, self.width) = (depth, width);
        self.numbers.resize(width.div_ceil(LANES) * depth * LANES, 0.0);
    }
}

#[inline(always)]
fn tile<const R: usize>(a: &[f32], depth: usize, panel: &[f32]) -> [[f32; LANES]; R] {
    let mut sums = [[0.0_f32; LANES]; R];
    let rows: [&[f32]; R] = core::array::from_fn(|r| &a[r * depth..(r + 1) * depth]);
    let (panel, _) = panel.as_chunks::<LANES>();
    for (k, b) in panel[..depth].iter().enumerate() {
        for r in 0..R {
            let x = rows[r][k];
            for l in 0..LANES {
                sums[r][l] = x.mul_add(b[l], sums[r][l]);
            }
        }
    }
    sums
}

widest! {
    /// The product of `a` (rows × depth) and panels, row by row to `finish`.
    fn product<F: Finish>(a: &[f32], panels: &Panels, finish: &mut F) {
        let (depth, rows) = (panels.depth, a.len() / panels.depth);
        let whole = rows - rows % ROWS;
        for (p, panel) in panels.numbers.chunks_exact(depth * LANES).enumerate() {
            let column = p * LANES;
            for row in (0..whole).step_by(ROWS) {
                let sums = tile::<ROWS>(&a[row * depth..(row + ROWS) * depth], depth, panel);
                for (r, sums) in sums.iter().enumerate() {
                    finish.row(row + r, column, sums);
                }
            }
            let mut row = whole;
            if rows - row >= 4 {
                let sums = tile::<4>(&a[row * depth..(row + 4) * depth], depth, panel);
                for (r, sums) in sums.iter().enumerate() {
                    finish.row(row + r, column, sums);
                }
                row += 4;
            }
            for row in row..rows {
                let [sums] = tile::<1>(&a[row * depth..(row + 1) * depth], depth, panel);
                finish.row(row, column, &sums);
            }
        }
    }
}

/// Stores rows into a matrix of this width.
pub(crate) struct Store<'a>(pub(crate) &'a mut [f32], pub(crate) usize);

impl Finish for Store<'_> {
    #[inline(always)]
    fn row(&mut self, row: usize, column: usize, sums: &[f32; LANES]) {
        let start = row * self.1 + column;
        let to = &mut self.0[start..row * self.1 + self.1.min(column + LANES)];
        if let Ok(to) = <&mut [f32; LANES]>::try_from(&mut *to) {
            *to = *sums;
        } else {
            to.copy_from_slice(&sums[..to.len()]);
        }
    }
}

/// Adds rows to a matrix of this width.
pub(crate) struct Add<'a>(pub(crate) &'a mut [f32], pub(crate) usize);

impl Finish for Add<'_> {
    #[inline(always)]
    fn row(&mut self, row: usize, column: usize, sums: &[f32; LANES]) {
        let start = row * self.1 + column;
        let to = &mut self.0[start..row * self.1 + self.1.min(column + LANES)];
        if let Ok(to) = <&mut [f32; LANES]>::try_from(&mut *to) {
            for l in 0..LANES {
                to[l] += sums[l];
            }
        } else {
            to.iter_mut().zip(sums).for_each(|(to, sum)| *to += sum);
        }
    }
}

#[inline(always)]
fn outer<const R: usize>(a: &[f32], depth: usize, b: &[f32], width: usize, out: &mut [f32]) {
    let mut sums = [[0.0_f32; LANES]; R];
    for (a, b) in a.chunks(depth).zip(b.chunks(width)) {
        let (Some(a), Some(b)) = (a.first_chunk::<R>(), b.first_chunk::<LANES>()) else { break };
        for r in 0..R {
            for l in 0..LANES {
                sums[r][l] = a[r].mul_add(b[l], sums[r][l]);
            }
        }
    }
    for (sums, to) in sums.iter().zip(out.chunks_mut(width)) {
        for (to, sum) in to.iter_mut().zip(sums) {
            *to += sum;
        }
    }
}

widest! {
    /// Adds the product of `a` transposed (`a`: rows × depth) and `b` (rows × width) to `out` (depth × width).
    fn accumulate_transposed(a: &[f32], depth: usize, b: &[f32], width: usize, out: &mut [f32]) {
        let (blocks, narrow) = (width / LANES, width % LANES);
        for (a, b) in a.chunks(BLOCK * depth).zip(b.chunks(BLOCK * width)) {
            for k in (0..depth - depth % 4).step_by(4) {
                for j in 0..blocks {
                    outer::<4>(&a[k..], depth, &b[j * LANES..], width, &mut out[k * width + j * LANES..]);
                }
            }
            for k in depth - depth % 4..depth {
                for j in 0..blocks {
                    outer::<1>(&a[k..], depth, &b[j * LANES..], width, &mut out[k * width + j * LANES..]);
                }
            }
            if narrow > 0 {
                for (a, b) in a.chunks_exact(depth).zip(b.chunks_exact(width)) {
                    for (a, out) in a.iter().zip(out.chunks_exact_mut(width)) {
                        for (to, b) in out[blocks * LANES..].iter_mut().zip(&b[blocks * LANES..]) {
                            *to = a.mul_add(*b, *to);
                        }
                    }
                }
            }
        }
    }
}

/// e to the power of `x`, to 2 units in the last place, for `x` of at most 80.
#[inline(always)]
pub(crate) fn exp(x: f32) -> f32 {
    // 2^n · 2^f with n whole and |f| ≤ 1/2; the second by its Taylor series.
    let y = (x * std::f32::consts::LOG2_E).clamp(-125.0, 125.0);
    // Adding 1.5 · 2²³ rounds to a whole number without a library call.
    let rounder = 12_582_912.0_f32;
    let n = (y + rounder) - rounder;
    let f = (y - n) * std::f32::consts::LN_2;
    let series = [1.0 / 720.0, 1.0 / 120.0, 1.0 / 24.0, 1.0 / 6.0, 0.5, 1.0, 1.0];
    let power = series.iter().skip(1).fold(series[0], |sum: f32, c| sum.mul_add(f, *c));
    power * f32::from_bits(((n as i32 + 127) as u32) << 23)
}
