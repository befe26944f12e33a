//! The transfer that was learned: a policy rolled out ahead of time, a step of it at a time, and shortened.
//!
//! The arm does not move by what happens here. What fails, or fails in the sweep afterwards, leaves the transfer to the
//! next planner.

use nalgebra::Vector3;
use tandem_clearance::Monitor;
use tandem_kinematics::Chain;
use tandem_msg::{Coded, Subtask};
use tandem_policy::{Activations, DOF, Destination, Policies, Policy, Rollout, Surroundings};

use super::way::{Shortened, Way};
use super::{Goal, Tools};
use crate::{Joints, Params};

/// How a preview stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Previewed {
    More,
    /// The way across is known by its corners.
    Ready,
    Failed,
}

/// A part that is carried across is placed by that policy from this distance on, metres: it was trained around the box.
const PLACING: f64 = 0.40;

/// A preview under way.
pub(super) struct Preview {
    rollout: Option<Rollout>,
    from: Joints,
    destination: Destination,
    /// The policy that places may lead the end of a transfer.
    places: bool,
    /// Policies that had a part in the way so far, a bit for the number of each subtask.
    led_by: u32,
    room: Activations,
}

impl Preview {
    pub(super) fn new() -> Self {
        Self {
            rollout: None,
            from: [0.0; tandem_msg::JOINTS_MAX],
            destination: Destination::default(),
            places: true,
            led_by: 0,
            room: Activations::default(),
        }
    }

    /// Begins at a joint position, where `way` stands already. The monitor must hold the part, and allow no contact.
    pub(super) fn begin(&mut self, tools: &Tools<'_>, goal: &Goal, from: &Joints, to: &Joints) {
        let position = tools.chain.forward(to).base_from_tcp.translation.vector.into();
        let part = if goal.attached.present == 1 { goal.attached.half_extents } else { [0.0; 3] };
        self.destination = Destination { joints: *to, position, part };
        (self.from, self.places, self.led_by) = (*from, true, 0);
        self.rollout = Some(Rollout::begin(tools.chain, tools.monitor, from));
    }

    /// Whether the next step is one of the policy, which takes longer than a look.
    pub(super) fn rolls(&self) -> bool {
        self.rollout.is_some()
    }

    /// One step of the policy of the goal's subtask, or one look of the shortening.
    pub(super) fn step(&mut self, tools: &Tools<'_>, goal: &Goal, way: &mut Way) -> Previewed {
        let Tools { chain, params, monitor, surroundings, policies, .. } = tools;
        let Some(rollout) = self.rollout.take() else {
            return match way.shorten(chain, monitor, params) {
                Shortened::More => Previewed::More,
                Shortened::Done => Previewed::Ready,
                Shortened::Failed => Previewed::Failed,
            };
        };
        let leader = self.leader(&rollout, policies, goal.subtask);
        let Some(policy) = policy_for(policies, leader) else { return Previewed::Failed };
        self.led_by |= 1 << leader.code();
        let previewed = self.roll(rollout, (chain, monitor), params, surroundings, &policy, way);
        if previewed == Previewed::Failed && self.places && self.led_by & (1 << Subtask::Place.code()) != 0 {
            // Once more, by the policy of the subtask alone.
            way.restart();
            (self.places, self.led_by) = (false, 0);
            self.rollout = Some(Rollout::begin(chain, monitor, &self.from));
            return Previewed::More;
        }
        previewed
    }

    /// The subtask whose policy makes the next step.
    fn leader(&self, rollout: &Rollout, policies: &Policies, subtask: Subtask) -> Subtask {
        let to_go = rollout.poses().base_from_tcp.translation.vector - Vector3::from(self.destination.position);
        let places = self.places && subtask == Subtask::Transfer && policies.place.is_some();
        if places && to_go.norm() <= PLACING { Subtask::Place } else { trained_for(subtask) }
    }

    /// Policies that had a part in the way.
    pub(super) fn led_by(&self) -> u32 {
        self.led_by
    }

    fn roll(
        &mut self,
        mut rollout: Rollout,
        (chain, monitor): (&Chain, &Monitor),
        params: &Params,
        surroundings: &Surroundings,
        policy: &Policy<'_>,
        way: &mut Way,
    ) -> Previewed {
        if rollout.arrived(&self.destination) {
            let fits = way.pass(&self.destination.joints);
            way.close();
            return if fits { Previewed::More } else { Previewed::Failed };
        }
        if rollout.stuck() {
            return Previewed::Failed;
        }
        let observation = rollout.observe(chain, monitor, surroundings, &self.destination);
        let mut action = [0.0; DOF];
        if policy.act(&mut self.room, &observation.numbers, &mut action).is_err() {
            return Previewed::Failed;
        }
        if rollout.advance(chain, monitor, &action, params.path_margin) && !way.pass(rollout.joints()) {
            return Previewed::Failed;
        }
        self.rollout = Some(rollout);
        Previewed::More
    }
}

/// The policy that was trained for what a task is for.
pub fn policy_for(policies: &Policies, subtask: Subtask) -> Option<Policy<'_>> {
    let stored = match trained_for(subtask) {
        Subtask::Grasp => &policies.grasp,
        Subtask::Transfer => &policies.transfer,
        Subtask::Place => &policies.place,
        Subtask::Assemble => &policies.assemble,
        _ => &None,
    };
    stored.as_ref().map(tandem_policy::Stored::policy)
}

/// The subtask of the paper's four whose policy leads a task.
fn trained_for(subtask: Subtask) -> Subtask {
    match subtask {
        Subtask::ToolChange | Subtask::Home => Subtask::Grasp,
        Subtask::HandOver | Subtask::HoldStill => Subtask::Transfer,
        paper => paper,
    }
}
