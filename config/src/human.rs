//! The person of the cell: where they stand and how they move.

use crate::read::{Bound, Table, bound};

const PLACE: Bound = bound("rest_m", "m", -5.0, 5.0);
const WORK: Bound = bound("work_m", "m", -5.0, 5.0);
const SHOULDER: Bound = bound("shoulder_height_m", "m", 0.8, 2.0);
const WALK: Bound = bound("walk_speed_m_s", "m/s", 0.1, 2.0);
const REACH: Bound = bound("reach_speed_m_s", "m/s", 0.1, 2.5);
const REACTION: Bound = bound("reaction_s", "s", 0.0, 60.0);
const ASSEMBLE: Bound = bound("assemble_s", "s", 0.1, 600.0);
const INSPECT: Bound = bound("inspect_s", "s", 0.1, 600.0);
const SPREAD: Bound = bound("spread", "", 0.0, 0.9);
const INTRUSION: Bound = bound("intrusion_probability", "", 0.0, 1.0);
const DECLINE: Bound = bound("decline_probability", "", 0.0, 1.0);
const SIGMA: Bound = bound("tracking_sigma_m", "m", 0.0, 0.2);

/// The person: the real one's places, and the habits of the simulated one.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Human {
    /// Ground point where they wait, metres, base frame.
    pub rest: [f64; 3],
    /// Ground point where they work at the bench, metres, base frame.
    pub work: [f64; 3],
    /// Height of the shoulder above the ground, metres.
    pub shoulder_height: f64,
    /// Walking speed, m/s.
    pub walk_speed: f64,
    /// Hand speed, m/s.
    pub reach_speed: f64,
    /// Mean time from a prompt to the first movement, s.
    pub reaction_s: f64,
    /// Mean time of assembling a part by hand, s.
    pub assemble_s: f64,
    /// Mean time of looking at something and answering, s.
    pub inspect_s: f64,
    /// Relative standard deviation of those times.
    pub spread: f64,
    /// Probability, per step of the robot, of stepping into its space.
    pub intrusion_probability: f64,
    /// Probability of declining a prompt.
    pub decline_probability: f64,
    /// Standard deviation of their tracked position, metres.
    pub tracking_sigma: f64,
}

impl Human {
    /// Where the shoulder is when they work at the bench, metres, base frame: the
    /// point from which Eq. (1) measures the distance to a part.
    pub fn working_shoulder(&self) -> [f64; 3] {
        [self.work[0], self.work[1], self.work[2] + self.shoulder_height]
    }

    pub(crate) fn read(cell: &Table<'_>) -> Option<Self> {
        let table = cell.table("human")?;
        Some(Self {
            rest: table.numbers(&PLACE),
            work: table.numbers(&WORK),
            shoulder_height: table.number(&SHOULDER),
            walk_speed: table.number(&WALK),
            reach_speed: table.number(&REACH),
            reaction_s: table.number(&REACTION),
            assemble_s: table.number(&ASSEMBLE),
            inspect_s: table.number(&INSPECT),
            spread: table.number(&SPREAD),
            intrusion_probability: table.number(&INTRUSION),
            decline_probability: table.number(&DECLINE),
            tracking_sigma: table.number(&SIGMA),
        })
    }
}
