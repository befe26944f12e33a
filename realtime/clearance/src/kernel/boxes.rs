//! Boxes: against a segment by the breakpoints of a convex function, against a
//! box by the edges of both.

use nalgebra::{Matrix3, Vector3};

use super::{Near, TOUCHING};

/// A box somewhere in the base frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OrientedBox {
    /// Centre, metres.
    pub(crate) centre: Vector3<f64>,
    /// Its axes as columns: base from box.
    pub(crate) axes: Matrix3<f64>,
    /// Half extents, metres.
    pub(crate) half: Vector3<f64>,
}

impl OrientedBox {
    pub(crate) const UNUSED: Self = Self {
        centre: Vector3::new(0.0, 0.0, 0.0),
        axes: Matrix3::new(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
        half: Vector3::new(0.0, 0.0, 0.0),
    };

    /// A point of the base frame in the box's frame.
    #[inline]
    pub(crate) fn inwards(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.axes.tr_mul(&(point - self.centre))
    }

    /// A point of the box's frame in the base frame.
    #[inline]
    pub(crate) fn outwards(&self, point: Vector3<f64>) -> Vector3<f64> {
        self.centre + self.axes * point
    }

    /// Half extents of the box along the base axes that holds this one.
    pub(crate) fn half_in_base(&self) -> Vector3<f64> {
        self.axes.abs() * self.half
    }

    /// Nearest points of a segment in base coordinates (first) and this box (second).
    #[inline]
    pub(crate) fn near_segment(&self, segment: &[Vector3<f64>; 2]) -> Near {
        let near = segment_to_box(&[self.inwards(&segment[0]), self.inwards(&segment[1])], &self.half);
        near.mapped(|point| self.outwards(point))
    }
}

/// Nearest points of a segment (first) and the box |x| ≤ `half` (second), both in its frame.
///
/// The squared distance along the segment is convex and piecewise quadratic; its
/// slope is piecewise linear with breaks where the segment crosses the planes of the
/// six faces. Shrinking a bracket of the slope's root over the breaks leaves one linear piece.
#[inline]
fn segment_to_box(segment: &[Vector3<f64>; 2], half: &Vector3<f64>) -> Near {
    let start = segment[0];
    let along = segment[1] - start;
    let slope = |t: f64| {
        let point = start + along * t;
        along.dot(&(point - clamp(&point, half)))
    };
    let (mut low, mut high) = (0.0, 1.0);
    let (mut slope_low, mut slope_high) = (slope(low), slope(high));
    let t = if slope_low >= 0.0 {
        low
    } else if slope_high <= 0.0 {
        high
    } else {
        for axis in 0..3 {
            let per_metre = 1.0 / along[axis];
            for face in [-half[axis], half[axis]] {
                // Infinite or not a number when the segment runs along the face: never inside the bracket.
                let crossing = (face - start[axis]) * per_metre;
                if crossing > low && crossing < high {
                    let at = slope(crossing);
                    if at < 0.0 {
                        (low, slope_low) = (crossing, at);
                    } else {
                        (high, slope_high) = (crossing, at);
                    }
                }
            }
        }
        low + (high - low) * (slope_low / (slope_low - slope_high))
    };
    let on_first = start + along * t;
    let on_second = clamp(&on_first, half);
    let distance = (on_first - on_second).norm();
    if distance > TOUCHING {
        return Near { distance, on_first, on_second };
    }
    let (depth, way_out) = depth_in_box(segment, half);
    // The end that reaches deepest against the way out.
    let deepest = if along.dot(&way_out) < 0.0 { segment[1] } else { start };
    Near { distance: -depth, on_first: deepest, on_second: deepest + way_out * depth }
}

#[inline]
fn clamp(point: &Vector3<f64>, half: &Vector3<f64>) -> Vector3<f64> {
    Vector3::new(point.x.max(-half.x).min(half.x), point.y.max(-half.y).min(half.y), point.z.max(-half.z).min(half.z))
}

/// Shortest way a segment must move to leave the box, and its direction: the
/// smallest overlap over the six normals that the sum of the two bodies has.
fn depth_in_box(segment: &[Vector3<f64>; 2], half: &Vector3<f64>) -> (f64, Vector3<f64>) {
    let centre = (segment[0] + segment[1]) * 0.5;
    let reach = (segment[1] - segment[0]) * 0.5;
    let mut depth = f64::INFINITY;
    let mut way_out = Vector3::zeros();
    for axis in 0..3 {
        let overlap = half[axis] + reach[axis].abs() - centre[axis].abs();
        if overlap < depth {
            depth = overlap;
            way_out = Vector3::zeros();
            way_out[axis] = if centre[axis] < 0.0 { -1.0 } else { 1.0 };
        }
    }
    for axis in 0..3 {
        let mut unit = Vector3::zeros();
        unit[axis] = 1.0;
        let normal = unit.cross(&reach);
        let length = normal.norm();
        if length > 1e-9 {
            let normal = normal / length;
            let offset = centre.dot(&normal);
            let overlap = half.dot(&normal.abs()) - offset.abs();
            if overlap < depth {
                depth = overlap;
                way_out = if offset < 0.0 { -normal } else { normal };
            }
        }
    }
    (depth.max(0.0), way_out)
}

/// Nearest points of two boxes, or `None` when they are farther apart than `enough`.
///
/// Apart, two boxes are nearest at an edge of at least one of them, so the 24
/// edges against the other box are all there is. Overlapping, the depth is the
/// smallest overlap over the 15 normals of the separating-axis test.
pub(crate) fn box_to_box(first: &OrientedBox, second: &OrientedBox, enough: f64) -> Option<Near> {
    let (gap, normal) = widest_gap(first, second);
    if gap > enough {
        return None;
    }
    if gap <= 0.0 {
        // The corner of the first that reaches deepest; `normal` points from first to second.
        let corner = first.axes.tr_mul(&normal).zip_map(&first.half, |n, h| h.copysign(n));
        let on_first = first.outwards(corner);
        return Some(Near { distance: gap, on_first, on_second: on_first + normal * gap });
    }
    let mut best = Near { distance: f64::INFINITY, on_first: Vector3::zeros(), on_second: Vector3::zeros() };
    for edge in edges(first) {
        let near = second.near_segment(&edge);
        if near.distance < best.distance {
            best = near;
        }
    }
    for edge in edges(second) {
        let near = first.near_segment(&edge);
        if near.distance < best.distance {
            best = near.swapped();
        }
    }
    Some(best)
}

/// The largest gap over the 15 normals (negative: the smallest overlap), and its normal from
/// the first box to the second. Never larger than the distance.
fn widest_gap(first: &OrientedBox, second: &OrientedBox) -> (f64, Vector3<f64>) {
    let between = second.centre - first.centre;
    let mut widest = f64::NEG_INFINITY;
    let mut way = Vector3::zeros();
    let mut consider = |normal: Vector3<f64>| {
        let reach =
            first.axes.tr_mul(&normal).abs().dot(&first.half) + second.axes.tr_mul(&normal).abs().dot(&second.half);
        let offset = between.dot(&normal);
        let gap = offset.abs() - reach;
        if gap > widest {
            widest = gap;
            way = if offset < 0.0 { -normal } else { normal };
        }
    };
    for a in 0..3 {
        consider(first.axes.column(a).into_owned());
        consider(second.axes.column(a).into_owned());
    }
    for a in 0..3 {
        for b in 0..3 {
            let normal = first.axes.column(a).cross(&second.axes.column(b));
            let length = normal.norm();
            if length > 1e-6 {
                consider(normal / length);
            }
        }
    }
    (widest, way)
}

/// The twelve edges of a box, in base coordinates.
fn edges(solid: &OrientedBox) -> [[Vector3<f64>; 2]; 12] {
    core::array::from_fn(|index| {
        let axis = index / 4;
        let sign = |bit: usize| if index & bit == 0 { -1.0 } else { 1.0 };
        let mut start = Vector3::zeros();
        start[axis] = -solid.half[axis];
        start[(axis + 1) % 3] = sign(1) * solid.half[(axis + 1) % 3];
        start[(axis + 2) % 3] = sign(2) * solid.half[(axis + 2) % 3];
        let mut end = start;
        end[axis] = solid.half[axis];
        [solid.outwards(start), solid.outwards(end)]
    })
}
