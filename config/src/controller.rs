//! The `[controller]` table: limits, margins and the protective separation.
//!
//! Bounds that depend on one another are the controller's own to check; here each value
//! has its range, and [`Params::check`] has the last word on the whole.

use crate::read::{Bound, Table, bound};
use crate::timing::Timing;
use core::time::Duration;
use tandem_controller::{Params, SeparationParams, WALLS_MAX, Wall, Workspace};

const LATE: Bound = bound("late_command_periods", "periods", 1.0, 100.0);
const VALIDITY: Bound = bound("command_validity_ms", "ms", 2.0, 200.0);
const ARM_AGE: Bound = bound("arm_age_max_ms", "ms", 0.25, 100.0);
const HUMAN_AGE: Bound = bound("human_age_max_ms", "ms", 0.25, 500.0);
const SUPERVISOR_AGE: Bound = bound("supervisor_age_max_ms", "ms", 1.0, 2000.0);
const ENGAGE: Bound = bound("engage_timeout_ms", "ms", 10.0, 60_000.0);
const TRACKING: Bound = bound("tracking_error_max_rad", "rad", 0.001, 0.5);
const TOLERANCE: Bound = bound("joint_limit_tolerance_rad", "rad", 0.0, 0.2);
const TCP_SPEED: Bound = bound("tcp_speed_max_m_s", "m/s", 0.01, 3.0);
const LINE_SPEED: Bound = bound("line_speed_max_m_s", "m/s", 0.01, 3.0);
const PATH_MARGIN: Bound = bound("path_margin_m", "m", 0.0, 0.2);
const APPROACH_MARGIN: Bound = bound("approach_margin_m", "m", 0.0, 0.1);
const CLEARANCE: Bound = bound("clearance_min_m", "m", 0.0, 0.1);
const DEPART: Bound = bound("depart_distance_m", "m", 0.0, 0.5);
const TRANSIT: Bound = bound("transit_height_m", "m", -2.0, 2.0);
const RISE: Bound = bound("via_rise_m", "m", 0.0, 1.0);
const OFFSET: Bound = bound("via_offset_m", "m", 0.0, 1.0);
const WORK: Bound = bound("planning_work", "samples", 1.0, 100.0);
const SAMPLING: Bound = bound("sampling_looks_max", "looks", 0.0, 1e7);
const RENEWAL: Bound = bound("renewal_period_ms", "ms", 0.0, 10_000.0);
const SETTLE: Bound = bound("settle_ms", "ms", 0.0, 2000.0);
const ACTION: Bound = bound("action_timeout_ms", "ms", 10.0, 600_000.0);
const LOST: Bound = bound("part_lost_after_ms", "ms", 0.25, 10_000.0);
const REDUCED: Bound = bound("reduced_speed_max_m_s", "m/s", 0.01, 1.0);
const REDUCED_WITHIN: Bound = bound("reduced_within_m", "m", 0.0, 10.0);
const RECOVERY: Bound = bound("recovery_speed_max_m_s", "m/s", 0.001, 0.25);
const CORNER: Bound = bound("", "m", -5.0, 5.0);
const DIRECTION: Bound = bound("inwards", "", -1.0, 1.0);
const REACTION: Bound = bound("reaction_time_ms", "ms", 0.0, 500.0);
const HUMAN_SPEED: Bound = bound("human_speed_min_m_s", "m/s", 0.0, 3.0);
const HUMAN_SPEED_NEAR: Bound = bound("human_speed_near_m_s", "m/s", 0.0, 4.0);
const NEAR: Bound = bound("near_distance_m", "m", 0.0, 2.0);
const INTRUSION: Bound = bound("intrusion_m", "m", 0.0, 1.0);
const SIGMAS: Bound = bound("sigma_factor", "sigma", 0.0, 6.0);
const UNCERTAINTY: Bound = bound("arm_uncertainty_m", "m", 0.0, 0.1);
const RESERVE: Bound = bound("reserve_m", "m", 0.0, 0.5);
const HYSTERESIS: Bound = bound("hysteresis_m", "m", 0.0, 0.5);
const SPEED_UP: Bound = bound("speed_up_delay_ms", "ms", 0.0, 60_000.0);
const RESUME: Bound = bound("resume_delay_ms", "ms", 0.0, 60_000.0);

