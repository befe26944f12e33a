//! The transfer that is searched for when no hand-made one is clear.
//!
//! While the manual planner goes through its candidates it notes every end that a transfer could
//! have: where a clear departure comes to rest, where a clear approach begins. If none of its routes
//! joins two of them, the sampling planner looks for a way from any of the first to any of the second.

use tandem_clearance::Monitor;
use tandem_kinematics::Chain;
use tandem_msg::{MotionFailure, Planner as PlannedBy};
use tandem_planner::{Planner, Progress, Request};

use super::search::{LEGS_MAX, Search, Step};
use super::{DEPARTS, Leg, Tools};
use crate::path::Path;
use crate::{Joints, Params};

/// Joint positions in each tree of the planner, after which they are grown anew: about 1.5 MB in all.
const NODES: usize = 4_096;
/// What a sampled transfer may give away of the margin so as not to look too often, metres.
const RESOLUTION: f64 = 0.005;

/// Ends of transfers, and the search between them.
pub(super) struct Sampled {
    planner: Planner,
    starts: [Joints; DEPARTS],
    ways: [usize; DEPARTS],
    start_count: usize,
    goals: [Joints; 8],
    branches: [usize; 8],
    goal_count: usize,
}

/// The way to depart and the branch at the goal that a transfer joins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Joined {
    pub(super) way: usize,
    pub(super) branch: usize,
}

impl Sampled {
    pub(super) fn new() -> Self {
        let nowhere = [0.0; tandem_msg::JOINTS_MAX];
        Self {
            planner: Planner::new(NODES),
            starts: [nowhere; DEPARTS],
            ways: [0; DEPARTS],
            start_count: 0,
            goals: [nowhere; 8],
            branches: [0; 8],
            goal_count: 0,
        }
    }

    /// Forgets all ends.
    pub(super) fn clear(&mut self) {
        (self.start_count, self.goal_count) = (0, 0);
    }

    /// A departure that is clear ends here.
    pub(super) fn note_start(&mut self, way: usize, position: &Joints) {
        let count = self.start_count;
        if count < self.starts.len() && !self.ways[..count].contains(&way) {
            (self.starts[count], self.ways[count]) = (*position, way);
            self.start_count += 1;
        }
    }

    /// An approach that is clear begins here.
    pub(super) fn note_goal(&mut self, branch: usize, position: &Joints) {
        let count = self.goal_count;
        if count < self.goals.len() && !self.branches[..count].contains(&branch) {
            (self.goals[count], self.branches[count]) = (*position, branch);
            self.goal_count += 1;
        }
    }

    /// Whether there is anything to join.
    pub(super) fn is_promising(&self) -> bool {
        self.start_count > 0 && self.goal_count > 0
    }

    /// Begins to search. The monitor must hold the part, and allow no contact.
    pub(super) fn begin(&mut self, chain: &Chain, monitor: &Monitor, params: &Params, looks_max: u32, seed: u64) {
        let request = Request {
            margin: (params.path_margin - RESOLUTION).max(params.clearance_min),
            resolution: RESOLUTION,
            looks_max,
            seed,
        };
        let (starts, goals) = (&self.starts[..self.start_count], &self.goals[..self.goal_count]);
        self.planner.begin(chain, monitor, starts, goals, &request);
    }

    pub(super) fn work(&mut self, chain: &Chain, monitor: &Monitor, looks: u32) -> Progress {
        self.planner.work(chain, monitor, looks)
    }

    /// The transfer that was found.
    pub(super) fn path(&self) -> &[Joints] {
        self.planner.path()
    }

    /// Which of the ends it joins.
    pub(super) fn joined(&self) -> Option<Joined> {
        let (first, last) = (self.path().first()?, self.path().last()?);
        let start = self.starts[..self.start_count].iter().position(|start| start == first)?;
        let goal = self.goals[..self.goal_count].iter().position(|goal| goal == last)?;
        Some(Joined { way: self.ways[start], branch: self.branches[goal] })
    }
}

impl Search {
    /// No candidate is clear: the transfer is left to the sampling planner, where there is one to search.
    pub(super) fn fall_back(&mut self, tools: &mut Tools<'_>) -> Step {
        if !self.reached {
            return Step::Failed(MotionFailure::Unreachable);
        }
        if !self.sampled.is_promising() || tools.params.sampling_looks_max == 0 {
            return Step::Failed(MotionFailure::NoClearPath);
        }
        tools.monitor.set_touch(&[0; 16]);
        let looks_max = tools.params.sampling_looks_max;
        self.sampled.begin(tools.chain, tools.monitor, tools.params, looks_max, self.goal.seed);
        Step::Sample
    }

    /// A transfer was found: its departure and approach are made once more.
    pub(super) fn begin_joining(&mut self) -> Step {
        self.joined = self.sampled.joined();
        self.approach = None;
        match self.joined {
            Some(joined) => {
                self.planner = PlannedBy::RrtConnect;
                self.branch = joined.branch + 1;
                self.begin_branch()
            }
            None => Step::Failed(MotionFailure::NoClearPath),
        }
    }

    /// Puts departure, sampled transfer and approach together.
    pub(super) fn join(&mut self, tools: &Tools<'_>) -> Step {
        let first = usize::from(self.depart > 1);
        let across = self.sampled.path().len().saturating_sub(1);
        if first + across + usize::from(self.approach.is_some()) > LEGS_MAX {
            return Step::Failed(MotionFailure::NoClearPath);
        }
        for index in 0..across {
            let [from, to] = [index, index + 1].map(|k| self.sampled.path()[k]);
            let path = Path::line(&from, &to);
            self.legs[first + index] = Leg::across(&self.goal, tools, &path);
        }
        self.count = first + across;
        self.finish()
    }
}
