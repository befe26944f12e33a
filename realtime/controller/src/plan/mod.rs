//! Planning: what was learned first, then the paper's hand-designed path (Section 3.2.2), its baseline;
//! behind them a sampling planner for the transfer.
//!
//! ```text
//! depart ----> transfer (direct, or over hand-made via points) ----> approach
//! straight     in joint space, all joints in proportion              straight, along the goal's z
//! ```
//!
//! The search is a fixed list of candidates, tried in order until one is clear:
//! for each branch of the inverse kinematics at the goal, for each way to depart
//! (not at all, straight back, straight up), for each route (direct, over raised
//! points, over one raised point, to the left, to the right, over the resting
//! configuration). It takes a bounded number of steps a cycle while the arm
//! stands; a step is one inverse-kinematics solution or one clearance sample.
//!
//! **Policy.** Where the task's subtask has a policy, it is rolled out ahead of time before the first of these
//! routes is tried ([`preview`]); what it does not bring across clear is left to them.
//!
//! **Fallback.** When no candidate is clear, the sampling planner ([`tandem_planner`]) looks for a transfer
//! from any clear departure to any clear approach, and the plan is said to be its own ([`Search::planner`]).
//!
//! **Leaving a contact.** Where the arm starts nearer to something than the
//! margin asks, as after letting go of a part, the first stretch may not bring it
//! nearer than it is; the objects of the task and of the one before may be
//! touched until that stretch is done.

mod preview;
mod route;
mod sampled;

use nalgebra::{Isometry3, Translation3};
use tandem_clearance::Monitor;
use tandem_kinematics::{Branches, Chain};
use tandem_msg::{AttachedPart, MotionFailure, MotionPhase, Planner, Subtask};
use tandem_planner::Progress as Sampling;
use tandem_policy::{Policies, Surroundings};

use crate::law::{Law, LawLimits};
use crate::line::Line;
use crate::path::Path;
use crate::reach::Reach;
use crate::sweep::{Sweep, Swept};
use crate::{Joints, Params};
use preview::Preview;
pub use preview::policy_for;
use route::{ROUTES, via_points};
use sampled::{Joined, Sampled};
use tandem_trajectory::State;

/// Objects that may be touched: those of a task and of the task before it. 0 = none.
pub(crate) type Touch = [u32; 16];

/// Stretches of a plan: depart, across, approach. By hand there are up to three across; a sampled way with
/// more than fit is none.
const LEGS_MAX: usize = 18;
/// Looks of the sampling planner that take as long as a clearance sample and an inverse-kinematics solution.
const LOOKS_PER_STEP: u32 = 8;
/// Ways to depart.
const DEPARTS: usize = 3;
/// A start that is this far off the approach line, or less, is on it: metres, rad.
const ON_LINE: f64 = 0.008;
const ON_LINE_TURN: f64 = 0.03;
/// How much nearer an arm may come that leaves a contact: rounding, metres.
const FLOOR_SLACK: f64 = 2e-4;

/// One stretch with everything needed to follow and to guard it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Leg {
    pub(crate) path: Path,
    pub(crate) phase: MotionPhase,
    pub(crate) touch: Touch,
    /// Clearance it was planned with, metres.
    pub(crate) margin: f64,
    /// Bound on the arm's travel per length.
    pub(crate) rate: f64,
    pub(crate) limits: LawLimits,
}

/// What is to be planned.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Goal {
    /// Where the TCP shall end.
    pub(crate) base_from_tcp: Isometry3<f64>,
    /// Given instead for a goal in joint space.
    pub(crate) joints: Option<Joints>,
    /// Length of the approach, metres.
    pub(crate) approach: f64,
    /// Only the straight line from the start will do (withdrawing after an action).
    pub(crate) straight_only: bool,
    /// Share of the arm's speed.
    pub(crate) speed: f64,
    /// What the tool carries.
    pub(crate) attached: AttachedPart,
    /// May be touched on the approach.
    pub(crate) touch: Touch,
    /// May be touched on the first stretch.
    pub(crate) touch_at_start: Touch,
    /// What the motion is for: which policy is asked.
    pub(crate) subtask: Subtask,
    /// Where a sampled way takes its randomness from.
    pub(crate) seed: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    Begin,
    StraightLine,
    StraightSweep,
    Branch,
    ApproachLine,
    ApproachSweep,
    Depart,
    DepartLine,
    DepartSweep,
    Preview,
    PreviewPath,
    PreviewSweep,
    Route,
    RouteSweep,
    Sample,
    Join,
    Found,
    Failed(MotionFailure),
}

