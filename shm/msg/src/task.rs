//! Work for the arm and what became of it: supervisor to controller and back.

use crate::coded::coded;
use crate::header::message;
use crate::{Code, EffectorAction, Header, Pose, SCENE_OBJECTS_MAX, SceneObject, Tool};

coded! {
    /// What a motion is for; the first four are the paper's (Section 3.2.2).
    pub enum Subtask {
        /// No task.
        None = 0, "none";
        /// Move to a part and take it.
        Grasp = 1, "grasp";
        /// Carry it across the cell.
        Transfer = 2, "transfer";
        /// Set it down.
        Place = 3, "place";
        /// Join it to the product.
        Assemble = 4, "assemble";
        /// Couple or leave a tool.
        ToolChange = 5, "tool_change";
        /// Offer it to a person and let go.
        HandOver = 6, "hand_over";
        /// Hold it still while a person works on it.
        HoldStill = 7, "hold";
        /// Go to the resting configuration.
        Home = 8, "home";
    }
}

coded! {
    /// Whether the arm may move; obeyed every cycle, whatever the task.
    pub enum RunMode {
        /// Controlled stop, then hold: shutting down or not yet ready. The default, so silence never moves an arm.
        Halt = 0, "halt";
        /// Carry out the task.
        Run = 1, "run";
        /// Controlled stop on the path; `Run` goes on from there.
        Pause = 2, "pause";
        /// Carry out the task at reduced speed.
        Reduced = 3, "reduced";
    }
}

/// The part in the tool, as a box around it or a registered hull, for clearance. All zero when nothing is carried.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct AttachedPart {
    /// 1 when a part is carried, else 0.
    pub present: u32,
    /// Number of a hull that was registered at start, when the part is given as one; 0: it is the box.
    pub shape: u32,
    /// Half extents of the box, metres.
    pub half_extents: [f64; 3],
    /// Its centre and axes.
    pub tcp_from_part: Pose,
    /// Mass, kg.
    pub mass: f64,
}

/// One motion with its final action, supervisor to controller: the paper's
/// "initial pose, end pose, obstacle, final action" (Section 2); the initial pose
/// is wherever the arm is, the obstacles are the [`Scene`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct MotionTask {
    /// Header; its stamp is the supervisor's heartbeat.
    pub header: Header,
    /// Identity, never reused; a new number replaces the task.
    pub id: u32,
    /// What it is for.
    pub subtask: Code<Subtask>,
    /// Whether to move.
    pub run: Code<RunMode>,
    /// Grows by one to clear a latched stop.
    pub reset_count: u32,
    /// Where the TCP shall come to rest; ignored by `Home`.
    pub base_from_tcp: Pose,
    /// The last stretch is straight along the goal's own z axis, this long, metres.
    pub approach: f64,
    /// After the final action, straight back along the same axis, this far, metres.
    pub retract: f64,
    /// Share of the arm's limits to use, above 0 and at most 1.
    pub speed: f64,
    /// Done at the goal, before the retract.
    pub action: Code<EffectorAction>,
    /// Tool of the action.
    pub tool: Code<Tool>,
    /// Quantity of the action.
    pub value: f64,
    /// What the tool carries on the way to the goal.
    pub attached_before: AttachedPart,
    /// What it carries after the action.
    pub attached_after: AttachedPart,
    /// Scene objects that tool and carried part may touch on the approach, at the goal and on the retract; 0 = none.
    pub touch: [u32; 8],
    /// The task needs this version of the scene, or a later one.
    pub scene_version: u64,
}
message!(MotionTask, 376);

coded! {
    /// Where a task stands.
    pub enum MotionPhase {
        /// No task.
        Idle = 0, "idle";
        /// Searching a path.
        Planning = 1, "planning";
        /// Withdrawing from where it stood.
        Depart = 2, "depart";
        /// On the way across.
        Transfer = 3, "transfer";
        /// On the last straight stretch.
        Approach = 4, "approach";
        /// The tool is at work.
        Acting = 5, "acting";
        /// Withdrawing after the action.
        Retract = 6, "retract";
        /// Finished as asked.
        Done = 7, "done";
        /// Given up; `failure` says why.
        Failed = 8, "failed";
    }
}

coded! {
    /// Why a task was given up.
    pub enum MotionFailure {
        /// It was not.
        None = 0, "none";
        /// A number of the task is not finite or out of range.
        InvalidTask = 1, "invalid_task";
        /// No joint position reaches the goal.
        Unreachable = 2, "unreachable";
        /// Every path that was tried meets an obstacle.
        NoClearPath = 3, "no_clear_path";
        /// The tool reported failure.
        ActionFailed = 4, "action_failed";
        /// The tool gave no answer in time.
        ActionTimeout = 5, "action_timeout";
        /// The part was lost on the way.
        PartLost = 6, "part_lost";
    }
}

coded! {
    /// Who planned the motion.
    pub enum Planner {
        /// Nobody yet.
        None = 0, "none";
        /// Hand-designed retract, transfer, approach: the paper's manual method.
        Manual = 1, "manual";
        /// Rapidly-exploring random trees from both ends, when no hand-designed path is clear.
        RrtConnect = 2, "rrt_connect";
        /// A learned policy, rolled out ahead of time and found clear.
        Policy = 3, "policy";
        /// Nobody had to: straight on, or straight back.
        Straight = 4, "straight";
    }
}

coded! {
    /// Why the arm went over to another way while it was moving.
    pub enum ChangeReason {
        /// It did not.
        None = 0, "none";
        /// Something had come into the one it followed.
        Blocked = 1, "blocked";
        /// The other one was clearly shorter.
        Shorter = 2, "shorter";
    }
}

