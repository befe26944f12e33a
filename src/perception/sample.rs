//! From 10,000 points to what the network reads: 512 points with local shape, in groups.
//!
//! 1. Centre on the median and scale by the 95 % quantile of the radius, so that stray
//!    points do not set the scale.
//! 2. Find the dominant plane and turn the cloud so that its normal, on the camera's side,
//!    is z: heights over it and slopes against it tell features apart wherever the camera
//!    stood. Most of a scan is flat surface that says little: at least [`OFF_PLANE`] of the
//!    points kept lie off that plane, where the scan has as many.
//! 3. Keep 512 points by farthest-point sampling that favours the middle of the view.
//! 4. Give each its normal and roughness from all scanned points around it: threads
//!    are smaller than the spacing of 512 points and would be lost otherwise.
//! 5. Choose 64 group centres, 16 neighbours each.
//!
//! **Invariant:** the same points in the same order give the same sample, bit for bit.

use rand::SeedableRng;
use rand::seq::SliceRandom;
use rand_chacha::ChaCha8Rng;

use super::columns::Columns;
use super::grid::{Grid, moments, smallest_axis};

/// Points the network reads.
pub const POINTS: usize = 512;
/// Groups, and attention tokens.
pub const CENTRES: usize = 64;
/// Points of a group.
pub const NEIGHBOURS: usize = 16;
/// Numbers a point: place, normal, roughness.
pub const CHANNELS: usize = 7;

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
/// Radius of the neighbourhood that normal and roughness are taken from, in scaled units.
const LOCAL_RADIUS: f32 = 0.05;
/// A cloud with fewer points is not looked at.
pub const CLOUD_MIN: usize = 2 * POINTS;

/// A down-sampled cloud.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// Centre taken off, metres, in the camera frame.
    pub centre: [f32; 3],
    /// Metres a scaled unit.
    pub scale: f32,
    /// Rotation from the camera frame into the sample's, by rows: z is the normal of the
    /// dominant plane.
    pub turn: [[f32; 3]; 3],
    /// Points: [`POINTS`] × (place turned and scaled, normal towards the camera, roughness).
    pub points: Vec<[f32; CHANNELS]>,
    /// Index of each in the cloud.
    pub source: Vec<u16>,
    /// Group centres, indices into `points`.
    pub centres: Vec<u16>,
    /// Members of each group, [`CENTRES`] × [`NEIGHBOURS`], indices into `points`.
    pub groups: Vec<[u16; NEIGHBOURS]>,
    /// The centre (index into `centres`) nearest to each point.
    pub home: Vec<u16>,
}

impl Sample {
    /// Normal of a sampled point in the camera frame, towards the camera.
    pub fn normal_in_camera(&self, index: usize) -> [f32; 3] {
        let p = &self.points[index];
        [0, 1, 2].map(|c| self.turn[0][c] * p[3] + self.turn[1][c] * p[4] + self.turn[2][c] * p[5])
    }
}

/// Room for sampling, kept between clouds.
#[derive(Debug)]
pub struct Sampler {
    order: Vec<u16>,
    scaled: Vec<[f32; 3]>,
    column: Vec<f32>,
    grid: Grid,
}

impl Default for Sampler {
    fn default() -> Self {
        Self::new()
    }
}

impl Sampler {
    /// A sampler for clouds of up to 65,536 points.
    pub fn new() -> Self {
        Self { order: Vec::new(), scaled: Vec::new(), column: Vec::new(), grid: Grid::new() }
    }

    /// Samples a cloud (finite points, metres, camera frame); `None` if it has fewer than
    /// [`CLOUD_MIN`] points, more than 65,536, or no extent.
    pub fn sample(&mut self, cloud: &[[f32; 3]]) -> Option<Sample> {
        if cloud.len() < CLOUD_MIN || cloud.len() > 1 << 16 {
            return None;
        }
        self.shuffle(cloud.len());
        let (centre, scale) = self.normalise(cloud)?;
        let (normal, offset) = self.dominant_plane(centre);
        let turn = upright(normal);
        for p in &mut self.scaled {
            *p = turned(&turn, *p);
        }
        let kept = self.choose(offset);

        self.grid.fill(&self.scaled);
        let to_camera = turned(&turn, centre.map(|c| -c / scale));
        let points: Vec<[f32; CHANNELS]> = kept
            .iter()
            .map(|&i| {
                let p = self.scaled[usize::from(i)];
                let towards = [0, 1, 2].map(|k| to_camera[k] - p[k]);
                let (n, roughness) = self.grid.local_shape(&self.scaled, p, LOCAL_RADIUS, towards);
                [p[0], p[1], p[2], n[0], n[1], n[2], roughness]
            })
            .collect();
        let (centres, groups, home) = group(&points);
        Some(Sample { centre, scale, turn, points, source: kept, centres, groups, home })
    }

