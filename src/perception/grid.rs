//! A voxel grid over a scaled cloud, and the local shape of the surface it shows.

use super::sample::{cross, dot, squared, sub};

/// Cells along each axis; the grid spans ±1.6 scaled units.
const CELLS: usize = 32;
const SPAN: f32 = 1.6;
const WIDTH: f32 = 2.0 * SPAN / CELLS as f32;
/// Neighbours a normal needs.
const NEIGHBOURS_MIN: u32 = 6;

/// Points sorted by cell.
#[derive(Debug)]
pub(crate) struct Grid {
    /// First entry of each cell in `members`, and one past the last.
    start: Vec<u32>,
    members: Vec<u16>,
    cell: Vec<u32>,
}

impl Grid {
    pub(crate) fn new() -> Self {
        Self { start: vec![0; CELLS * CELLS * CELLS + 1], members: Vec::new(), cell: Vec::new() }
    }

    pub(crate) fn fill(&mut self, points: &[[f32; 3]]) {
        self.start.fill(0);
        self.cell.clear();
        self.cell.extend(points.iter().map(|p| index(p.map(axis))));
        for &cell in &self.cell {
            self.start[cell as usize + 1] += 1;
        }
        for i in 1..self.start.len() {
            self.start[i] += self.start[i - 1];
        }
        self.members.clear();
        self.members.resize(points.len(), 0);
        // Backwards, each start serving as its cell's cursor's end: keeps the order within a cell.
        let mut cursor = self.start.clone();
        for (i, &cell) in self.cell.iter().enumerate() {
            let at = &mut cursor[cell as usize];
            self.members[*at as usize] = i as u16;
            *at += 1;
        }
    }

    /// Unit normal, on the side of `towards`, and roughness of the points within `radius`
    /// (at most half a cell) of `p`. Roughness is 0 on a plane, 1/3 without any direction.
    pub(crate) fn local_shape(
        &self,
        points: &[[f32; 3]],
        p: [f32; 3],
        radius: f32,
        towards: [f32; 3],
    ) -> ([f32; 3], f32) {
        debug_assert!(radius <= 0.5 * WIDTH);
        let low = p.map(|v| axis(v - radius));
        let high = p.map(|v| axis(v + radius));
        let cells = (low[0]..=high[0]).flat_map(|x| {
            (low[1]..=high[1]).flat_map(move |y| (low[2]..=high[2]).map(move |z| index([x, y, z]) as usize))
        });
        let members = cells.flat_map(|cell| &self.members[self.start[cell] as usize..self.start[cell + 1] as usize]);
        let near = members.map(|&i| sub(points[usize::from(i)], p)).filter(|d| squared(*d) < radius * radius);
        let (count, _, covariance) = moments(near);
        let back = 1.0 / squared(towards).sqrt().max(1e-9);
        let towards = towards.map(|v| v * back);
        if count < NEIGHBOURS_MIN {
            return (towards, 0.0);
        }
        let (normal, roughness) = smallest_axis(covariance);
        if dot(normal, towards) < 0.0 { (normal.map(|v| -v), roughness) } else { (normal, roughness) }
    }
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
    let mut covariance = [0.0; 6];
    for k in 0..3 {
        covariance[k] = products[k] * share - mean[k] * mean[k];
        covariance[k + 3] = products[k + 3] * share - mean[k] * mean[(k + 1) % 3];
    }
    (count, mean, covariance)
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

#[inline]
fn axis(v: f32) -> u32 {
    // A float too large or negative saturates in the cast.
    (((v + SPAN) / WIDTH) as u32).min(CELLS as u32 - 1)
}

#[inline]
fn index([x, y, z]: [u32; 3]) -> u32 {
    (z * CELLS as u32 + y) * CELLS as u32 + x
}
