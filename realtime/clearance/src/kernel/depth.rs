//! How far two cores that overlap must be moved apart.
//!
//! Moving the first against the outward normal of a support plane of the difference of
//! both, by that plane's distance from the origin, parts them: every normal gives a
//! depth that is at least the true one. The expanding polytope (van den Bergen 2001) finds
//! good normals; the least depth of all that were tried is answered, so the
//! room for its faces, and its rounding, cost nothing but tightness.

use nalgebra::Vector3;

use super::simplex::Corner;
use super::{Core, Near};

/// Corners the polytope is grown by.
const GROWTH: usize = 32;
const FACES_MAX: usize = 4 + 2 * GROWTH;
/// Edges of a horizon; more means that rounding has torn the polytope.
const HORIZON_MAX: usize = 3 * GROWTH;
/// Gap between the polytope and the support plane at which the search ends, metres.
const OPEN: f64 = 1e-7;

/// The least depth tried so far.
struct Shallowest {
    depth: f64,
    /// Outward unit normal of the difference.
    normal: Vector3<f64>,
    corner: Vector3<f64>,
}

impl Shallowest {
    /// Tries one outward unit normal; the corner of the difference that lies farthest along it.
    fn look(&mut self, first: &Core, second: &Core, normal: Vector3<f64>) -> Vector3<f64> {
        let (on_first, on_second) = (first.support(&normal), second.support(&-normal));
        let difference = on_first - on_second;
        let depth = difference.dot(&normal);
        if depth < self.depth {
            *self = Self { depth, normal, corner: on_first };
        }
        difference
    }

    /// Tries the axes of the base by the boxes around both, which tell nearly as much as the cores.
    fn part_boxes(&mut self, first: &Core, second: &Core) {
        let between = second.centre() - first.centre();
        let overlap = first.half_in_base() + second.half_in_base() - between.abs();
        let axis = overlap.imin();
        if overlap[axis] < self.depth {
            let mut normal = Vector3::zeros();
            normal[axis] = 1.0_f64.copysign(between[axis]);
            *self = Self { depth: overlap[axis], normal, corner: first.support(&normal) };
        }
    }
}

/// Nearest points of two cores that overlap, with minus a depth that is at least the true one, or `None` when
/// that is above `limit`. `corners` are those of the difference that hold the origin, as far as they are known.
pub(super) fn of_overlap(first: &Core, second: &Core, corners: &[Corner], limit: f64) -> Option<Near> {
    let mut best = Shallowest { depth: f64::INFINITY, normal: Vector3::x(), corner: Vector3::zeros() };
    if let Some(normal) = (first.centre() - second.centre()).try_normalize(1e-9) {
        best.look(first, second, -normal);
    }
    for core in [first, second] {
        for normal in core.normals().iter().filter(|normal| normal.norm_squared() > 0.5) {
            best.look(first, second, *normal);
            best.look(first, second, -normal);
        }
    }
    best.part_boxes(first, second);
    if -best.depth > limit {
        return None;
    }
    if let Some(mut polytope) = Polytope::around(first, second, corners) {
        polytope.grow(first, second, limit, &mut best);
    }
    if -best.depth > limit {
        return None;
    }
    let depth = best.depth.max(0.0);
    // The first leaves against the outward normal; the corner reaches deepest that way.
    Some(Near { distance: -depth, on_first: best.corner, on_second: best.corner - best.normal * depth })
}

#[derive(Clone, Copy)]
struct Face {
    corners: [usize; 3],
    normal: Vector3<f64>,
    distance: f64,
}

struct Polytope {
    corners: [Vector3<f64>; 4 + GROWTH],
    corner_count: usize,
    faces: [Face; FACES_MAX],
    face_count: usize,
}

