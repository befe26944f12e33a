//! Segment against segment and point, in closed form.

use nalgebra::Vector3;

use super::Near;

/// Nearest points of a point (first) and a segment (second).
#[inline]
pub(crate) fn point_to_segment(point: &Vector3<f64>, segment: &[Vector3<f64>; 2]) -> Near {
    let along = segment[1] - segment[0];
    let length_squared = along.norm_squared();
    let share =
        if length_squared > 0.0 { (along.dot(&(point - segment[0])) / length_squared).clamp(0.0, 1.0) } else { 0.0 };
    let nearest = segment[0] + along * share;
    Near { distance: (point - nearest).norm(), on_first: *point, on_second: nearest }
}

/// Nearest points of two segments.
///
/// Either both nearest points are inside their segments, or one is an end: the
/// inner solution is taken when it exists, otherwise the best of the four ends.
/// So segments that are nearly parallel cost no accuracy.
#[inline]
pub(crate) fn segment_to_segment(first: &[Vector3<f64>; 2], second: &[Vector3<f64>; 2]) -> Near {
    let (u, v) = (first[1] - first[0], second[1] - second[0]);
    let between = first[0] - second[0];
    let (uu, uv, vv) = (u.dot(&u), u.dot(&v), v.dot(&v));
    let (ub, vb) = (u.dot(&between), v.dot(&between));
    let determinant = uu * vv - uv * uv;
    if determinant > 1e-12 * uu * vv {
        let s = (uv * vb - vv * ub) / determinant;
        let t = (uu * vb - uv * ub) / determinant;
        if (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t) {
            let (on_first, on_second) = (first[0] + u * s, second[0] + v * t);
            return Near { distance: (on_first - on_second).norm(), on_first, on_second };
        }
    }
    let mut best = point_to_segment(&first[0], second);
    for other in [
        point_to_segment(&first[1], second),
        point_to_segment(&second[0], first).swapped(),
        point_to_segment(&second[1], first).swapped(),
    ] {
        if other.distance < best.distance {
            best = other;
        }
    }
    best
}
