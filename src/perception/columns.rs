//! Points by coordinate, in blocks that compile to vector instructions.

/// Lanes of a block.
const LANES: usize = 8;
/// Coordinate of the points that fill up the last block: farther than anything.
const NOWHERE: f32 = 1e18;

/// Points as blocks of x, of y and of z.
#[derive(Debug, Default)]
pub(crate) struct Columns {
    blocks: Vec<[[f32; LANES]; 3]>,
}

impl Columns {
    pub(crate) fn of(points: impl Iterator<Item = [f32; 3]>) -> Self {
        let mut blocks = Vec::new();
        for (i, p) in points.enumerate() {
            if i % LANES == 0 {
                blocks.push([[NOWHERE; LANES]; 3]);
            }
            if let Some(block) = blocks.last_mut() {
                for (row, v) in block.iter_mut().zip(p) {
                    row[i % LANES] = v;
                }
            }
        }
        Self { blocks }
    }

    #[inline]
    fn squared([x, y, z]: &[[f32; LANES]; 3], p: [f32; 3]) -> [f32; LANES] {
        std::array::from_fn(|l| {
            let (dx, dy, dz) = (x[l] - p[0], y[l] - p[1], z[l] - p[2]);
            dx * dx + dy * dy + dz * dz
        })
    }

    /// Squared distance from `p` to the nearest point; huge when there is none.
    #[inline]
    pub(crate) fn nearest(&self, p: [f32; 3]) -> f32 {
        let mut least = [f32::MAX; LANES];
        for block in &self.blocks {
            let d = Self::squared(block, p);
            for (m, d) in least.iter_mut().zip(d) {
                *m = if d < *m { d } else { *m };
            }
        }
        least.iter().fold(f32::MAX, |m, d| m.min(*d))
    }

    /// Lowers each gap to the squared distance from `p` and answers the first index at which
    /// gap × weight is largest. `gaps` and `weights` come from [`Columns::filled`].
    #[inline]
    pub(crate) fn farthest(&self, p: [f32; 3], gaps: &mut [[f32; LANES]], weights: &[[f32; LANES]]) -> usize {
        let mut top = [-1.0_f32; LANES];
        for ((block, gap), weight) in self.blocks.iter().zip(gaps.iter_mut()).zip(weights) {
            let d = Self::squared(block, p);
            for l in 0..LANES {
                gap[l] = if d[l] < gap[l] { d[l] } else { gap[l] };
                let reach = gap[l] * weight[l];
                top[l] = if reach > top[l] { reach } else { top[l] };
            }
        }
        let top = top.iter().fold(-1.0_f32, |m, r| m.max(*r));
        let at = gaps.iter().zip(weights).position(|(gap, weight)| (0..LANES).any(|l| gap[l] * weight[l] == top));
        let block = at.unwrap_or(0);
        let lane = (0..LANES).find(|&l| gaps[block][l] * weights[block][l] == top).unwrap_or(0);
        block * LANES + lane
    }

    /// One number a point in blocks; zero past the last point.
    pub(crate) fn filled(values: impl Iterator<Item = f32>) -> Vec<[f32; LANES]> {
        let mut blocks = Vec::new();
        for (i, v) in values.enumerate() {
            if i % LANES == 0 {
                blocks.push([0.0; LANES]);
            }
            if let Some(block) = blocks.last_mut() {
                block[i % LANES] = v;
            }
        }
        blocks
    }
}
