//! From the files of a cell to the plant's own terms: what the hardware is and how well it works.

use core::time::Duration;

use nalgebra::{Isometry3, Vector3};
use tandem_config::{Body, Cell, FixedObject, Part};
use tandem_kinematics::{Chain, JointKind};
use tandem_msg::{Coded, EffectorAction, FeatureClass, JOINTS_MAX, Tool};

use super::arm::{ArmModel, JointModel, LinkMass};
use super::effector::{EffectorModel, GRIPPER_OPENING};
use super::human::PersonModel;
use super::parts::{Block, PartModel};
use super::referee::{ArmCapsule, Kind, Obstacle};
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
    pub(super) capsules: Vec<ArmCapsule>,
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

/// The arm of a cell: chain, mass of each moving link, capsules around them, joints at rest.
pub(super) struct Robot {
    pub(super) chain: Chain,
    pub(super) links: Vec<LinkMass>,
    pub(super) capsules: Vec<ArmCapsule>,
    pub(super) home: [f64; JOINTS_MAX],
}

impl PlantModel {
    pub(super) fn of(cell: &Cell, robot: &Robot) -> Self {
        let base_from_fixture = cell.layout.base_from_fixture;
        Self {
            arm: arm(robot),
            capsules: robot.capsules.clone(),
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
        }
    }
}

fn arm(robot: &Robot) -> ArmModel {
    let joints = robot.chain.joints().iter().zip(&robot.links).map(|(joint, link)| JointModel {
        parent_from_joint: joint.parent_from_joint,
        axis: joint.axis,
        prismatic: joint.kind == JointKind::Prismatic,
        position: [joint.position_min, joint.position_max],
        velocity_max: joint.velocity_max,
        acceleration_max: joint.acceleration_max,
        effort_max: joint.effort_max,
        link: *link,
    });
    ArmModel { joints: joints.collect(), flange_from_tcp: *robot.chain.tool(), home: robot.home }
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

/// The arm of a cell.
pub(super) fn robot(_cell: &Cell) -> Result<Robot, super::PlantError> {
    use nalgebra::{Matrix3, Translation3, UnitQuaternion};
    use tandem_kinematics::Joint;
    let half = core::f64::consts::FRAC_PI_2;
    let rows = [
        ([0.0, 0.0, 0.1273], 0.0, Vector3::z_axis(), 7.778, [0.0, 0.0, 0.0]),
        ([0.0, 0.220941, 0.0], half, Vector3::y_axis(), 12.93, [0.0, 0.0, 0.306]),
        ([0.0, -0.1719, 0.612], 0.0, Vector3::y_axis(), 3.87, [0.0, 0.0, 0.28615]),
        ([0.0, 0.0, 0.5723], half, Vector3::y_axis(), 1.96, [0.0, 0.0, 0.0]),
        ([0.0, 0.1149, 0.0], 0.0, Vector3::z_axis(), 1.96, [0.0, 0.0, 0.0]),
        ([0.0, 0.0, 0.1157], 0.0, Vector3::y_axis(), 0.202, [0.0, 0.0, 0.0]),
    ];
    let mut joints = Vec::new();
    let mut links = Vec::new();
    for (xyz, pitch, axis, mass, centre) in rows {
        joints.push(Joint {
            kind: JointKind::Revolute,
            parent_from_joint: Isometry3::from_parts(
                Translation3::from(Vector3::from(xyz)),
                UnitQuaternion::from_axis_angle(&Vector3::y_axis(), pitch),
            ),
            axis,
            position_min: -6.2,
            position_max: 6.2,
            velocity_max: 2.16,
            acceleration_max: 8.0,
            jerk_max: 80.0,
            effort_max: 330.0,
        });
        links.push(LinkMass { mass, centre: Vector3::from(centre), inertia: Matrix3::identity() * (0.01 * mass) });
    }
    let tool =
        Isometry3::from_parts(Translation3::new(0.0, 0.0922, 0.0), UnitQuaternion::from_euler_angles(-half, 0.0, 0.0))
            * Translation3::new(0.0, 0.0, 0.2);
    let chain = Chain::new(&joints, tool).expect("stand-in");
    let c = |link, a: [f64; 3], b: [f64; 3], radius| ArmCapsule { link, ends: [a.into(), b.into()], radius };
    let capsules = vec![
        c(2, [0.0, 0.0, 0.0], [0.0, 0.0, 0.612], 0.08),
        c(3, [0.0, 0.0, 0.0], [0.0, 0.0, 0.5723], 0.065),
        c(4, [0.0, 0.0, 0.0], [0.0, 0.1149, 0.0], 0.05),
        c(5, [0.0, 0.0, 0.0], [0.0, 0.0, 0.1157], 0.05),
        c(6, [0.0, 0.05, 0.0], [0.0, 0.24, 0.0], 0.04),
    ];
    let home = [0.0, -half, half, -half, -half, 0.0, 0.0, 0.0];
    Ok(Robot { chain, links, capsules, home })
}
