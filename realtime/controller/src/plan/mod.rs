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
//! **Renewal.** While the arm follows a way across, the rest of it is previewed anew ten times a second ([`renewal`]);
//! where it has become blocked, or a new one is clearly shorter, the arm goes over to the new one without a stop.
//!
//! **Fallback.** When no candidate is clear, the sampling planner ([`tandem_planner`]) looks for a transfer
//! from any clear departure to any clear approach, and the plan is said to be its own ([`Search::planner`]).
//!
//! **Leaving a contact.** Where the arm starts nearer to something than the
//! margin asks, as after letting go of a part, the first stretch may not bring it
//! nearer than it is; the objects of the task and of the one before may be
//! touched until that stretch is done.

mod outlook;
mod preview;
mod renewal;
mod route;
mod sampled;
mod search;
mod tempo;
mod way;

use nalgebra::Isometry3;
use tandem_clearance::Monitor;
use tandem_kinematics::Chain;
use tandem_msg::{AttachedPart, MotionPhase, Subtask};
use tandem_policy::{Policies, Surroundings};

use crate::law::LawLimits;
use crate::path::Path;
use crate::reach::Reach;
use crate::{Joints, Params};
pub(crate) use outlook::Outlook;
pub use preview::policy_for;
pub(crate) use renewal::{Chance, Renewed};
pub(crate) use search::{Progress, Search};

/// Objects that may be touched: those of a task and of the task before it. 0 = none.
pub(crate) type Touch = [u32; 16];

/// Looks of the sampling planner that take as long as a clearance sample and an inverse-kinematics solution.
const LOOKS_PER_STEP: u32 = 8;
/// Ways to depart.
const DEPARTS: usize = 3;

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

impl Leg {
    /// A stretch of a motion.
    fn of(goal: &Goal, tools: &Tools<'_>, path: &Path, phase: MotionPhase, touch: Touch, margin: f64) -> Self {
        let tcp_speed_max = match phase {
            MotionPhase::Transfer => tools.params.tcp_speed_max,
            _ => tools.params.line_speed_max,
        };
        let reach = tools.reach.with(&goal.attached);
        Self {
            path: *path,
            phase,
            touch,
            margin,
            rate: path.sweep_rate(&reach),
            limits: path.limits(tools.chain, goal.speed, tcp_speed_max),
        }
    }

    /// A stretch of the way across.
    fn across(goal: &Goal, tools: &Tools<'_>, path: &Path) -> Self {
        Self::of(goal, tools, path, MotionPhase::Transfer, [0; 16], tools.params.path_margin)
    }
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

/// What planning works with.
pub(crate) struct Tools<'a> {
    pub(crate) chain: &'a Chain,
    pub(crate) params: &'a Params,
    pub(crate) reach: &'a Reach,
    pub(crate) monitor: &'a mut Monitor,
    pub(crate) policies: &'a Policies,
    pub(crate) surroundings: &'a Surroundings,
}
