//! Collision shapes, covered by capsules.

use super::mesh::{self, Capsule};
use super::origin;
use super::source::Source;
use super::tree::{Member, Tree};
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

/// Where meshes are looked for, and which were read.
pub(super) struct Meshes<'p> {
    /// The URDF: other paths are relative to its folder.
    pub(super) urdf: &'p Path,
    /// Folders of packages.
    pub(super) packages: &'p [PathBuf],
    /// Files that were read.
    pub(super) read: Vec<PathBuf>,
}

impl Meshes<'_> {
    /// A capsule around a mesh, in the shape's frame.
    fn cover(&mut self, name: &str, scale: [f64; 3]) -> Result<Capsule, (String, String)> {
        if !scale.iter().all(|factor| factor.is_finite() && *factor != 0.0) {
            return Err((format!("\"{name}\" of scale {scale:?}"), "write finite factors that are not 0".into()));
        }
        let file = mesh::resolve(name, self.urdf, self.packages)?;
        let vertices = mesh::vertices(&file)?;
        self.read.push(file);
        let scale = Vector3::from(scale);
        let scaled: Vec<_> = vertices.iter().map(|vertex| vertex.component_mul(&scale)).collect();
        Ok(mesh::around(&scaled))
    }
}

/// Capsules around every collision shape of the chain's links, in the order of the links.
pub(super) fn capsules(
    source: &Source,
    urdf: &urdf_rs::Robot,
    tree: &Tree,
    meshes: &mut Meshes,
    faults: &mut Vec<Fault>,
) -> Vec<LinkCapsule> {
    let mut capsules = Vec::new();
    for link in 0..=tree.chain.len() {
        let before = (capsules.len(), faults.len());
        for member in tree.members.iter().filter(|member| member.link == link) {
            cover_member(source, &urdf.links[member.index], member, meshes, &mut capsules, faults);
        }
        if link > 0 && before == (capsules.len(), faults.len()) {
            let name = &urdf.joints[tree.chain[link - 1].index].child.link;
            let advice = "give the link a <collision>: a joint moves it";
            faults.push(source.fault_in("link", name, "", "collision", "missing", "at least one shape", advice));
        }
    }
    capsules
}

fn cover_member(
    source: &Source,
    link: &urdf_rs::Link,
    member: &Member,
    meshes: &mut Meshes,
    capsules: &mut Vec<LinkCapsule>,
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
        let pose = member.link_from_member * pose;
        let place = |ends: [Vector3<f64>; 2], radius: f64| LinkCapsule {
            link: member.link,
            ends: ends.map(|end| (pose * Point3::from(end)).coords.into()),
            radius,
            tool: member.tool,
        };
        match &collision.geometry {
            Geometry::Mesh { filename, scale } => {
                match meshes.cover(filename, scale.as_ref().map_or([1.0; 3], |scale| scale.0)) {
                    Ok((ends, radius)) => capsules.push(place(ends, radius)),
                    Err((found, advice)) => {
                        refuse("collision/geometry/mesh", "collision mesh", &found, "", &advice);
                    }
                }
            }
            geometry => match covering(geometry) {
                Some(covers) => capsules.extend(covers.into_iter().map(|(ends, radius)| place(ends, radius))),
                None => {
                    let found = "a size that is not finite and above 0 m";
                    refuse("collision/geometry", "collision geometry", found, "", "write the shape's size");
                }
            },
        }
    }
}

/// Segments with radii that hold a primitive, in its own frame; `None` when a size of it cannot be.
fn covering(geometry: &Geometry) -> Option<Vec<([Vector3<f64>; 2], f64)>> {
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
fn around_box(half: [f64; 3]) -> Vec<([Vector3<f64>; 2], f64)> {
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
            let solid = covering(&Geometry::Box { size: urdf_rs::Vec3(size) }).expect("sizes above 0");
            let inside = Vector3::new(at[0] * size[0], at[1] * size[1], at[2] * size[2]) / 2.0;
            prop_assert!(holds(&solid, &inside), "{inside} of a box of {size:?}");
            let corner = inside.map(|x| x.signum()).component_mul(&Vector3::from(size)) / 2.0;
            prop_assert!(holds(&solid, &corner), "{corner} of a box of {size:?}");

            let (radius, length) = (size[0], size[1]);
            let solid = covering(&Geometry::Cylinder { radius, length }).expect("sizes above 0");
            let rim = Vector3::new(radius * turn.cos(), radius * turn.sin(), length / 2.0 * at[2].signum());
            prop_assert!(holds(&solid, &rim), "{rim} of a cylinder of {radius}, {length}");
            let inside = Vector3::new(rim.x * at[0], rim.y * at[0], length / 2.0 * at[2]);
            prop_assert!(holds(&solid, &inside), "{inside} of a cylinder of {radius}, {length}");
        }
    }

    /// The identity pose leaves an end where it is.
    #[test]
    fn a_sphere_is_a_capsule_of_no_length() {
        let solid = covering(&Geometry::Sphere { radius: 0.1 }).expect("a radius above 0");
        assert_eq!(solid, vec![([Vector3::zeros(); 2], 0.1)]);
        assert_eq!(nalgebra::Isometry3::<f64>::identity() * Point3::from(solid[0].0[0]), Point3::origin());
        assert_eq!(covering(&Geometry::Sphere { radius: f64::NAN }), None);
        assert_eq!(covering(&Geometry::Cylinder { radius: 0.1, length: 0.0 }), None);
    }
}
