//! Segment against an upright cylinder with flat caps.

use nalgebra::Vector3;

use super::{Near, TOUCHING};

/// Steps of the root search; every fourth halves the bracket, and in practice ten do.
const STEPS: u32 = 80;

/// What the search may leave open of a distance, metres.
const OPEN: f64 = 1e-9;

/// Nearest points of a segment (first) and the cylinder `x² + y² ≤ radius²`, `|z| ≤ half_length` (second), in its frame.
///
/// The squared distance along the segment is convex, so its slope is searched
/// for its root. What the search leaves open is taken off the answer: by
/// convexity the least value lies at most slope × bracket below the last one.
pub(crate) fn segment_to_cylinder(segment: &[Vector3<f64>; 2], radius: f64, half_length: f64) -> Near {
    let start = segment[0];
    let along = segment[1] - start;
    let nearest = |point: &Vector3<f64>| {
        let from_axis = (point.x * point.x + point.y * point.y).sqrt();
        let scale = if from_axis > radius { radius / from_axis } else { 1.0 };
        Vector3::new(point.x * scale, point.y * scale, point.z.max(-half_length).min(half_length))
    };
    // Half the derivative of the squared distance.
    let slope = |t: f64| {
        let point = start + along * t;
        along.dot(&(point - nearest(&point)))
    };
    let (mut low, mut high) = (0.0, 1.0);
    let (mut slope_low, mut slope_high) = (slope(low), slope(high));
    let mut open = 0.0;
    let t = if slope_low >= 0.0 {
        low
    } else if slope_high <= 0.0 {
        high
    } else {
        // False position, weighted down on the side that stays (Illinois), with a bisection now and then.
        let mut t = 0.5;
        let mut last = 0.0;
        for step in 0..STEPS {
            let guess = low + (high - low) * (slope_low / (slope_low - slope_high));
            t = if step % 4 == 3 || !(guess > low && guess < high) { 0.5 * (low + high) } else { guess };
            let point = start + along * t;
            let away = point - nearest(&point);
            let at = along.dot(&away);
            open = 2.0 * at.abs() * (high - low);
            if open <= OPEN * away.norm() {
                break;
            }
            if at < 0.0 {
                (low, slope_low) = (t, at);
                if last < 0.0 {
                    slope_high *= 0.5;
                }
            } else {
                (high, slope_high) = (t, at);
                if last > 0.0 {
                    slope_low *= 0.5;
                }
            }
            last = if at < 0.0 { -1.0 } else { 1.0 };
        }
        t
    };
    let on_first = start + along * t;
    let on_second = nearest(&on_first);
    let squared = (on_first - on_second).norm_squared();
    if squared > open + TOUCHING * TOUCHING {
        return Near { distance: (squared - open).sqrt(), on_first, on_second };
    }
    let (depth, way_out) = depth_in_cylinder(segment, radius, half_length);
    let deepest = if along.dot(&way_out) < 0.0 { segment[1] } else { start };
    Near { distance: -depth, on_first: deepest, on_second: deepest + way_out * depth }
}

/// A way to leave the cylinder, along the axis or across it: at least as long as the shortest one.
fn depth_in_cylinder(segment: &[Vector3<f64>; 2], radius: f64, half_length: f64) -> (f64, Vector3<f64>) {
    let middle = 0.5 * (segment[0].z + segment[1].z);
    let up = half_length + 0.5 * (segment[1].z - segment[0].z).abs() - middle.abs();
    let flat = segment.map(|end| Vector3::new(end.x, end.y, 0.0));
    let nearest = super::point_to_segment(&Vector3::zeros(), &flat);
    let across = radius - nearest.distance;
    if up <= across {
        return (up.max(0.0), Vector3::new(0.0, 0.0, if middle < 0.0 { -1.0 } else { 1.0 }));
    }
    let way_out = if nearest.distance > 1e-9 {
        nearest.on_second / nearest.distance
    } else {
        // Through the axis: any direction square to the segment's shadow.
        let shadow = flat[1] - flat[0];
        let square = Vector3::new(-shadow.y, shadow.x, 0.0);
        if square.norm() > 1e-9 { square.normalize() } else { Vector3::x() }
    };
    (across.max(0.0), way_out)
}
