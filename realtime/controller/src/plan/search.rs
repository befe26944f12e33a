//! The planning job: candidates one after another, a bounded number of steps of it a cycle while the arm stands.

use nalgebra::{Isometry3, Translation3};
use tandem_kinematics::Branches;
use tandem_msg::{AttachedPart, MotionFailure, MotionPhase, Planner, Subtask};
use tandem_planner::Progress as Sampling;
use tandem_trajectory::State;

use super::preview::{Preview, Previewed, policy_for};
use super::renewal::Renewal;
use super::route::{ROUTES, via_points};
use super::sampled::{Joined, Sampled};
use super::way::Way;
use super::{DEPARTS, Goal, LOOKS_PER_STEP, Leg, Tools};
use crate::Joints;
use crate::law::{Law, LawLimits};
use crate::line::Line;
use crate::path::Path;
use crate::sweep::{Sweep, Swept};

/// Stretches of a plan: depart, across, approach. By hand there are up to three across; a sampled way with
/// more than fit is none.
pub(super) const LEGS_MAX: usize = 18;
/// Previews for one plan: branches and ways to depart that a policy is asked for.
const PREVIEWS: u32 = 6;
/// A start that is this far off the approach line, or less, is on it: metres, rad.
const ON_LINE: f64 = 0.008;
const ON_LINE_TURN: f64 = 0.03;
/// How much nearer an arm may come that leaves a contact: rounding, metres.
const FLOOR_SLACK: f64 = 2e-4;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Step {
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
    pub(super) goal: Goal,
    pub(super) start: Joints,
    pub(super) start_pose: Isometry3<f64>,
    pub(super) step: Step,
    pub(super) line: Line,
    pub(super) sweep: Sweep,
    pub(super) branches: [Joints; 8],
    pub(super) branch_count: usize,
    pub(super) branch: usize,
    pub(super) reached: bool,
    /// Where the transfer ends.
    pub(super) across_to: Joints,
    pub(super) approach: Option<Leg>,
    pub(super) depart: usize,
    pub(super) depart_end: Joints,
    pub(super) route: usize,
    pub(super) legs: [Leg; LEGS_MAX],
    pub(super) count: usize,
    /// Legs of the present candidate that are checked already.
    pub(super) checked: usize,
    pub(super) floor: f64,
    pub(super) preview: Preview,
    /// The way in hand: a preview's, or one that renews another.
    pub(super) way: Way,
    pub(super) previews: u32,
    /// Who made the plan.
    pub(super) planner: Planner,
    /// Policies that had a part in it, where it is theirs.
    pub(super) led_by: u32,
    pub(super) sampled: Sampled,
    /// What the sampled transfer joins, once there is one.
    pub(super) joined: Option<Joined>,
    pub(super) renewal: Renewal,
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
            way: Way::new(),
            previews: 0,
            planner: Planner::None,
            led_by: 0,
            sampled: Sampled::new(),
            joined: None,
            renewal: Renewal::new(),
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
        self.renewal.drop();
    }

    /// Who made the plan.
    pub(crate) fn planner(&self) -> Planner {
        self.planner
    }

    /// Policies that led the arm across, a bit for the number of each one's subtask.
    pub(crate) fn led_by(&self) -> u32 {
        if self.planner == Planner::Policy { self.led_by } else { 0 }
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
                        // A step of a policy, or a look, of which the sampling planner takes two at that price.
                        Step::Preview if self.preview.rolls() => 8,
                        Step::Preview => 1,
                        Step::PreviewPath => 16,
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
                    self.legs[0] = Leg::of(&self.goal, tools, &path, phase, self.goal.touch_at_start, margin);
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
                    let leg = Leg::of(&self.goal, tools, &path, MotionPhase::Approach, self.goal.touch, margin);
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
                    self.legs[0] =
                        Leg::of(&self.goal, tools, &path, MotionPhase::Depart, self.goal.touch_at_start, margin);
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
    pub(super) fn begin_branch(&mut self) -> Step {
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
            self.legs[count] = Leg::across(&self.goal, tools, &path);
            count += 1;
            at = *target;
        }
        self.count = count;
        self.checked = first;
        self.sweep_leg(tools, first);
        Step::RouteSweep
    }

    /// Asks the policy of the task's subtask for the way across, where there is one and it was not asked too often.
    fn begin_preview(&mut self, tools: &mut Tools<'_>) -> Option<Step> {
        policy_for(tools.policies, self.goal.subtask).filter(|_| self.previews < PREVIEWS)?;
        self.previews += 1;
        tools.monitor.set_touch(&[0; 16]);
        self.way.clear();
        self.way.turn_at(&self.depart_end);
        self.way.branch_off();
        self.preview.begin(tools, &self.goal, &self.depart_end, &self.across_to);
        Some(Step::Preview)
    }

    /// Goes on with the preview.
    fn preview(&mut self, tools: &Tools<'_>) -> Step {
        match self.preview.step(tools, &self.goal, &mut self.way) {
            Previewed::More => Step::Preview,
            Previewed::Ready => {
                self.led_by = self.preview.led_by();
                Step::PreviewPath
            }
            Previewed::Failed => Step::Route,
        }
    }

    /// The next path along the previewed way.
    fn preview_path(&mut self, tools: &mut Tools<'_>) -> Step {
        let Some(path) = self.way.path(tools, None, 0.0, self.goal.speed) else { return Step::Route };
        let first = usize::from(self.depart > 1);
        self.legs[first] = Leg::across(&self.goal, tools, &path);
        if !self.legs[first].limits.are_usable() && path.length() > 0.0 {
            return Step::PreviewPath;
        }
        (self.count, self.checked) = (first + 1, first);
        if self.way.is_straight() {
            // Shortening has looked at all of it.
            self.planner = Planner::Policy;
            return self.finish();
        }
        self.sweep_leg(tools, first);
        Step::PreviewSweep
    }

    /// All up to the approach is there.
    pub(super) fn finish(&mut self) -> Step {
        if let Some(approach) = &self.approach {
            self.legs[self.count] = *approach;
            self.count += 1;
        }
        Step::Found
    }

    pub(super) fn sweep_leg(&mut self, tools: &mut Tools<'_>, index: usize) {
        let leg = &self.legs[index];
        tools.monitor.set_touch(&leg.touch);
        self.sweep = Sweep::new(0.0, leg.rate, leg.margin, tools.params.clearance_min);
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
