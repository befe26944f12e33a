//! From 10,000 points to what the network reads: 512 points with local shape, in groups.
//!
//! 1. Centre on the median and scale by the 95 % quantile of the radius, so that stray
//!    points do not set the scale.
//! 2. Find the dominant plane and turn the cloud so that its normal, on the camera's side,
//!    is z: heights over it and slopes against it tell features apart wherever the camera
//!    stood. Most of a scan is flat surface that says little: at least [`OFF_PLANE`] of the
//!    points kept lie off that plane, where the scan has as many.
//! 3. Keep 512 points by farthest-point sampling that favours the middle of the view.
//! 4. Give each the shape of the surface around it at two scales, from all scanned points:
//!    threads and edges are smaller than the spacing of 512 points and would be lost otherwise.
//! 5. Choose 64 group centres, 16 neighbours each, and for each point the three it is nearest to.
//!
//! **Invariant:** the same points in the same order give the same sample, bit for bit.

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use super::columns::{Columns, Numbers, farthest};
use super::grid::{Grid, LocalShape, local_shapes, moments, smallest_axis};

/// Points the network reads.
pub const POINTS: usize = 512;
/// Groups, and attention tokens.
pub const CENTRES: usize = 64;
/// Points of a group.
pub const NEIGHBOURS: usize = 16;
/// Numbers a point: place, fine normal, fine and coarse roughness, bulge, alignment.
pub const CHANNELS: usize = 10;
/// Centres a point hears from.
pub const HOMES: usize = 3;

/// Points off the dominant plane that are kept, when there are as many.
const OFF_PLANE: usize = 336;
/// Points that compete in farthest-point sampling, off and on the plane.
const CANDIDATES: [usize; 2] = [1536, 512];
/// Half thickness of the dominant plane, in scaled units.
const PLANE_BAND: f32 = 0.02;
/// Points that vote on the dominant plane.
const VOTERS: usize = 768;
/// Plane hypotheses tried.
const HYPOTHESES: usize = 64;
/// Radius of the fine neighbourhood in spacings of the cloud, and its limits in scaled units:
/// some fifteen points, as few as a normal can be told from.
const FINE_RADIUS: f32 = 2.2;
const FINE_LIMITS: [f32; 2] = [0.02, 0.12];
/// Radius of the coarse neighbourhood in scaled units and, at least, in fine radii.
const COARSE_RADIUS: [f32; 2] = [0.1, 1.6];
/// Points the coarse neighbourhoods are taken from, and the quantiles of all coordinates.
const COARSE_POINTS: usize = 4096;
/// A cloud with fewer points is not looked at.
pub const CLOUD_MIN: usize = 2 * POINTS;

/// A down-sampled cloud.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sample {
    /// Centre taken off, metres, in the camera frame.
    pub centre: [f32; 3],
    /// Metres a scaled unit.
    pub scale: f32,
    /// Rotation from the camera frame into the sample's, by rows: z is the normal of the
    /// dominant plane.
    pub turn: [[f32; 3]; 3],
    /// Points: [`POINTS`] × (place turned and scaled, z over the dominant plane; fine normal towards the
    /// camera; deviation from the tangent plane over the radius, fine and coarse; how far the
    /// middle of the coarse neighbourhood lies outwards; cosine between fine and coarse normal).
    pub points: Vec<[f32; CHANNELS]>,
    /// Normal of the coarse neighbourhood of each, towards the camera.
    pub smooth: Vec<[f32; 3]>,
    /// Index of each in the cloud.
    pub source: Vec<u16>,
    /// Group centres, indices into `points`.
    pub centres: Vec<u16>,
    /// Members of each group, [`CENTRES`] × [`NEIGHBOURS`], indices into `points`.
    pub groups: Vec<[u16; NEIGHBOURS]>,
    /// The centres (indices into `centres`) nearest to each point.
    pub home: Vec<[u16; HOMES]>,
    /// Their shares in it, falling with the square of the distance; of each point they add up to one.
    pub share: Vec<[f32; HOMES]>,
}