/// Reads the table; a value that does not stand there has the controller's default.
/// The resting configuration and the configuration's hash are filled in by the cell.
pub(crate) fn read(cell: &Table<'_>, timing: &Timing) -> Params {
    let default = Params { period: timing.controller.period, ..Params::default() };
    if !cell.has("controller") {
        return default;
    }
    let Some(table) = cell.table("controller") else { return default };
    let number = |bound: &Bound, absent: f64| table.number_or(bound, absent);
    let time = |bound: &Bound, absent: Duration| {
        Duration::from_secs_f64(table.number_or(bound, absent.as_secs_f64() * 1e3) / 1e3)
    };
    let params = Params {
        late_command_periods: number(&LATE, default.late_command_periods.into()) as u32,
        command_validity: time(&VALIDITY, default.command_validity),
        arm_age_max: time(&ARM_AGE, default.arm_age_max),
        human_age_max: time(&HUMAN_AGE, default.human_age_max),
        supervisor_age_max: time(&SUPERVISOR_AGE, default.supervisor_age_max),
        engage_timeout: time(&ENGAGE, default.engage_timeout),
        tracking_error_max: number(&TRACKING, default.tracking_error_max),
        joint_limit_tolerance: number(&TOLERANCE, default.joint_limit_tolerance),
        tcp_speed_max: number(&TCP_SPEED, default.tcp_speed_max),
        line_speed_max: number(&LINE_SPEED, default.line_speed_max),
        path_margin: number(&PATH_MARGIN, default.path_margin),
        approach_margin: number(&APPROACH_MARGIN, default.approach_margin),
        clearance_min: number(&CLEARANCE, default.clearance_min),
        depart_distance: number(&DEPART, default.depart_distance),
        transit_height: number(&TRANSIT, default.transit_height),
        via_rise: number(&RISE, default.via_rise),
        via_offset: number(&OFFSET, default.via_offset),
        planning_work: number(&WORK, f64::from(default.planning_work)) as u32,
        sampling_looks_max: number(&SAMPLING, f64::from(default.sampling_looks_max)) as u32,
        renewal_period: time(&RENEWAL, default.renewal_period),
        settle: time(&SETTLE, default.settle),
        action_timeout: time(&ACTION, default.action_timeout),
        part_lost_after: time(&LOST, default.part_lost_after),
        reduced_speed_max: number(&REDUCED, default.reduced_speed_max),
        reduced_within: number(&REDUCED_WITHIN, default.reduced_within),
        recovery_speed_max: number(&RECOVERY, default.recovery_speed_max),
        workspace: workspace(&table),
        separation: separation(&table, &default.separation),
        resume_after_separation: if table.has("resume_after_separation") {
            table.flag("resume_after_separation")
        } else {
            default.resume_after_separation
        },
        ..default
    };
    if let Err(error) = params.check() {
        // What is left now are values that do not fit together.
        for value in error.0 {
            let key = table.key_beginning_with(value.field).unwrap_or_else(|| value.field.to_owned());
            let [min, max] = value.allowed;
            let (found, allowed) = (format!("{} {}", value.value, value.unit), format!("{min}..={max} {}", value.unit));
            table.refuse(&key, &found, &allowed, "choose values that fit together");
        }
    }
    params
}

/// `[controller.workspace]`: a box by two corners, and any further walls.
fn workspace(controller: &Table<'_>) -> Workspace {
    if !controller.has("workspace") {
        return Workspace::default();
    }
    let Some(table) = controller.table("workspace") else { return Workspace::default() };
    let walls = table.tables("wall");
    let walls: Vec<_> = walls
        .iter()
        .map(|wall| {
            let point = wall.numbers(&Bound { key: "point_m", ..CORNER });
            let inwards: [f64; 3] = wall.numbers(&DIRECTION);
            if inwards.iter().all(|x| x.abs() < 1e-6) {
                wall.refuse(DIRECTION.key, "no direction", "a vector that is not 0", "point it into the workspace");
            }
            Wall { point, inwards }
        })
        .collect();
    let around = if table.has("min_m") || table.has("max_m") {
        let [min, max] = ["min_m", "max_m"].map(|key| table.numbers::<3>(&Bound { key, ..CORNER }));
        let inside = Workspace::within(min, max);
        if inside.is_none() {
            let found = format!("{max:?} m");
            table.refuse("max_m", &found, &format!("above min_m = {min:?} m"), "swap or move the corners");
        }
        inside.unwrap_or_default()
    } else {
        Workspace::default()
    };
    around.and(&walls).unwrap_or_else(|| {
        let found = format!("{} walls", around.walls().len() + walls.len());
        let allowed = format!("0..={WALLS_MAX} walls, six of them the box");
        table.refuse("wall", &found, &allowed, "leave out those that nothing reaches");
        around
    })
}

fn separation(controller: &Table<'_>, default: &SeparationParams) -> SeparationParams {
    if !controller.has("separation") {
        return *default;
    }
    let Some(table) = controller.table("separation") else { return *default };
    let time = |bound: &Bound, absent: Duration| {
        Duration::from_secs_f64(table.number_or(bound, absent.as_secs_f64() * 1e3) / 1e3)
    };
    SeparationParams {
        reaction_time: time(&REACTION, default.reaction_time),
        human_speed_min: table.number_or(&HUMAN_SPEED, default.human_speed_min),
        human_speed_near: table.number_or(&HUMAN_SPEED_NEAR, default.human_speed_near),
        near_distance: table.number_or(&NEAR, default.near_distance),
        intrusion: table.number_or(&INTRUSION, default.intrusion),
        sigma_factor: table.number_or(&SIGMAS, default.sigma_factor),
        arm_uncertainty: table.number_or(&UNCERTAINTY, default.arm_uncertainty),
        reserve: table.number_or(&RESERVE, default.reserve),
        hysteresis: table.number_or(&HYSTERESIS, default.hysteresis),
        speed_up_delay: time(&SPEED_UP, default.speed_up_delay),
        resume_delay: time(&RESUME, default.resume_delay),
        recede: if table.has("recede") { table.flag("recede") } else { default.recede },
    }
}