/// How the search stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Progress {
    Searching,
    Found,
    Failed(MotionFailure),
}

/// A search and its result. Kept for the life of the role; begun anew for each plan.
pub(crate) struct Search {
    goal: Goal,
    start: Joints,
    start_pose: Isometry3<f64>,
    step: Step,
    line: Line,
    sweep: Sweep,
    branches: [Joints; 8],
    branch_count: usize,
    branch: usize,
    reached: bool,
    /// Where the transfer ends.
    across_to: Joints,
    approach: Option<Leg>,
    depart: usize,
    depart_end: Joints,
    route: usize,
    legs: [Leg; LEGS_MAX],
    count: usize,
    /// Legs of the present candidate that are checked already.
    checked: usize,
    floor: f64,
    preview: Preview,
    previews: u32,
    /// Who made the plan.
    planner: Planner,
    sampled: Sampled,
    /// What the sampled transfer joins, once there is one.
    joined: Option<Joined>,
}

/// What a search works with.
pub(crate) struct Tools<'a> {
    pub(crate) chain: &'a Chain,
    pub(crate) params: &'a Params,
    pub(crate) reach: &'a Reach,
    pub(crate) monitor: &'a mut Monitor,
    pub(crate) policies: &'a Policies,
    pub(crate) surroundings: &'a Surroundings,
}

impl Search {
    pub(crate) fn new() -> Self {
        let nowhere = [0.0; tandem_msg::JOINTS_MAX];
        let leg = Leg {
            path: Path::point(&nowhere),
            phase: MotionPhase::Idle,
            touch: [0; 16],
            margin: 0.0,
            rate: 0.0,
            limits: LawLimits { velocity: 1.0, acceleration: 1.0, jerk: 1.0 },
        };
        Self {
            goal: Goal {
                base_from_tcp: Isometry3::identity(),
                joints: None,
                approach: 0.0,
                straight_only: false,
                speed: 1.0,
                attached: AttachedPart::default(),
                touch: [0; 16],
                touch_at_start: [0; 16],
                subtask: Subtask::None,
                seed: 0,
            },
            start: nowhere,
            start_pose: Isometry3::identity(),
            step: Step::Failed(MotionFailure::None),
            line: Line::forward(&Isometry3::identity(), &Isometry3::identity(), &nowhere),
            sweep: Sweep::default(),
            branches: [nowhere; 8],
            branch_count: 0,
            branch: 0,
            reached: false,
            across_to: nowhere,
            approach: None,
            depart: 0,
            depart_end: nowhere,
            route: 0,
            legs: [leg; LEGS_MAX],
            count: 0,
            checked: 0,
            floor: 0.0,
            preview: Preview::new(),
            previews: 0,
            planner: Planner::None,
            sampled: Sampled::new(),
            joined: None,
        }
    }

    /// Forgets what was found and begins anew from a position at rest.
    pub(crate) fn begin(&mut self, start: &Joints, goal: &Goal) {
        self.goal = *goal;
        self.start = *start;
        self.step = Step::Begin;
        self.count = 0;
        self.sampled.clear();
        self.joined = None;
        self.previews = 0;
        self.planner = Planner::Manual;
    }

    /// Who made the plan.
    pub(crate) fn planner(&self) -> Planner {
        self.planner
    }

    /// The stretches found.
    pub(crate) fn legs(&self) -> &[Leg] {
        &self.legs[..self.count.min(LEGS_MAX)]
    }

