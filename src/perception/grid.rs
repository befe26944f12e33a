//! The local shape of the surface a scaled cloud shows, from a grid over it.

use super::kernel::widest;
use super::sample::{cross, dot, squared, sub};

/// Cells along x and y; the grid spans ±1.6 scaled units. Along z, off the dominant plane, a
/// scan is thin.
const CELLS: usize = 64;
const SPAN: f32 = 1.6;
const WIDTH: f32 = 2.0 * SPAN / CELLS as f32;
/// Lanes of a block of points.
const LANES: usize = 8;
/// Coordinate of the points that fill up a block: farther than anything.
const NOWHERE: f32 = 1e9;
/// Neighbours a normal needs.
const NEIGHBOURS_MIN: f32 = 6.0;

/// Points sorted by cell, coordinate by coordinate.
#[derive(Clone, Debug)]
pub(crate) struct Grid {
    /// First point of each cell, and one past the last.
    start: Vec<u32>,
    cursor: Vec<u32>,
    sorted: [Vec<f32>; 3],
}

impl Default for Grid {
    fn default() -> Self {
        Self { start: vec![0; CELLS * CELLS + 1], cursor: vec![0; CELLS * CELLS], sorted: Default::default() }
    }
}

impl Grid {
    pub(crate) fn fill(&mut self, points: impl Iterator<Item = [f32; 3]> + Clone) {
        self.start.fill(0);
        for p in points.clone() {
            self.start[index(p) + 1] += 1;
        }
        for i in 1..self.start.len() {
            self.start[i] += self.start[i - 1];
        }
        self.cursor.copy_from_slice(&self.start[..CELLS * CELLS]);
        let count = self.start[CELLS * CELLS] as usize;
        for column in &mut self.sorted {
            // Room to read a whole block from any point.
            column.resize(count + LANES, NOWHERE);
            column[count..].fill(NOWHERE);
        }
        for p in points {
            let at = &mut self.cursor[index(p)];
            for (column, v) in self.sorted.iter_mut().zip(p) {
                column[*at as usize] = v;
            }
            *at += 1;
        }
    }

    /// Shape of the points within `radius` of `p`, seen from the side of `towards`.
    #[inline(always)]
    fn local_shape(&self, p: [f32; 3], radius: f32, towards: [f32; 3]) -> LocalShape {
        let (low, high) = ([0, 1].map(|k| cell(p[k] - radius)), [0, 1].map(|k| cell(p[k] + radius)));
        let mut sums = [[0.0_f32; LANES]; 10];
        for y in low[1]..=high[1] {
            // Cells of a row follow each other.
            let (from, to) = (self.start[y * CELLS + low[0]] as usize, self.start[y * CELLS + high[0] + 1] as usize);
            for block in (from..to).step_by(LANES) {
                let [x, y, z] = [0, 1, 2].map(|k| {
                    let column = self.sorted[k][block..].first_chunk::<LANES>();
                    let column = column.unwrap_or(&[NOWHERE; LANES]);
                    std::array::from_fn::<f32, LANES, _>(|l| column[l] - p[k])
                });
                for l in 0..LANES {
                    let (x, y, z) = (x[l], y[l], z[l]);
                    // The last block reaches into the next row's cells.
                    let inside = x * x + y * y + z * z < radius * radius && block + l < to;
                    let (w, x, y, z) = if inside { (1.0, x, y, z) } else { (0.0, 0.0, 0.0, 0.0) };
                    for (sum, v) in sums.iter_mut().zip([w, x, y, z, x * x, y * y, z * z, x * y, y * z, z * x]) {
                        sum[l] += v;
                    }
                }
            }
        }
        let [count, sx, sy, sz, rest @ ..] = sums.map(|lanes| lanes.iter().sum::<f32>());
        let back = 1.0 / squared(towards).sqrt().max(1e-9);
        if count < NEIGHBOURS_MIN {
            return LocalShape { normal: towards.map(|v| v * back), roughness: 0.0, bulge: 0.0 };
        }
        let share = 1.0 / count;
        let mean = [sx, sy, sz].map(|s| s * share);
        let covariance = centred(rest.map(|s| s * share), mean);
        let (normal, least) = smallest_axis(covariance);
        let normal = if dot(normal, towards) < 0.0 { normal.map(|v| -v) } else { normal };
        let variance = least * (covariance[0] + covariance[1] + covariance[2]);
        LocalShape { normal, roughness: variance.max(0.0).sqrt() / radius, bulge: dot(mean, normal) / radius }
    }
}

