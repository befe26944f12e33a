//! Collision shapes, covered by capsules or hulls.

use super::capsule::{self, Capsule};
use super::origin;
use super::source::Source;
use super::tree::{Member, Tree};
use super::{hull, mesh};
use crate::fault::Fault;
use nalgebra::{Point3, Vector3};
use std::path::{Path, PathBuf};
use tandem_clearance::LinkCapsule;
use urdf_rs::Geometry;

/// A capsule around a cylinder is this much wider than it: its round ends then reach 0.64 of the
/// radius past the cylinder's, where a capsule of the same width would reach 1.
const WIDER: f64 = 1.1;
/// Capsules side by side around one box.
const ROWS_MAX: usize = 4;

/// What stands for the collision geometry of the file.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Collision {
    /// Capsules around every shape: quick to check, wider than what they hold.
    #[default]
    Capsules,
    /// The convex hull of every shape, each in a capsule that holds it: closer to the arm, dearer to check.
    Hulls,
}

/// A capsule of the chain's body, and the hull in it that stands for it.
pub(super) struct Cover {
    pub(super) capsule: LinkCapsule,
    /// Points in the frame of the capsule's link, metres.
    pub(super) hull: Option<Vec<[f64; 3]>>,
}

/// Where meshes are looked for, which were read, and what is made of them.
pub(super) struct Covering<'p> {
    /// The URDF: other paths are relative to its folder.
    pub(super) urdf: &'p Path,
    /// Folders of packages.
    pub(super) packages: &'p [PathBuf],
    /// What is wanted.
    pub(super) collision: Collision,
    /// Files that were read.
    pub(super) read: Vec<PathBuf>,
    /// What was done otherwise than asked, a sentence each.
    pub(super) notes: Vec<String>,
}

impl Covering<'_> {
    /// The vertices of a mesh, in the shape's frame, metres.
    fn mesh(&mut self, name: &str, scale: [f64; 3]) -> Result<Vec<Vector3<f64>>, (String, String)> {
        if !scale.iter().all(|factor| factor.is_finite() && *factor != 0.0) {
            return Err((format!("\"{name}\" of scale {scale:?}"), "write finite factors that are not 0".into()));
        }
        let file = mesh::resolve(name, self.urdf, self.packages)?;
        let vertices = mesh::vertices(&file)?;
        self.read.push(file);
        let scale = Vector3::from(scale);
        Ok(vertices.iter().map(|vertex| vertex.component_mul(&scale)).collect())
    }

    /// Covers for points whose convex hull is wanted.
    fn around(&mut self, points: &[Vector3<f64>], link: &str) -> Shapely {
        if self.collision == Collision::Hulls {
            if let Some(hull) = hull::around(points) {
                return vec![(capsule::around(&hull), Some(hull))];
            }
            self.notes.push(format!("link \"{link}\": its mesh is flat, so a capsule stands for it"));
        }
        vec![(capsule::around(points), None)]
    }

    /// Covers for a primitive; `None` when a size of it cannot be.
    fn primitive(&self, geometry: &Geometry) -> Option<Shapely> {
        let capsules = capsules_of(geometry)?;
        let corners = (self.collision == Collision::Hulls).then(|| corners_of(geometry)).flatten();
        Some(match corners {
            Some(corners) => vec![(capsule::around(&corners), Some(corners))],
            None => capsules.into_iter().map(|capsule| (capsule, None)).collect(),
        })
    }
}

/// Capsules, and the points of the hulls in them, in the shape's frame.
type Shapely = Vec<(Capsule, Option<Vec<Vector3<f64>>>)>;

/// Covers of every collision shape of the chain's links, in the order of the links.
pub(super) fn covers(
    source: &Source,
    urdf: &urdf_rs::Robot,
    tree: &Tree,
    covering: &mut Covering,
    faults: &mut Vec<Fault>,
) -> Vec<Cover> {
    let mut covers = Vec::new();
    for link in 0..=tree.chain.len() {
        let before = (covers.len(), faults.len());
        for member in tree.members.iter().filter(|member| member.link == link) {
            cover_member(source, &urdf.links[member.index], member, covering, &mut covers, faults);
        }
        if link > 0 && before == (covers.len(), faults.len()) {
            let name = &urdf.joints[tree.chain[link - 1].index].child.link;
            let advice = "give the link a <collision>: a joint moves it";
            faults.push(source.fault_in("link", name, "", "collision", "missing", "at least one shape", advice));
        }
    }
    covers
}