    /// Seconds the stretches take at full scale.
    pub(crate) fn duration(&self) -> f64 {
        self.legs()
            .iter()
            .filter_map(|leg| Law::to(leg.path.length(), State::at_rest(0.0), &leg.limits).ok())
            .map(|law| law.duration())
            .sum()
    }

    /// Does up to `params.planning_work` steps.
    pub(crate) fn work(&mut self, tools: &mut Tools<'_>) -> Progress {
        // Between two costly steps there are at most three cheap ones.
        let mut budget = 4 * tools.params.planning_work;
        while budget > 0 {
            match self.step {
                Step::Found => return Progress::Found,
                Step::Failed(failure) => return Progress::Failed(failure),
                step => {
                    let cost = match step {
                        Step::StraightLine | Step::ApproachLine | Step::DepartLine => 4,
                        Step::StraightSweep | Step::ApproachSweep | Step::DepartSweep | Step::RouteSweep => 4,
                        Step::Sample => 4,
                        Step::Preview => 12,
                        _ => 2,
                    };
                    budget = budget.saturating_sub(cost);
                    self.step = self.advance(step, tools);
                }
            }
        }
        Progress::Searching
    }

    fn advance(&mut self, step: Step, tools: &mut Tools<'_>) -> Step {
        match step {
            Step::Begin => self.begin_straight(tools),
            Step::StraightLine => match self.line.step(tools.chain) {
                Ok(None) => step,
                Ok(Some(path)) => {
                    let phase = if self.goal.straight_only { MotionPhase::Retract } else { MotionPhase::Approach };
                    let margin = tools.params.approach_margin.min(self.floor);
                    self.legs[0] = self.leg(tools, &path, phase, self.goal.touch_at_start, margin);
                    self.count = 1;
                    self.sweep_leg(tools, 0);
                    Step::StraightSweep
                }
                Err(_) => self.after_straight(tools),
            },
            Step::StraightSweep => match self.sweep.step(tools.chain, tools.monitor, &self.legs[0].path) {
                Swept::More => step,
                Swept::Clear => {
                    self.planner = Planner::Straight;
                    Step::Found
                }
                Swept::Blocked => self.after_straight(tools),
            },
            Step::Branch => self.next_branch(tools),
            Step::ApproachLine => match self.line.step(tools.chain) {
                Ok(None) => step,
                Ok(Some(path)) => {
                    self.reached = true;
                    self.across_to = *path.start();
                    let margin = tools.params.approach_margin;
                    let leg = self.leg(tools, &path, MotionPhase::Approach, self.goal.touch, margin);
                    self.approach = Some(leg);
                    tools.monitor.set_touch(&self.goal.touch);
                    self.sweep = Sweep::new(0.0, leg.rate, margin, tools.params.clearance_min);
                    Step::ApproachSweep
                }
                Err(_) => Step::Branch,
            },
            Step::ApproachSweep => match &self.approach {
                Some(leg) => match self.sweep.step(tools.chain, tools.monitor, &leg.path) {
                    Swept::More => step,
                    Swept::Clear => {
                        self.sampled.note_goal(self.branch - 1, &self.across_to);
                        self.first_depart()
                    }
                    Swept::Blocked => Step::Branch,
                },
                None => Step::Failed(MotionFailure::NoClearPath),
            },
            Step::Depart => self.next_depart(tools),
            Step::DepartLine => match self.line.step(tools.chain) {
                Ok(None) => step,
                Ok(Some(path)) => {
                    let margin = tools.params.approach_margin.min(self.floor);
                    self.legs[0] = self.leg(tools, &path, MotionPhase::Depart, self.goal.touch_at_start, margin);
                    self.depart_end = *path.end();
                    self.sweep_leg(tools, 0);
                    Step::DepartSweep
                }
                Err(_) => Step::Depart,
            },
            Step::DepartSweep => match self.sweep.step(tools.chain, tools.monitor, &self.legs[0].path) {
                Swept::More => step,
                Swept::Clear => self.departed(tools),
                Swept::Blocked => Step::Depart,
            },
            Step::Preview => self.preview(tools),
            Step::PreviewPath => self.preview_path(tools),
            Step::PreviewSweep => match self.sweep.step(tools.chain, tools.monitor, &self.legs[self.checked].path) {
                Swept::More => step,
                Swept::Clear => {
                    self.planner = Planner::Policy;
                    self.finish()
                }
                Swept::Blocked => Step::PreviewPath,
            },
            Step::Route => self.next_route(tools),
            Step::RouteSweep => match self.sweep.step(tools.chain, tools.monitor, &self.legs[self.checked].path) {
                Swept::More => step,
                Swept::Clear => {
                    self.checked += 1;
                    if self.checked < self.count {
                        self.sweep_leg(tools, self.checked);
                        return step;
                    }
                    self.finish()
                }
                Swept::Blocked => Step::Route,
            },
            Step::Sample => match self.sampled.work(tools.chain, tools.monitor, LOOKS_PER_STEP) {
                Sampling::Searching => step,
                Sampling::Failed(_) => Step::Failed(MotionFailure::NoClearPath),
                Sampling::Found => self.begin_joining(),
            },
            Step::Join => self.join(tools),
            Step::Found | Step::Failed(_) => step,
        }
    }

