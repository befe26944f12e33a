//! A way across as joint positions one after another, and what becomes of it: a path that the arm need not stop on.
//!
//! ```text
//! positions ──▶ shortened ──▶ rounded off
//!               what can be   smooth, from rest or from
//!               left out is   the middle of a motion
//! ```
//!
//! **Rounding off.** Places at equal distances along the corners are drawn between their neighbours again and again;
//! they are the control points of the path. So the path stays near its corners, and its first three control points
//! alone decide how it begins: set from position and derivatives of another path, they make it go on from there.

use tandem_clearance::{Monitor, MotionSweep, Swept};
use tandem_kinematics::Chain;
use tandem_msg::JOINTS_MAX;

use super::Tools;
use super::tempo::at_its_tempo;
use crate::path::{CONTROLS, NODES_MAX, Path, PathPoint};
use crate::{Joints, Params};

/// Positions of a way: a rollout's start, its steps and its goal, and the piece of another path before them.
const POSITIONS: usize = tandem_policy::STEPS_MAX + 2 + LEAD;
/// Positions on the path that is left, from where a way leaves it to its first corner.
pub(super) const LEAD: usize = 4;
/// Looks that shortening may take; what is not shortened by then fails.
const LOOKS_MAX: u32 = 4_000;
/// What shortening may give away of the margin so as not to look too often, metres.
const RESOLUTION: f64 = 0.005;
/// Times that each place is drawn between its neighbours: the rounder, the faster and the farther off the corners.
const ROUNDINGS: [u32; 3] = [40, 12, 4];
/// A path that is hardly followed where it is left has no direction, joint movement per length.
const PACE_MIN: f64 = 0.05;

/// How the shortening stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shortened {
    More,
    /// The way is known by its corners.
    Done,
    Failed,
}

/// A way across.
pub(super) struct Way {
    positions: [Joints; POSITIONS],
    count: usize,
    /// Corners that are kept: indices of positions.
    corners: [usize; POSITIONS],
    corner_count: usize,
    /// Of them, those on the path that is left.
    lead: usize,
    /// Position that the last corner is being joined with.
    reach: usize,
    sweep: MotionSweep,
    sweeping: bool,
    looks: u32,
    /// How round the next path is.
    rounding: usize,
}

impl Way {
    pub(super) fn new() -> Self {
        Self {
            positions: [[0.0; JOINTS_MAX]; POSITIONS],
            count: 0,
            corners: [0; POSITIONS],
            corner_count: 0,
            lead: 0,
            reach: 0,
            sweep: MotionSweep::new(),
            sweeping: false,
            looks: 0,
            rounding: 0,
        }
    }

    /// Forgets it.
    pub(super) fn clear(&mut self) {
        self.lead = 0;
        self.restart();
    }

    /// From here on it leads elsewhere: what comes now is forgotten when it begins anew.
    pub(super) fn branch_off(&mut self) {
        self.lead = self.count;
    }

    /// Forgets all that came after it branched off.
    pub(super) fn restart(&mut self) {
        (self.count, self.corner_count, self.reach) = (self.lead, self.lead, 0);
        (self.sweeping, self.looks, self.rounding) = (false, 0, 0);
    }

    /// The next position, which is left out where it can be; false when there is no room.
    pub(super) fn pass(&mut self, position: &Joints) -> bool {
        let Some(slot) = self.positions.get_mut(self.count) else { return false };
        *slot = *position;
        self.count += 1;
        true
    }

    /// The next position, which is kept whatever can be left out; false when there is no room.
    pub(super) fn turn_at(&mut self, position: &Joints) -> bool {
        let index = self.count;
        let fits = self.pass(position);
        if fits {
            self.corners[self.corner_count] = index;
            self.corner_count += 1;
        }
        fits
    }

    /// All positions are there.
    pub(super) fn close(&mut self) {
        self.reach = self.count.saturating_sub(1);
    }