impl Polytope {
    /// A tetrahedron of corners of the difference, or `None` where it is too flat for one.
    fn around(first: &Core, second: &Core, known: &[Corner]) -> Option<Self> {
        let mut corners = [Vector3::zeros(); 4];
        let mut count = 0;
        let look = |direction: Vector3<f64>| {
            let normal = direction.try_normalize(1e-12)?;
            Some(first.support(&normal) - second.support(&-normal))
        };
        for corner in known.iter().take(4) {
            corners[count] = corner.difference;
            count += 1;
        }
        if count == 0 {
            corners[0] = look(Vector3::x())?;
            count = 1;
        }
        if count == 1 {
            corners[1] = look(-corners[0]).or_else(|| look(Vector3::y()))?;
            count = 2;
        }
        if count == 2 {
            let along = corners[1] - corners[0];
            let square = if along.x.abs() < along.y.abs() { Vector3::x() } else { Vector3::y() }.cross(&along);
            corners[2] = look(square)?;
            if (corners[2] - corners[0]).cross(&along).norm() < 1e-9 {
                corners[2] = look(-square)?;
            }
            count = 3;
        }
        let normal = (corners[1] - corners[0]).cross(&(corners[2] - corners[0]));
        if count == 3 {
            corners[3] = look(normal)?;
            if normal.dot(&(corners[3] - corners[0])).abs() < 1e-12 {
                corners[3] = look(-normal)?;
            }
        }
        let volume = normal.dot(&(corners[3] - corners[0]));
        if volume.is_nan() || volume.abs() < 1e-15 {
            return None;
        }
        if volume > 0.0 {
            corners.swap(1, 2);
        }
        let mut all = [Vector3::zeros(); 4 + GROWTH];
        all[..4].copy_from_slice(&corners);
        let unused = Face { corners: [0; 3], normal: Vector3::zeros(), distance: f64::INFINITY };
        let mut polytope = Self { corners: all, corner_count: 4, faces: [unused; FACES_MAX], face_count: 0 };
        // With the fourth corner behind the first three, these wind outwards.
        for face in [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]] {
            polytope.push(face);
        }
        Some(polytope)
    }

    fn push(&mut self, corners: [usize; 3]) {
        let [a, b, c] = corners.map(|corner| self.corners[corner]);
        let normal = (b - a).cross(&(c - a));
        let length = normal.norm();
        let face = if length > 1e-14 {
            let normal = normal / length;
            Face { corners, normal, distance: normal.dot(&a) }
        } else {
            // A sliver: part of the surface, but no normal worth a try.
            Face { corners, normal: Vector3::zeros(), distance: f64::INFINITY }
        };
        self.faces[self.face_count] = face;
        self.face_count += 1;
    }

    /// Tries the normals of the polytope's nearest faces, until nothing is gained or the depth is of no interest.
    fn grow(&mut self, first: &Core, second: &Core, limit: f64, best: &mut Shallowest) {
        for _ in 0..GROWTH {
            let faces = &self.faces[..self.face_count];
            let Some(nearest) = faces.iter().min_by(|a, b| a.distance.total_cmp(&b.distance)).copied() else { return };
            if !nearest.distance.is_finite() {
                return;
            }
            let corner = best.look(first, second, nearest.normal);
            if best.depth - nearest.distance <= OPEN || -best.depth > limit || !self.expand(corner) {
                return;
            }
        }
    }

    /// Replaces the faces that a new corner sees by those around it; `false` when nothing is gained.
    fn expand(&mut self, corner: Vector3<f64>) -> bool {
        let mut horizon = [[0_usize; 2]; HORIZON_MAX];
        let mut edges = 0;
        let mut kept = 0;
        for index in 0..self.face_count {
            let face = self.faces[index];
            let seen = face.normal.dot(&(corner - self.corners[face.corners[0]])) > 1e-12;
            if !seen {
                self.faces[kept] = face;
                kept += 1;
                continue;
            }
            let [a, b, c] = face.corners;
            for edge in [[a, b], [b, c], [c, a]] {
                // An edge between two faces that are seen is inside the hole.
                if let Some(twin) = horizon[..edges].iter().position(|other| *other == [edge[1], edge[0]]) {
                    edges -= 1;
                    horizon[twin] = horizon[edges];
                } else if edges < HORIZON_MAX {
                    horizon[edges] = edge;
                    edges += 1;
                } else {
                    return false;
                }
            }
        }
        if edges < 3 || kept + edges > FACES_MAX || self.corner_count >= self.corners.len() {
            return false;
        }
        self.face_count = kept;
        let newest = self.corner_count;
        self.corners[newest] = corner;
        self.corner_count += 1;
        for [a, b] in horizon.iter().take(edges).copied() {
            self.push([a, b, newest]);
        }
        true
    }
}