    /// First candidate: the arm stands on the approach line already, or has only to withdraw.
    fn begin_straight(&mut self, tools: &mut Tools<'_>) -> Step {
        let poses = tools.chain.forward(&self.start);
        self.start_pose = poses.base_from_tcp;
        self.reached = false;
        self.branch = 0;
        tools.monitor.set_attached(self.goal.attached.present.eq(&1).then_some(&self.goal.attached));
        tools.monitor.set_touch(&self.goal.touch_at_start);
        self.floor = tools.monitor.clearance(&poses).distance - FLOOR_SLACK;
        if !self.floor.is_finite() && !(self.floor > 0.0) {
            return Step::Failed(MotionFailure::InvalidTask);
        }
        let goal = &self.goal.base_from_tcp;
        let on_line = {
            let offset = goal.inverse_transform_vector(&(self.start_pose.translation.vector - goal.translation.vector));
            let turn = goal.rotation.angle_to(&self.start_pose.rotation);
            offset.xy().norm() <= ON_LINE
                && (-self.goal.approach - ON_LINE..=ON_LINE).contains(&offset.z)
                && turn <= ON_LINE_TURN
        };
        if self.goal.joints.is_none() && (on_line || self.goal.straight_only) {
            self.line = Line::forward(&self.start_pose, goal, &self.start);
            Step::StraightLine
        } else {
            self.after_straight(tools)
        }
    }

    /// Second: branches of the goal, nearest first.
    fn after_straight(&mut self, tools: &Tools<'_>) -> Step {
        self.count = 0;
        if self.goal.straight_only {
            return Step::Failed(MotionFailure::NoClearPath);
        }
        self.branch = 0;
        if let Some(joints) = &self.goal.joints {
            self.branches[0] = *joints;
            self.branch_count = 1;
            return Step::Branch;
        }
        match tools.chain.branches(&self.goal.base_from_tcp, &self.start) {
            Ok(found) => {
                self.branch_count = copy_branches(&found, &mut self.branches);
                Step::Branch
            }
            Err(_) => Step::Failed(MotionFailure::Unreachable),
        }
    }

    fn next_branch(&mut self, tools: &mut Tools<'_>) -> Step {
        if self.joined.is_some() {
            return Step::Failed(MotionFailure::NoClearPath);
        }
        if self.branch >= self.branch_count {
            return self.fall_back(tools);
        }
        self.branch += 1;
        self.begin_branch()
    }

    /// The approach of the branch in hand, where there is one.
    fn begin_branch(&mut self) -> Step {
        let goal = self.branches[self.branch - 1];
        if self.goal.joints.is_some() || self.goal.approach <= 0.0 {
            self.reached = true;
            self.approach = None;
            self.across_to = goal;
            self.sampled.note_goal(self.branch - 1, &goal);
            return self.first_depart();
        }
        let end = &self.goal.base_from_tcp;
        let from = end * Translation3::new(0.0, 0.0, -self.goal.approach);
        self.line = Line::backward(&from, end, &goal);
        Step::ApproachLine
    }

