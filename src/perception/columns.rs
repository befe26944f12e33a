//! Points by coordinate, in blocks that compile to vector instructions.

use super::kernel::widest;

/// Lanes of a block.
const LANES: usize = 8;
/// Coordinate of the points that fill up the last block: farther than anything.
const NOWHERE: f32 = 1e18;

/// A block of x, of y and of z.
pub(crate) type Block = [[f32; LANES]; 3];

/// Points in blocks, the last of which is filled up.
pub(crate) fn blocks(mut points: impl Iterator<Item = [f32; 3]>) -> impl Iterator<Item = Block> {
    std::iter::from_fn(move || {
        let mut block = [[NOWHERE; LANES]; 3];
        let mut next = points.next();
        next?;
        for lane in 0..LANES {
            let Some(p) = next else { break };
            for (row, v) in block.iter_mut().zip(p) {
                row[lane] = v;
            }
            next = if lane + 1 < LANES { points.next() } else { None };
        }
        Some(block)
    })
}

#[inline(always)]
fn squared([x, y, z]: &Block, p: [f32; 3]) -> [f32; LANES] {
    std::array::from_fn(|l| {
        let (dx, dy, dz) = (x[l] - p[0], y[l] - p[1], z[l] - p[2]);
        dx * dx + dy * dy + dz * dz
    })
}

/// Squared distance from `p` to the nearest point of some blocks; huge when there is none.
#[inline]
pub(crate) fn nearest(blocks: &[Block], p: [f32; 3]) -> f32 {
    let mut least = [f32::MAX; LANES];
    for block in blocks {
        let d = squared(block, p);
        for (m, d) in least.iter_mut().zip(d) {
            *m = if d < *m { d } else { *m };
        }
    }
    least.iter().fold(f32::MAX, |m, d| m.min(*d))
}

/// Points as blocks.
#[derive(Clone, Debug, Default)]
pub(crate) struct Columns {
    blocks: Vec<Block>,
}

impl Columns {
    /// Makes room for this many points.
    pub(crate) fn reserve(&mut self, points: usize) {
        self.blocks.clear();
        self.blocks.reserve(points.div_ceil(LANES));
    }

    /// Lays points out in place of those before; allocates only when it grows.
    pub(crate) fn fill(&mut self, points: impl Iterator<Item = [f32; 3]>) {
        self.blocks.clear();
        self.blocks.extend(blocks(points));
    }
}

/// One number a point in blocks; zero past the last point.
#[derive(Clone, Debug, Default)]
pub(crate) struct Numbers(Vec<[f32; LANES]>);

impl Numbers {
    /// Makes room for this many points.
    pub(crate) fn reserve(&mut self, points: usize) {
        self.0.clear();
        self.0.reserve(points.div_ceil(LANES));
    }

    pub(crate) fn fill(&mut self, values: impl Iterator<Item = f32>) {
        self.0.clear();
        for (i, v) in values.enumerate() {
            if i % LANES == 0 {
                self.0.push([0.0; LANES]);
            }
            if let Some(block) = self.0.last_mut() {
                block[i % LANES] = v;
            }
        }
    }
}

widest! {
    /// Farthest-point sampling: `chosen` indices of points, from `first` on, each the one whose squared
    /// distance to those before it, times its weight, is largest. `gaps` is room.
    fn farthest(points: &Columns, weights: &Numbers, gaps: &mut Numbers, first: usize, chosen: &mut [u16]) {
        gaps.0.clear();
        gaps.0.resize(points.blocks.len(), [f32::MAX; LANES]);
        let mut next = first;
        for chosen in chosen {
            *chosen = next as u16;
            let [x, y, z] = &points.blocks[next / LANES];
            let p = [x[next % LANES], y[next % LANES], z[next % LANES]];
            let (mut top, mut at) = ([-1.0_f32; LANES], [0_u32; LANES]);
            for (b, ((block, gap), weight)) in points.blocks.iter().zip(&mut gaps.0).zip(&weights.0).enumerate() {
                let d = squared(block, p);
                for l in 0..LANES {
                    gap[l] = if d[l] < gap[l] { d[l] } else { gap[l] };
                    let reach = gap[l] * weight[l];
                    let farther = reach > top[l];
                    top[l] = if farther { reach } else { top[l] };
                    at[l] = if farther { b as u32 } else { at[l] };
                }
            }
            let mut best = 0;
            for l in 1..LANES {
                if top[l] > top[best] || (top[l] == top[best] && at[l] < at[best]) {
                    best = l;
                }
            }
            next = at[best] as usize * LANES + best;
        }
    }
}
