//! Which joints make the chain, and what hangs fixed on which of its links.

use super::origin;
use super::source::Source;
use crate::fault::Fault;
use nalgebra::Isometry3;
use std::collections::BTreeMap;
use tandem_kinematics::JOINTS_MAX;
use urdf_rs::JointType;

/// A joint of the chain.
pub(super) struct ChainJoint {
    /// Its index in the file.
    pub(super) index: usize,
    /// Frame of the joint in the frame the previous one moves.
    pub(super) parent_from_joint: Isometry3<f64>,
}

/// A link of the file and the link of the chain it moves with.
pub(super) struct Member {
    /// Its index in the file.
    pub(super) index: usize,
    /// Link of the chain: 0 the base, i moved by joint i.
    pub(super) link: usize,
    /// Its frame in the frame of that link.
    pub(super) link_from_member: Isometry3<f64>,
    /// Whether it is fixed behind the last joint's own link: part of the tool.
    pub(super) tool: bool,
}

/// A URDF as a serial chain.
pub(super) struct Tree {
    /// Moving joints, from the base outwards.
    pub(super) chain: Vec<ChainJoint>,
    /// Every link, in the order of the file.
    pub(super) members: Vec<Member>,
    /// The TCP in the frame of the chain's last link.
    pub(super) tip_from_tcp: Isometry3<f64>,
}

impl Tree {
    /// Orders the joints of a file.
    pub(super) fn of(source: &Source, urdf: &urdf_rs::Robot, tcp: Option<&str>) -> Result<Self, Vec<Fault>> {
        let links = named_once(source, urdf)?;
        let parents = parents(source, urdf, &links)?;
        let roots: Vec<usize> = (0..urdf.links.len()).filter(|link| parents[*link].is_none()).collect();
        let [root] = roots[..] else { return Err(vec![root_fault(source, urdf, &roots)]) };

        if let Some(name) = on_a_loop(urdf, &parents) {
            let advice = "let the joints run outwards from one base";
            return Err(vec![source.fault_in("link", name, "", "", "on a loop of joints", "a chain", advice)]);
        }

        let tcp = tcp_link(source, urdf, &links, tcp)?;
        // From the TCP back to the root.
        let mut way = Vec::new();
        let mut at = tcp;
        while let Some((joint, parent)) = parents[at] {
            way.push(joint);
            at = parent;
        }
        way.reverse();
        let moves = |joint: &usize| urdf.joints[*joint].joint_type != JointType::Fixed;
        let moving: Vec<usize> = way.iter().copied().filter(moves).collect();
        check_joints(source, urdf, &moving, &urdf.links[tcp].name)?;

        let mut tree = Self { chain: Vec::new(), members: Vec::new(), tip_from_tcp: Isometry3::identity() };
        // Poses in the chain's links, from the root outwards over the whole tree.
        let mut placed: Vec<Option<(usize, Isometry3<f64>)>> = vec![None; urdf.links.len()];
        placed[root] = Some((0, Isometry3::identity()));
        for _ in 0..urdf.links.len() {
            for link in 0..urdf.links.len() {
                let (None, Some((joint, parent))) = (placed[link], parents[link]) else { continue };
                let Some((on, pose)) = placed[parent] else { continue };
                let step = pose * origin(&urdf.joints[joint].origin).unwrap_or_else(Isometry3::identity);
                placed[link] = Some(match moving.iter().position(|other| *other == joint) {
                    Some(order) => {
                        tree.chain.push(ChainJoint { index: joint, parent_from_joint: step });
                        (order + 1, Isometry3::identity())
                    }
                    None => (on, step),
                });
            }
        }
        tree.chain.sort_by_key(|joint| moving.iter().position(|other| *other == joint.index));
        let last_own = moving.last().map(|joint| urdf.joints[*joint].child.link.as_str());
        for (index, place) in placed.iter().enumerate() {
            // Every link was placed: none is on a loop.
            let Some((link, link_from_member)) = *place else { continue };
            let tool = link == moving.len() && last_own != Some(urdf.links[index].name.as_str());
            tree.members.push(Member { index, link, link_from_member, tool });
        }
        tree.tip_from_tcp = tree.members[tcp].link_from_member;
        Ok(tree)
    }
}

/// Indices of the links by name; repeated names are refused.
fn named_once<'u>(source: &Source, urdf: &'u urdf_rs::Robot) -> Result<BTreeMap<&'u str, usize>, Vec<Fault>> {
    let mut faults = Vec::new();
    let mut links = BTreeMap::new();
    for (index, link) in urdf.links.iter().enumerate() {
        if links.insert(link.name.as_str(), index).is_some() {
            faults.push(source.fault_of_repeated("link", &link.name));
        }
    }
    let mut joints = BTreeMap::new();
    for joint in &urdf.joints {
        if joints.insert(joint.name.as_str(), ()).is_some() {
            faults.push(source.fault_of_repeated("joint", &joint.name));
        }
    }
    if faults.is_empty() { Ok(links) } else { Err(faults) }
}