widest! {
    /// Shapes of the surface around points, seen from `eye`.
    fn local_shapes(grid: &Grid, places: &[[f32; 3]], radius: f32, eye: [f32; 3], shapes: &mut [LocalShape]) {
        for (p, shape) in places.iter().zip(shapes) {
            *shape = grid.local_shape(*p, radius, sub(eye, *p));
        }
    }
}

/// What the surface is like around a point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct LocalShape {
    /// Unit normal of the tangent plane.
    pub(crate) normal: [f32; 3],
    /// Standard deviation from it over the radius: 0 on a plane.
    pub(crate) roughness: f32,
    /// How far the middle of the neighbourhood lies outwards of the point, over the radius:
    /// below 0 on a ridge, above in a groove.
    pub(crate) bulge: f32,
}

/// Second moments (xx, yy, zz, xy, yz, zx) about the mean.
#[inline(always)]
fn centred(mut products: [f32; 6], mean: [f32; 3]) -> [f32; 6] {
    for k in 0..3 {
        products[k] -= mean[k] * mean[k];
        products[k + 3] -= mean[k] * mean[(k + 1) % 3];
    }
    products
}

/// Count, mean and covariance (xx, yy, zz, xy, yz, zx) of points.
#[inline]
pub(crate) fn moments(points: impl Iterator<Item = [f32; 3]>) -> (u32, [f32; 3], [f32; 6]) {
    let (mut count, mut sum, mut products) = (0_u32, [0.0_f32; 3], [0.0_f32; 6]);
    for d in points {
        count += 1;
        for k in 0..3 {
            sum[k] += d[k];
            products[k] += d[k] * d[k];
            products[k + 3] += d[k] * d[(k + 1) % 3];
        }
    }
    let share = 1.0 / count.max(1) as f32;
    let mean = sum.map(|s| s * share);
    (count, mean, centred(products.map(|p| p * share), mean))
}

/// Direction of least variance of a covariance (xx, yy, zz, xy, yz, zx), and that variance's
/// share of the whole. Eigenvalue in closed form, eigenvector as the best of three cross products.
pub(crate) fn smallest_axis(c: [f32; 6]) -> ([f32; 3], f32) {
    let trace = c[0] + c[1] + c[2];
    if trace <= 1e-12 {
        return ([0.0, 0.0, 1.0], 0.0);
    }
    // In double precision: the smallest eigenvalue is a small difference of large ones.
    let [xx, yy, zz, xy, yz, zx] = c.map(f64::from);
    let q = f64::from(trace) / 3.0;
    let (a, b, d) = (xx - q, yy - q, zz - q);
    let p = ((a * a + b * b + d * d + 2.0 * (xy * xy + yz * yz + zx * zx)) / 6.0).sqrt();
    if p < 1e-15 {
        return ([0.0, 0.0, 1.0], 1.0 / 3.0);
    }
    let determinant = a * (b * d - yz * yz) - xy * (xy * d - yz * zx) + zx * (xy * yz - b * zx);
    let angle = (0.5 * determinant / (p * p * p)).clamp(-1.0, 1.0).acos() / 3.0;
    let least = q + 2.0 * p * (angle + 2.0 * std::f64::consts::FRAC_PI_3).cos();
    let rows = [[xx - least, xy, zx], [xy, yy - least, yz], [zx, yz, zz - least]].map(|r| r.map(|v| (v / p) as f32));
    let best = [cross(rows[0], rows[1]), cross(rows[1], rows[2]), cross(rows[2], rows[0])]
        .into_iter()
        .max_by(|u, v| squared(*u).total_cmp(&squared(*v)))
        .unwrap_or([0.0, 0.0, 1.0]);
    let length = squared(best).sqrt();
    let normal = if length > 1e-12 { best.map(|v| v / length) } else { [0.0, 0.0, 1.0] };
    (normal, (least.max(0.0) / f64::from(trace)) as f32)
}

#[inline(always)]
fn cell(v: f32) -> usize {
    // A float too large or negative saturates in the cast.
    (((v + SPAN) * (1.0 / WIDTH)) as usize).min(CELLS - 1)
}

#[inline(always)]
fn index([x, y, _]: [f32; 3]) -> usize {
    cell(y) * CELLS + cell(x)
}