    /// One look of the shortening: from each corner straight to the goal, or to half as far, and so on, to the first of
    /// these that is clear.
    pub(super) fn shorten(&mut self, chain: &Chain, monitor: &Monitor, params: &Params) -> Shortened {
        let from = self.corners[self.corner_count.max(1) - 1];
        if from + 1 >= self.count {
            return Shortened::Done;
        }
        if self.looks >= LOOKS_MAX {
            return Shortened::Failed;
        }
        self.looks += 1;
        if !self.sweeping {
            let [start, end] = [from, self.reach].map(|index| self.positions[index.min(POSITIONS - 1)]);
            let margin = (params.path_margin - RESOLUTION).max(params.clearance_min);
            self.sweep.begin(monitor, &start, &end, margin, RESOLUTION);
            self.sweeping = true;
        }
        match self.sweep.look(chain, monitor) {
            Swept::More => return Shortened::More,
            Swept::Clear => {
                self.corners[self.corner_count.min(POSITIONS - 1)] = self.reach;
                self.corner_count += 1;
                self.reach = self.count - 1;
            }
            // A single step that is not clear between its looks.
            Swept::Blocked if self.reach == from + 1 => return Shortened::Failed,
            Swept::Blocked => self.reach = from + (self.reach - from) / 2,
        }
        self.sweeping = false;
        Shortened::More
    }

    /// Whether it was shortened to a straight motion of the joints, which is clear on all its length then.
    pub(super) fn is_straight(&self) -> bool {
        self.corner_count == 2
    }

    /// The next path through the corners, less rounded each time; `None` when there are no more. It begins at rest, or
    /// as a path at `start` goes on that is followed at `speed`, length per second; at a `share` of the arm's speed.
    pub(super) fn path(
        &mut self,
        tools: &Tools<'_>,
        start: Option<&PathPoint>,
        speed: f64,
        share: f64,
    ) -> Option<Path> {
        let corners = self.corners.get(..self.corner_count)?;
        let [first, last] = [corners.first()?, corners.last()?].map(|index| self.positions[*index]);
        if start.is_none() && corners.len() <= 2 {
            self.rounding += 1;
            return (self.rounding == 1).then(|| Path::line(&first, &last));
        }
        let roundings = *ROUNDINGS.get(self.rounding)?;
        self.rounding += 1;
        let around: f64 = corners.windows(2).map(|pair| self.stretch(pair)).sum();
        // A path that goes on from another one is followed as fast by its length as that one.
        let pace = start.map_or(1.0, |point| point.first.iter().fold(0.0, |pace: f64, q| pace.max(q.abs())));
        if !(around > 0.0 && pace > PACE_MIN) {
            return None;
        }
        let spacing = around / (NODES_MAX - 1) as f64;
        let mut controls = [last; CONTROLS];
        let (mut k, mut passed) = (0, 0.0);
        for (index, control) in controls.iter_mut().enumerate().take(NODES_MAX).skip(1) {
            let at = spacing * (index - 1) as f64;
            while k + 2 < corners.len() && at > passed + self.stretch(&corners[k..k + 2]) {
                passed += self.stretch(&corners[k..k + 2]);
                k += 1;
            }
            let share = ((at - passed) / self.stretch(&corners[k..k + 2]).max(1e-9)).clamp(0.0, 1.0);
            let [a, b] = [corners[k], corners[k + 1]].map(|index| self.positions[index]);
            *control = core::array::from_fn(|joint| a[joint] + share * (b[joint] - a[joint]));
        }
        let curve = round_off(&mut controls, start, around / pace, roundings);
        Some(at_its_tempo(tools, &curve, start, speed, share))
    }

    /// Largest movement of a joint between two corners.
    fn stretch(&self, pair: &[usize]) -> f64 {
        let ends = pair.first().zip(pair.last()).map(|(a, b)| [*a, *b].map(|index| &self.positions[index]));
        ends.map_or(0.0, |[a, b]| a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max))
    }
}

/// Draws each place but the ends so often between its neighbours, and a curve by all of them. It begins at the first one
/// or as a path at `start` goes on, and ends at the last.
pub(super) fn round_off(
    controls: &mut [Joints; CONTROLS],
    start: Option<&PathPoint>,
    length: f64,
    roundings: u32,
) -> Path {
    let kept = start.map_or(2, |point| Path::begin_as(controls, point, length));
    for _ in 0..roundings {
        let before = *controls;
        for (index, control) in controls.iter_mut().enumerate().take(NODES_MAX).skip(kept) {
            *control = core::array::from_fn(|joint| {
                0.25 * before[index - 1][joint] + 0.5 * before[index][joint] + 0.25 * before[index + 1][joint]
            });
        }
    }
    // The ends are the first and the last place themselves.
    let beyond = |end: &Joints, inner: &Joints| core::array::from_fn(|joint| 2.0 * end[joint] - inner[joint]);
    controls[CONTROLS - 1] = beyond(&controls[CONTROLS - 2], &controls[CONTROLS - 3]);
    if start.is_none() {
        controls[0] = beyond(&controls[1], &controls[2]);
    }
    Path::spline(controls, length)
}
