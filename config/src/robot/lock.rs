//! Joints the cell holds still: a gripper's fingers, an axis that is not used. They become fixed
//! ones before the chain is looked for, and those that mimic them with them.

use super::origin;
use super::source::Source;
use crate::fault::Fault;
use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};
use std::collections::BTreeMap;
use urdf_rs::JointType;

/// Fixes the joints named in `locked`, each at the position nearest to 0 within its limits.
///
/// # Errors
/// A name that is no moving joint of the file, or an axis that is no direction.
pub(super) fn lock(source: &Source, urdf: &mut urdf_rs::Robot, locked: &[String]) -> Result<(), Vec<Fault>> {
    let mut faults = Vec::new();
    let mut held: BTreeMap<String, f64> = BTreeMap::new();
    for name in locked {
        let moves = |joint: &&urdf_rs::Joint| {
            let kinds = [JointType::Revolute, JointType::Continuous, JointType::Prismatic];
            joint.name == *name && kinds.contains(&joint.joint_type)
        };
        match urdf.joints.iter().find(moves) {
            Some(joint) if joint.joint_type == JointType::Continuous => _ = held.insert(name.clone(), 0.0),
            Some(joint) => {
                _ = held.insert(name.clone(), 0.0_f64.max(joint.limit.lower).min(joint.limit.upper));
            }
            None => {
                let found = format!("no moving joint \"{name}\", which the cell locks");
                faults.push(source.fault_of_robot("", &found, "", "mend robot.locked of the cell"));
            }
        }
    }
    // Followers of followers too: each pass holds at least one more or ends.
    loop {
        let follow = |joint: &urdf_rs::Joint| {
            let mimic = joint.mimic.as_ref().filter(|_| !held.contains_key(&joint.name))?;
            let leader = held.get(&mimic.joint)?;
            Some((joint.name.clone(), mimic.multiplier.unwrap_or(1.0) * leader + mimic.offset.unwrap_or(0.0)))
        };
        let followers: Vec<(String, f64)> = urdf.joints.iter().filter_map(follow).collect();
        if followers.is_empty() {
            break;
        }
        held.extend(followers);
    }
    for joint in &mut urdf.joints {
        let Some(position) = held.get(&joint.name) else { continue };
        let axis =
            Unit::try_new(Vector3::from(joint.axis.xyz.0), 1e-6).filter(|axis| axis.iter().all(|x| x.is_finite()));
        let (Some(axis), Some(pose)) = (axis, origin(&joint.origin)) else {
            let advice = "write numbers, and an axis that is not zero";
            faults.push(source.fault_in("joint", &joint.name, "", "", "no pose to hold it at", "", advice));
            continue;
        };
        let motion = match joint.joint_type {
            JointType::Prismatic => Translation3::from(axis.into_inner() * *position).into(),
            _ => Isometry3::from_parts(Translation3::identity(), UnitQuaternion::from_axis_angle(&axis, *position)),
        };
        let pose = pose * motion;
        let (roll, pitch, yaw) = pose.rotation.euler_angles();
        joint.origin.xyz.0 = pose.translation.vector.into();
        joint.origin.rpy.0 = [roll, pitch, yaw];
        joint.joint_type = JointType::Fixed;
        joint.mimic = None;
    }
    if faults.is_empty() { Ok(()) } else { Err(faults) }
}