    /// A fixed pseudo-random order, so that clouds in raster order are sampled evenly too.
    fn shuffle(&mut self, count: usize) {
        if self.order.len() != count {
            self.order = (0..count).map(|i| i as u16).collect();
            self.order.shuffle(&mut ChaCha8Rng::seed_from_u64(count as u64));
        }
    }

    fn normalise(&mut self, cloud: &[[f32; 3]]) -> Option<([f32; 3], f32)> {
        let mut centre = [0.0; 3];
        for (axis, value) in centre.iter_mut().enumerate() {
            self.column.clear();
            self.column.extend(cloud.iter().map(|p| p[axis]));
            *value = quantile(&mut self.column, 0.5);
        }
        self.scaled.clear();
        self.scaled.extend(cloud.iter().map(|p| [0, 1, 2].map(|k| p[k] - centre[k])));
        self.column.clear();
        self.column.extend(self.scaled.iter().map(|p| squared(*p)));
        let scale = quantile(&mut self.column, 0.95).sqrt();
        if !(scale.is_finite() && scale > 1e-6) {
            return None;
        }
        let inverse = 1.0 / scale;
        for p in &mut self.scaled {
            *p = p.map(|v| v * inverse);
        }
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
    fn choose(&self, offset: f32) -> Vec<u16> {
        let (mut off, mut on) = (Vec::with_capacity(CANDIDATES[0]), Vec::with_capacity(CANDIDATES[0]));
        for &i in &self.order {
            let p = self.scaled[usize::from(i)];
            let side = if (p[2] - offset).abs() > PLANE_BAND { &mut off } else { &mut on };
            if side.len() < CANDIDATES[0] {
                side.push(i);
            }
        }
        let from_off = OFF_PLANE.max(POINTS.saturating_sub(on.len())).min(off.len()).min(POINTS);
        let from_on = POINTS - from_off;
        if from_on <= CANDIDATES[1] {
            on.truncate(CANDIDATES[1].max(from_on));
        }
        let mut kept = Vec::with_capacity(POINTS);
        kept.extend(self.farthest(&off, from_off));
        kept.extend(self.farthest(&on, from_on));
        kept
    }

    fn farthest(&self, candidates: &[u16], count: usize) -> Vec<u16> {
        let places: Vec<[f32; 3]> = candidates.iter().map(|&i| self.scaled[usize::from(i)]).collect();
        farthest_points(&places, count).iter().map(|&k| candidates[usize::from(k)]).collect()
    }
}

/// Farthest-point sampling with distances weighted towards the middle of the view: `count`
/// indices into `places`, the first the one nearest to the middle.
fn farthest_points(places: &[[f32; 3]], count: usize) -> Vec<u16> {
    let mut chosen = Vec::with_capacity(count);
    if count == 0 {
        return chosen;
    }
    let weights = Columns::filled(places.iter().map(|p| {
        let off_axis = (p[0] * p[0] + p[1] * p[1]).sqrt();
        // Stray points, far out of the scan, are never the farthest.
        if off_axis > 2.0 || p[2].abs() > 2.0 { 1e-6 } else { (0.25 + off_axis).powi(-2) }
    }));
    let columns = Columns::of(places.iter().copied());
    let mut gaps = Columns::filled(places.iter().map(|_| f32::MAX));
    let mut next = (0..places.len()).min_by(|&a, &b| squared(places[a]).total_cmp(&squared(places[b]))).unwrap_or(0);
    for _ in 0..count {
        chosen.push(next as u16);
        next = columns.farthest(places[next], &mut gaps, &weights);
    }
    chosen
}

/// Centres, their nearest points, and each point's nearest centre.
fn group(points: &[[f32; CHANNELS]]) -> (Vec<u16>, Vec<[u16; NEIGHBOURS]>, Vec<u16>) {
    let places: Vec<[f32; 3]> = points.iter().map(|p| [p[0], p[1], p[2]]).collect();
    let centres = farthest_points(&places, CENTRES);
    let mut nearest = vec![f32::INFINITY; places.len()];
    let mut home = vec![0_u16; places.len()];
    let mut keys: Vec<u64> = Vec::with_capacity(places.len());
    let groups = centres
        .iter()
        .enumerate()
        .map(|(token, &centre)| {
            let from = places[usize::from(centre)];
            keys.clear();
            for (i, p) in places.iter().enumerate() {
                let d = squared(sub(*p, from));
                if d < nearest[i] {
                    nearest[i] = d;
                    home[i] = token as u16;
                }
                // Non-negative floats sort as their bits do; the index breaks ties.
                keys.push(u64::from(d.to_bits()) << 16 | i as u64);
            }
            keys.select_nth_unstable(NEIGHBOURS - 1);
            keys[..NEIGHBOURS].sort_unstable();
            std::array::from_fn(|k| (keys[k] & 0xffff) as u16)
        })
        .collect();
    (centres, groups, home)
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
