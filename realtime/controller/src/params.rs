//! Parameters of the role, and the range of every one of them.

use core::f64::consts::TAU;
use core::fmt;
use core::time::Duration;

use tandem_msg::JOINTS_MAX;

use crate::Workspace;

/// Everything the controller is told about its cell besides the arm itself.
///
/// The values are plain; [`Params::check`] says which of them are out of range
/// and [`crate::Controller::new`] refuses a set that fails it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Params {
    /// Hash of the cell's configuration; samples that carry another are refused.
    pub config_hash: u64,
    /// Time from one cycle to the next.
    pub period: Duration,
    /// A command older than so many periods makes the arm slow down; a newer one lets it catch up.
    pub late_command_periods: u32,
    /// How long the arm may act on a command; after that it brakes to a standstill.
    pub command_validity: Duration,
    /// Oldest arm state that may be acted on.
    pub arm_age_max: Duration,
    /// Oldest tracked person that may be acted on.
    pub human_age_max: Duration,
    /// Oldest word of the supervisor that may be acted on.
    pub supervisor_age_max: Duration,
    /// The arm may take this long to answer after its brakes are released.
    pub engage_timeout: Duration,
    /// Resting configuration, rad.
    pub home: [f64; JOINTS_MAX],
    /// Largest difference between commanded and measured position of a joint, rad.
    pub tracking_error_max: f64,
    /// How far outside its limits a joint may be measured, rad.
    pub joint_limit_tolerance: f64,
    /// Largest speed of the TCP on the way across, m/s.
    pub tcp_speed_max: f64,
    /// Largest speed of the TCP on straight stretches (depart, approach, retract), m/s.
    pub line_speed_max: f64,
    /// Clearance a planned path keeps on the way across, metres.
    pub path_margin: f64,
    /// Clearance a planned path keeps on straight stretches, metres.
    pub approach_margin: f64,
    /// Clearance below which a moving arm is stopped, metres. Below both margins.
    pub clearance_min: f64,
    /// Length of the straight withdrawal before a transfer, metres.
    pub depart_distance: f64,
    /// Height of the TCP above the base that a vertical withdrawal aims at, metres.
    pub transit_height: f64,
    /// How far above start and goal the raised via points stand, metres.
    pub via_rise: f64,
    /// How far to the side the lateral via points stand, metres.
    pub via_offset: f64,
    /// Inverse-kinematics solutions and clearance samples the planner may take in one cycle.
    pub planning_work: u32,
    /// Looks at the scene that the sampling planner may take for a motion when no hand-designed path is
    /// clear; it takes eight in the time of a sample. 0 = it is not asked.
    pub sampling_looks_max: u32,
    /// Time from one look for a better way to the next while the arm follows one across; 0 = it keeps to what was
    /// planned at rest.
    pub renewal_period: Duration,
    /// Time at rest before the tool acts, for the arm to settle.
    pub settle: Duration,
    /// How long the tool may take for an action.
    pub action_timeout: Duration,
    /// How long the part-presence sensor may be dark before a carried part counts as lost.
    pub part_lost_after: Duration,
    /// Where the arm may be.
    pub workspace: Workspace,
    /// Largest speed of the TCP in reduced mode, m/s.
    pub reduced_speed_max: f64,
    /// Distance to a person within which the mode is reduced, metres; 0 = only when asked for.
    pub reduced_within: f64,
    /// Largest speed of the TCP in recovery mode, m/s.
    pub recovery_speed_max: f64,
    /// Mass of all that moves of the arm, kg: bounds its speed where it may touch a person.
    pub moving_mass: f64,
    /// Protective separation.
    pub separation: SeparationParams,
    /// Whether a stop for separation ends by itself once the person has left; every other cause needs a reset.
    pub resume_after_separation: bool,
}

/// Terms of the protective separation distance, ISO/TS 15066 clause 5.5.4:
/// `S_p = S_h + S_r + S_s + C + Z_d + Z_r`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeparationParams {
    /// `T_r`: from a person's movement to the first changed command, without the age of the sample, which is added.
    pub reaction_time: Duration,
    /// Speed towards the arm that every person is credited with, m/s; a measured closing speed counts when higher.
    pub human_speed_min: f64,
    /// The same within `near_distance` of the arm, m/s (ISO 13855: 2.0 m/s up to 0.5 m).
    pub human_speed_near: f64,
    /// Distance up to which people are credited with `human_speed_near`, metres.
    pub near_distance: f64,
    /// `C`: how far a limb may reach before it is tracked, metres.
    pub intrusion: f64,
    /// `Z_d`: standard deviations of the tracked position that are added.
    pub sigma_factor: f64,
    /// `Z_r`: uncertainty of the arm's own position, metres.
    pub arm_uncertainty: f64,
    /// Kept on top by speed scaling, so that the arm slows before it must stop, metres.
    pub reserve: f64,
    /// Further distance before the arm speeds up again, metres.
    pub hysteresis: f64,
    /// How long that distance must last before the arm speeds up again.
    pub speed_up_delay: Duration,
    /// How long the distance must suffice before an arm at rest starts again.
    pub resume_delay: Duration,
    /// Whether a link owes nothing to a body part it moves away from and which does not follow it.
    pub recede: bool,
}

