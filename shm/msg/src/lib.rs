//! What crosses a process boundary in a cell, and nothing else.
//!
//! Every message is plain data: `repr(C)`, `Copy`, fixed size, no pointer, no
//! padding left to chance, SI units, sizes asserted where they are declared.
//! Each begins with a [`Header`], whose stamp and sequence number double as its
//! writer's heartbeat. A service carries the *latest value*: whoever reads it
//! may miss values in between, so every message says the whole of what it is
//! about and repeating one changes nothing.
//!
//! **Invariant:** nothing here does input or output, and nothing here trusts a
//! peer: codes are read through [`Code::get`], which answers `None` to a value
//! it does not know, and [`Header::judge`] names what is wrong with a sample.
#![no_std]

mod arm;
mod cell;
mod coded;
mod geometry;
mod header;
mod sensing;
mod task;

pub use arm::{
    EffectorAction, EffectorCommand, EffectorPhase, EffectorState, JointCommand, JointState, PlantFault, Tool,
};
pub use cell::{Answer, CellRequest, CellState, OperatorEvent, Prompt, PromptKind, RequestKind, RequestPhase, Role};
pub use coded::{Code, Coded};
pub use geometry::{Capsule, Pose, SceneObject, ShapeKind};
pub use header::{Freshness, Header, Message, Stamp, Suspect};
pub use sensing::{BodyPart, Feature, FeatureClass, FeatureDimensions, HumanState, Measured, PointCloud, Recognition};
pub use task::{
    AttachedPart, ChangeReason, MotionFailure, MotionPhase, MotionStatus, MotionTask, Planner, RunMode, SafetyMode,
    Scene, StopCategory, StopCause, StopState, Subtask,
};

/// Joints a message has room for; arms of up to this many joints are accepted.
pub const JOINTS_MAX: usize = 8;
/// Points of one cloud, as in the paper's data set (Section 3.1).
pub const CLOUD_POINTS: usize = 10_000;
/// Capsules that cover the tracked body of a person.
pub const HUMAN_CAPSULES_MAX: usize = 16;
/// Objects of a scene.
pub const SCENE_OBJECTS_MAX: usize = 48;
/// Assembly feature classes (Section 2.1 of the paper).
pub const FEATURE_CLASSES: usize = 8;
