//! Allowed collisions of an SRDF: pairs of links that need no check.

use super::source::Source;
use super::tree::Tree;
use crate::fault::Fault;
use std::collections::BTreeSet;

/// Pairs of the chain's links (smaller first) of which the SRDF allows every pair of members with a
/// collision shape to touch.
///
/// # Errors
/// A pair that names no link, or one the URDF does not have.
pub(super) fn allowed_pairs(
    srdf: &Source,
    urdf: &urdf_rs::Robot,
    tree: &Tree,
) -> Result<BTreeSet<[usize; 2]>, Vec<Fault>> {
    let mut faults = Vec::new();
    let mut named = BTreeSet::new();
    for (offset, ends) in srdf.pairs("disable_collisions", ["link1", "link2"]) {
        for (key, end) in ["link1", "link2"].into_iter().zip(ends) {
            let field = format!("disable_collisions {key}");
            let known = |name: &str| urdf.links.iter().any(|link| link.name == name);
            match end {
                None => faults.push(srdf.fault(Some(offset), &field, "missing", "a link of the URDF", "name it")),
                Some(name) if !known(name) => {
                    let found = format!("\"{name}\"");
                    let advice = "mend the name, or take the line out";
                    faults.push(srdf.fault(Some(offset), &field, &found, "a link of the URDF", advice));
                }
                Some(_) => {}
            }
        }
        if let [Some(a), Some(b)] = ends {
            named.insert([a.min(b), a.max(b)]);
        }
    }
    if !faults.is_empty() {
        return Err(faults);
    }
    let shaped = |link: usize| {
        let here =
            tree.members.iter().filter(move |member| member.link == link).map(|member| &urdf.links[member.index]);
        here.filter(|link| !link.collision.is_empty()).map(|link| link.name.as_str())
    };
    let mut allowed = BTreeSet::new();
    for a in 0..=tree.chain.len() {
        for b in a + 1..=tree.chain.len() {
            let may_touch = |(x, y): (&str, &str)| named.contains(&[x.min(y), x.max(y)]);
            if shaped(a).flat_map(|x| shaped(b).map(move |y| (x, y))).all(may_touch) {
                allowed.insert([a, b]);
            }
        }
    }
    Ok(allowed)
}
