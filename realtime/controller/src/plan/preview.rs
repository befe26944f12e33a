//! The transfer that was learned: a policy rolled out ahead of time, a step of it at a time.
//!
//! ```text
//! roll out ──▶ shorten ──▶ round off ──▶ swept like any other transfer
//!  policy      what can be   smooth, so that the
//!  steps       left out is   arm need not stop
//! ```
//!
//! Nothing moves meanwhile. What fails here, or in the sweep afterwards, leaves the transfer to the hand-made routes.

use tandem_clearance::{Monitor, MotionSweep, Swept};
use tandem_kinematics::Chain;
use tandem_msg::{JOINTS_MAX, MotionPhase, Subtask};
use tandem_policy::{Activations, DOF, Destination, Policies, Policy, Rollout, STEPS_MAX, Surroundings};

use super::{Search, Step, Tools};
use crate::path::{NODES_MAX, Path};
use crate::{Joints, Params};

/// Previews for one plan: branches and ways to depart that a policy is asked for.
const PREVIEWS: u32 = 6;
/// Positions of a preview: its start, each step, the goal.
const POSITIONS: usize = STEPS_MAX + 2;
/// Looks that shortening may take; what is not shortened by then fails.
const LOOKS_MAX: u32 = 4_000;
/// What shortening may give away of the margin so as not to look too often, metres.
const RESOLUTION: f64 = 0.005;
/// Times that each node is drawn between its neighbours: the rounder, the faster and the farther off the corners.
const ROUNDINGS: [u32; 3] = [40, 12, 4];

/// How a preview stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Previewed {
    More,
    /// The way across is known by its corners.
    Ready,
    Failed,
}

/// A preview under way, and its result.
pub(super) struct Preview {
    rollout: Option<Rollout>,
    destination: Destination,
    positions: [Joints; POSITIONS],
    count: usize,
    /// Corners that are kept: indices of positions.
    corners: [usize; POSITIONS],
    corner_count: usize,
    /// Position that the last corner is being joined with.
    reach: usize,
    sweep: MotionSweep,
    sweeping: bool,
    looks: u32,
    /// How round the next path is.
    rounding: usize,
    room: Activations,
}

impl Preview {
    pub(super) fn new() -> Self {
        Self {
            rollout: None,
            destination: Destination::default(),
            positions: [[0.0; JOINTS_MAX]; POSITIONS],
            count: 0,
            corners: [0; POSITIONS],
            corner_count: 0,
            reach: 0,
            sweep: MotionSweep::new(),
            sweeping: false,
            looks: 0,
            rounding: 0,
            room: Activations::default(),
        }
    }

    /// Begins at a joint position. The monitor must hold the part, and allow no contact.
    pub(super) fn begin(&mut self, chain: &Chain, monitor: &Monitor, from: &Joints, to: &Joints, part: [f64; 3]) {
        let position = chain.forward(to).base_from_tcp.translation.vector.into();
        self.destination = Destination { joints: *to, position, part };
        self.rollout = Some(Rollout::begin(chain, monitor, from));
        self.positions[0] = *from;
        (self.count, self.corner_count, self.reach) = (1, 0, 0);
        (self.sweeping, self.looks, self.rounding) = (false, 0, 0);
    }

    /// One step of the policy, or one look of the shortening.
    pub(super) fn step(
        &mut self,
        chain: &Chain,
        monitor: &Monitor,
        params: &Params,
        surroundings: &Surroundings,
        policy: &Policy<'_>,
    ) -> Previewed {
        match self.rollout.take() {
            Some(rollout) => self.roll(rollout, chain, monitor, params, surroundings, policy),
            None => self.shorten(chain, monitor, params),
        }
    }

    fn roll(
        &mut self,
        mut rollout: Rollout,
        chain: &Chain,
        monitor: &Monitor,
        params: &Params,
        surroundings: &Surroundings,
        policy: &Policy<'_>,
    ) -> Previewed {
        if rollout.arrived(&self.destination) {
            let goal = self.destination.joints;
            self.keep(&goal);
            self.corners[0] = 0;
            self.corner_count = 1;
            self.reach = self.count - 1;
            return Previewed::More;
        }
        if rollout.stuck() || self.count >= POSITIONS - 1 {
            return Previewed::Failed;
        }
        let observation = rollout.observe(chain, monitor, surroundings, &self.destination);
        let mut action = [0.0; DOF];
        if policy.act(&mut self.room, &observation.numbers, &mut action).is_err() {
            return Previewed::Failed;
        }
        if rollout.advance(chain, monitor, &action, params.path_margin) {
            self.keep(rollout.joints());
        }
        self.rollout = Some(rollout);
        Previewed::More
    }

    fn keep(&mut self, position: &Joints) {
        if let Some(slot) = self.positions.get_mut(self.count) {
            *slot = *position;
            self.count += 1;
        }
    }

