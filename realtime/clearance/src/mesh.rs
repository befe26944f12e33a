//! Triangle meshes of the scene, in a tree of boxes.
#![allow(clippy::disallowed_types, reason = "meshes are made while starting")]

use std::collections::BTreeMap;

use nalgebra::Vector3;

use crate::kernel::{Core, Near, Wanted, core_to_core, nearest_of_triangle};
use crate::shapes::{MESH_TRIANGLES_MAX, ShapeError, middle_of};

/// Triangles of a leaf.
const LEAF: usize = 4;
/// Halving 65 536 triangles down to leaves takes 14 levels, each of which leaves one node waiting.
const STACK: usize = 32;

/// A box around some triangles: `count` of them from `first`, or two nodes at `first` when `count` is 0.
#[derive(Clone, Copy, Debug)]
struct Node {
    centre: Vector3<f64>,
    half: Vector3<f64>,
    first: u32,
    count: u32,
}

impl Node {
    fn squared_gap(&self, centre: &Vector3<f64>, half: &Vector3<f64>) -> f64 {
        ((centre - self.centre).abs() - half - self.half).sup(&Vector3::zeros()).norm_squared()
    }
}

/// A mesh about the middle of the box around it.
#[derive(Clone, Debug)]
pub(crate) struct Mesh {
    triangles: Vec<[Vector3<f64>; 3]>,
    /// Of a solid, for each triangle: the outward normal of its corners (bits 0 to 2), edges (two bits) and face (all three),
    /// weighted by angle as by Bærentzen and Aanæs (2005), so that their side is the point's.
    normals: Option<Vec<[Vector3<f64>; 8]>>,
    nodes: Vec<Node>,
    /// Middle of the box in the frame the points were given in.
    pub(crate) centre: Vector3<f64>,
    pub(crate) half: Vector3<f64>,
}

impl Mesh {
    pub(crate) fn of(points: &[[f64; 3]], triangles: &[[u32; 3]]) -> Result<Self, ShapeError> {
        if triangles.is_empty() || triangles.len() > MESH_TRIANGLES_MAX {
            return Err(ShapeError::MeshTriangles { count: triangles.len() });
        }
        let (centre, half) = middle_of(points)?;
        if let Some(index) = triangles.iter().position(|t| t.iter().any(|point| *point as usize >= points.len())) {
            return Err(ShapeError::Triangle { index });
        }
        let place = |triangle: &[u32; 3]| triangle.map(|point| Vector3::from(points[point as usize]) - centre);
        // One with two corners in one place is an edge, which its neighbours have too.
        let has_area = |[a, b, c]: &[Vector3<f64>; 3]| a != b && b != c && c != a;
        let placed: Vec<[Vector3<f64>; 3]> = triangles.iter().map(place).filter(has_area).collect();
        if placed.is_empty() {
            return Err(ShapeError::MeshTriangles { count: 0 });
        }
        let mut order: Vec<u32> = (0..placed.len() as u32).collect();
        let mut nodes = Vec::new();
        nodes.push(around(&placed, &order));
        split(&placed, &mut nodes, 0, &mut order, 0);
        let normals = outward_normals(&placed);
        Ok(Self {
            triangles: order.iter().map(|index| placed[*index as usize]).collect(),
            normals: normals.map(|all| order.iter().map(|index| all[*index as usize]).collect()),
            nodes,
            centre,
            half,
        })
    }

    /// Nearest points of a core in this mesh's frame and the mesh, or `None` when farther apart than
    /// wanted. A core that crosses the surface, or is in the solid, is as deep in as the box around the mesh is.
    pub(crate) fn near(&self, core: &Core, wanted: Wanted) -> Option<Near> {
        let near = self.near_surface(core, wanted);
        if near.is_some_and(|near| near.distance <= 0.0) || self.holds(&core.centre()) {
            return Some(self.depth(core));
        }
        near
    }

