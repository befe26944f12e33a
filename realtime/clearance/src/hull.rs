//! Convex hulls, and the farthest of their points along a direction.
#![allow(clippy::disallowed_types, reason = "shapes are made while starting")]

use nalgebra::Vector3;

use crate::lanes::{Wide, wide};
use crate::shapes::{HULL_POINTS_MAX, ShapeError, middle_of};

/// Points that are looked at side by side.
const LANES: usize = 8;
/// Blocks of that many points, in multiples of it.
const BLOCKS_MAX: usize = HULL_POINTS_MAX / LANES;
/// Rounding that no bound may rest on, metres along a unit vector.
const ROUNDING: f64 = 1e-9;

/// The convex hull of some points, about the middle of the box around them.
#[derive(Clone, Debug)]
pub(crate) struct Hull {
    /// Coordinates of `LANES` points side by side, points that lie near each other in one block; the last block is
    /// filled up with its first point.
    blocks: Vec<[[f64; LANES]; 3]>,
    /// Middles and half extents of the boxes around `LANES` blocks side by side; those of no block reach nowhere.
    boxes: Vec<[[f64; LANES]; 6]>,
    /// Middle of the box in the frame the points were given in.
    pub(crate) centre: Vector3<f64>,
    pub(crate) half: Vector3<f64>,
}

impl Hull {
    pub(crate) fn of(points: &[[f64; 3]]) -> Result<Self, ShapeError> {
        if !(4..=HULL_POINTS_MAX).contains(&points.len()) {
            return Err(ShapeError::HullPoints { count: points.len() });
        }
        let (centre, half) = middle_of(points)?;
        let mut points: Vec<Vector3<f64>> = points.iter().map(|point| Vector3::from(*point) - centre).collect();
        gather(&mut points);
        let lanes = |of: &dyn Fn(usize) -> f64| core::array::from_fn(of);
        let blocks: Vec<_> = points.chunks(LANES).collect();
        let boxes = blocks.chunks(LANES).map(|blocks| {
            let bounds: Vec<_> = blocks.iter().map(|block| bounds(block)).collect();
            core::array::from_fn(|row| {
                lanes(&|lane| match bounds.get(lane) {
                    Some((middle, half)) => {
                        if row < 3 {
                            middle[row]
                        } else {
                            half[row - 3] + ROUNDING
                        }
                    }
                    None => {
                        if row < 3 {
                            0.0
                        } else {
                            -1e9
                        }
                    }
                })
            })
        });
        let boxes = boxes.collect();
        let of_block = |block: &&[Vector3<f64>]| {
            core::array::from_fn(|axis| lanes(&|lane| block.get(lane).unwrap_or(&block[0])[axis]))
        };
        Ok(Self { blocks: blocks.iter().map(of_block).collect(), boxes, centre, half })
    }

    /// A point that lies farthest along `direction`: what is not looked at lies in a box that does not reach as
    /// far, so no point of the hull lies farther.
    pub(crate) fn support(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        let (place, lane) = wide(Farthest { hull: self, direction: [direction.x, direction.y, direction.z] });
        let [xs, ys, zs] = &self.blocks[place];
        Vector3::new(xs[lane], ys[lane], zs[lane])
    }

    /// The points in the frame they were given in.
    pub(crate) fn points(&self) -> impl Iterator<Item = Vector3<f64>> + '_ {
        let of_block = |block: &[[f64; LANES]; 3]| {
            let [xs, ys, zs] = *block;
            (0..LANES).map(move |lane| Vector3::new(xs[lane], ys[lane], zs[lane]))
        };
        self.blocks.iter().flat_map(of_block).map(|point| point + self.centre)
    }
}

/// Orders points so that each `LANES` of them lie near each other: split across the longest side, over and over.
fn gather(points: &mut [Vector3<f64>]) {
    if points.len() <= LANES {
        return;
    }
    let axis = bounds(points).1.imax();
    let half = (points.len() / 2).next_multiple_of(LANES);
    let half = if half < points.len() { half } else { LANES };
    points.select_nth_unstable_by(half, |a, b| a[axis].total_cmp(&b[axis]));
    let (low, high) = points.split_at_mut(half);
    gather(low);
    gather(high);
}

/// Middle and half extents of the box around points.
fn bounds(points: &[Vector3<f64>]) -> (Vector3<f64>, Vector3<f64>) {
    let low = points.iter().fold(Vector3::repeat(f64::INFINITY), |low, point| low.inf(point));
    let high = points.iter().fold(Vector3::repeat(f64::NEG_INFINITY), |high, point| high.sup(point));
    ((low + high) * 0.5, (high - low) * 0.5)
}

/// The farthest point along a direction: its block and its place there.
struct Farthest<'a> {
    hull: &'a Hull,
    direction: [f64; 3],
}

impl Wide for Farthest<'_> {
    type Output = (usize, usize);

    #[inline(always)]
    fn run(self) -> Self::Output {
        let [x, y, z] = self.direction;
        let [ax, ay, az] = [x.abs(), y.abs(), z.abs()];
        // How far each block may reach.
        let mut reach = [f64::NEG_INFINITY; BLOCKS_MAX];
        for (reach, [xs, ys, zs, us, vs, ws]) in reach.chunks_exact_mut(LANES).zip(&self.hull.boxes) {
            for lane in 0..LANES {
                let middle = xs[lane] * x + ys[lane] * y + zs[lane] * z;
                reach[lane] = middle + (us[lane] * ax + vs[lane] * ay + ws[lane] * az);
            }
        }
        let reach = &reach[..self.hull.blocks.len().min(BLOCKS_MAX)];
        let mut first = 0;
        for (place, other) in reach.iter().enumerate() {
            first = if *other > reach[first] { place } else { first };
        }
        let mut best = (f64::NEG_INFINITY, first, 0);
        let mut look = |place: usize| {
            let [xs, ys, zs] = &self.hull.blocks[place];
            let mut along = [0.0; LANES];
            for lane in 0..LANES {
                along[lane] = xs[lane] * x + ys[lane] * y + zs[lane] * z;
            }
            for (lane, along) in along.into_iter().enumerate() {
                if along > best.0 {
                    best = (along, place, lane);
                }
            }
            best.0
        };
        let mut farthest = look(first);
        for (place, reach) in reach.iter().enumerate() {
            if *reach > farthest && place != first {
                farthest = look(place);
            }
        }
        (best.1, best.2)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::disallowed_macros, reason = "a test may allocate")]
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// No point lies farther than the one that is found, however many there are.
        #[test]
        fn the_farthest_point_is_found(
            points in prop::collection::vec([-1.0..1.0_f64, -0.5..0.5, -0.1..0.1], 4..=HULL_POINTS_MAX),
            way in [-1.0..1.0_f64, -1.0..1.0, -1.0..1.0],
        ) {
            let hull = Hull::of(&points).expect("few enough points");
            let way = Vector3::from(way);
            let farthest = points.iter().map(|point| way.dot(&Vector3::from(*point))).fold(f64::NEG_INFINITY, f64::max);
            let found = way.dot(&(hull.support(&way) + hull.centre));
            prop_assert!((found - farthest).abs() < 1e-12, "{found} for {farthest}");
            prop_assert!(hull.points().count() < points.len() + LANES);
        }
    }
}
