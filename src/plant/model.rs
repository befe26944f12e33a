//! From the files of a cell to the plant's own terms: what the hardware is and how well it works.

use core::time::Duration;

use nalgebra::{Isometry3, Matrix3, Vector3};
use tandem_clearance::LinkCapsule;
use tandem_config::{Body, Cell, FixedObject, Part, Robot};
use tandem_kinematics::JointKind;
use tandem_msg::{Coded, EffectorAction, FeatureClass, Tool};

use super::PlantError;
use super::arm::{ArmModel, JointModel, LinkMass};
use super::effector::{EffectorModel, GRIPPER_OPENING};
use super::human::PersonModel;
use super::parts::{Block, PartModel};
use super::referee::{Kind, Obstacle};
use super::station::FeederModel;

/// Farthest from the rack pose a tool still couples: metres, radians.
const COUPLE: (f64, f64) = (0.010, 0.105);
/// Thinnest edge that fingers can take, metres.
const FINGER_MIN: f64 = 0.002;
/// Radius of the suction cup, metres, and the heaviest part it carries, kg.
const CUP: f64 = 0.015;
const CUP_LOAD: f64 = 6.0;

/// Everything the plant is made of, in its own terms.
pub(crate) struct PlantModel {
    pub(super) arm: ArmModel,
    /// Each capsule of the arm, and corners of the hull that stands for it where one does.
    pub(super) links: Vec<(LinkCapsule, Vec<[f64; 3]>)>,
    pub(super) obstacles: Vec<Obstacle>,
    pub(super) effector: EffectorModel,
    pub(super) parts: Vec<PartModel>,
    pub(super) feeder: FeederModel,
    pub(super) person: PersonModel,
    /// Standard deviations of a measured joint, rad, and of the tracked person, metres.
    pub(super) joint_noise: f64,
    pub(super) tracking_sigma: f64,
    pub(super) period: Duration,
    pub(super) config_hash: u64,
}

impl PlantModel {
    /// # Errors
    /// An arm whose joints and masses do not match.
    pub(super) fn of(cell: &Cell) -> Result<Self, PlantError> {
        let base_from_fixture = cell.layout.base_from_fixture;
        Ok(Self {
            arm: arm(&cell.robot)?,
            links: links(cell),
            obstacles: obstacles(cell),
            effector: effector(cell),
            parts: cell.product.parts.iter().map(|part| part_model(part, &base_from_fixture)).collect(),
            feeder: FeederModel {
                base_from_station: cell.layout.stations.iter().map(|station| station.base_from_station).collect(),
                jitter: (cell.plant.placement_sigma, cell.plant.placement_sigma_rad),
                new_box: cell.plant.new_box_s,
                present: cell.plant.present_s,
                scan: cell.plant.scan_s,
                scan_period: cell.timing.perception.period,
            },
            person: person(cell),
            joint_noise: cell.plant.joint_noise,
            tracking_sigma: cell.human.tracking_sigma,
            period: cell.timing.plant.period,
            config_hash: cell.hash,
        })
    }
}

fn arm(robot: &Robot) -> Result<ArmModel, PlantError> {
    // The first link is the base, which does not move.
    let (joints, links) = (robot.chain.joint_count(), robot.links.len());
    if links != joints + 1 {
        return Err(PlantError::LinkCount { robot: robot.name.clone(), joints, links });
    }
    let joints = robot.chain.joints().iter().zip(&robot.links[1..]).map(|(joint, link)| JointModel {
        parent_from_joint: joint.parent_from_joint,
        axis: joint.axis,
        prismatic: joint.kind == JointKind::Prismatic,
        position: [joint.position_min, joint.position_max],
        velocity_max: joint.velocity_max,
        acceleration_max: joint.acceleration_max,
        effort_max: joint.effort_max,
        link: LinkMass {
            mass: link.mass,
            centre: Vector3::from(link.centre),
            inertia: Matrix3::from_fn(|row, column| link.inertia[row][column]),
        },
    });
    Ok(ArmModel { joints: joints.collect(), flange_from_tcp: *robot.chain.tool(), home: robot.home })
}

/// The capsules of the arm and the hulls in them.
fn links(cell: &Cell) -> Vec<(LinkCapsule, Vec<[f64; 3]>)> {
    let monitor = cell.robot.monitor();
    let capsules = monitor.body().capsules().iter().enumerate();
    capsules.map(|(index, capsule)| (*capsule, monitor.hull_points(index).collect())).collect()
}

fn obstacles(cell: &Cell) -> Vec<Obstacle> {
    let layout = &cell.layout;
    let of = |kind| {
        move |object: &FixedObject| Obstacle {
            kind,
            half_extents: object.half_extents,
            base_from_object: object.base_from_object,
        }
    };
    let carriers = layout.stations.iter().map(|station| &station.carrier);
    layout
        .fixed
        .iter()
        .map(|object| of(if object.name == "bench" { Kind::Table } else { Kind::Other })(object))
        .chain([of(Kind::Table)(&layout.fixture)])
        .chain(carriers.map(of(Kind::Carrier)))
        .chain([of(Kind::Rack)(&layout.rack)])
        .collect()
}