impl Sample {
    /// A direction of the sample's frame in the camera frame.
    fn in_camera(&self, d: [f32; 3]) -> [f32; 3] {
        [0, 1, 2].map(|c| self.turn[0][c] * d[0] + self.turn[1][c] * d[1] + self.turn[2][c] * d[2])
    }

    /// Fine normal of a sampled point in the camera frame, towards the camera.
    pub fn normal_in_camera(&self, index: usize) -> [f32; 3] {
        let p = &self.points[index];
        self.in_camera([p[3], p[4], p[5]])
    }

    /// Coarse normal of a sampled point in the camera frame, towards the camera.
    pub fn smooth_normal_in_camera(&self, index: usize) -> [f32; 3] {
        self.in_camera(self.smooth[index])
    }
}

/// Room for sampling, kept between clouds.
#[derive(Clone, Debug, Default)]
pub struct Sampler {
    order: Vec<u16>,
    scaled: Vec<[f32; 3]>,
    column: Vec<f32>,
    grid: [Grid; 2],
    /// Candidates off and on the dominant plane.
    candidates: [Vec<u16>; 2],
    places: Vec<[f32; 3]>,
    columns: Columns,
    weights: Numbers,
    gaps: Numbers,
    picked: Vec<u16>,
    shapes: [Vec<LocalShape>; 2],
    nearest: Vec<[f32; HOMES]>,
    keys: Vec<u64>,
}

impl Sampler {
    /// A sampler for clouds of up to 65,536 points.
    pub fn new() -> Self {
        Self::default()
    }

    /// Samples a cloud (finite points, metres, camera frame) into `out`; false if it has fewer than
    /// [`CLOUD_MIN`] points, more than 65,536, or no extent.
    ///
    /// Allocates nothing once it has seen a cloud as large.
    pub fn sample(&mut self, cloud: &[[f32; 3]], out: &mut Sample) -> bool {
        if cloud.len() < CLOUD_MIN || cloud.len() > 1 << 16 {
            return false;
        }
        self.shuffle(cloud.len());
        let Some((centre, scale)) = self.normalise(cloud) else { return false };
        let (normal, offset) = self.dominant_plane(centre);
        let turn = upright(normal);
        for p in &mut self.scaled {
            *p = turned(&turn, *p);
        }
        (out.centre, out.scale, out.turn) = (centre, scale, turn);
        self.choose(offset, &mut out.source);

        let (order, scaled) = (&self.order, &self.scaled);
        let thin = order.iter().take(COARSE_POINTS).map(|&i| scaled[usize::from(i)]);
        self.grid[0].fill(scaled.iter().copied());
        self.grid[1].fill(thin);
        self.places.clear();
        self.places.extend(out.source.iter().map(|&i| scaled[usize::from(i)]));
        // Most of a scan lies within a disc of radius one.
        let spacing = (std::f32::consts::PI / cloud.len() as f32).sqrt();
        let fine = (FINE_RADIUS * spacing).clamp(FINE_LIMITS[0], FINE_LIMITS[1]);
        let coarse = COARSE_RADIUS[0].max(COARSE_RADIUS[1] * fine);
        let eye = turned(&turn, centre.map(|c| -c / scale));
        for ((grid, radius), shapes) in self.grid.iter().zip([fine, coarse]).zip(&mut self.shapes) {
            shapes.resize(POINTS, LocalShape::default());
            local_shapes(grid, &self.places, radius, eye, shapes);
        }
        out.smooth.clear();
        out.smooth.extend(self.shapes[1].iter().map(|shape| shape.normal));
        out.points.clear();
        let shapes = self.shapes[0].iter().zip(&self.shapes[1]);
        out.points.extend(self.places.iter().zip(shapes).map(|(p, (fine, coarse))| {
            let n = fine.normal;
            let alike = dot(n, coarse.normal);
            [p[0], p[1], p[2] - offset, n[0], n[1], n[2], fine.roughness, coarse.roughness, coarse.bulge, alike]
        }));
        self.group(out);
        true
    }

