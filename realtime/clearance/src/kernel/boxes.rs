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
/// edges against the other box are all there is; and of those the ones that do not reach towards the other box as far as
/// what was found already is near are ruled out. Overlapping, the depth is the
/// smallest overlap over the 15 normals of the separating-axis test.
pub(crate) fn box_to_box(first: &OrientedBox, second: &OrientedBox, enough: f64) -> Option<Near> {
    let turn = first.axes.tr_mul(&second.axes);
    let between = second.centre - first.centre;
    let (gap, normal) = widest_gap(first, second, &turn, &between);
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
    // Edges of the first in the second's frame, then the other way round.
    let at = second.axes.tr_mul(&-between);
    if let Some(near) = near_edges(first, &normal, &turn.transpose(), &at, &second.half, gap, best.distance) {
        best = near.mapped(|point| second.outwards(point));
    }
    let at = first.axes.tr_mul(&between);
    if let Some(near) = near_edges(second, &-normal, &turn, &at, &first.half, gap, best.distance) {
        best = near.mapped(|point| first.outwards(point)).swapped();
    }
    Some(best)
}

/// Nearest points of the edges of a box (first) and another one (second), in the frame of that: `turn` and `at` are
/// where the box stands in it, `half` its half extents. `None` where no edge is nearer than `limit`.
///
/// `way` points from the box to the other, base coordinates, and a plane across it parts them with `gap` to spare.
fn near_edges(
    of: &OrientedBox,
    way: &Vector3<f64>,
    turn: &Matrix3<f64>,
    at: &Vector3<f64>,
    half: &Vector3<f64>,
    gap: f64,
    limit: f64,
) -> Option<Near> {
    let reach = of.axes.tr_mul(way).component_mul(&of.half);
    let corner = reach.zip_map(&of.half, |reach, half| half.copysign(reach));
    let mut best: Option<Near> = None;
    let mut limit = limit;
    // Beginning with the edges at the corner that reaches farthest: an edge lies back from there, along
    // the two axes across its own, by as much as it is on their other side.
    for sides in [[false, false], [true, false], [false, true], [true, true]] {
        for axis in 0..3 {
            let across = [(axis + 1) % 3, (axis + 2) % 3];
            let mut back = 0.0;
            let mut middle = corner;
            for (other, aside) in across.into_iter().zip(sides) {
                if aside {
                    back += 2.0 * reach[other].abs();
                    middle[other] = -middle[other];
                }
            }
            if gap + back > limit {
                continue;
            }
            middle[axis] = 0.0;
            let (centre, along) = (at + turn * middle, turn.column(axis) * of.half[axis]);
            let near = segment_to_box(&[centre - along, centre + along], half);
            if near.distance < limit {
                limit = near.distance;
                best = Some(near);
            }
        }
    }
    best
}

/// The largest gap over the 15 normals (negative: the smallest overlap), and its normal from
/// the first box to the second. Never larger than the distance. `turn`: first from second; `between`: their centres, in base
/// coordinates.
fn widest_gap(
    first: &OrientedBox,
    second: &OrientedBox,
    turn: &Matrix3<f64>,
    between: &Vector3<f64>,
) -> (f64, Vector3<f64>) {
    let (a_half, b_half) = (&first.half, &second.half);
    let in_first = first.axes.tr_mul(between);
    let in_second = turn.tr_mul(&in_first);
    let size = turn.abs();
    let a_reach = a_half + size * b_half;
    let b_reach = b_half + size.tr_mul(a_half);
    let mut widest = (f64::NEG_INFINITY, 0.0, 0, 0);
    let mut consider = |offset: f64, reach: f64, a: usize, b: usize| {
        let gap = offset.abs() - reach;
        if gap > widest.0 {
            widest = (gap, offset, a, b);
        }
    };
    // Index 3: the normal is an axis of the other box alone.
    for axis in 0..3 {
        consider(in_first[axis], a_reach[axis], axis, 3);
        consider(in_second[axis], b_reach[axis], 3, axis);
    }
    for a in 0..3 {
        let (a1, a2) = ((a + 1) % 3, (a + 2) % 3);
        for b in 0..3 {
            // Of the cross product of the two axes.
            let length = (turn[(a1, b)].powi(2) + turn[(a2, b)].powi(2)).sqrt();
            if length > 1e-6 {
                let (b1, b2) = ((b + 1) % 3, (b + 2) % 3);
                let offset = in_first[a2] * turn[(a1, b)] - in_first[a1] * turn[(a2, b)];
                let reach = a_half[a1] * size[(a2, b)]
                    + a_half[a2] * size[(a1, b)]
                    + b_half[b1] * size[(a, b2)]
                    + b_half[b2] * size[(a, b1)];
                consider(offset / length, reach / length, a, b);
            }
        }
    }
    let (gap, offset, a, b) = widest;
    let normal = match (a, b) {
        (a, 3) => first.axes.column(a).into_owned(),
        (3, b) => second.axes.column(b).into_owned(),
        (a, b) => first.axes.column(a).cross(&second.axes.column(b)).normalize(),
    };
    (gap, if offset < 0.0 { -normal } else { normal })
}
