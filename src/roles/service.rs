//! Names of the services of a cell.

use tandem_msg::Role;

/// `JointState`, plant to controller and supervisor.
pub const ARM_STATE: &str = "arm/state";
/// `JointCommand`, controller to plant.
pub const ARM_COMMAND: &str = "arm/command";
/// `PointCloud`, plant to perception.
pub const CLOUD: &str = "camera/cloud";
/// `HumanState`, plant to controller and supervisor.
pub const HUMAN: &str = "cell/human";
/// `CellState`, plant to supervisor.
pub const CELL: &str = "cell/state";
/// `OperatorEvent`, the person to supervisor.
pub const OPERATOR: &str = "operator/event";
/// `Feature`, perception to supervisor.
pub const FEATURE: &str = "perception/feature";
/// `MotionTask`, supervisor to controller.
pub const TASK: &str = "supervisor/task";
/// `Scene`, supervisor to controller.
pub const SCENE: &str = "supervisor/scene";
/// `Prompt`, supervisor to the person.
pub const PROMPT: &str = "supervisor/prompt";
/// `CellRequest`, supervisor to plant.
pub const REQUEST: &str = "supervisor/request";
/// `MotionStatus`, controller to supervisor.
pub const STATUS: &str = "controller/status";

/// What a role reads, in the order in which it says what it has heard.
pub const fn inputs(role: Role) -> &'static [&'static str] {
    match role {
        Role::Plant => &[ARM_COMMAND, REQUEST, PROMPT],
        Role::Perception => &[CLOUD],
        Role::Supervisor => &[ARM_STATE, FEATURE, STATUS, HUMAN, OPERATOR, CELL],
        Role::Controller => &[ARM_STATE, HUMAN, SCENE, TASK],
    }
}