    fn near_surface(&self, core: &Core, wanted: Wanted) -> Option<Near> {
        let (centre, half) = (core.centre(), core.half_in_base());
        let mut best: Option<Near> = None;
        let mut limit = wanted.limit.max(0.0);
        let mut stack = [0_u32; STACK];
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            let node = self.nodes[stack[waiting] as usize];
            if node.squared_gap(&centre, &half) > limit * limit {
                continue;
            }
            if node.count == 0 {
                let gap = |child: u32| self.nodes[child as usize].squared_gap(&centre, &half);
                let (left, right) = (node.first, node.first + 1);
                let left_first = gap(left) < gap(right);
                stack[waiting] = if left_first { right } else { left };
                stack[waiting + 1] = if left_first { left } else { right };
                waiting += 2;
                continue;
            }
            for triangle in &self.triangles[node.first as usize..(node.first + node.count) as usize] {
                // Only whether it is crossed counts, not how deep a triangle lies in it.
                let wanted = Wanted { limit, enough: wanted.enough.max(0.0) };
                let near = core_to_core(core, &Core::Triangle(*triangle), None, wanted);
                if let Some(near) = near.filter(|near| best.is_none_or(|best| near.distance < best.distance)) {
                    limit = limit.min(near.distance.max(0.0));
                    best = Some(near);
                    if near.distance <= wanted.enough {
                        return best;
                    }
                }
            }
        }
        best
    }

    /// Whether a point lies in the solid: it does when it is behind what is nearest of the surface.
    fn holds(&self, point: &Vector3<f64>) -> bool {
        let Some(normals) = &self.normals else { return false };
        if (0..3).any(|axis| point[axis].abs() > self.half[axis]) {
            return false;
        }
        let mut best = (f64::INFINITY, false);
        let mut stack = [0_u32; STACK];
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            let node = self.nodes[stack[waiting] as usize];
            if node.squared_gap(point, &Vector3::zeros()) > best.0 {
                continue;
            }
            if node.count == 0 {
                let gap = |child: u32| self.nodes[child as usize].squared_gap(point, &Vector3::zeros());
                let (left, right) = (node.first, node.first + 1);
                let left_first = gap(left) < gap(right);
                stack[waiting] = if left_first { right } else { left };
                stack[waiting + 1] = if left_first { left } else { right };
                waiting += 2;
                continue;
            }
            let held = node.first as usize..(node.first + node.count) as usize;
            for (triangle, normals) in self.triangles[held.clone()].iter().zip(&normals[held]) {
                let (away, feature) = nearest_of_triangle(triangle.map(|corner| corner - point));
                if away.norm_squared() < best.0 {
                    best = (away.norm_squared(), away.dot(&normals[feature]) > 0.0);
                }
            }
        }
        best.1
    }

    /// The way out of the box around the mesh: at least as long as the shortest one.
    fn depth(&self, core: &Core) -> Near {
        let (centre, half) = (core.centre(), core.half_in_base());
        let overlap = half + self.half - centre.abs();
        let axis = overlap.imin();
        let mut way_out = Vector3::zeros();
        way_out[axis] = if centre[axis] < 0.0 { -1.0 } else { 1.0 };
        let depth = overlap[axis].max(0.0);
        let on_first = core.support(&-way_out);
        Near { distance: -depth, on_first, on_second: on_first + way_out * depth }
    }
}

/// The box around some triangles, as a leaf.
fn around(triangles: &[[Vector3<f64>; 3]], order: &[u32]) -> Node {
    let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
    for corner in order.iter().flat_map(|index| &triangles[*index as usize]) {
        low = low.inf(corner);
        high = high.sup(corner);
    }
    // Rounding of the middle must leave no corner outside.
    let slack = Vector3::repeat(1e-12);
    Node { centre: (low + high) * 0.5, half: (high - low) * 0.5 + slack, first: 0, count: order.len() as u32 }
}

/// Splits `nodes[node]`, which holds `order` from `first` on, at the median of its longest side.
fn split(triangles: &[[Vector3<f64>; 3]], nodes: &mut Vec<Node>, node: usize, order: &mut [u32], first: u32) {
    if order.len() <= LEAF {
        nodes[node].first = first;
        return;
    }
    let axis = nodes[node].half.imax();
    let middle = |index: &u32| triangles[*index as usize].iter().map(|corner| corner[axis]).sum::<f64>();
    let half = order.len() / 2;
    order.select_nth_unstable_by(half, |a, b| middle(a).total_cmp(&middle(b)));
    let (left, right) = order.split_at_mut(half);
    let children = nodes.len();
    nodes[node].first = children as u32;
    nodes[node].count = 0;
    nodes.push(around(triangles, left));
    nodes.push(around(triangles, right));
    split(triangles, nodes, children, left, first);
    split(triangles, nodes, children + 1, right, first + half as u32);
}

/// Normals of all corners, edges and faces, when every edge has two sides that are wound alike and the
/// whole is not inside out.
fn outward_normals(triangles: &[[Vector3<f64>; 3]]) -> Option<Vec<[Vector3<f64>; 8]>> {
    let key = |point: &Vector3<f64>| [point.x, point.y, point.z].map(|x| (x + 0.0).to_bits());
    let face =
        |[a, b, c]: &[Vector3<f64>; 3]| (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or_else(Vector3::zeros);
    let mut edges: BTreeMap<[[u64; 3]; 2], Vector3<f64>> = BTreeMap::new();
    let mut corners: BTreeMap<[u64; 3], Vector3<f64>> = BTreeMap::new();
    let mut volume = 0.0;
    for triangle in triangles {
        let normal = face(triangle);
        volume += triangle[0].dot(&triangle[1].cross(&triangle[2]));
        for k in 0..3 {
            let [from, to, other] = [triangle[k], triangle[(k + 1) % 3], triangle[(k + 2) % 3]];
            if edges.insert([key(&from), key(&to)], normal).is_some() {
                return None;
            }
            *corners.entry(key(&from)).or_insert_with(Vector3::zeros) += normal * (to - from).angle(&(other - from));
        }
    }
    if volume <= 0.0 || !edges.keys().all(|[from, to]| edges.contains_key(&[*to, *from])) {
        return None;
    }
    let of = |triangle: &[Vector3<f64>; 3]| {
        let keys = [key(&triangle[0]), key(&triangle[1]), key(&triangle[2])];
        let edge = |a: usize, b: usize| edges[&[keys[a], keys[b]]] + edges[&[keys[b], keys[a]]];
        let [a, b, c] = [0, 1, 2].map(|k| corners[&keys[k]]);
        [Vector3::zeros(), a, b, edge(0, 1), c, edge(2, 0), edge(1, 2), face(triangle)]
    };
    Some(triangles.iter().map(of).collect())
}
