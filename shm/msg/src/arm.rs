//! The arm and what it carries at its flange: plant to controller and back.

use crate::coded::coded;
use crate::header::message;
use crate::{Code, Header, JOINTS_MAX, Stamp};

coded! {
    /// The four assembly tools of the cell (Fig. 4 of the paper counts four, without naming them).
    pub enum Tool {
        /// Bare flange.
        None = 0, "none";
        /// Two-finger gripper.
        ParallelGripper = 1, "parallel_gripper";
        /// Suction cup.
        VacuumGripper = 2, "vacuum_gripper";
        /// Driven spindle for threads; holds the part it turns.
        Screwdriver = 3, "screwdriver";
        /// Force-controlled ram for press and snap fits; holds the part it presses.
        PressTool = 4, "press_tool";
    }
}

coded! {
    /// What the tool is asked to do.
    pub enum EffectorAction {
        /// Keep as is.
        Keep = 0, "keep";
        /// Close or suck until the part is held. Value: expected width, metres (0 = not checked).
        Grasp = 1, "grasp";
        /// Let go of the part.
        Release = 2, "release";
        /// Turn the held part home. Value: torque, Nm.
        Screw = 3, "screw";
        /// Press the held part home. Value: force, N.
        Press = 4, "press";
        /// Couple the tool that stands in the rack at the TCP. Tool field says which.
        AttachTool = 5, "attach_tool";
        /// Leave the coupled tool in the rack.
        DetachTool = 6, "detach_tool";
        /// Set the held part down where it is: seat it, then let go.
        Seat = 7, "seat";
    }
}

coded! {
    /// How far an effector command has come.
    pub enum EffectorPhase {
        /// Nothing asked yet.
        Idle = 0, "idle";
        /// Under way.
        Busy = 1, "busy";
        /// Done as asked.
        Done = 2, "done";
        /// Did not succeed: nothing gripped, torque not reached, no such tool.
        Failed = 3, "failed";
    }
}

coded! {
    /// Why the plant holds its brakes.
    pub enum PlantFault {
        /// Brakes are open.
        None = 0, "none";
        /// The last command's `valid_until` has passed.
        CommandExpired = 1, "command_expired";
        /// A command was not finite, out of range or of a replaced writer.
        CommandRefused = 2, "command_refused";
        /// No command was ever heard.
        NeverCommanded = 3, "never_commanded";
    }
}

/// What a tool is asked for; a new `id` starts a new action.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct EffectorCommand {
    /// Counts actions; the plant acts once on each new number.
    pub id: u32,
    /// The action.
    pub action: Code<EffectorAction>,
    /// The tool, for `AttachTool` and `DetachTool`.
    pub tool: Code<Tool>,
    /// Zero; keeps the layout free of padding.
    pub reserved: u32,
    /// Quantity of the action, in the unit [`EffectorAction`] names.
    pub value: f64,
}

/// What a tool reports.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct EffectorState {
    /// `EffectorCommand::id` this speaks of.
    pub command_id: u32,
    /// How far it has come.
    pub phase: Code<EffectorPhase>,
    /// Tool coupled to the flange.
    pub tool: Code<Tool>,
    /// 1 when the part-presence sensor sees a part, else 0.
    pub holding: u32,
    /// Opening of the fingers, metres.
    pub width: f64,
    /// Force or torque at the tool in the unit of the action.
    pub force: f64,
}

/// Measured state of the arm, plant to everyone. SI units, radians.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct JointState {
    /// Header.
    pub header: Header,
    /// Joints in use; entries past it are 0.
    pub joint_count: u32,
    /// Why the brakes are closed, if they are.
    pub fault: Code<PlantFault>,
    /// Measured position, rad.
    pub position: [f64; JOINTS_MAX],
    /// Measured velocity, rad/s.
    pub velocity: [f64; JOINTS_MAX],
    /// Motor effort, Nm.
    pub effort: [f64; JOINTS_MAX],
    /// Sequence number of the command this state answers to; 0 while braking by itself.
    pub command_seq: u64,
    /// Stamp of that command.
    pub command_stamp: Stamp,
    /// Share of the brakes the arm is slowed by, 0 to 1: of its own accord when commands are late, or as asked.
    pub braking: f64,
    /// The tool.
    pub effector: EffectorState,
}
message!(JointState, 288);

/// What the arm is asked for, controller to plant. SI units, radians.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct JointCommand {
    /// Header.
    pub header: Header,
    /// The next command is due by then. Without it the plant slows down by itself along its path, the harder the
    /// nearer `valid_until` is; with it, it catches up.
    pub next_due: Stamp,
    /// The plant brakes by itself to a standstill when this instant has passed.
    pub valid_until: Stamp,
    /// Joints in use.
    pub joint_count: u32,
    /// 1 asks for category 1: brake at once, whatever the set-points say.
    pub brake: u32,
    /// Set-point position, rad.
    pub position: [f64; JOINTS_MAX],
    /// Set-point velocity, rad/s.
    pub velocity: [f64; JOINTS_MAX],
    /// Set-point acceleration, rad/s².
    pub acceleration: [f64; JOINTS_MAX],
    /// The tool.
    pub effector: EffectorCommand,
}
message!(JointCommand, 272);