    /// A fixed pseudo-random order, so that clouds in raster order are sampled evenly too.
    fn shuffle(&mut self, count: usize) {
        if self.order.len() != count {
            self.order.clear();
            self.order.extend((0..count).map(|i| i as u16));
            self.order.shuffle(&mut ChaCha8Rng::seed_from_u64(count as u64));
        }
    }

    fn normalise(&mut self, cloud: &[[f32; 3]]) -> Option<([f32; 3], f32)> {
        let few = &self.order[..self.order.len().min(COARSE_POINTS)];
        let mut centre = [0.0; 3];
        for (axis, value) in centre.iter_mut().enumerate() {
            self.column.clear();
            self.column.extend(few.iter().map(|&i| cloud[usize::from(i)][axis]));
            *value = quantile(&mut self.column, 0.5);
        }
        self.column.clear();
        self.column.extend(few.iter().map(|&i| squared(sub(cloud[usize::from(i)], centre))));
        let scale = quantile(&mut self.column, 0.95).sqrt();
        if !(scale.is_finite() && scale > 1e-6) {
            return None;
        }
        let inverse = 1.0 / scale;
        self.scaled.clear();
        self.scaled.extend(cloud.iter().map(|p| sub(*p, centre).map(|v| v * inverse)));
        Some((centre, scale))
    }

    /// The plane with most points near it: unit normal on the camera's side, and offset.
    fn dominant_plane(&self, centre: [f32; 3]) -> ([f32; 3], f32) {
        let place = |i: u16| self.scaled[usize::from(i)];
        let voters = &self.order[..VOTERS];
        let mut best = (0, [0.0, 0.0, -1.0], 0.0);
        for h in 0..HYPOTHESES {
            let [a, b, c] = [0, 1, 2].map(|k| place(self.order[3 * h + k]));
            let normal = cross(sub(b, a), sub(c, a));
            let length = squared(normal).sqrt();
            if length < 1e-2 {
                continue;
            }
            let normal = normal.map(|v| v / length);
            let offset = dot(normal, a);
            let votes = voters.iter().filter(|i| (dot(normal, place(**i)) - offset).abs() < PLANE_BAND).count();
            if votes > best.0 {
                best = (votes, normal, offset);
            }
        }
        let (_, mut normal, mut offset) = best;
        // Least squares on its voters, twice: three noisy points lean.
        for _ in 0..2 {
            let on = voters.iter().map(|i| place(*i)).filter(|p| (dot(normal, *p) - offset).abs() < PLANE_BAND);
            let (count, mean, covariance) = moments(on);
            if count < 8 {
                break;
            }
            normal = smallest_axis(covariance).0;
            offset = dot(normal, mean);
        }
        if dot(normal, centre) > 0.0 { (normal.map(|v| -v), -offset) } else { (normal, offset) }
    }

    /// Indices of the points kept.
    fn choose(&mut self, offset: f32, kept: &mut Vec<u16>) {
        let [off, on] = &mut self.candidates;
        for side in [&mut *off, &mut *on] {
            side.clear();
            side.reserve(CANDIDATES[0]);
        }
        for &i in &self.order {
            let p = self.scaled[usize::from(i)];
            let side = if (p[2] - offset).abs() > PLANE_BAND { &mut *off } else { &mut *on };
            if side.len() < CANDIDATES[0] {
                side.push(i);
            }
        }
        let from_off = OFF_PLANE.max(POINTS.saturating_sub(on.len())).min(off.len()).min(POINTS);
        let from_on = POINTS - from_off;
        if from_on <= CANDIDATES[1] {
            on.truncate(CANDIDATES[1].max(from_on));
        }
        kept.clear();
        for (side, count) in [from_off, from_on].into_iter().enumerate() {
            self.places.clear();
            self.places.reserve(CANDIDATES[0]);
            self.places.extend(self.candidates[side].iter().map(|&i| self.scaled[usize::from(i)]));
            self.farthest(count);
            kept.extend(self.picked.iter().map(|&k| self.candidates[side][usize::from(k)]));
        }
    }

