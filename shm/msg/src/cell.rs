//! The cell around the arm: feeder, person at the bench, health of the roles.

use crate::coded::coded;
use crate::header::message;
use crate::{Code, FeatureClass, Header, Pose, Tool};

coded! {
    /// What the supervisor asks of the cell's peripherals.
    pub enum RequestKind {
        /// Nothing.
        None = 0, "none";
        /// Bring an empty fixture for the next box.
        NewBox = 1, "new_box";
        /// Bring the part to its station and scan it.
        Present = 2, "present";
        /// Scan the presented part again.
        Rescan = 3, "rescan";
    }
}

coded! {
    /// How far a request has come.
    pub enum RequestPhase {
        /// Nothing asked.
        Idle = 0, "idle";
        /// Under way.
        Busy = 1, "busy";
        /// Served: the part stands at its station.
        Served = 2, "served";
        /// Could not be served.
        Failed = 3, "failed";
    }
}

/// Supervisor to the cell's peripherals; a new `id` is a new request.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct CellRequest {
    /// Header.
    pub header: Header,
    /// Identity, never reused.
    pub id: u32,
    /// What is asked.
    pub kind: Code<RequestKind>,
    /// Box under assembly, from 0.
    pub box_index: u32,
    /// Part type: index in the product file.
    pub part_index: u32,
}
message!(CellRequest, 48);

/// The peripherals' answer, and the referee's count. The referee fields feed the
/// run's summary; no role decides by them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct CellState {
    /// Header.
    pub header: Header,
    /// `CellRequest::id` this speaks of.
    pub request: u32,
    /// How far it has come.
    pub phase: Code<RequestPhase>,
    /// Referee: contacts of arm or carried part with what they must not touch, since start.
    pub contacts: u32,
    /// Referee: parts of the present box that sit where the product file wants them.
    pub parts_seated: u32,
    /// Where the presented part's carrier stands (the part lies on it as it happens to).
    pub base_from_station: Pose,
}
message!(CellState, 104);

coded! {
    /// What a person is asked to do.
    pub enum PromptKind {
        /// Nothing.
        None = 0, "none";
        /// Take the part from its station and assemble it.
        Assemble = 1, "assemble";
        /// Take the part out of the robot's tool and assemble it.
        Receive = 2, "receive";
        /// Assemble the part while the robot holds it.
        AssembleHeld = 3, "assemble_held";
        /// Look at the presented part and say which feature it has.
        Identify = 4, "identify";
        /// Look at the cell and say whether it may go on.
        Inspect = 5, "inspect";
        /// Finish by hand what the robot could not.
        TakeOver = 6, "take_over";
    }
}

/// Supervisor to the person (and to the simulated one); a new `id` is a new prompt.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Prompt {
    /// Header.
    pub header: Header,
    /// Identity, never reused; 0 = none.
    pub id: u32,
    /// What is asked.
    pub kind: Code<PromptKind>,
    /// Box under assembly, from 0.
    pub box_index: u32,
    /// Part type: index in the product file.
    pub part_index: u32,
    /// Hand tool to use, as the strategy says.
    pub tool: Code<Tool>,
    /// Zero; keeps the layout free of padding.
    pub reserved: u32,
    /// Where the part is handed over or held.
    pub base_from_part: Pose,
}
message!(Prompt, 112);

coded! {
    /// A person's answer.
    pub enum Answer {
        /// None yet.
        None = 0, "none";
        /// At work on it.
        Started = 1, "started";
        /// Done.
        Done = 2, "done";
        /// Will not do it.
        Declined = 3, "declined";
        /// Holds the part the robot offers: let go.
        Holding = 4, "holding";
    }
}

/// The person's answer, by button, voice or page, to the supervisor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct OperatorEvent {
    /// Header.
    pub header: Header,
    /// `Prompt::id` this answers.
    pub prompt_id: u32,
    /// The answer.
    pub answer: Code<Answer>,
    /// For `Identify`: the class the person sees.
    pub class: Code<FeatureClass>,
    /// Zero; keeps the layout free of padding.
    pub reserved: u32,
}
message!(OperatorEvent, 48);

coded! {
    /// The roles of a cell.
    pub enum Role {
        /// Starts and watches the others, decides.
        Supervisor = 0, "supervisor";
        /// Stands for the hardware.
        Plant = 1, "plant";
        /// Sees.
        Perception = 2, "perception";
        /// Moves.
        Controller = 3, "controller";
    }
}
