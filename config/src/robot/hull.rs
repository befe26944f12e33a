//! The convex hull around points, of few corners.
//!
//! **Invariant:** it holds every one of the points: where corners were left out, the rest is
//! scaled up until nothing is outside.

use nalgebra::Vector3;
use parry3d_f64::glamx::DVec3;
use parry3d_f64::transformation::try_convex_hull;
use tandem_clearance::HULL_POINTS_MAX;

/// A hull whose middle is no farther inside than this is flat, metres.
const FLAT: f64 = 1e-6;
/// How much larger the hull may be than the smallest one, if that saves corners.
const GROWTH: f64 = 1e-3;
/// Growth that hides the rounding of the sums below.
const ROUNDING: f64 = 1e-9;
/// Directions that the first corners are taken from.
const DIRECTIONS: u32 = 64;

/// Corners of a hull that holds all points, or `None` when they are flat.
///
/// It begins with the outermost points in a few directions; what sticks out of it farthest becomes a corner,
/// until next to nothing does or there is no room.
pub(super) fn around(points: &[Vector3<f64>]) -> Option<Vec<Vector3<f64>>> {
    let points = Polyhedron::of(&distinct(points.to_vec()))?.corners;
    let mut chosen = outermost(&points, DIRECTIONS);
    loop {
        let Polyhedron { corners, faces } = Polyhedron::of(&chosen)?;
        let centre = corners.iter().sum::<Vector3<f64>>() / corners.len() as f64;
        // What sticks out of each face: by how much the hull would have to grow for it, and the point.
        let mut outside = Vec::new();
        for face in faces {
            let [a, b, c] = face.map(|corner| corners[corner as usize] - centre);
            // A sliver has no normal, and no room to hide anything behind it.
            let Some(normal) = (b - a).cross(&(c - a)).try_normalize(1e-15) else { continue };
            let normal = if normal.dot(&a) < 0.0 { -normal } else { normal };
            let reach = normal.dot(&a);
            if reach < FLAT {
                return None;
            }
            let along = |point: &Vector3<f64>| normal.dot(&(point - centre)) / reach;
            outside.extend(points.iter().max_by(|p, q| along(p).total_cmp(&along(q))).map(|p| (along(p), *p)));
        }
        outside.sort_by(|a, b| b.0.total_cmp(&a.0));
        let growth = outside.first().map_or(1.0, |worst| worst.0.max(1.0));
        let room = HULL_POINTS_MAX.saturating_sub(chosen.len());
        if growth <= 1.0 + GROWTH || room == 0 {
            let outwards = |corner: Vector3<f64>| centre + (corner - centre) * (growth * (1.0 + ROUNDING));
            return Some(corners.into_iter().map(outwards).collect());
        }
        let wanted = outside.into_iter().filter(|(growth, _)| *growth > 1.0 + GROWTH).map(|(_, point)| point);
        let before = chosen.len();
        // A few at a time: each makes others needless.
        chosen.extend(wanted.take(room.min(16)));
        chosen = distinct(chosen);
        if chosen.len() == before {
            return None;
        }
    }
}

/// A convex hull.
struct Polyhedron {
    corners: Vec<Vector3<f64>>,
    /// Triangles, as indices of corners.
    faces: Vec<[u32; 3]>,
}

impl Polyhedron {
    /// `None` when the points make no solid.
    fn of(points: &[Vector3<f64>]) -> Option<Self> {
        let given: Vec<DVec3> = points.iter().map(|point| DVec3::new(point.x, point.y, point.z)).collect();
        let (corners, faces) = try_convex_hull(&given).ok()?;
        Some(Self { corners: corners.iter().map(|corner| Vector3::new(corner.x, corner.y, corner.z)).collect(), faces })
    }
}

/// The farthest points in so many directions spread evenly over the sphere (a Fibonacci lattice).
pub(super) fn outermost(points: &[Vector3<f64>], directions: u32) -> Vec<Vector3<f64>> {
    const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
    let farthest = |index: u32| {
        let z = 1.0 - (2.0 * f64::from(index) + 1.0) / f64::from(directions);
        let (sin, cos) = (GOLDEN_ANGLE * f64::from(index)).sin_cos();
        let direction = Vector3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z);
        points.iter().copied().max_by(|a, b| direction.dot(a).total_cmp(&direction.dot(b)))
    };
    distinct((0..directions).filter_map(farthest).collect())
}

/// The points without those that are there twice.
fn distinct(mut points: Vec<Vector3<f64>>) -> Vec<Vector3<f64>> {
    points.sort_by(|a, b| {
        let axes = a.as_slice().iter().zip(b.as_slice());
        axes.fold(std::cmp::Ordering::Equal, |order, (a, b)| order.then(a.total_cmp(b)))
    });
    points.dedup();
    points
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]

        /// In any direction the hull reaches at least as far as the points, and hardly farther, few or many.
        #[test]
        fn a_hull_holds_its_points(
            points in prop::collection::vec([-1.0..1.0_f64, -0.2..0.2, -0.05..0.05], 8..40),
            round in 0..2_usize,
            ways in prop::collection::vec([-1.0..1.0_f64, -1.0..1.0, -1.0..1.0], 20),
        ) {
            let mut points: Vec<Vector3<f64>> = points.into_iter().map(Vector3::from).collect();
            // A ball of more corners than a hull may have.
            let ball: Vec<_> = (0..round * 1_000).map(|k| {
                let turn = f64::from(k as u32) * 2.4;
                let z = 1.0 - 2.0 * (f64::from(k as u32) + 0.5) / 1_000.0;
                Vector3::new((1.0 - z * z).sqrt() * turn.cos(), (1.0 - z * z).sqrt() * turn.sin(), z) * 0.3
            }).collect();
            points.extend(ball);
            let corners = around(&points).expect("points all over a box are a solid");
            prop_assert!(corners.len() <= HULL_POINTS_MAX);
            for way in ways.into_iter().map(Vector3::from).filter(|way| way.norm() > 0.1).map(|way| way.normalize()) {
                let reach = |of: &[Vector3<f64>]| of.iter().map(|p| way.dot(p)).fold(f64::NEG_INFINITY, f64::max);
                let (hull, given) = (reach(&corners), reach(&points));
                prop_assert!(hull >= given && hull < given + 0.02, "{hull} for {given} along {way:?}");
            }
        }
    }

    /// What has no inside is no hull.
    #[test]
    fn a_plate_without_thickness_has_no_hull() {
        let plate: Vec<_> = (0..20).map(|k| Vector3::new(f64::from(k % 5), f64::from(k / 5), 0.0)).collect();
        assert_eq!(around(&plate), None);
        assert_eq!(around(&[Vector3::zeros(); 9]), None);
    }
}