impl Default for SeparationParams {
    fn default() -> Self {
        Self {
            reaction_time: Duration::from_millis(10),
            human_speed_min: 1.6,
            human_speed_near: 2.0,
            near_distance: 0.5,
            intrusion: 0.03,
            sigma_factor: 3.0,
            arm_uncertainty: 0.005,
            reserve: 0.03,
            hysteresis: 0.04,
            speed_up_delay: Duration::from_millis(100),
            resume_delay: Duration::from_millis(200),
            recede: true,
        }
    }
}

impl Default for Params {
    /// Values fit for a UR10-class arm on a bench.
    fn default() -> Self {
        Self {
            config_hash: 0,
            period: Duration::from_millis(1),
            late_command_periods: 2,
            command_validity: Duration::from_millis(20),
            arm_age_max: Duration::from_millis(10),
            human_age_max: Duration::from_millis(50),
            supervisor_age_max: Duration::from_millis(100),
            engage_timeout: Duration::from_secs(1),
            home: [0.0, -1.57, 1.57, -1.57, -1.57, 0.0, 0.0, 0.0],
            tracking_error_max: 0.06,
            joint_limit_tolerance: 0.02,
            tcp_speed_max: 1.2,
            line_speed_max: 0.4,
            path_margin: 0.015,
            approach_margin: 0.004,
            clearance_min: 0.002,
            depart_distance: 0.10,
            transit_height: 0.40,
            via_rise: 0.20,
            via_offset: 0.25,
            planning_work: 4,
            sampling_looks_max: 300_000,
            renewal_period: Duration::from_millis(100),
            settle: Duration::from_millis(30),
            action_timeout: Duration::from_secs(20),
            part_lost_after: Duration::from_millis(100),
            workspace: Workspace::default(),
            reduced_speed_max: 0.25,
            reduced_within: 0.0,
            recovery_speed_max: 0.05,
            moving_mass: 20.0,
            separation: SeparationParams::default(),
            resume_after_separation: true,
        }
    }
}

/// One value outside its range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OutOfRange {
    /// The field, as it stands in [`Params`].
    pub field: &'static str,
    /// What was found, in `unit`.
    pub value: f64,
    /// What is allowed, both ends included.
    pub allowed: [f64; 2],
    /// Unit of the three numbers.
    pub unit: &'static str,
}

impl fmt::Display for OutOfRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [min, max] = self.allowed;
        write!(f, "controller.{} = {} {}, allowed {min}..={max} {}", self.field, self.value, self.unit, self.unit)
    }
}

/// Why a set of parameters is refused: every value out of range, not only the first.
#[derive(Clone, Debug, PartialEq)]
pub struct ParamsError(
    /// The values, in the order of the fields.
    #[allow(clippy::disallowed_types, reason = "made before the first cycle")]
    pub Vec<OutOfRange>,
);

impl fmt::Display for ParamsError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, value) in self.0.iter().enumerate() {
            if index > 0 {
                f.write_str("\n")?;
            }
            write!(f, "{value}")?;
        }
        Ok(())
    }
}

impl std::error::Error for ParamsError {}