    fn first_depart(&mut self) -> Step {
        self.depart = self.joined.map_or(0, |joined| joined.way);
        Step::Depart
    }

    /// The way to depart in hand is clear.
    fn departed(&mut self, tools: &mut Tools<'_>) -> Step {
        self.sampled.note_start(self.depart - 1, &self.depart_end);
        self.route = 0;
        if self.joined.is_some() {
            return Step::Join;
        }
        self.begin_preview(tools).unwrap_or(Step::Route)
    }

    fn next_depart(&mut self, tools: &mut Tools<'_>) -> Step {
        let way = self.depart;
        self.depart += 1;
        self.route = 0;
        if self.joined.is_some_and(|joined| joined.way != way) {
            return Step::Failed(MotionFailure::NoClearPath);
        }
        let from = self.start_pose;
        let to = match way {
            0 => {
                self.depart_end = self.start;
                return self.departed(tools);
            }
            1 => from * Translation3::new(0.0, 0.0, -tools.params.depart_distance),
            _ if way < DEPARTS => {
                let mut to = from;
                to.translation.z = to.translation.z.max(tools.params.transit_height);
                to
            }
            _ => return Step::Branch,
        };
        if (to.translation.vector - from.translation.vector).norm() < 1e-3 {
            return Step::Depart;
        }
        self.line = Line::forward(&from, &to, &self.start);
        Step::DepartLine
    }

    /// Builds the transfer of the next route: its legs follow the departing one.
    fn next_route(&mut self, tools: &mut Tools<'_>) -> Step {
        let route = self.route;
        self.route += 1;
        if route >= ROUTES {
            return Step::Depart;
        }
        let (from, to) = (self.depart_end, self.across_to);
        let mut vias = [from; 2];
        let Some(via_count) = via_points(route, &from, &to, tools, &mut vias) else {
            return Step::Route;
        };
        let first = usize::from(self.depart > 1);
        let mut count = first;
        let mut at = from;
        for target in vias[..via_count].iter().chain(core::iter::once(&to)) {
            if !tools.chain.is_within_limits(target, 0.0) {
                return Step::Route;
            }
            let path = Path::line(&at, target);
            self.legs[count] = self.leg(tools, &path, MotionPhase::Transfer, [0; 16], tools.params.path_margin);
            count += 1;
            at = *target;
        }
        self.count = count;
        self.checked = first;
        self.sweep_leg(tools, first);
        Step::RouteSweep
    }

    /// All up to the approach is there.
    fn finish(&mut self) -> Step {
        if let Some(approach) = &self.approach {
            self.legs[self.count] = *approach;
            self.count += 1;
        }
        Step::Found
    }

    fn sweep_leg(&mut self, tools: &mut Tools<'_>, index: usize) {
        let leg = &self.legs[index];
        tools.monitor.set_touch(&leg.touch);
        self.sweep = Sweep::new(0.0, leg.rate, leg.margin, tools.params.clearance_min);
    }

    fn leg(&self, tools: &Tools<'_>, path: &Path, phase: MotionPhase, touch: Touch, margin: f64) -> Leg {
        let tcp_speed_max = match phase {
            MotionPhase::Transfer => tools.params.tcp_speed_max,
            _ => tools.params.line_speed_max,
        };
        let reach = tools.reach.with(&self.goal.attached);
        Leg {
            path: *path,
            phase,
            touch,
            margin,
            rate: path.sweep_rate(&reach),
            limits: path.limits(tools.chain, self.goal.speed, tcp_speed_max),
        }
    }
}

fn copy_branches(found: &Branches, into: &mut [Joints; 8]) -> usize {
    let mut count = 0;
    for (slot, solution) in into.iter_mut().zip(found.as_slice()) {
        *slot = *solution;
        count += 1;
    }
    count
}