coded! {
    /// Which limits the arm moves under.
    pub enum SafetyMode {
        /// Those of its files.
        Normal = 0, "normal";
        /// A lower speed, by request or because a person is near.
        Reduced = 1, "reduced";
        /// Found in contact or outside its limits: slowly out of it, in steps that make nothing worse.
        Recovery = 2, "recovery";
    }
}

coded! {
    /// Whether the arm may keep moving.
    pub enum StopState {
        /// It may.
        Running = 0, "running";
        /// It is being stopped.
        Stopping = 1, "stopping";
        /// It stands, and stays until the cause is gone and a reset is heard.
        Stopped = 2, "stopped";
    }
}

coded! {
    /// Stop categories of IEC 60204-1.
    pub enum StopCategory {
        /// Power removed at once.
        Zero = 0, "0";
        /// Controlled stop, then brakes.
        One = 1, "1";
        /// Controlled stop, power stays on.
        Two = 2, "2";
    }
}

coded! {
    /// Why the arm was stopped.
    pub enum StopCause {
        /// It was not.
        None = 0, "none";
        /// A person came nearer than the protective separation.
        Separation = 1, "separation";
        /// Clearance to the scene or to itself below its minimum.
        Clearance = 2, "clearance";
        /// The arm's measured state is late or missing.
        ArmStale = 3, "arm_stale";
        /// The tracked person is late or missing.
        HumanStale = 4, "human_stale";
        /// The scene is missing or not valid.
        SceneInvalid = 5, "scene_invalid";
        /// The supervisor has gone silent.
        SupervisorStale = 6, "supervisor_stale";
        /// A sample was not finite or out of range.
        InputInvalid = 7, "input_invalid";
        /// The arm did not follow its command.
        TrackingError = 8, "tracking_error";
        /// A joint is outside its limits.
        JointLimit = 9, "joint_limit";
        /// The plant closed its brakes.
        PlantBraked = 10, "plant_braked";
        /// An internal check failed.
        Internal = 11, "internal";
        /// A sample came from a replaced writer or another configuration.
        ForeignWriter = 12, "foreign_writer";
        /// The arm was about to leave its workspace.
        Workspace = 13, "workspace";
    }
}

/// What the controller does, every cycle, to everyone.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct MotionStatus {
    /// Header.
    pub header: Header,
    /// `MotionTask::id` this speaks of.
    pub task_id: u32,
    /// Where it stands.
    pub phase: Code<MotionPhase>,
    /// Why it was given up.
    pub failure: Code<MotionFailure>,
    /// Who planned it.
    pub planner: Code<Planner>,
    /// Whether the arm may move.
    pub stop: Code<StopState>,
    /// Why not.
    pub cause: Code<StopCause>,
    /// How it was stopped.
    pub category: Code<StopCategory>,
    /// 1 when every commanded joint velocity is 0.
    pub standstill: u32,
    /// Latched stops since start.
    pub stop_count: u32,
    /// `MotionTask::reset_count` last obeyed.
    pub reset_seen: u32,
    /// Limits in force.
    pub mode: Code<SafetyMode>,
    /// Ways that were changed for another in motion, since start.
    pub changes: u32,
    /// Why the last one was; who planned the other is `planner`.
    pub change_reason: Code<ChangeReason>,
    /// Policies that led the arm across, where they planned it: a bit for the number of each one's subtask.
    pub led_by: u32,
    /// Arm link (index) and scene object (id; 0 = the arm itself, 1000 + k = capsule k of the person) that are nearest.
    pub nearest: [u32; 2],
    /// Clearance now: smallest distance from arm or carried part to anything it must not touch, metres.
    pub clearance: f64,
    /// Smallest clearance since the task began, metres.
    pub clearance_min: f64,
    /// Distance to the part of a person that has least to spare beyond what it is owed, metres; infinite when
    /// nobody is in view.
    pub separation: f64,
    /// Distance that is owed to that part now, metres.
    pub separation_required: f64,
    /// Seconds a stop from the commanded state would take; 0 at rest.
    pub stopping_time: f64,
    /// Share of nominal speed in use, 0 to 1.
    pub speed: f64,
    /// Speed of the TCP, m/s.
    pub tcp_speed: f64,
    /// Seconds since the task began, standing time included.
    pub elapsed: f64,
    /// Expected seconds to the goal from the task's beginning.
    pub expected: f64,
    /// Scene version in use.
    pub scene_version: u64,
    /// Where the TCP is, by the measured joints.
    pub base_from_tcp: Pose,
}
message!(MotionStatus, 232);

/// Everything fixed or placed that the arm must not touch, supervisor to controller.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct Scene {
    /// Header.
    pub header: Header,
    /// Grows with every change of the objects.
    pub version: u64,
    /// Objects in use, the first of the array.
    pub object_count: u32,
    /// Zero; keeps the layout free of padding.
    pub reserved: u32,
    /// Objects, in the base frame.
    pub objects: [SceneObject; SCENE_OBJECTS_MAX],
}
message!(Scene, 4_272);

impl Default for Scene {
    fn default() -> Self {
        Self {
            header: Header::default(),
            version: 0,
            object_count: 0,
            reserved: 0,
            objects: [SceneObject::default(); SCENE_OBJECTS_MAX],
        }
    }
}

impl Scene {
    /// The objects in use; a count beyond the array is cut to it.
    pub fn objects(&self) -> &[SceneObject] {
        &self.objects[..(self.object_count as usize).min(SCENE_OBJECTS_MAX)]
    }
}
