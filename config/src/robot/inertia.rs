//! Mass, centre and inertia of the chain's links, what is fixed to them included.

use super::origin;
use super::source::Source;
use super::tree::Tree;
use crate::fault::Fault;
use nalgebra::{Isometry3, Matrix3, Unit, Vector3};
use tandem_clearance::LinkCapsule;

/// How mass is spread over one link of the chain.
#[derive(Clone, Debug, PartialEq)]
pub struct LinkInertia {
    /// Name of the link in the file; what is fixed to it is not named.
    pub name: String,
    /// Mass, kg.
    pub mass: f64,
    /// Centre of mass in the link's frame, metres.
    pub centre: [f64; 3],
    /// Inertia about the centre, in axes of the link's frame, row by row, kg m².
    pub inertia: [[f64; 3]; 3],
}

/// One body of a group.
struct Part {
    mass: f64,
    centre: Vector3<f64>,
    inertia: Matrix3<f64>,
}

/// The links of the chain; a moving one without a mass that can be is noted.
pub(super) fn links(source: &Source, urdf: &urdf_rs::Robot, tree: &Tree, faults: &mut Vec<Fault>) -> Vec<LinkInertia> {
    let mut links = Vec::new();
    for link in 0..=tree.chain.len() {
        let mut parts = Vec::new();
        for member in tree.members.iter().filter(|member| member.link == link) {
            let file_link = &urdf.links[member.index];
            match part(&file_link.inertial, &member.link_from_member) {
                Some(part) => parts.push(part),
                None => {
                    let mass = file_link.inertial.mass.value;
                    let found = format!("mass = {mass} kg with its inertia");
                    let allowed = "a mass of at least 0 kg and finite numbers";
                    let advice = "write what the link weighs";
                    faults.push(source.fault_in(
                        "link",
                        &file_link.name,
                        "inertial",
                        "inertial",
                        &found,
                        allowed,
                        advice,
                    ));
                }
            }
        }
        let name = own_name(urdf, tree, link);
        let total = sum(&parts);
        if link > 0 {
            check_moving(source, &name, &total, faults);
        }
        let inertia = std::array::from_fn(|row| std::array::from_fn(|column| total.inertia[(row, column)]));
        links.push(LinkInertia { name, mass: total.mass, centre: total.centre.into(), inertia });
    }
    links
}

/// Replaces inertias that no body of a link's shape can have (a gyration radius past its farthest
/// point, as the wrists of the widespread UR5 file) by those of its capsules taken as solid.
/// Answers a sentence for each.
pub(super) fn put_right(links: &mut [LinkInertia], capsules: &[LinkCapsule]) -> Vec<String> {
    let mut notes = Vec::new();
    for (index, link) in links.iter_mut().enumerate().skip(1) {
        let centre = Vector3::from(link.centre);
        let own: Vec<&LinkCapsule> = capsules.iter().filter(|capsule| capsule.link == index).collect();
        let reach = |capsule: &&LinkCapsule| {
            capsule
                .ends
                .map(|end| (Vector3::from(end) - centre).norm() + capsule.radius)
                .into_iter()
                .fold(0.0, f64::max)
        };
        let farthest = own.iter().map(reach).fold(0.0, f64::max);
        let given = Matrix3::from_fn(|row, column| link.inertia[row][column]);
        let gyration = (given.symmetric_eigenvalues().max() / link.mass).sqrt();
        if gyration <= farthest {
            continue;
        }
        let length = |capsule: &LinkCapsule| (Vector3::from(capsule.ends[1]) - Vector3::from(capsule.ends[0])).norm();
        // A cylinder as long as the capsule stands for it.
        let volume = |capsule: &LinkCapsule| capsule.radius.powi(2) * (length(capsule) + 2.0 * capsule.radius);
        let whole: f64 = own.iter().map(|capsule| volume(capsule)).sum();
        let mut inertia = Matrix3::zeros();
        for capsule in own {
            let [a, b] = capsule.ends.map(Vector3::from);
            let mass = link.mass * volume(capsule) / whole;
            let axis = Unit::try_new(b - a, 1e-9).unwrap_or(Vector3::z_axis());
            let (radius, long) = (capsule.radius, length(capsule) + 2.0 * capsule.radius);
            let (about, across) = (mass * radius * radius / 2.0, mass * (3.0 * radius * radius + long * long) / 12.0);
            let along = axis.into_inner() * axis.transpose();
            let off = (a + b) / 2.0 - centre;
            inertia += Matrix3::identity() * across + along * (about - across);
            inertia += (Matrix3::identity() * off.norm_squared() - off * off.transpose()) * mass;
        }
        link.inertia = std::array::from_fn(|row| std::array::from_fn(|column| inertia[(row, column)]));
        notes.push(format!(
            "link \"{}\": its inertia has a gyration radius of {gyration:.2} m, past its farthest point at \
             {farthest:.2} m; taken as that of its collision shape",
            link.name
        ));
    }
    notes
}