/// Each link's joint and parent link; links that do not exist, two parents and bad origins are refused.
fn parents(
    source: &Source,
    urdf: &urdf_rs::Robot,
    links: &BTreeMap<&str, usize>,
) -> Result<Vec<Option<(usize, usize)>>, Vec<Fault>> {
    let mut faults = Vec::new();
    let mut parents = vec![None; urdf.links.len()];
    for (index, joint) in urdf.joints.iter().enumerate() {
        let mut refuse = |child: &str, found: &str, allowed: &str, advice: &str| {
            faults.push(source.fault_in("joint", &joint.name, child, child, found, allowed, advice));
        };
        if origin(&joint.origin).is_none() {
            refuse("origin", "not finite", "finite numbers", "write the pose of the joint");
        }
        let known = |name: &str| links.get(name).copied();
        let named = |name: &str| format!("\"{name}\"");
        match (known(&joint.parent.link), known(&joint.child.link)) {
            (None, _) => refuse("parent", &named(&joint.parent.link), "a link of the file", "add the link"),
            (_, None) => refuse("child", &named(&joint.child.link), "a link of the file", "add the link"),
            (Some(parent), Some(child)) => match parents[child] {
                None => parents[child] = Some((index, parent)),
                Some((other, _)) => {
                    let found =
                        format!("\"{}\", which joint \"{}\" moves too", joint.child.link, urdf.joints[other].name);
                    refuse("child", &found, "one joint a link", "an arm is one chain");
                }
            },
        }
    }
    if faults.is_empty() { Ok(parents) } else { Err(faults) }
}

/// The first link from which the way back never comes to a root.
fn on_a_loop<'u>(urdf: &'u urdf_rs::Robot, parents: &[Option<(usize, usize)>]) -> Option<&'u str> {
    let ends = |link: &usize| {
        let mut at = *link;
        (0..=parents.len()).any(|_| match parents[at] {
            Some((_, parent)) => {
                at = parent;
                false
            }
            None => true,
        })
    };
    (0..parents.len()).find(|link| !ends(link)).map(|link| urdf.links[link].name.as_str())
}

fn root_fault(source: &Source, urdf: &urdf_rs::Robot, roots: &[usize]) -> Fault {
    let names: Vec<&str> = roots.iter().map(|root| urdf.links[*root].name.as_str()).collect();
    let found = match names.len() {
        0 => "no link that is no joint's child".to_owned(),
        _ => format!("{} links that are no joint's child: {}", names.len(), names.join(", ")),
    };
    source.fault_of_robot("", &found, "one, the base", "join the others to it by fixed joints")
}

/// The link whose frame is the TCP.
fn tcp_link(
    source: &Source,
    urdf: &urdf_rs::Robot,
    links: &BTreeMap<&str, usize>,
    chosen: Option<&str>,
) -> Result<usize, Vec<Fault>> {
    if let Some(name) = chosen {
        let found = format!("no link \"{name}\", which the cell names as the TCP");
        let missing = || vec![source.fault_of_robot("", &found, "", "add the link, or mend robot.tcp of the cell")];
        return links.get(name).copied().ok_or_else(missing);
    }
    if let Some(link) = ["tcp", "tool0"].iter().find_map(|name| links.get(name)) {
        return Ok(*link);
    }
    let is_parent = |link: &str| urdf.joints.iter().any(|joint| joint.parent.link == link);
    let ends: Vec<usize> = (0..urdf.links.len()).filter(|link| !is_parent(&urdf.links[*link].name)).collect();
    match ends[..] {
        [end] => Ok(end),
        _ => {
            let names: Vec<&str> = ends.iter().map(|end| urdf.links[*end].name.as_str()).collect();
            let found = format!("{} links at an end: {}", names.len(), names.join(", "));
            let advice = "name the TCP's link as robot.tcp of the cell";
            Err(vec![source.fault_of_robot("", &found, "one, or a link called tcp or tool0", advice)])
        }
    }
}

/// Refuses joints that move beside the chain, in ways a chain cannot, or are too many.
fn check_joints(source: &Source, urdf: &urdf_rs::Robot, moving: &[usize], tcp: &str) -> Result<(), Vec<Fault>> {
    let mut faults = Vec::new();
    for (index, joint) in urdf.joints.iter().enumerate() {
        let mut refuse = |child: &str, what: &str, found: &str, allowed: &str, advice: &str| {
            faults.push(source.fault_in("joint", &joint.name, child, what, found, allowed, advice));
        };
        let kind = match joint.joint_type {
            JointType::Fixed => continue,
            JointType::Revolute => "revolute",
            JointType::Continuous => "continuous",
            JointType::Prismatic => "prismatic",
            JointType::Floating => "floating",
            JointType::Planar => "planar",
            JointType::Spherical => "spherical",
        };
        if matches!(joint.joint_type, JointType::Floating | JointType::Planar | JointType::Spherical) {
            let found = format!("\"{kind}\"");
            refuse("", "type", &found, "revolute, continuous, prismatic, fixed", "an arm has joints of one axis");
        } else if let Some(mimic) = &joint.mimic {
            let found = format!("of joint \"{}\"", mimic.joint);
            refuse(
                "mimic",
                "mimic",
                &found,
                "joints that move by themselves",
                "name what it follows in robot.locked of the cell, or make it fixed",
            );
        } else if !moving.contains(&index) {
            let found = format!("\"{kind}\" beside the chain to \"{tcp}\"");
            let advice = "name it in robot.locked of the cell, or another link as robot.tcp";
            refuse("", "type", &found, "moving joints between base and TCP only", advice);
        }
    }
    if moving.is_empty() || moving.len() > JOINTS_MAX {
        let found = format!("{} moving joints between base and \"{tcp}\"", moving.len());
        let allowed = format!("1..={JOINTS_MAX}");
        faults.push(source.fault_of_robot("", &found, &allowed, "make some of them fixed, or name another file"));
    }
    if faults.is_empty() { Ok(()) } else { Err(faults) }
}