fn effector(cell: &Cell) -> EffectorModel {
    let plant = &cell.plant;
    let mut rack = [None; Tool::ALL.len()];
    for slot in &cell.layout.rack_slots {
        rack[slot.tool.code() as usize] = Some(slot.base_from_tcp);
    }
    let mut duration = [0.0; EffectorAction::ALL.len()];
    for &action in EffectorAction::ALL {
        duration[action.code() as usize] = match action {
            EffectorAction::Keep => 0.0,
            EffectorAction::Grasp | EffectorAction::Release => plant.grasp_s,
            EffectorAction::Seat => plant.seat_s,
            EffectorAction::Screw => plant.screw_s,
            EffectorAction::Press => plant.press_s,
            EffectorAction::AttachTool | EffectorAction::DetachTool => plant.couple_s,
        };
    }
    EffectorModel {
        grasp: (plant.grasp_tolerance, plant.grasp_tolerance_rad),
        couple: COUPLE,
        rack,
        initial_tool: cell.layout.initial_tool,
        duration,
    }
}

fn part_model(part: &Part, base_from_fixture: &Isometry3<f64>) -> PartModel {
    let mut held_by = [false; Tool::ALL.len()];
    for &tool in Tool::ALL {
        held_by[tool.code() as usize] = holds(tool, part);
    }
    let block = |cuboid: &tandem_config::Cuboid| Block { centre: cuboid.centre, half_extents: cuboid.half_extents };
    PartModel {
        class: part.feature.class,
        half_extents: part.half_extents,
        blocks: part.body.cuboids().iter().map(block).collect(),
        mass: part.mass,
        station: part.station,
        station_from_part: part.station_from_part,
        part_from_grasp: part.part_from_grasp,
        base_from_place: base_from_fixture * part.fixture_from_part,
        capture: (part.capture.position, part.capture.angle),
        grasp_width: part.grasp_width,
        held_by,
        joined_by: joins(part.feature.class),
        after: part.after.clone(),
    }
}

/// Whether a tool can hold a part, by the part's nature and whatever anyone believes of it.
fn holds(tool: Tool, part: &Part) -> bool {
    let [x, y, z] = part.half_extents.map(|half| 2.0 * half);
    match tool {
        Tool::None => false,
        Tool::ParallelGripper => {
            let width = if part.grasp_width > 0.0 { part.grasp_width } else { x.min(y) };
            z >= FINGER_MIN && width <= GRIPPER_OPENING
        }
        // A closed flat face under the whole cup, dry.
        Tool::VacuumGripper => {
            let flat = matches!(part.body, Body::Box { .. } | Body::Cylinder { .. });
            flat && x.min(y) >= 2.0 * CUP && !part.oily && part.mass <= CUP_LOAD
        }
        // Its bit has to find a thread.
        Tool::Screwdriver => threaded(part.feature.class),
        // The ram's clamp needs something stiff.
        Tool::PressTool => !part.flexible,
    }
}

fn threaded(class: FeatureClass) -> bool {
    matches!(class, FeatureClass::ThreadedHole | FeatureClass::ThreadedAxis)
}

/// What joins a feature: threads are turned, tapers and buckles pressed; plain fits
/// and slots slip in, and a ram does plain fits no harm.
fn joins(class: FeatureClass) -> Vec<EffectorAction> {
    match class {
        FeatureClass::ThreadedHole | FeatureClass::ThreadedAxis => vec![EffectorAction::Screw],
        FeatureClass::Cone | FeatureClass::Buckle => vec![EffectorAction::Press],
        FeatureClass::SmoothHole | FeatureClass::SmoothAxis => vec![EffectorAction::Seat, EffectorAction::Press],
        FeatureClass::Slot | FeatureClass::Other => vec![EffectorAction::Seat],
    }
}

fn person(cell: &Cell) -> PersonModel {
    let human = &cell.human;
    // People walk round everything that stands on the floor's level of the bench.
    let mut bench = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    for object in &cell.layout.fixed {
        let centre = object.base_from_object.translation.vector;
        for axis in 0..2 {
            bench[axis][0] = bench[axis][0].min(centre[axis] - object.half_extents[axis]);
            bench[axis][1] = bench[axis][1].max(centre[axis] + object.half_extents[axis]);
        }
    }
    PersonModel {
        rest: Vector3::from(human.rest),
        work: Vector3::from(human.work),
        focus: cell.layout.base_from_fixture.translation.vector,
        bench,
        walk_speed: human.walk_speed,
        hand_speed: human.reach_speed,
        reaction: human.reaction_s,
        assemble: human.assemble_s,
        inspect: human.inspect_s,
        spread: human.spread,
        intrusion_probability: human.intrusion_probability,
        decline_probability: human.decline_probability,
    }
}
