//! The supervisor role: decides who does what, and sees that it is done.
//!
//! For each part of a box: have it presented and looked at, check who can do it
//! (Eq. 1–2), find mode, tool and strategy, carry out the strategy's actions as
//! motions of the robot and prompts to the person, and write down what was done.
//!
//! ```text
//! NewBox -> Present -> Recognise -> Opening -> Acting -> Closing -> next part
//!              ^          |  ask                  |
//!              +----------+-------- retry --------+--> a person takes over
//! ```
//!
//! Beside this run two watches in every cycle: over the protective stop, which is
//! reset by rule or after a person has looked, and over the roles, whose loss pauses
//! everything until they are back.
//!
//! **Invariant:** a step begins only when the journal entry of its beginning is durable,
//! and the next only when that of its end is.
//! **Invariant:** every wait has a limit, and past it a name: nothing here hangs.
//! **Invariant:** nothing here knows where a part truly is; it knows what perception or a
//! person said.

mod actions;
mod capability;
mod event;
mod look;
mod placing;
mod role;
mod step;
#[cfg(test)]
mod tests;
mod watch;

pub use capability::{Demand, Margins, Reason, Verdict, judge};
pub use event::{Event, EventKind, Outcome, Planned, Summary};
pub use role::Supervisor;

use crate::strategy::JournalEntry;
use tandem_msg::{
    CellRequest, CellState, Feature, HumanState, JointState, MotionStatus, MotionTask, OperatorEvent, Prompt, Scene,
};

/// What a run is to do.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunOptions {
    /// Boxes to assemble.
    pub boxes: u32,
    /// Seed of the run, for its record.
    pub seed: u64,
    /// Identity of the run in the journal, lower case.
    pub run_id: String,
}

/// What became of a role's process, as the shell sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RoleFault {
    /// Ended by a signal.
    Killed,
    /// Ended by itself.
    Exited,
    /// Lives, but has not been heard within its limit.
    Silent,
    /// Lives, but was never ready.
    Unresponsive,
    /// Could not be started again.
    Unstartable,
}

impl RoleFault {
    /// The fault in a word.
    pub fn name(self) -> &'static str {
        match self {
            Self::Killed => "killed",
            Self::Exited => "exited",
            Self::Silent => "silent",
            Self::Unresponsive => "unresponsive",
            Self::Unstartable => "unstartable",
        }
    }
}

/// Health of a role, decided by the shell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RoleHealth {
    /// It runs and is heard.
    Up,
    /// It has been started and is not heard yet.
    Starting,
    /// It is gone.
    Lost {
        /// How.
        fault: RoleFault,
    },
}

/// Everything the supervisor hears in a cycle.
#[derive(Clone, Copy, Debug)]
pub struct SupervisorInputs<'a> {
    /// Measured arm and tool.
    pub arm: &'a JointState,
    /// Tracked person.
    pub human: &'a HumanState,
    /// Last recognition.
    pub feature: &'a Feature,
    /// What the controller does.
    pub motion: &'a MotionStatus,
    /// The person's last answer.
    pub operator: &'a OperatorEvent,
    /// The peripherals' answer.
    pub cell: &'a CellState,
    /// Health of each role, by its code.
    pub roles: [RoleHealth; 4],
    /// Highest [`JournalEntry::seq`] that is durable.
    pub journal_committed: u64,
    /// The run shall end.
    pub halt: bool,
}

/// Everything the supervisor says in a cycle. Headers are the shell's.
#[derive(Clone, Debug, Default)]
pub struct SupervisorOutputs {
    /// Work for the arm.
    pub task: MotionTask,
    /// What the arm must not touch.
    pub scene: Scene,
    /// What a person is asked.
    pub prompt: Prompt,
    /// What the peripherals are asked.
    pub request: CellRequest,
    /// What happened in this cycle.
    pub events: Vec<Event>,
    /// What is to be made durable, in order.
    pub journal: Vec<JournalEntry>,
    /// Set once, in the cycle in which the arm has come to rest and the run is over.
    pub finished: Option<Outcome>,
}