    /// From each corner straight to the goal, or to half as far, and so on: the first of these that is clear.
    fn shorten(&mut self, chain: &Chain, monitor: &Monitor, params: &Params) -> Previewed {
        let from = self.corners[self.corner_count.max(1) - 1];
        if from + 1 >= self.count {
            return Previewed::Ready;
        }
        if self.looks >= LOOKS_MAX {
            return Previewed::Failed;
        }
        self.looks += 1;
        if !self.sweeping {
            let [start, end] = [from, self.reach].map(|index| self.positions[index.min(POSITIONS - 1)]);
            let margin = (params.path_margin - RESOLUTION).max(params.clearance_min);
            self.sweep.begin(monitor, &start, &end, margin, RESOLUTION);
            self.sweeping = true;
        }
        match self.sweep.look(chain, monitor) {
            Swept::More => return Previewed::More,
            Swept::Clear => {
                self.corners[self.corner_count.min(POSITIONS - 1)] = self.reach;
                self.corner_count += 1;
                self.reach = self.count - 1;
            }
            // A single step that is not clear between its looks.
            Swept::Blocked if self.reach == from + 1 => return Previewed::Failed,
            Swept::Blocked => self.reach = from + (self.reach - from) / 2,
        }
        self.sweeping = false;
        Previewed::More
    }

    /// The next path through the corners, less rounded each time; `None` when there are no more.
    pub(super) fn path(&mut self) -> Option<Path> {
        let corners = self.corners.get(..self.corner_count)?;
        let (first, last) = (self.positions[0], self.destination.joints);
        if corners.len() <= 2 {
            self.rounding += 1;
            return (self.rounding == 1).then(|| Path::line(&first, &last));
        }
        let roundings = *ROUNDINGS.get(self.rounding)?;
        self.rounding += 1;
        let stretch = |k: usize| -> f64 {
            let [a, b] = [corners[k], corners[k + 1]].map(|index| self.positions[index]);
            a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
        };
        let length: f64 = (0..corners.len() - 1).map(stretch).sum();
        if !(length > 0.0) {
            return None;
        }
        let mut nodes = [last; NODES_MAX];
        let (mut k, mut passed) = (0, 0.0);
        for (index, node) in nodes.iter_mut().enumerate().take(NODES_MAX - 1) {
            let at = length * index as f64 / (NODES_MAX - 1) as f64;
            while k + 2 < corners.len() && at > passed + stretch(k) {
                passed += stretch(k);
                k += 1;
            }
            let share = ((at - passed) / stretch(k).max(1e-9)).clamp(0.0, 1.0);
            let [a, b] = [corners[k], corners[k + 1]].map(|index| self.positions[index]);
            *node = core::array::from_fn(|joint| a[joint] + share * (b[joint] - a[joint]));
        }
        for _ in 0..roundings {
            let before = nodes;
            for (index, node) in nodes.iter_mut().enumerate().take(NODES_MAX - 1).skip(1) {
                *node = core::array::from_fn(|joint| {
                    0.25 * before[index - 1][joint] + 0.5 * before[index][joint] + 0.25 * before[index + 1][joint]
                });
            }
        }
        Some(Path::through(&nodes, NODES_MAX, length))
    }
}

impl Search {
    /// Asks the policy of the task's subtask for the way across, where there is one and it was not asked too often.
    pub(super) fn begin_preview(&mut self, tools: &mut Tools<'_>) -> Option<Step> {
        policy_for(tools.policies, self.goal.subtask).filter(|_| self.previews < PREVIEWS)?;
        self.previews += 1;
        tools.monitor.set_touch(&[0; 16]);
        let part = if self.goal.attached.present == 1 { self.goal.attached.half_extents } else { [0.0; 3] };
        self.preview.begin(tools.chain, tools.monitor, &self.depart_end, &self.across_to, part);
        Some(Step::Preview)
    }

    /// Goes on with the rollout of the policy.
    pub(super) fn preview(&mut self, tools: &Tools<'_>) -> Step {
        let Some(policy) = policy_for(tools.policies, self.goal.subtask) else { return Step::Route };
        let Tools { chain, params, monitor, surroundings, .. } = tools;
        match self.preview.step(chain, monitor, params, surroundings, &policy) {
            Previewed::More => Step::Preview,
            Previewed::Ready => Step::PreviewPath,
            Previewed::Failed => Step::Route,
        }
    }

    /// The next path through the preview's corners.
    pub(super) fn preview_path(&mut self, tools: &mut Tools<'_>) -> Step {
        let Some(path) = self.preview.path() else { return Step::Route };
        let first = usize::from(self.depart > 1);
        self.legs[first] = self.leg(tools, &path, MotionPhase::Transfer, [0; 16], tools.params.path_margin);
        if !self.legs[first].limits.are_usable() && path.length() > 0.0 {
            return Step::PreviewPath;
        }
        (self.count, self.checked) = (first + 1, first);
        self.sweep_leg(tools, first);
        Step::PreviewSweep
    }
}

/// The policy that was trained for what a task is for.
pub fn policy_for(policies: &Policies, subtask: Subtask) -> Option<Policy<'_>> {
    let stored = match subtask {
        Subtask::Grasp | Subtask::ToolChange | Subtask::Home => &policies.grasp,
        Subtask::Transfer | Subtask::HandOver | Subtask::HoldStill => &policies.transfer,
        Subtask::Place => &policies.place,
        Subtask::Assemble => &policies.assemble,
        Subtask::None => &None,
    };
    stored.as_ref().map(tandem_policy::Stored::policy)
}
