//! One segment against many, in closed form and in lanes.

use nalgebra::Vector3;

use crate::lanes::{Wide, wide};

/// Lanes that are worked on at once; a multiple of every vector's width.
const LANES: usize = 4;

/// Up to `N` segments, laid out for vector code.
#[derive(Clone, Debug)]
pub(crate) struct Segments<const N: usize> {
    from: [[f64; N]; 3],
    along: [[f64; N]; 3],
    squared: [f64; N],
    /// Of the squared length; 0 of a point.
    inverse: [f64; N],
    count: usize,
}

impl<const N: usize> Segments<N> {
    pub(crate) const NONE: Self =
        Self { from: [[0.0; N]; 3], along: [[0.0; N]; 3], squared: [0.0; N], inverse: [0.0; N], count: 0 };

    pub(crate) fn clear(&mut self) {
        self.count = 0;
    }

    /// Adds one, as long as there is room.
    pub(crate) fn push(&mut self, ends: &[Vector3<f64>; 2]) {
        let index = self.count;
        if index < N {
            let along = ends[1] - ends[0];
            for axis in 0..3 {
                self.from[axis][index] = ends[0][axis];
                self.along[axis][index] = along[axis];
            }
            let squared = along.norm_squared();
            self.squared[index] = squared;
            self.inverse[index] = if squared > 0.0 { 1.0 / squared } else { 0.0 };
            self.count += 1;
        }
    }

    /// The way from a segment to each of these at their nearest points, axis by axis, and its length.
    /// What stands past the last segment means nothing.
    ///
    /// As in [`super::segment_to_segment`] the inner solution is taken where it exists, otherwise the best of the
    /// four ends; here all five are worked out and one is chosen, since lanes cannot go different ways.
    #[inline]
    pub(crate) fn ways_from(&self, first: &[Vector3<f64>; 2]) -> ([[f64; N]; 3], [f64; N]) {
        wide(Ways { segments: self, first: first.map(Into::into) })
    }
}

struct Ways<'a, const N: usize> {
    segments: &'a Segments<N>,
    first: [[f64; 3]; 2],
}

impl<const N: usize> Wide for Ways<'_, N> {
    type Output = ([[f64; N]; 3], [f64; N]);

    #[inline(always)]
    fn run(self) -> Self::Output {
        let Segments { from, along, squared, inverse, count } = self.segments;
        let [start, end] = self.first;
        let u = [end[0] - start[0], end[1] - start[1], end[2] - start[2]];
        let uu = dot(&u, &u);
        let uu_inverse = if uu > 0.0 { 1.0 / uu } else { 0.0 };
        let (mut ways, mut lengths) = ([[0.0; N]; 3], [0.0; N]);
        for lane in 0..count.next_multiple_of(LANES).min(N) {
            let v = [along[0][lane], along[1][lane], along[2][lane]];
            let between = [start[0] - from[0][lane], start[1] - from[1][lane], start[2] - from[2][lane]];
            let (uv, vv, vv_inverse) = (dot(&u, &v), squared[lane], inverse[lane]);
            let (ub, vb) = (dot(&u, &between), dot(&v, &between));
            // The way between the points at the shares s of the first and t of the second.
            let way = |s: f64, t: f64| {
                let way = |axis: usize| v[axis] * t - u[axis] * s - between[axis];
                let way = [way(0), way(1), way(2)];
                (dot(&way, &way), way)
            };
            let shorter = |a: (f64, [f64; 3]), b: (f64, [f64; 3])| if b.0 < a.0 { b } else { a };
            let ends = shorter(
                shorter(way(0.0, share(vb * vv_inverse)), way(1.0, share((vb + uv) * vv_inverse))),
                shorter(way(share(-ub * uu_inverse), 0.0), way(share((uv - ub) * uu_inverse), 1.0)),
            );
            let determinant = uu * vv - uv * uv;
            let s = (uv * vb - vv * ub) / determinant;
            let t = (uu * vb - uv * ub) / determinant;
            let within = |x: f64| (0.0..=1.0).contains(&x);
            let inside = (determinant > 1e-12 * uu * vv) & within(s) & within(t);
            let inner = way(s, t);
            let best = if inside { inner } else { ends };
            for (ways, way) in ways.iter_mut().zip(best.1) {
                ways[lane] = way;
            }
            lengths[lane] = best.0.sqrt();
        }
        (ways, lengths)
    }
}

#[inline(always)]
fn dot(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Between the ends.
#[inline(always)]
fn share(x: f64) -> f64 {
    let x = if x > 0.0 { x } else { 0.0 };
    if x < 1.0 { x } else { 1.0 }
}

#[cfg(test)]
#[allow(clippy::disallowed_types, clippy::disallowed_macros, reason = "a test may allocate")]
mod tests {
    use super::super::segment_to_segment;
    use super::*;
    use proptest::prelude::*;

    fn point() -> impl Strategy<Value = Vector3<f64>> {
        // Coarse at times, so that segments are parallel, cross, touch or are points.
        let coordinate = prop_oneof![(-8i32..=8).prop_map(|k| f64::from(k) * 0.25), -2.0..2.0f64];
        prop::array::uniform3(coordinate).prop_map(Vector3::from)
    }

    proptest! {
        /// Every lane answers what the segments answer one by one.
        #[test]
        fn lanes_agree_with_one_by_one(
            first in prop::array::uniform2(point()),
            others in prop::collection::vec(prop::array::uniform2(point()), 1..=16),
        ) {
            let mut segments = Segments::<16>::NONE;
            others.iter().for_each(|ends| segments.push(ends));
            let (ways, lengths) = segments.ways_from(&first);
            for (lane, ends) in others.iter().enumerate() {
                let near = segment_to_segment(&first, ends);
                prop_assert!((lengths[lane] - near.distance).abs() < 1e-12, "{} {}", lengths[lane], near.distance);
                let way = Vector3::new(ways[0][lane], ways[1][lane], ways[2][lane]);
                prop_assert!((way.norm() - lengths[lane]).abs() < 1e-12);
            }
        }
    }
}
