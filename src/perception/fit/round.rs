//! Holes, axes and cones: a surface of revolution about the feature's axis.

use bumpalo::Bump;
use bumpalo::collections::CollectIn;
use nalgebra::{SMatrix, SVector, Vector2, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use tandem_msg::{FeatureClass, FeatureDimensions, Measured};

use super::plane::Plane;
use super::{Dense, Fit, Frame, List, Local, measured, quantile, thread, wide};
use crate::perception::sample::Sample;

const CIRCLES: usize = 160;
const AXES: usize = 80;
/// Flat patches whose direction is tried as an axis.
const PATCHES: usize = 2;
/// Cosine between normals of one patch.
const FLAT: f64 = 0.97;
/// Cosine between axis and normal from which a point is of cap or floor.
const FACING: f64 = 0.88;
/// Cosine between the wall's normal and a point's for it to be of the wall, and distance in reaches.
const ALIKE: f64 = 0.8;
const NEAR: f64 = 0.06;
/// Share of the agreement of a free axis at which the surface's normal is believed.
const SURFACE: f64 = 0.85;
/// Points that vote on a circle.
const VOTERS: usize = 240;
/// Largest radius of a circle in the extent of its points: about half a turn of a wall is seen.
const WIDEST: f64 = 0.75;
/// Tolerance of a circle's votes, in its radius.
const TOLERANCE: f64 = 0.05;
/// Spread allowed between axis and surface normal where there is a surface, and where not.
const LEAN: [f64; 2] = [0.012, 0.3];

/// A wall of revolution in a local frame: at height z the centre is centre + lean·z and
/// the radius is radius + slope·z.
#[derive(Clone, Copy, Debug)]
struct Wall {
    centre: Vector2<f64>,
    lean: Vector2<f64>,
    radius: f64,
    slope: f64,
    /// Standard deviations of centre, radius.
    sigma: [f64; 2],
}

impl Wall {
    /// Distance of a point from the axis, and from the wall outwards.
    fn distance(&self, p: &Local) -> (Vector2<f64>, f64) {
        let off = p.xy() - self.centre - self.lean * p.z;
        (off, off.norm() - self.radius - self.slope * p.z)
    }
}

/// Fits a hole, axis or cone.
#[allow(clippy::too_many_arguments, reason = "all that was seen, and room")]
pub(crate) fn fit(
    surface: Option<&Plane>,
    cloud: &[[f32; 3]],
    sample: &Sample,
    segment: &[bool],
    dense: &Dense<'_>,
    class: FeatureClass,
    room: &Bump,
    rng: &mut ChaCha8Rng,
) -> Option<Fit> {
    let middle = dense.feature.iter().sum::<Vector3<f64>>() / dense.feature.len() as f64;
    let mut distances: List<'_, f64> = dense.feature.iter().map(|p| (p - middle).norm()).collect_in(room);
    let shown = Shown {
        points: segment
            .iter()
            .enumerate()
            .filter(|(_, s)| **s)
            .map(|(i, _)| (wide(cloud[usize::from(sample.source[i])]), wide(sample.smooth_normal_in_camera(i))))
            .collect_in(room),
        reach: quantile(&mut distances, 0.95),
    };
    let mut best: Option<(f64, Frame, Wall, bool)> = None;
    let mut consider = |frame: Frame, lean: f64, on_surface: bool, rng: &mut ChaCha8Rng| {
        if let Some(wall) = wall(&frame, dense, class, lean, room, rng) {
            let score = shown.agreement(&frame, &wall) / if on_surface { SURFACE } else { 1.0 };
            if best.as_ref().is_none_or(|b| score > b.0) {
                best = Some((score, frame, wall, on_surface));
            }
        }
    };
    if let Some(plane) = surface {
        let origin = middle - plane.normal * plane.height(middle);
        consider(Frame::on(origin, plane.normal), LEAN[0], true, rng);
    }
    // What stands out may stand on no surface that is seen: a plug at the end of a cable.
    if !matches!(class, FeatureClass::ThreadedHole | FeatureClass::SmoothHole) {
        for axis in shown.axes(room, rng) {
            consider(Frame::on(middle, axis), LEAN[1], false, rng);
        }
    }
    let (_, frame, wall, on_surface) = best?;
    Some(finish(&frame, &wall, on_surface, dense, class, sample, room))
}

/// The feature's sampled points with their smooth normals, in the camera frame.
struct Shown<'r> {
    points: List<'r, (Vector3<f64>, Vector3<f64>)>,
    /// Distance from their middle that nearly all keep.
    reach: f64,
}

