//! Slots: the outline of the opening, seen along the surface's normal.

use bumpalo::Bump;
use bumpalo::collections::CollectIn;
use nalgebra::{Matrix2, SymmetricEigen, Vector2, Vector3};
use tandem_msg::{FeatureDimensions, Measured};

use super::plane::Plane;
use super::{Dense, Fit, Frame, List, Local, measured, quantile};

/// Points beside an edge that are counted, and those whose spacing says how dense they lie. Noise carries some
/// over the edge but changes no count.
const COUNTED: usize = 12;
const SPACED: usize = 48;
/// Points an edge is told from at least.
const EDGE_MIN: usize = 8;

/// Fits a slot: direction, centre, length, width, depth.
///
/// The camera looks aslant, so the wall on its side is hidden and the floor is cut off
/// there; the surface is seen up to both edges. Edges are therefore taken from where the
/// surface ends, and only the depth from the floor.
pub(crate) fn fit(plane: &Plane, dense: &Dense<'_>, room: &Bump) -> Option<Fit> {
    let middle = dense.feature.iter().sum::<Vector3<f64>>() / dense.feature.len() as f64;
    let frame = Frame::on(middle - plane.normal * plane.height(middle), plane.normal);
    let inside: List<'_, Local> = dense.feature.iter().map(|p| frame.local(*p)).collect_in(room);
    let band = (4.0 * plane.rms).max(40e-6);
    let all = dense.rest.iter().chain(&dense.feature);
    let on: List<'_, Local> = all.map(|p| frame.local(*p)).filter(|p| p.z.abs() < band).collect_in(room);

    let mut along = longest(&inside);
    let mut centre = Vector2::zeros();
    let (mut length, mut width) = (0.0, 0.0);
    let (mut length_seen, mut spacing) = (true, 0.0);
    for round in 0..3 {
        let across = Vector2::new(-along.y, along.x);
        let place = |p: &Local| Vector2::new(along.dot(&(p.xy() - centre)), across.dot(&(p.xy() - centre)));
        let feature: List<'_, Vector2<f64>> = inside.iter().map(place).collect_in(room);
        let mut xs: List<'_, f64> = feature.iter().map(|p| p.x).collect_in(room);
        let mut ys: List<'_, f64> = feature.iter().map(|p| p.y).collect_in(room);
        let (x0, x1) = (quantile(&mut xs, 0.01), quantile(&mut xs, 0.99));
        let (y0, y1) = (quantile(&mut ys, 0.01), quantile(&mut ys, 0.99));
        let plate: List<'_, Vector2<f64>> = on.iter().map(place).collect_in(room);
        spacing = ((x1 - x0) * (y1 - y0) / feature.len().max(1) as f64).sqrt();

        // Both long edges, over the straight part.
        let mid = Vector2::new(0.5 * (x0 + x1), 0.5 * (y0 + y1));
        let straight = (0.5 * (x1 - x0) - 0.7 * (y1 - y0)).max(0.2 * (x1 - x0));
        let beside: List<'_, Vector2<f64>> =
            plate.iter().copied().filter(|p| (p.x - mid.x).abs() < straight).collect_in(room);
        // Without the surface on both sides it is no slot that could be measured.
        let edge_y = gap(beside.iter().map(|p| p.y), mid.y, y1 - y0, room)?;
        if round < 2 {
            // Turn along the edges: slope of the gap's middle from one half to the other.
            let half = |sign: f64| {
                let part = beside.iter().filter(|p| sign * (p.x - mid.x) > 0.0).map(|p| p.y);
                gap(part, mid.y, y1 - y0, room).map(|e| 0.5 * (e[0] + e[1]))
            };
            if let (Some(left), Some(right)) = (half(-1.0), half(1.0)) {
                let turn = ((right - left) / straight).clamp(-0.1, 0.1);
                along = (along + across * turn).normalize();
            }
        }
        // Both ends, near the middle line.
        let y_mid = 0.5 * (edge_y[0] + edge_y[1]);
        let round = 0.5 * (edge_y[1] - edge_y[0]).max(2.0 * spacing);
        // Where a rounded end would lie on the middle line if it passed through the point; of a square end the
        // points on the line itself come first.
        let end = |p: &Vector2<f64>| {
            let off = (p.y - y_mid).abs();
            let back = round - (round * round - off * off).max(0.0).sqrt();
            (off < 0.6 * round).then_some(p.x + back * (p.x - mid.x).signum())
        };
        let ends = gap(plate.iter().filter_map(end), mid.x, x1 - x0, room);
        length_seen = ends.is_some();
        let edge_x = ends.unwrap_or([x0, x1]);
        length = edge_x[1] - edge_x[0];
        width = edge_y[1] - edge_y[0];
        centre += along * (0.5 * (edge_x[0] + edge_x[1])) + Vector2::new(-along.y, along.x) * y_mid;
    }
    let mut heights: List<'_, f64> = inside.iter().map(|p| -p.z).collect_in(room);
    let deep = quantile(&mut heights, 0.85);
    let mut floor: List<'_, f64> = heights.iter().copied().filter(|h| *h > 0.8 * deep).collect_in(room);
    let depth = quantile(&mut floor, 0.5);
    // The surface ends at the chamfer; the wall, where one is seen, tells the plain width.
    let across = Vector2::new(-along.y, along.x);
    let mut walls: List<'_, f64> = inside
        .iter()
        .filter(|p| p.z > -0.8 * depth && p.z < -0.35 * depth)
        .map(|p| p.xy() - centre)
        .filter(|p| along.dot(p).abs() < 0.5 * (length - width))
        .map(|p| across.dot(&p).abs())
        .collect_in(room);
    if walls.len() >= 6 {
        let chamfer = (0.5 * width - quantile(&mut walls, 0.5)).clamp(0.0, 0.12 * width);
        (length, width) = (length - 2.0 * chamfer, width - 2.0 * chamfer);
    }
    let dimensions = FeatureDimensions {
        // How long a slot is that leaves the view nobody can tell.
        length: if length_seen { measured(length, 0.5 * spacing) } else { Measured::default() },
        width: measured(width, 0.3 * spacing),
        depth: measured(depth, plane.rms + 0.02 * depth),
        ..FeatureDimensions::default()
    };
    let pose = frame.pose(Vector3::new(centre.x, centre.y, 0.0), Vector3::z(), Vector3::new(along.x, along.y, 0.0));
    Some(Fit { camera_from_feature: pose, dimensions, winding: None })
}

