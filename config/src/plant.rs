//! Habits of the simulated hardware: tolerances, times and noise.

use crate::read::{Bound, Table, bound};

const PLACEMENT: Bound = bound("placement_sigma_m", "m", 0.0, 0.02);
const PLACEMENT_TURN: Bound = bound("placement_sigma_rad", "rad", 0.0, 0.2);
const GRASP: Bound = bound("grasp_tolerance_m", "m", 0.001, 0.05);
const GRASP_TURN: Bound = bound("grasp_tolerance_rad", "rad", 0.01, 0.5);
const JOINT_NOISE: Bound = bound("joint_noise_rad", "rad", 0.0, 0.001);
const NEW_BOX: Bound = bound("new_box_s", "s", 0.0, 60.0);
const PRESENT: Bound = bound("present_s", "s", 0.0, 60.0);
const SCAN: Bound = bound("scan_s", "s", 0.0, 10.0);
const COUPLE: Bound = bound("couple_s", "s", 0.0, 20.0);
const GRIP: Bound = bound("grasp_s", "s", 0.0, 20.0);
const SEAT: Bound = bound("seat_s", "s", 0.0, 20.0);
const SCREW: Bound = bound("screw_s", "s", 0.0, 60.0);
const PRESS: Bound = bound("press_s", "s", 0.0, 60.0);

/// The simulated hardware.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Plant {
    /// Standard deviation of where a part lies on its carrier, metres in each of x and y.
    pub placement_sigma: f64,
    /// Standard deviation of how it is turned there, radians about z.
    pub placement_sigma_rad: f64,
    /// A grasp succeeds within this distance of the true grasp point, metres.
    pub grasp_tolerance: f64,
    /// And within this angle, radians.
    pub grasp_tolerance_rad: f64,
    /// Standard deviation of a measured joint position, radians.
    pub joint_noise: f64,
    /// Time to bring an empty fixture, s.
    pub new_box_s: f64,
    /// Time to bring a part to its station, s.
    pub present_s: f64,
    /// Time to scan it, s.
    pub scan_s: f64,
    /// Time to couple or leave a tool, s.
    pub couple_s: f64,
    /// Time to take or let go of a part, s.
    pub grasp_s: f64,
    /// Time to seat a part, s.
    pub seat_s: f64,
    /// Time to turn a thread home, s.
    pub screw_s: f64,
    /// Time to press a part home, s.
    pub press_s: f64,
}

impl Plant {
    pub(crate) fn read(cell: &Table<'_>) -> Option<Self> {
        let table = cell.table("plant")?;
        Some(Self {
            placement_sigma: table.number(&PLACEMENT),
            placement_sigma_rad: table.number(&PLACEMENT_TURN),
            grasp_tolerance: table.number(&GRASP),
            grasp_tolerance_rad: table.number(&GRASP_TURN),
            joint_noise: table.number(&JOINT_NOISE),
            new_box_s: table.number(&NEW_BOX),
            present_s: table.number(&PRESENT),
            scan_s: table.number(&SCAN),
            couple_s: table.number(&COUPLE),
            grasp_s: table.number(&GRIP),
            seat_s: table.number(&SEAT),
            screw_s: table.number(&SCREW),
            press_s: table.number(&PRESS),
        })
    }
}