fn cover_member(
    source: &Source,
    link: &urdf_rs::Link,
    member: &Member,
    covering: &mut Covering,
    covers: &mut Vec<Cover>,
    faults: &mut Vec<Fault>,
) {
    for (number, collision) in link.collision.iter().enumerate() {
        let mut refuse = |path: &str, what: &str, found: &str, allowed: &str, advice: &str| {
            faults.push(source.fault_in_nth("link", &link.name, path, number, what, found, allowed, advice));
        };
        let Some(pose) = origin(&collision.origin) else {
            refuse("collision/origin", "collision origin", "not finite", "finite numbers", "write the shape's pose");
            continue;
        };
        let shapes = match &collision.geometry {
            Geometry::Mesh { filename, scale } => {
                match covering.mesh(filename, scale.as_ref().map_or([1.0; 3], |scale| scale.0)) {
                    Ok(points) => covering.around(&points, &link.name),
                    Err((found, advice)) => {
                        refuse("collision/geometry/mesh", "collision mesh", &found, "", &advice);
                        continue;
                    }
                }
            }
            geometry => match covering.primitive(geometry) {
                Some(shapes) => shapes,
                None => {
                    let found = "a size that is not finite and above 0 m";
                    refuse("collision/geometry", "collision geometry", found, "", "write the shape's size");
                    continue;
                }
            },
        };
        let pose = member.link_from_member * pose;
        let place = |point: Vector3<f64>| (pose * Point3::from(point)).coords.into();
        covers.extend(shapes.into_iter().map(|((ends, radius), hull)| Cover {
            capsule: LinkCapsule { link: member.link, ends: ends.map(place), radius, tool: member.tool },
            hull: hull.map(|points| points.into_iter().map(place).collect()),
        }));
    }
}

/// Corners of a solid that holds a primitive, in its own frame: a box its own, a cylinder those of a prism
/// around it. What is round all over has none.
fn corners_of(geometry: &Geometry) -> Option<Vec<Vector3<f64>>> {
    /// Sides of the prism: it reaches 0.5 % of the radius past the cylinder.
    const SIDES: u32 = 32;
    let ends = [-0.5, 0.5];
    match *geometry {
        Geometry::Box { size: urdf_rs::Vec3([x, y, z]) } => {
            let edges = ends.into_iter().flat_map(|a| ends.map(|b| [a * x, b * y]));
            Some(edges.flat_map(|[x, y]| ends.map(|c| Vector3::new(x, y, c * z))).collect())
        }
        Geometry::Cylinder { radius, length } => {
            let angle = std::f64::consts::TAU / f64::from(SIDES);
            let reach = radius / (angle / 2.0).cos();
            let around = (0..SIDES).map(|side| (angle * f64::from(side)).sin_cos());
            let end = |(sin, cos): (f64, f64)| ends.map(|c| Vector3::new(reach * cos, reach * sin, c * length));
            Some(around.flat_map(end).collect())
        }
        _ => None,
    }
}

/// Capsules that hold a primitive, in its own frame; `None` when a size of it cannot be.
fn capsules_of(geometry: &Geometry) -> Option<Vec<Capsule>> {
    let sound = |sizes: &[f64]| sizes.iter().all(|size| size.is_finite() && *size > 0.0);
    match *geometry {
        Geometry::Sphere { radius } => sound(&[radius]).then(|| vec![([Vector3::zeros(); 2], radius)]),
        Geometry::Capsule { radius, length } => sound(&[radius, length])
            .then(|| vec![([Vector3::z() * (-length / 2.0), Vector3::z() * (length / 2.0)], radius)]),
        Geometry::Cylinder { radius, length } => sound(&[radius, length]).then(|| {
            let (reach, radius) = around_cylinder(radius, length / 2.0);
            vec![([Vector3::z() * -reach, Vector3::z() * reach], radius)]
        }),
        Geometry::Box { size } => sound(&size.0).then(|| around_box(size.0.map(|extent| extent / 2.0))),
        Geometry::Mesh { .. } => None,
    }
}

