//! The capsule around points.
//!
//! **Invariant:** it holds every one of them, so all of a mesh whose vertices they are.

use super::hull::outermost;
use nalgebra::{Matrix3, Vector3};

/// Ends and radius of a capsule.
pub(super) type Capsule = ([Vector3<f64>; 2], f64);

/// A small capsule around points: the least over the principal and the coordinate axes, then over
/// axes turned a little from the best, ever less. The axis is looked for with the mesh's outermost
/// points, its ends and radius are those that all points need.
pub(super) fn around(all: &[Vector3<f64>]) -> Capsule {
    /// Directions in which points are looked for.
    const DIRECTIONS: u32 = 256;
    let points = &outermost(all, DIRECTIONS)[..];
    let centre = points.iter().sum::<Vector3<f64>>() / points.len().max(1) as f64;
    let spread: Matrix3<f64> = points.iter().map(|p| (p - centre) * (p - centre).transpose()).sum();
    let principal = spread.symmetric_eigen().eigenvectors;
    let coordinate = Matrix3::identity();
    let mut axis = Vector3::z();
    let mut best = along(points, points, &axis);
    let mut take = |candidate: Vector3<f64>, axis: &mut Vector3<f64>| {
        let fitted = along(points, points, &candidate);
        let better = volume(&fitted) < volume(&best);
        if better {
            (best, *axis) = (fitted, candidate);
        }
        better
    };
    for candidate in principal.column_iter().chain(coordinate.column_iter()) {
        take(candidate.into_owned(), &mut axis);
    }
    let mut tilt = 0.2;
    while tilt > 1e-3 {
        let u = axis.cross(&if axis.x.abs() < 0.7 { Vector3::x() } else { Vector3::y() }).normalize();
        let v = axis.cross(&u);
        let turned = [u, -u, v, -v].map(|to| (axis + to * tilt).normalize());
        if !turned.into_iter().any(|candidate| take(candidate, &mut axis)) {
            tilt /= 2.0;
        }
    }
    along(points, all, &axis)
}

fn volume((ends, radius): &Capsule) -> f64 {
    std::f64::consts::PI * radius * radius * ((ends[1] - ends[0]).norm() + 4.0 / 3.0 * radius)
}

/// The capsule around `all` along an axis, centred on some of the points: as thin as their shadow, then
/// as short as that lets it be.
fn along(points: &[Vector3<f64>], all: &[Vector3<f64>], axis: &Vector3<f64>) -> Capsule {
    /// Room for the rounding of the sums below, added when the ends are found.
    const ROUNDING: f64 = 1e-9;
    let shadow = |p: &Vector3<f64>| p - axis * axis.dot(p);
    let farthest = |of: &[Vector3<f64>], from: &Vector3<f64>| {
        let distance = |p: &&Vector3<f64>| (shadow(p) - from).norm_squared();
        of.iter().max_by(|a, b| distance(a).total_cmp(&distance(b))).map_or(*from, shadow)
    };
    // The smallest circle around the shadow, nearly: a centre that runs to the farthest point in
    // ever smaller steps (Bădoiu and Clarkson). The radius is what that centre needs.
    let mut centre = farthest(points, &Vector3::zeros());
    for step in 1..200 {
        centre += (farthest(points, &centre) - centre) / f64::from(step + 1);
    }
    let radius = (farthest(all, &centre) - centre).norm();
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for p in all {
        let room = (radius * radius - (shadow(p) - centre).norm_squared()).max(0.0).sqrt();
        low = low.min(axis.dot(p) + room);
        high = high.max(axis.dot(p) - room);
    }
    if low > high {
        low = 0.5 * (low + high);
        high = low;
    }
    ([centre + axis * low, centre + axis * high], radius + ROUNDING)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn holds((ends, radius): &Capsule, point: &Vector3<f64>) -> bool {
        let along = ends[1] - ends[0];
        let share = (along.dot(&(point - ends[0])) / along.norm_squared().max(1e-300)).clamp(0.0, 1.0);
        (point - ends[0] - along * share).norm() <= *radius
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// Every vertex is held, whatever the points.
        #[test]
        fn a_capsule_holds_its_mesh(points in prop::collection::vec([-1.0..1.0_f64, -0.2..0.2, -0.05..0.05], 3..60)) {
            let points: Vec<Vector3<f64>> = points.into_iter().map(Vector3::from).collect();
            let capsule = around(&points);
            prop_assert!(points.iter().all(|point| holds(&capsule, point)), "{capsule:?}");
        }

        /// Points of a capsule are wrapped by hardly more than that capsule.
        #[test]
        fn a_capsule_is_found_again(
            axis in [-1.0..1.0_f64, -1.0..1.0, -1.0..1.0], length in 0.1..0.6_f64, radius in 0.03..0.1_f64,
        ) {
            let axis = Vector3::from(axis);
            prop_assume!(axis.norm() > 0.2);
            let axis = axis.normalize();
            let turn = nalgebra::UnitQuaternion::rotation_between(&Vector3::z(), &axis).unwrap_or_default();
            let mut points = Vec::new();
            for ring in 0..=16 {
                let polar = std::f64::consts::PI * f64::from(ring) / 16.0;
                for spoke in 0..24 {
                    let (sin, cos) = (std::f64::consts::TAU * f64::from(spoke) / 24.0).sin_cos();
                    let side = length / 2.0 * if ring <= 8 { 1.0 } else { -1.0 };
                    let ball = Vector3::new(polar.sin() * cos, polar.sin() * sin, polar.cos()) * radius;
                    points.push(turn * (ball + Vector3::z() * side));
                }
            }
            let true_volume = volume(&([Vector3::zeros(), Vector3::z() * length], radius));
            let found = around(&points);
            prop_assert!(volume(&found) < 1.1 * true_volume, "{found:?} for {length}, {radius}");
        }
    }
}
