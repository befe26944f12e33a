//! The services of a cell: who writes what to whom.
//!
//! The names are the contract between processes; each is written by one role.

use tandem_bus::{BusError, Latest, Node, Publisher};
use tandem_msg::{
    CellRequest, CellState, Coded, Feature, HumanState, JointCommand, JointState, MotionStatus, MotionTask,
    OperatorEvent, PointCloud, Prompt, Role, RoleStats, Scene,
};

const ARM_STATE: &str = "arm/state";
const ARM_COMMAND: &str = "arm/command";
const CAMERA_CLOUD: &str = "camera/cloud";
const CELL_HUMAN: &str = "cell/human";
const CELL_STATE: &str = "cell/state";
const OPERATOR_EVENT: &str = "operator/event";
const PERCEPTION_FEATURE: &str = "perception/feature";
const SUPERVISOR_TASK: &str = "supervisor/task";
const SUPERVISOR_SCENE: &str = "supervisor/scene";
const SUPERVISOR_PROMPT: &str = "supervisor/prompt";
const SUPERVISOR_REQUEST: &str = "supervisor/request";
const CONTROLLER_STATUS: &str = "controller/status";

/// What the plant reads and writes.
pub(super) struct PlantPorts {
    pub(super) command: Latest<JointCommand>,
    pub(super) request: Latest<CellRequest>,
    pub(super) prompt: Latest<Prompt>,
    pub(super) arm: Publisher<JointState>,
    pub(super) human: Publisher<HumanState>,
    pub(super) cell: Publisher<CellState>,
    pub(super) operator: Publisher<OperatorEvent>,
    pub(super) cloud: Publisher<PointCloud>,
}

impl PlantPorts {
    pub(super) fn open(node: &Node) -> Result<Self, BusError> {
        Ok(Self {
            command: node.latest(ARM_COMMAND)?,
            request: node.latest(SUPERVISOR_REQUEST)?,
            prompt: node.latest(SUPERVISOR_PROMPT)?,
            arm: node.publisher(ARM_STATE)?,
            human: node.publisher(CELL_HUMAN)?,
            cell: node.publisher(CELL_STATE)?,
            operator: node.publisher(OPERATOR_EVENT)?,
            cloud: node.publisher(CAMERA_CLOUD)?,
        })
    }
}

/// What perception reads and writes.
pub(super) struct PerceptionPorts {
    pub(super) cloud: Latest<PointCloud>,
    pub(super) feature: Publisher<Feature>,
}

impl PerceptionPorts {
    pub(super) fn open(node: &Node) -> Result<Self, BusError> {
        Ok(Self { cloud: node.latest(CAMERA_CLOUD)?, feature: node.publisher(PERCEPTION_FEATURE)? })
    }
}

/// What the controller reads and writes.
pub(super) struct ControllerPorts {
    pub(super) arm: Latest<JointState>,
    pub(super) human: Latest<HumanState>,
    pub(super) scene: Latest<Scene>,
    pub(super) task: Latest<MotionTask>,
    pub(super) command: Publisher<JointCommand>,
    pub(super) status: Publisher<MotionStatus>,
}

impl ControllerPorts {
    pub(super) fn open(node: &Node) -> Result<Self, BusError> {
        Ok(Self {
            arm: node.latest(ARM_STATE)?,
            human: node.latest(CELL_HUMAN)?,
            scene: node.latest(SUPERVISOR_SCENE)?,
            task: node.latest(SUPERVISOR_TASK)?,
            command: node.publisher(ARM_COMMAND)?,
            status: node.publisher(CONTROLLER_STATUS)?,
        })
    }
}

/// What the supervisor reads and writes.
pub(super) struct SupervisorPorts {
    pub(super) arm: Latest<JointState>,
    pub(super) human: Latest<HumanState>,
    pub(super) cell: Latest<CellState>,
    pub(super) operator: Latest<OperatorEvent>,
    pub(super) feature: Latest<Feature>,
    pub(super) motion: Latest<MotionStatus>,
    /// In the order of [`super::child::CHILDREN`].
    pub(super) stats: [Latest<RoleStats>; 3],
    pub(super) task: Publisher<MotionTask>,
    pub(super) scene: Publisher<Scene>,
    pub(super) prompt: Publisher<Prompt>,
    pub(super) request: Publisher<CellRequest>,
}

impl SupervisorPorts {
    pub(super) fn open(node: &Node) -> Result<Self, BusError> {
        let [plant, perception, controller] = super::child::CHILDREN;
        let stats = |role| node.latest(&stats_service(role));
        Ok(Self {
            arm: node.latest(ARM_STATE)?,
            human: node.latest(CELL_HUMAN)?,
            cell: node.latest(CELL_STATE)?,
            operator: node.latest(OPERATOR_EVENT)?,
            feature: node.latest(PERCEPTION_FEATURE)?,
            motion: node.latest(CONTROLLER_STATUS)?,
            stats: [stats(plant)?, stats(perception)?, stats(controller)?],
            task: node.publisher(SUPERVISOR_TASK)?,
            scene: node.publisher(SUPERVISOR_SCENE)?,
            prompt: node.publisher(SUPERVISOR_PROMPT)?,
            request: node.publisher(SUPERVISOR_REQUEST)?,
        })
    }
}

/// The service on which a role reports the health of its loop.
pub(super) fn stats_service(role: Role) -> String {
    format!("{}/stats", role.name())
}
