//! The arm: a URDF read into a chain, a body of capsules and the masses of its links.
//!
//! Any serial chain of up to eight moving joints is accepted: fixed joints are
//! folded into the link they hang on, and with them those the cell holds still;
//! collision shapes and meshes are covered by capsules or hulls, and the pairs of links that
//! must not meet are worked out here, less what an SRDF allows. Everything else is
//! refused with its place in the file: meshes that are not there, joints that mimic
//! or branch off, links without mass or shape, limits that are none.
//!
//! **Invariant:** a [`Robot`] never covers less than its file's collision geometry.

mod capsule;
mod contact;
mod hull;
mod inertia;
mod lock;
mod mesh;
mod shape;
mod source;
mod srdf;
mod tree;

use crate::fault::{Fault, Faults};
use nalgebra::{Isometry3, Unit, Vector3};
use shape::Cover;
use source::Source;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tandem_clearance::{ArmBody, LINK_CAPSULES_MAX, LinkCapsule, Monitor, ShapeError, Shapes};
use tandem_kinematics::{Chain, JOINTS_MAX, Joint, JointKind};
use tree::Tree;

pub use inertia::LinkInertia;
pub use shape::Collision;

/// A joint without limits may turn this far either way, rad.
const CONTINUOUS: f64 = 200.0 * std::f64::consts::PI;
/// Acceleration of a joint whose file gives none: it reaches its speed in half a second.
const ACCELERATION_PER_VELOCITY: f64 = 2.0;
/// Jerk of a joint whose file gives none: it reaches its acceleration in a tenth of a second.
const JERK_PER_ACCELERATION: f64 = 10.0;

/// What a cell says of its arm beyond the URDF; lists have one entry a moving joint, in rad or m.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RobotOptions {
    /// Link whose frame is the TCP; else `tcp`, else `tool0`, else the one link at the chain's end.
    pub tcp: Option<String>,
    /// Where the arm rests; else 0, or the limit nearest to it.
    pub home: Option<Vec<f64>>,
    /// Largest accelerations; else the URDF's (from version 1.2), else twice the velocity, per second.
    pub acceleration_max: Option<Vec<f64>>,
    /// Largest jerks; else the URDF's, else ten times the acceleration, per second.
    pub jerk_max: Option<Vec<f64>>,
    /// Joints that are held still where they stand nearest to 0; what mimics them is held too.
    pub locked: Vec<String>,
    /// Folders in which `package://` is looked for.
    pub packages: Vec<PathBuf>,
    /// What stands for the collision geometry.
    pub collision: Collision,
    /// Name and text of an SRDF, whose `disable_collisions` are obeyed.
    pub srdf: Option<(PathBuf, String)>,
}

/// An arm that passed every check.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Robot {
    /// Name in its file.
    pub name: String,
    /// The file.
    pub file: PathBuf,
    /// The file as it was read, locked joints fixed.
    pub urdf: urdf_rs::Robot,
    /// Moving joints and TCP.
    pub chain: Chain,
    /// Capsules around the links, the hulls in them, and the pairs of links that must not meet.
    pub body: ArmBody,
    monitor: Monitor,
    /// Mass of each link of the chain, what is fixed to it included: `[0]` the base, `[i]` moved by joint i.
    pub links: Vec<LinkInertia>,
    /// Names of the moving joints, from the base outwards.
    pub joint_names: Vec<String>,
    /// Mesh files the body was made from.
    pub meshes: Vec<PathBuf>,
    /// What was put right while reading, a sentence each.
    pub notes: Vec<String>,
    /// Where the arm rests, rad or m.
    pub home: [f64; JOINTS_MAX],
}

impl Robot {
    /// Reads a URDF file.
    ///
    /// # Errors
    /// All faults of the file.
    pub fn load(file: &Path, options: &RobotOptions) -> Result<Self, Faults> {
        let text = std::fs::read_to_string(file).map_err(|error| {
            Faults::new(vec![Fault {
                file: file.display().to_string(),
                line: 0,
                column: 0,
                field: String::new(),
                found: error.to_string(),
                allowed: String::new(),
                advice: "name a file that can be read".into(),
            }])
        })?;
        Self::parse(file, &text, options).map_err(Faults::new)
    }