impl Params {
    /// Compares every value with its range.
    ///
    /// # Errors
    /// All values that are out of range, together.
    #[allow(clippy::disallowed_types, reason = "made before the first cycle")]
    pub fn check(&self) -> Result<(), ParamsError> {
        let mut found = Vec::new();
        let mut value = |field, value: f64, min: f64, max: f64, unit| {
            if !(min..=max).contains(&value) {
                found.push(OutOfRange { field, value, allowed: [min, max], unit });
            }
        };
        let ms = |duration: Duration| duration.as_secs_f64() * 1e3;
        value("period", ms(self.period), 0.1, 10.0, "ms");
        value("late_command_periods", self.late_command_periods.into(), 1.0, 100.0, "periods");
        let late = f64::from(self.late_command_periods) * ms(self.period);
        value("command_validity", ms(self.command_validity), late + ms(self.period), 200.0, "ms");
        value("arm_age_max", ms(self.arm_age_max), ms(self.period), 100.0, "ms");
        value("human_age_max", ms(self.human_age_max), ms(self.period), 500.0, "ms");
        value("supervisor_age_max", ms(self.supervisor_age_max), ms(self.period), 2_000.0, "ms");
        value("engage_timeout", ms(self.engage_timeout), 10.0, 60_000.0, "ms");
        for position in self.home {
            value("home", position, -TAU, TAU, "rad");
        }
        value("tracking_error_max", self.tracking_error_max, 0.001, 0.5, "rad");
        value("joint_limit_tolerance", self.joint_limit_tolerance, 0.0, 0.2, "rad");
        value("tcp_speed_max", self.tcp_speed_max, 0.01, 3.0, "m/s");
        value("line_speed_max", self.line_speed_max, 0.01, 3.0, "m/s");
        value("clearance_min", self.clearance_min, 0.0, 0.1, "m");
        value("approach_margin", self.approach_margin, self.clearance_min, 0.1, "m");
        value("path_margin", self.path_margin, self.approach_margin, 0.2, "m");
        value("depart_distance", self.depart_distance, 0.0, 0.5, "m");
        value("transit_height", self.transit_height, -2.0, 2.0, "m");
        value("via_rise", self.via_rise, 0.0, 1.0, "m");
        value("via_offset", self.via_offset, 0.0, 1.0, "m");
        value("planning_work", f64::from(self.planning_work), 1.0, 100.0, "samples");
        value("sampling_looks_max", f64::from(self.sampling_looks_max), 0.0, 1e7, "looks");
        value("renewal_period", ms(self.renewal_period), 0.0, 10_000.0, "ms");
        value("settle", ms(self.settle), 0.0, 2_000.0, "ms");
        value("action_timeout", ms(self.action_timeout), 10.0, 600_000.0, "ms");
        value("part_lost_after", ms(self.part_lost_after), ms(self.period), 10_000.0, "ms");
        value("reduced_speed_max", self.reduced_speed_max, 0.01, 1.0, "m/s");
        value("reduced_within", self.reduced_within, 0.0, 10.0, "m");
        value("recovery_speed_max", self.recovery_speed_max, 0.001, 0.25, "m/s");
        value("moving_mass", self.moving_mass, 0.1, 2_000.0, "kg");
        let separation = &self.separation;
        value("separation.reaction_time", ms(separation.reaction_time), 0.0, 500.0, "ms");
        value("separation.human_speed_min", separation.human_speed_min, 0.0, 3.0, "m/s");
        let faster = separation.human_speed_min;
        value("separation.human_speed_near", separation.human_speed_near, faster, 4.0, "m/s");
        value("separation.near_distance", separation.near_distance, 0.0, 2.0, "m");
        value("separation.intrusion", separation.intrusion, 0.0, 1.0, "m");
        value("separation.sigma_factor", separation.sigma_factor, 0.0, 6.0, "sigma");
        value("separation.arm_uncertainty", separation.arm_uncertainty, 0.0, 0.1, "m");
        value("separation.reserve", separation.reserve, 0.0, 0.5, "m");
        value("separation.hysteresis", separation.hysteresis, 0.0, 0.5, "m");
        value("separation.speed_up_delay", ms(separation.speed_up_delay), 0.0, 60_000.0, "ms");
        value("separation.resume_delay", ms(separation.resume_delay), 0.0, 60_000.0, "ms");
        if found.is_empty() { Ok(()) } else { Err(ParamsError(found)) }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::disallowed_types, reason = "a test may allocate")]
    use super::*;

    #[test]
    fn the_defaults_pass() {
        assert_eq!(Params::default().check(), Ok(()));
    }

    /// Two faults, one of them not a number: both are named, with value and range.
    #[test]
    fn every_value_out_of_range_is_listed() {
        let params = Params { tcp_speed_max: f64::NAN, clearance_min: 0.5, ..Params::default() };
        let error = params.check().expect_err("two values are out of range");
        let fields: Vec<_> = error.0.iter().map(|value| value.field).collect();
        // A minimum above a margin makes the margin's own range empty, so that is named as well.
        assert_eq!(fields, ["tcp_speed_max", "clearance_min", "approach_margin"]);
        assert!(error.to_string().contains("controller.clearance_min = 0.5 m, allowed 0..=0.1 m"), "{error}");
    }
}
