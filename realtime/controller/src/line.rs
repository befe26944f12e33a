//! Straight stretches of the TCP: joint positions along a line in space, one inverse-kinematics solution at a time.

use nalgebra::{Isometry3, Translation3};
use tandem_kinematics::{Chain, IkFailure};
use tandem_msg::JOINTS_MAX;

use crate::Joints;
use crate::path::{NODES_MAX, Path};

/// Distance between neighbouring nodes, metres: the curve between them leaves the line by micrometres.
const SPACING: f64 = 0.012;
/// Turning between neighbouring nodes, rad.
const TURN_SPACING: f64 = 0.05;
/// A joint that moves farther between two nodes has changed the branch, rad.
const BRANCH_JUMP: f64 = 0.35;
/// Lines shorter than this are points, metres.
const SHORTEST: f64 = 1e-6;
/// Length that stands for a turn of one radian without travel, metres.
const TURN_LENGTH: f64 = 0.2;

/// A line under construction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line {
    from: Isometry3<f64>,
    to: Isometry3<f64>,
    nodes: [Joints; NODES_MAX],
    count: usize,
    done: usize,
    backward: bool,
    length: f64,
}

impl Line {
    fn new(from: &Isometry3<f64>, to: &Isometry3<f64>, known: &Joints, backward: bool) -> Self {
        let travel = (to.translation.vector - from.translation.vector).norm();
        let turn = from.rotation.angle_to(&to.rotation);
        let length = travel.max(turn * TURN_LENGTH);
        let intervals = (travel / SPACING).max(turn / TURN_SPACING).ceil();
        let count = if length < SHORTEST { 2 } else { (intervals as usize + 1).clamp(5, NODES_MAX) };
        let mut line =
            Self { from: *from, to: *to, nodes: [[0.0; JOINTS_MAX]; NODES_MAX], count, done: 1, backward, length };
        if length < SHORTEST {
            line.nodes = [*known; NODES_MAX];
            line.length = 0.0;
            line.done = line.count;
        } else {
            line.nodes[line.slot(0)] = *known;
        }
        line
    }

    /// A line whose first joint position is known.
    pub(crate) fn forward(from: &Isometry3<f64>, to: &Isometry3<f64>, start: &Joints) -> Self {
        Self::new(from, to, start, false)
    }

    /// A line whose last joint position is known.
    pub(crate) fn backward(from: &Isometry3<f64>, to: &Isometry3<f64>, end: &Joints) -> Self {
        Self::new(from, to, end, true)
    }

    /// Index of the k-th node to be solved.
    fn slot(&self, k: usize) -> usize {
        if self.backward { self.count - 1 - k } else { k }
    }

    /// Solves one more node. `Ok(Some)` is the finished path.
    pub(crate) fn step(&mut self, chain: &Chain) -> Result<Option<Path>, IkFailure> {
        if self.done < self.count {
            let slot = self.slot(self.done);
            let share = slot as f64 / (self.count - 1) as f64;
            let position = self.from.translation.vector.lerp(&self.to.translation.vector, share);
            let rotation = self.from.rotation.try_slerp(&self.to.rotation, share, 1e-9).unwrap_or(self.to.rotation);
            let pose = Isometry3::from_parts(Translation3::from(position), rotation);
            let neighbour = self.nodes[self.slot(self.done - 1)];
            let solution = chain.inverse(&pose, &neighbour)?;
            if solution.iter().zip(&neighbour).any(|(a, b)| !((a - b).abs() <= BRANCH_JUMP)) {
                return Err(IkFailure::Singular);
            }
            self.nodes[slot] = solution;
            self.done += 1;
        }
        Ok((self.done >= self.count).then(|| Path::through(&self.nodes, self.count, self.length)))
    }
}