impl<'r> Shown<'r> {
    /// Share of the points that lie on the wall with its normal, or face along the axis within it as a cap
    /// or floor does.
    fn agreement(&self, frame: &Frame, wall: &Wall) -> f64 {
        let axis = Vector3::new(wall.lean.x, wall.lean.y, 1.0).normalize();
        let on = |(p, n): &&(Vector3<f64>, Vector3<f64>)| {
            let (off, e) = wall.distance(&frame.local(*p));
            let normal = frame.axes.tr_mul(n);
            if axis.dot(&normal) > FACING {
                return e < NEAR * self.reach;
            }
            let out = off / off.norm().max(1e-9);
            let lean = -wall.slope - wall.lean.dot(&out);
            // Of a bore the wall is seen from within.
            let cosine = Vector3::new(out.x, out.y, lean).normalize().dot(&normal).abs();
            e.abs() < NEAR * self.reach && cosine > ALIKE
        };
        self.points.iter().filter(on).count() as f64 / self.points.len().max(1) as f64
    }

    /// Axes worth trying, out of the part: the one most normals keep a common angle to, and those that
    /// flat patches, such as the end of a pin, look along.
    fn axes(&self, room: &'r Bump, rng: &mut ChaCha8Rng) -> List<'r, Vector3<f64>> {
        let normals: List<'_, Vector3<f64>> = self.points.iter().map(|(_, n)| *n).collect_in(room);
        let mut axes = List::with_capacity_in(1 + PATCHES, room);
        if normals.len() < 12 {
            return axes;
        }
        let mut round: (usize, Vector3<f64>) = (0, Vector3::zeros());
        for _ in 0..AXES {
            let [a, b, c] = [0; 3].map(|_| normals[rng.random_range(0..normals.len())]);
            let axis = (a - b).cross(&(a - c));
            let length = axis.norm();
            if length < 0.05 {
                continue;
            }
            let axis = axis / length;
            let level = axis.dot(&a);
            // Flanks only: caps look along the axis.
            if level.abs() > 0.75 {
                continue;
            }
            let votes = normals.iter().filter(|n| (axis.dot(n) - level).abs() < 0.08).count();
            if votes > round.0 {
                round = (votes, axis);
            }
        }
        if round.0 * 4 >= normals.len() {
            axes.push(round.1);
        }
        let count = normals.len();
        let mut left = normals;
        for _ in 0..PATCHES {
            let alike = |n: &Vector3<f64>| left.iter().filter(|m| n.dot(m) > FLAT).count();
            let Some(patch) = left.iter().copied().max_by_key(alike) else { break };
            let on = |m: &Vector3<f64>| patch.dot(m) > FLAT;
            if left.iter().filter(|m| on(m)).count() * 10 < count {
                break;
            }
            axes.push(left.iter().filter(|m| on(m)).sum::<Vector3<f64>>().normalize());
            left.retain(|m| !on(m));
        }
        // Out of the part: towards the camera.
        axes.iter_mut().for_each(|axis| *axis = if axis.z > 0.0 { -*axis } else { *axis });
        axes
    }
}

/// The wall among the feature's points, given a frame with z near its axis.
fn wall(
    frame: &Frame,
    dense: &Dense<'_>,
    class: FeatureClass,
    lean: f64,
    room: &Bump,
    rng: &mut ChaCha8Rng,
) -> Option<Wall> {
    let mut flank: List<'_, Local> = dense.feature.iter().map(|p| frame.local(*p)).collect_in(room);
    let mut heights: List<'_, f64> = flank.iter().map(|p| p.z).collect_in(room);
    let (low, high) = (quantile(&mut heights, 0.03), quantile(&mut heights, 0.97));
    let span = high - low;
    // Floor, cap and chamfer are not wall.
    flank.retain(|p| p.z > low + 0.10 * span && p.z < high - 0.08 * span);
    if flank.len() < 10 {
        return None;
    }
    let cone = class == FeatureClass::Cone;
    let start = guess(&flank, cone, room, rng)?;
    refine(start, &flank, lean, cone, room)
}

/// The upright wall most flank points lie on: a circle through three points, for a cone
/// three of about the same height and a fourth to say how the radius changes.
fn guess(flank: &[Local], cone: bool, room: &Bump, rng: &mut ChaCha8Rng) -> Option<Wall> {
    let stride = flank.len().div_ceil(VOTERS);
    let mut voters: List<'_, &Local> = flank.iter().step_by(stride).collect_in(room);
    voters.sort_unstable_by(|a, b| a.z.total_cmp(&b.z));
    let count = voters.len();
    let slice = if cone { (count / 8).max(4).min(count) } else { count };
    let extent = flank.iter().fold([f64::MAX, f64::MIN, f64::MAX, f64::MIN], |e, p| {
        [e[0].min(p.x), e[1].max(p.x), e[2].min(p.y), e[3].max(p.y)]
    });
    let widest = (extent[1] - extent[0]).max(extent[3] - extent[2]);
    let mut best: Option<(usize, Wall)> = None;
    for _ in 0..if cone { 3 * CIRCLES } else { CIRCLES } {
        let first = rng.random_range(0..=count - slice);
        let [a, b, c] = [0; 3].map(|_| voters[first + rng.random_range(0..slice)]);
        let Some((centre, radius)) = through(a.xy(), b.xy(), c.xy()) else {
            continue;
        };
        if radius > WIDEST * widest || radius < 0.05 * widest {
            continue;
        }
        let mut wall = Wall { centre, lean: Vector2::zeros(), radius, slope: 0.0, sigma: [0.0; 2] };
        if cone {
            let height = (a.z + b.z + c.z) / 3.0;
            let other = voters[rng.random_range(0..count)];
            let rise = other.z - height;
            if rise.abs() < 1e-9 {
                continue;
            }
            wall.slope = ((other.xy() - centre).norm() - radius) / rise;
            wall.radius = radius - wall.slope * height;
            if wall.slope.abs() > 1.5 {
                continue;
            }
        }
        let tolerance = radius * TOLERANCE;
        let votes = voters.iter().filter(|p| wall.distance(p).1.abs() < tolerance).count();
        if best.is_none_or(|b| votes > b.0) {
            best = Some((votes, wall));
        }
    }
    best.map(|(_, wall)| wall)
}

/// Centre and radius of the circle through three points.
fn through(a: Vector2<f64>, b: Vector2<f64>, c: Vector2<f64>) -> Option<(Vector2<f64>, f64)> {
    let (u, v) = (b - a, c - a);
    let twice = 2.0 * (u.x * v.y - u.y * v.x);
    if twice.abs() < 1e-12 {
        return None;
    }
    let (uu, vv) = (u.norm_squared(), v.norm_squared());
    let off = Vector2::new(v.y * uu - u.y * vv, u.x * vv - v.x * uu) / twice;
    Some((a + off, off.norm()))
}

/// Gauss–Newton on centre, lean, radius and slope, with Tukey weights. `lean` is the prior
/// standard deviation of the lean, radians; cylinders keep their slope at nothing.
fn refine(mut wall: Wall, flank: &[Local], lean: f64, cone: bool, room: &Bump) -> Option<Wall> {
    let mut off_wall = List::with_capacity_in(flank.len(), room);
    let start = flank.iter().map(|p| wall.radius + wall.slope * p.z).sum::<f64>() / flank.len() as f64;
    let mut reach = 0.2 * start;
    for _ in 0..12 {
        let mut normal = SMatrix::<f64, 6, 6>::zeros();
        let mut right = SVector::<f64, 6>::zeros();
        let (mut squares, mut weight_sum, mut inliers) = (0.0, 0.0, 0);
        off_wall.clear();
        for p in flank {
            let (off, e) = wall.distance(p);
            off_wall.push(e.abs());
            if e.abs() > reach {
                continue;
            }
            let w = (1.0 - (e / reach).powi(2)).powi(2);
            let u = off / off.norm().max(1e-9);
            let row = SVector::<f64, 6>::from([-u.x, -u.y, -u.x * p.z, -u.y * p.z, -1.0, -p.z]);
            normal += row * row.transpose() * w;
            right -= row * (w * e);
            squares += w * e * e;
            weight_sum += w;
            inliers += 1;
        }
        if inliers < 8 {
            return None;
        }
        let rms = (squares / weight_sum).sqrt().max(10e-6);
        // Priors, in units of the measured noise.
        for (k, prior, now) in
            [(2, lean, wall.lean.x), (3, lean, wall.lean.y), (5, if cone { 1.0 } else { 1e-6 }, wall.slope)]
        {
            let stiffness = (rms / prior).powi(2);
            normal[(k, k)] += stiffness;
            right[k] -= stiffness * now;
        }
        let inverse = normal.try_inverse()?;
        let mut step = inverse * right;
        // A short arc says little about its radius: not farther than halfway at once.
        let most = 0.5 * wall.radius.abs() / step[4].abs().max(1e-12);
        step *= most.min(1.0);
        wall.centre += Vector2::new(step[0], step[1]);
        wall.lean += Vector2::new(step[2], step[3]);
        wall.radius += step[4];
        wall.slope += step[5];
        wall.sigma = [inverse[(0, 0)].max(inverse[(1, 1)]), inverse[(4, 4)]].map(|v| rms * v.max(0.0).sqrt());
        reach = (6.0 * quantile(&mut off_wall, 0.5)).clamp(0.02 * start, reach);
    }
    let sane =
        wall.radius > 0.1 * start && wall.radius < 6.0 * start && wall.lean.norm() < 1.0 && wall.slope.abs() < 2.0;
    sane.then_some(wall)
}

fn finish(
    frame: &Frame,
    wall: &Wall,
    on_surface: bool,
    dense: &Dense<'_>,
    class: FeatureClass,
    sample: &Sample,
    room: &Bump,
) -> Fit {
    let axis = Vector3::new(wall.lean.x, wall.lean.y, 1.0).normalize();
    // Along the axis from the frame's plane; inside the rim, so that chamfers do not count.
    let local: List<'_, Local> = dense.feature.iter().map(|p| frame.local(*p)).collect_in(room);
    let mut heights: List<'_, f64> = local.iter().map(|p| p.z).collect_in(room);
    let sunk = quantile(&mut heights, 0.5) < 0.0 && on_surface;
    // Of what it stands on, a cable say, some may have been taken for it: that is not on the wall.
    let mut on_wall: List<'_, f64> =
        local.iter().filter(|p| wall.distance(p).1.abs() < 0.1 * wall.radius.abs()).map(|p| p.z).collect_in(room);
    let base = if on_surface { 0.0 } else { quantile(&mut on_wall, 0.01) };
    // The end of a sharp cone shows few points.
    let last = if class == FeatureClass::Cone { 0.01 } else { 0.04 };
    let end = quantile(&mut heights, if sunk { last } else { 1.0 - last });
    let end = level(&heights, end, 0.04 * (end - base).abs(), room);
    let spacing = 2.0 * f64::from(sample.scale) / 100.0;
    let depth = measured((end - base).abs(), 0.3 * spacing + 0.01 * (end - base).abs());

    // Neither floor nor chamfer.
    let (from, to) = (base.min(end), base.max(end));
    let inside = from + 0.06 * (to - from)..to - 0.06 * (to - from);
    let flank: List<'_, [f64; 3]> = local
        .iter()
        .filter(|p| inside.contains(&p.z))
        .filter_map(|p| {
            let (off, e) = wall.distance(p);
            (e.abs() < 0.2 * wall.radius).then(|| [p.z, off.y.atan2(off.x), e])
        })
        .collect_in(room);
    let wound = if class == FeatureClass::Cone { None } else { thread::wound(&flank, wall.radius, room) };
    let (diameter, pitch) = match class {
        FeatureClass::ThreadedHole | FeatureClass::ThreadedAxis => {
            let pitch = wound.unwrap_or_default().pitch;
            // Crests hide much of the roots, so that the wall fitted lies nearer to them: in a
            // bore the major diameter is most of twice the profile's height outside, on an axis
            // a little of it. Shares measured on generated threads.
            let hole = class == FeatureClass::ThreadedHole;
            let (height, share) = if hole { (0.5413, 1.58) } else { (0.6134, 0.12) };
            let steepness = if pitch.value > 0.0 { pitch.value } else { 0.27 * wall.radius };
            let height = height * share * steepness;
            (measured(2.0 * wall.radius + height, 2.0 * wall.sigma[1] + 0.3 * height), pitch)
        }
        FeatureClass::Cone => {
            let at_base = wall.radius + wall.slope * base;
            (measured(2.0 * at_base, 2.0 * wall.sigma[1] + 0.02 * at_base), Measured::default())
        }
        _ => (measured(2.0 * wall.radius, 2.0 * wall.sigma[1] + 0.002 * wall.radius), Measured::default()),
    };
    let at = Vector3::new(wall.centre.x + wall.lean.x * base, wall.centre.y + wall.lean.y * base, base);
    Fit {
        camera_from_feature: frame.pose(at, axis, Vector3::x()),
        dimensions: FeatureDimensions { diameter, depth, pitch, ..FeatureDimensions::default() },
        winding: wound.map(|wound| wound.winding),
    }
}

/// The middle of the heights within `band` of `near`: the level of a floor or cap.
fn level(heights: &[f64], near: f64, band: f64, room: &Bump) -> f64 {
    let mut on: List<'_, f64> = heights.iter().copied().filter(|h| (h - near).abs() <= band).collect_in(room);
    if on.is_empty() { near } else { quantile(&mut on, 0.5) }
}
