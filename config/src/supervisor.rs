//! What the supervisor knows of its subjects, and how patient it is.

use crate::read::{Bound, Table, bound};

const REACH_HUMAN: Bound = bound("human_reach_m", "m", 0.1, 5.0);
const LOAD_HUMAN: Bound = bound("human_load_kg", "kg", 0.1, 50.0);
const REACH_ROBOT: Bound = bound("robot_reach_m", "m", 0.1, 5.0);
const LOAD_ROBOT: Bound = bound("robot_load_kg", "kg", 0.1, 500.0);

const ATTEMPTS: Bound = bound("attempts_max", "", 1.0, 10.0);
const RESET_AFTER: Bound = bound("reset_after_s", "s", 0.1, 60.0);
const RESETS: Bound = bound("resets_max", "", 0.0, 1000.0);
const APPROACH: Bound = bound("approach_m", "m", 0.02, 0.4);
const RETRACT: Bound = bound("retract_m", "m", 0.02, 0.4);
const HOVER: Bound = bound("hover_m", "m", 0.02, 0.4);
const SPEED: Bound = bound("speed_free", "", 0.01, 1.0);
const SPEED_CARRY: Bound = bound("speed_carry", "", 0.01, 1.0);
const SPEED_NEAR: Bound = bound("speed_near", "", 0.01, 1.0);
const START: Bound = bound("start_s", "s", 1.0, 600.0);
const PRESENT: Bound = bound("present_s", "s", 0.1, 600.0);
const RECOGNISE: Bound = bound("recognise_s", "s", 0.1, 600.0);
const MOTION: Bound = bound("motion_s", "s", 1.0, 3600.0);
const ANSWER: Bound = bound("answer_s", "s", 1.0, 86_400.0);
const JOURNAL: Bound = bound("journal_s", "s", 0.1, 600.0);
const RECOVERY: Bound = bound("recovery_s", "s", 0.1, 600.0);

/// What the two subjects can do: the constants of Eq. (1) and (2).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capability {
    /// Grasping range of the person, metres (R_h).
    pub human_reach: f64,
    /// Grasping load of the person, kg (L_h).
    pub human_load: f64,
    /// Grasping range of the robot, metres (R_r).
    pub robot_reach: f64,
    /// Grasping load of the robot, kg (L_r).
    pub robot_load: f64,
    /// Whether a harmful part may be given to a person.
    pub harmful_by_hand: bool,
}

/// How long each wait may last, seconds; past it the wait is a fault, never a hang.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timeouts {
    /// All roles up, from the start.
    pub start_s: f64,
    /// A request to the peripherals.
    pub present_s: f64,
    /// A recognition after a scan.
    pub recognise_s: f64,
    /// One motion with its final action, standing time excluded.
    pub motion_s: f64,
    /// A person's answer.
    pub answer_s: f64,
    /// The journal's commit of an entry.
    pub journal_s: f64,
    /// A lost role's return.
    pub recovery_s: f64,
}

/// The supervisor's policy.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Supervisor {
    /// Constants of the capability check.
    pub capability: Capability,
    /// Waits.
    pub timeouts: Timeouts,
    /// Attempts at a step before a person takes over.
    pub attempts_max: u32,
    /// A stop that may reset itself does so when its cause has been gone this long, s.
    pub reset_after_s: f64,
    /// Resets of that kind in one step before a person must inspect.
    pub resets_max: u32,
    /// Straight way down to a grasp, metres.
    pub approach: f64,
    /// Straight way up after an action, metres.
    pub retract: f64,
    /// Height above its place at which a carried part arrives, metres.
    pub hover: f64,
    /// Share of the arm's limits without a part.
    pub speed_free: f64,
    /// Share of the arm's limits with one.
    pub speed_carry: f64,
    /// Share of the arm's limits on the way down into the box.
    pub speed_near: f64,
}

impl Supervisor {
    pub(crate) fn read(cell: &Table<'_>) -> Option<Self> {
        let table = cell.table("supervisor")?;
        let capability = table.table("capability")?;
        let timeouts = table.table("timeout")?;
        Some(Self {
            capability: Capability {
                human_reach: capability.number(&REACH_HUMAN),
                human_load: capability.number(&LOAD_HUMAN),
                robot_reach: capability.number(&REACH_ROBOT),
                robot_load: capability.number(&LOAD_ROBOT),
                harmful_by_hand: capability.flag("harmful_by_hand"),
            },
            timeouts: Timeouts {
                start_s: timeouts.number(&START),
                present_s: timeouts.number(&PRESENT),
                recognise_s: timeouts.number(&RECOGNISE),
                motion_s: timeouts.number(&MOTION),
                answer_s: timeouts.number(&ANSWER),
                journal_s: timeouts.number(&JOURNAL),
                recovery_s: timeouts.number(&RECOVERY),
            },
            attempts_max: table.whole(&ATTEMPTS),
            reset_after_s: table.number(&RESET_AFTER),
            resets_max: table.whole(&RESETS),
            approach: table.number(&APPROACH),
            retract: table.number(&RETRACT),
            hover: table.number(&HOVER),
            speed_free: table.number(&SPEED),
            speed_carry: table.number(&SPEED_CARRY),
            speed_near: table.number(&SPEED_NEAR),
        })
    }
}
