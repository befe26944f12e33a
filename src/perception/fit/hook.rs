//! Buckles: the upright box around the hooks.

use bumpalo::Bump;
use bumpalo::collections::CollectIn;
use nalgebra::{Vector2, Vector3};
use tandem_msg::FeatureDimensions;

use super::plane::Plane;
use super::{Dense, Fit, Frame, List, Local, measured, quantile, wide};
use crate::perception::sample::Sample;

/// Directions tried over a right angle.
const DIRECTIONS: usize = 60;
/// What the slopes of a hook count against its overhang.
const SLOPE_WEIGHT: f64 = 0.4;
/// Upward components of the normals of sloping faces.
const SLOPING: std::ops::Range<f64> = 0.2..0.93;

/// Fits a buckle: direction, centre of the foot, length, width, height.
pub(crate) fn fit(plane: &Plane, dense: &Dense<'_>, sample: &Sample, segment: &[bool], room: &Bump) -> Option<Fit> {
    let middle = dense.feature.iter().sum::<Vector3<f64>>() / dense.feature.len() as f64;
    let frame = Frame::on(middle - plane.normal * plane.height(middle), plane.normal);
    let local: List<'_, Local> = dense.feature.iter().map(|p| frame.local(*p)).collect_in(room);
    let mut heights: List<'_, f64> = local.iter().map(|p| p.z).collect_in(room);
    let top = quantile(&mut heights, 0.98);
    let spacing = 0.02 * top;
    // Points of the surface itself do not show the outline.
    let upper: List<'_, &Local> = local.iter().filter(|p| p.z > 0.12 * top).collect_in(room);
    if upper.len() < 8 {
        return None;
    }
    let mut values = List::with_capacity_in(upper.len(), room);
    let mut extents = |along: Vector2<f64>, low: f64, high: f64| {
        values.clear();
        values.extend(upper.iter().filter(|p| p.z >= low && p.z <= high).map(|p| along.dot(&p.xy())));
        // From well inside on to the very ends, which stray points have moved.
        let [a, b, c, d] = [0.01, 0.02, 0.98, 0.99].map(|share| quantile(&mut values, share));
        [a - (b - a), d + (d - c)]
    };
    let direction = |k: usize| {
        let (sin, cos) = (std::f64::consts::FRAC_PI_2 * k as f64 / DIRECTIONS as f64).sin_cos();
        [Vector2::new(cos, sin), Vector2::new(-sin, cos)]
    };
    let mut area = |k: usize| {
        direction(k).iter().fold(1.0, |area, d| {
            let [a, b] = extents(*d, 0.0, f64::MAX);
            area * (b - a)
        })
    };
    let best = (0..DIRECTIONS).map(|k| (area(k), k)).min_by(|a, b| a.0.total_cmp(&b.0))?.1;
    let axes = direction(best);
    // Along x the noses slope; along y all faces are upright or level.
    let mut slopes = [0.0_f64; 2];
    for (i, _) in segment.iter().enumerate().filter(|(_, s)| **s) {
        let normal = frame.axes.tr_mul(&wide(sample.normal_in_camera(i)));
        if SLOPING.contains(&normal.z) {
            for (slope, d) in slopes.iter_mut().zip(axes) {
                *slope += d.dot(&normal.xy()).powi(4);
            }
        }
    }
    // They also overhang, or there is a gap between two hooks.
    let shape = axes.map(|d| {
        let [a, b] = extents(d, 0.0, f64::MAX);
        let (wide, foot) = (extents(d, 0.5 * top, f64::MAX), extents(d, 0.0, 0.45 * top));
        let between = upper.iter().filter(|p| {
            let s = (d.dot(&p.xy()) - a) / (b - a).max(1e-9);
            s > 0.42 && s < 0.58
        });
        let share = between.count() as f64 / upper.len() as f64;
        let overhang = ((wide[1] - wide[0]) - (foot[1] - foot[0])) / (b - a).max(1e-9);
        overhang + 2.0 * (0.16 - share).max(0.0) / 0.16
    });
    let lead = shape[0] - shape[1] + SLOPE_WEIGHT * ((slopes[0] + 1.0) / (slopes[1] + 1.0)).ln();
    let (along, across) = if lead >= 0.0 { (axes[0], axes[1]) } else { (axes[1], axes[0]) };
    let (x, y) = (extents(along, 0.0, f64::MAX), extents(across, 0.0, f64::MAX));
    let centre = along * (0.5 * (x[0] + x[1])) + across * (0.5 * (y[0] + y[1]));
    let dimensions = FeatureDimensions {
        length: measured(x[1] - x[0], spacing + 0.02 * (x[1] - x[0])),
        width: measured(y[1] - y[0], spacing + 0.02 * (y[1] - y[0])),
        depth: measured(top, plane.rms + 0.01 * top),
        ..FeatureDimensions::default()
    };
    let pose = frame.pose(Vector3::new(centre.x, centre.y, 0.0), Vector3::z(), Vector3::new(along.x, along.y, 0.0));
    Some(Fit { camera_from_feature: pose, dimensions, winding: None })
}