/// Half length and radius of a capsule whose round ends just hold the rims of a cylinder.
fn around_cylinder(radius: f64, half_length: f64) -> (f64, f64) {
    let inset = radius * (WIDER * WIDER - 1.0_f64).sqrt();
    if half_length > inset { (half_length - inset, radius * WIDER) } else { (0.0, radius.hypot(half_length)) }
}

/// Capsules along the longest side, in a row along the second longest.
fn around_box(half: [f64; 3]) -> Vec<Capsule> {
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| half[*b].total_cmp(&half[*a]));
    let [long, middle, thin] = order;
    let rows = ((half[middle] / half[thin]).round() as usize).clamp(1, ROWS_MAX);
    let share = half[middle] / rows as f64;
    let (reach, radius) = around_cylinder(share.hypot(half[thin]), half[long]);
    (0..rows)
        .map(|row| {
            let mut centre = Vector3::zeros();
            centre[middle] = -half[middle] + (2 * row + 1) as f64 * share;
            let mut along = Vector3::zeros();
            along[long] = reach;
            ([centre - along, centre + along], radius)
        })
        .collect()
}

/// Whether a point of a link lies in one of its capsules.
#[cfg(test)]
fn holds(capsules: &[([Vector3<f64>; 2], f64)], point: &Vector3<f64>) -> bool {
    capsules.iter().any(|(ends, radius)| {
        let along = ends[1] - ends[0];
        let squared = along.norm_squared();
        let share = if squared > 0.0 { (along.dot(&(point - ends[0])) / squared).clamp(0.0, 1.0) } else { 0.0 };
        (point - ends[0] - along * share).norm() <= radius + 1e-12
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Every point of a box or cylinder lies in one of the capsules around it.
        #[test]
        fn covers_hold_their_shapes(
            size in [0.01..0.5_f64, 0.01..0.5, 0.01..0.5],
            at in [-1.0..=1.0_f64, -1.0..=1.0, -1.0..=1.0],
            turn in 0.0..std::f64::consts::TAU,
        ) {
            let solid = capsules_of(&Geometry::Box { size: urdf_rs::Vec3(size) }).expect("sizes above 0");
            let inside = Vector3::new(at[0] * size[0], at[1] * size[1], at[2] * size[2]) / 2.0;
            prop_assert!(holds(&solid, &inside), "{inside} of a box of {size:?}");
            let corner = inside.map(|x| x.signum()).component_mul(&Vector3::from(size)) / 2.0;
            prop_assert!(holds(&solid, &corner), "{corner} of a box of {size:?}");

            let (radius, length) = (size[0], size[1]);
            let solid = capsules_of(&Geometry::Cylinder { radius, length }).expect("sizes above 0");
            let rim = Vector3::new(radius * turn.cos(), radius * turn.sin(), length / 2.0 * at[2].signum());
            prop_assert!(holds(&solid, &rim), "{rim} of a cylinder of {radius}, {length}");
            let inside = Vector3::new(rim.x * at[0], rim.y * at[0], length / 2.0 * at[2]);
            prop_assert!(holds(&solid, &inside), "{inside} of a cylinder of {radius}, {length}");
        }
    }

    /// The identity pose leaves an end where it is.
    #[test]
    fn a_sphere_is_a_capsule_of_no_length() {
        let solid = capsules_of(&Geometry::Sphere { radius: 0.1 }).expect("a radius above 0");
        assert_eq!(solid, vec![([Vector3::zeros(); 2], 0.1)]);
        assert_eq!(nalgebra::Isometry3::<f64>::identity() * Point3::from(solid[0].0[0]), Point3::origin());
        assert_eq!(capsules_of(&Geometry::Sphere { radius: f64::NAN }), None);
        assert_eq!(capsules_of(&Geometry::Cylinder { radius: 0.1, length: 0.0 }), None);
    }
}