    /// A monitor of this arm, by what stands for its collision geometry, in an empty scene.
    pub fn monitor(&self) -> Monitor {
        self.monitor.clone()
    }

    /// Reads the text of a URDF; `file` is its name in messages.
    ///
    /// # Errors
    /// All faults found, never none.
    pub fn parse(file: &Path, text: &str, options: &RobotOptions) -> Result<Self, Vec<Fault>> {
        let source = Source::scan(&file.display().to_string(), text)?;
        let mut urdf = urdf_rs::read_from_string(text).map_err(|error| vec![source.refused(&error.to_string())])?;
        lock::lock(&source, &mut urdf, &options.locked)?;
        let tree = Tree::of(&source, &urdf, options.tcp.as_deref())?;

        let mut faults = Vec::new();
        let joints = moving_joints(&source, &urdf, &tree, options, &mut faults);
        let mut links = inertia::links(&source, &urdf, &tree, &mut faults);
        let (packages, collision) = (&options.packages[..], options.collision);
        let mut covering = shape::Covering { urdf: file, packages, collision, read: Vec::new(), notes: Vec::new() };
        let covers = shape::covers(&source, &urdf, &tree, &mut covering, &mut faults);
        let (meshes, mut notes) = (covering.read, covering.notes);
        if covers.len() > LINK_CAPSULES_MAX {
            let found = format!("{} capsules around its links", covers.len());
            let allowed = format!("at most {LINK_CAPSULES_MAX}");
            faults.push(source.fault_of_robot("robot", &found, &allowed, "give the links fewer collision shapes"));
        }
        if !faults.is_empty() {
            return Err(faults);
        }
        let allowed = match &options.srdf {
            Some((name, text)) => {
                let srdf = Source::scan(&name.display().to_string(), text)?;
                srdf::allowed_pairs(&srdf, &urdf, &tree)?
            }
            None => BTreeSet::new(),
        };
        let capsules: Vec<LinkCapsule> = covers.iter().map(|cover| cover.capsule).collect();
        notes.extend(inertia::put_right(&mut links, &capsules));

        let of_robot =
            |error: &dyn std::fmt::Display| vec![source.fault_of_robot("", &error.to_string(), "", "mend the file")];
        let chain = Chain::new(&joints, tree.tip_from_tcp).map_err(|error| of_robot(&error))?;
        let home = home(&chain, options);
        let mut shapes = Shapes::new();
        let hulls = register(&covers, &mut shapes).map_err(|error| of_robot(&error))?;
        let shapes = Arc::new(shapes);
        let monitor = |pairs: &[[usize; 2]]| {
            let mut body = ArmBody::new(&capsules, pairs)?;
            hulls.iter().try_for_each(|(capsule, hull)| body.refine(*capsule, *hull))?;
            Monitor::with_shapes(body, Arc::clone(&shapes))
        };
        let unpaired = monitor(&[]).map_err(|error| of_robot(&error))?;
        let mut pairs = contact::pairs_to_check(&unpaired, &chain, &home);
        pairs.retain(|pair| !allowed.contains(pair));
        let monitor = monitor(&pairs).map_err(|error| of_robot(&error))?;
        Ok(Self {
            name: urdf.name.clone(),
            file: file.to_owned(),
            joint_names: tree.chain.iter().map(|joint| urdf.joints[joint.index].name.clone()).collect(),
            chain,
            body: *monitor.body(),
            monitor,
            links,
            meshes,
            notes,
            home,
            urdf,
        })
    }
}

/// Registers the hulls of all covers: which capsule each of them stands for, and its number.
fn register(covers: &[Cover], shapes: &mut Shapes) -> Result<Vec<(usize, u32)>, ShapeError> {
    let hulls = covers.iter().enumerate().filter_map(|(capsule, cover)| Some((capsule, cover.hull.as_ref()?)));
    hulls.map(|(capsule, points)| Ok((capsule, shapes.add_hull(points)?))).collect()
}