fn check_moving(source: &Source, name: &str, total: &Part, faults: &mut Vec<Fault>) {
    let mut refuse = |found: String, allowed: &str, advice: &str| {
        faults.push(source.fault_in("link", name, "inertial", "inertial", &found, allowed, advice));
    };
    if total.mass <= 0.0 {
        let advice = "write what the link weighs: a joint moves it";
        return refuse("mass 0 kg, with all that is fixed to it".into(), "above 0 kg", advice);
    }
    let principal = total.inertia.symmetric_eigenvalues();
    if !principal.iter().all(|moment| *moment > 0.0) {
        let [a, b, c] = [principal[0], principal[1], principal[2]];
        let found = format!("principal moments {a:.3e}, {b:.3e}, {c:.3e} kg m2");
        refuse(found, "all above 0 kg m2", "write the inertia about the centre of mass");
    }
}

/// The link a joint moves itself, or the root.
fn own_name(urdf: &urdf_rs::Robot, tree: &Tree, link: usize) -> String {
    match link.checked_sub(1).and_then(|joint| tree.chain.get(joint)) {
        Some(joint) => urdf.joints[joint.index].child.link.clone(),
        None => {
            let is_child = |name: &str| urdf.joints.iter().any(|joint| joint.child.link == name);
            urdf.links.iter().find(|link| !is_child(&link.name)).map_or_else(String::new, |link| link.name.clone())
        }
    }
}

fn part(inertial: &urdf_rs::Inertial, link_from_member: &Isometry3<f64>) -> Option<Part> {
    let i = &inertial.inertia;
    let inertia = Matrix3::new(i.ixx, i.ixy, i.ixz, i.ixy, i.iyy, i.iyz, i.ixz, i.iyz, i.izz);
    let mass = inertial.mass.value;
    if !mass.is_finite() || mass < 0.0 || !inertia.iter().all(|x| x.is_finite()) {
        return None;
    }
    let pose = link_from_member * origin(&inertial.origin)?;
    let turn = pose.rotation.to_rotation_matrix().into_inner();
    Some(Part { mass, centre: pose.translation.vector, inertia: turn * inertia * turn.transpose() })
}

/// All parts as one, by the parallel axis theorem.
fn sum(parts: &[Part]) -> Part {
    let mass: f64 = parts.iter().map(|part| part.mass).sum();
    let weighted: Vector3<f64> = parts.iter().map(|part| part.centre * part.mass).sum();
    let centre = if mass > 0.0 { weighted / mass } else { Vector3::zeros() };
    let mut inertia = Matrix3::zeros();
    for part in parts.iter().filter(|part| part.mass > 0.0) {
        let off = part.centre - centre;
        inertia += part.inertia + (Matrix3::identity() * off.norm_squared() - off * off.transpose()) * part.mass;
    }
    Part { mass, centre, inertia }
}