    /// Farthest-point sampling of `places` with distances weighted towards the middle of the view:
    /// `count` indices into it go to `picked`, the first the one nearest to the middle.
    fn farthest(&mut self, count: usize) {
        // Room for the most there may be, so that no later cloud needs more.
        self.picked.clear();
        self.picked.reserve(POINTS);
        self.picked.resize(count.min(self.places.len()), 0);
        self.columns.reserve(CANDIDATES[0]);
        self.weights.reserve(CANDIDATES[0]);
        self.gaps.reserve(CANDIDATES[0]);
        self.columns.fill(self.places.iter().copied());
        self.weights.fill(self.places.iter().map(|p| {
            let off_axis = (p[0] * p[0] + p[1] * p[1]).sqrt();
            // Stray points, far out of the scan, are never the farthest.
            if off_axis > 2.0 || p[2].abs() > 2.0 { 1e-6 } else { (0.25 + off_axis).powi(-2) }
        }));
        let middle =
            (0..self.places.len()).min_by(|&a, &b| squared(self.places[a]).total_cmp(&squared(self.places[b])));
        farthest(&self.columns, &self.weights, &mut self.gaps, middle.unwrap_or(0), &mut self.picked);
    }

    /// Centres, their nearest points, and the centres each point is nearest to with their shares.
    fn group(&mut self, out: &mut Sample) {
        self.places.clear();
        self.places.extend(out.points.iter().map(|p| [p[0], p[1], p[2]]));
        self.farthest(CENTRES);
        out.centres.clear();
        out.centres.extend_from_slice(&self.picked);
        self.nearest.clear();
        self.nearest.resize(POINTS, [f32::INFINITY; HOMES]);
        out.home.clear();
        out.home.resize(POINTS, [0; HOMES]);
        out.groups.clear();
        for (token, &centre) in out.centres.iter().enumerate() {
            let from = self.places[usize::from(centre)];
            self.keys.clear();
            for (i, p) in self.places.iter().enumerate() {
                let d = squared(sub(*p, from));
                // Insertion into the sorted few.
                let (mut d_in, mut token_in) = (d, token as u16);
                for (d, token) in self.nearest[i].iter_mut().zip(&mut out.home[i]) {
                    if d_in < *d {
                        std::mem::swap(&mut d_in, d);
                        std::mem::swap(&mut token_in, token);
                    }
                }
                // Non-negative floats sort as their bits do; the index breaks ties.
                self.keys.push(u64::from(d.to_bits()) << 16 | i as u64);
            }
            self.keys.select_nth_unstable(NEIGHBOURS - 1);
            self.keys[..NEIGHBOURS].sort_unstable();
            out.groups.push(std::array::from_fn(|k| (self.keys[k] & 0xffff) as u16));
        }
        out.share.clear();
        out.share.extend(self.nearest.iter().map(|d| {
            let weight = d.map(|d| 1.0 / (d + 1e-4));
            let sum: f32 = weight.iter().sum();
            weight.map(|w| w / sum)
        }));
    }
}

/// Rotation that turns the unit vector `z` upright, by the smallest angle; rows.
fn upright(z: [f32; 3]) -> [[f32; 3]; 3] {
    // Rodrigues' formula about z × (0, 0, 1), the cosine being z₂.
    let (x, y, c) = (z[1], -z[0], z[2]);
    if c < -0.999_999 {
        return [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]];
    }
    let k = 1.0 / (1.0 + c);
    [[c + k * x * x, k * x * y, y], [k * x * y, c + k * y * y, -x], [-y, x, c]]
}

#[inline]
fn turned(rows: &[[f32; 3]; 3], p: [f32; 3]) -> [f32; 3] {
    rows.map(|r| dot(r, p))
}

/// The value below which `share` of the values lie; reorders them.
fn quantile(values: &mut [f32], share: f32) -> f32 {
    let at = ((values.len() - 1) as f32 * share) as usize;
    *values.select_nth_unstable_by(at, f32::total_cmp).1
}

#[inline]
pub(crate) fn sub(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

#[inline]
pub(crate) fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[inline]
pub(crate) fn squared(a: [f32; 3]) -> f32 {
    dot(a, a)
}

#[inline]
pub(crate) fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