fn home(chain: &Chain, options: &RobotOptions) -> [f64; JOINTS_MAX] {
    let mut home = [0.0; JOINTS_MAX];
    for (index, joint) in chain.joints().iter().enumerate() {
        let wanted = options.home.as_ref().and_then(|home| home.get(index).copied()).unwrap_or(0.0);
        home[index] = wanted.clamp(joint.position_min, joint.position_max);
    }
    home
}

/// The joints of the chain with their limits; those that cannot be are noted and left out.
fn moving_joints(
    source: &Source,
    urdf: &urdf_rs::Robot,
    tree: &Tree,
    options: &RobotOptions,
    faults: &mut Vec<Fault>,
) -> Vec<Joint> {
    let mut joints = Vec::new();
    for (order, place) in tree.chain.iter().enumerate() {
        let joint = &urdf.joints[place.index];
        let prismatic = joint.joint_type == urdf_rs::JointType::Prismatic;
        let unit = if prismatic { "m" } else { "rad" };
        let mut refuse = |child: &str, what: &str, found: String, allowed: &str, advice: &str| {
            faults.push(source.fault_in("joint", &joint.name, child, what, &found, allowed, advice));
        };
        let limit = &joint.limit;
        let (position_min, position_max) = match joint.joint_type {
            urdf_rs::JointType::Continuous => (-CONTINUOUS, CONTINUOUS),
            _ => (limit.lower, limit.upper),
        };
        for (what, value) in [("limit lower", position_min), ("limit upper", position_max)] {
            if !value.is_finite() {
                refuse("limit", what, format!("{value} {unit}"), "finite numbers", "write how far the joint may go");
            }
        }
        if position_min > position_max {
            let found = format!("{position_min} {unit} above upper = {position_max} {unit}");
            refuse("limit", "limit lower", found, "at most upper", "swap the limits");
        }
        for (what, value, rate) in [("limit velocity", limit.velocity, "/s"), ("limit effort", limit.effort, "")] {
            if !(value.is_finite() && value > 0.0) {
                let unit = match (rate, prismatic) {
                    ("/s", _) => format!("{unit}/s"),
                    (_, true) => "N".to_owned(),
                    (_, false) => "Nm".to_owned(),
                };
                let advice = "write what the joint's motor can do";
                refuse("limit", what, format!("{value} {unit}"), &format!("above 0 {unit}"), advice);
            }
        }
        let axis = Vector3::from(joint.axis.xyz.0);
        let Some(axis) = Unit::try_new(axis, 1e-6).filter(|axis| axis.iter().all(|x| x.is_finite())) else {
            let [x, y, z] = joint.axis.xyz.0;
            refuse("axis", "axis xyz", format!("\"{x} {y} {z}\""), "a direction", "write a vector that is not zero");
            continue;
        };
        let chosen = |list: &Option<Vec<f64>>| list.as_ref().and_then(|list| list.get(order).copied());
        let given = |value: f64| (value.is_finite() && value > 0.0).then_some(value);
        let acceleration_max = chosen(&options.acceleration_max)
            .or(given(limit.acceleration))
            .unwrap_or(ACCELERATION_PER_VELOCITY * limit.velocity);
        let jerk_max =
            chosen(&options.jerk_max).or(given(limit.jerk)).unwrap_or(JERK_PER_ACCELERATION * acceleration_max);
        joints.push(Joint {
            kind: if prismatic { JointKind::Prismatic } else { JointKind::Revolute },
            parent_from_joint: place.parent_from_joint,
            axis,
            position_min,
            position_max,
            velocity_max: limit.velocity,
            acceleration_max,
            jerk_max,
            effort_max: limit.effort,
        });
    }
    joints
}

/// A pose as a URDF writes it, or `None` when a number of it is not finite.
fn origin(pose: &urdf_rs::Pose) -> Option<Isometry3<f64>> {
    let finite = pose.xyz.iter().chain(pose.rpy.iter()).all(|x| x.is_finite());
    let [roll, pitch, yaw] = pose.rpy.0;
    finite.then(|| {
        Isometry3::from_parts(
            Vector3::from(pose.xyz.0).into(),
            nalgebra::UnitQuaternion::from_euler_angles(roll, pitch, yaw),
        )
    })
}