/// Direction of greatest spread, x positive.
pub(crate) fn longest(points: &[Local]) -> Vector2<f64> {
    let share = 1.0 / points.len().max(1) as f64;
    let mean = points.iter().map(|p| p.xy()).sum::<Vector2<f64>>() * share;
    let covariance = points.iter().fold(Matrix2::zeros(), |sum, p| {
        let d = p.xy() - mean;
        sum + d * d.transpose() * share
    });
    let eigen = SymmetricEigen::new(covariance);
    let along: Vector2<f64> = eigen.eigenvectors.column(eigen.eigenvalues.imax()).into();
    if along.x < 0.0 { -along } else { along }
}

/// The empty interval around `middle`: where an even density of points, counted back from well outside,
/// would have come to its end on either side. `None` when one side shows nothing within three times `extent`.
fn gap(values: impl Iterator<Item = f64>, middle: f64, extent: f64, room: &Bump) -> Option<[f64; 2]> {
    let (mut below, mut above) = (List::new_in(room), List::new_in(room));
    for v in values {
        if v < middle - 0.25 * extent {
            below.push(v);
        } else if v > middle + 0.25 * extent {
            above.push(v);
        }
    }
    if below.len() < EDGE_MIN || above.len() < EDGE_MIN {
        return None;
    }
    below.sort_unstable_by(|a, b| b.total_cmp(a));
    above.sort_unstable_by(f64::total_cmp);
    let edge = |v: &[f64]| {
        let far = SPACED.min(v.len() - 1);
        let near = COUNTED.min(far / 3);
        v[near] - (v[far] - v[near]) * (near as f64 + 0.5) / (far - near) as f64
    };
    let edges = [edge(&below), edge(&above)];
    let near = middle - edges[0] < 3.0 * extent && edges[1] - middle < 3.0 * extent;
    (near && edges[0] < edges[1]).then_some(edges)
}
