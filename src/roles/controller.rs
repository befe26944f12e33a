//! The controller and its ports.

use tandem_bus::{Read, Write};
use tandem_controller::{Controller, ControllerInputs, ControllerOutputs};
use tandem_msg::{Header, HumanState, JointCommand, JointState, MotionStatus, MotionTask, Scene, Stamp};

use super::{Ports, service};

/// The controller with its ports.
pub struct ControllerRole<P: Ports> {
    controller: Controller,
    outputs: ControllerOutputs,
    arm: P::Reader<JointState>,
    human: P::Reader<HumanState>,
    scene: P::Reader<Scene>,
    task: P::Reader<MotionTask>,
    command: P::Writer<JointCommand>,
    status: P::Writer<MotionStatus>,
    unsent: u64,
}

impl<P: Ports> ControllerRole<P> {
    /// Opens the controller's ports.
    ///
    /// # Errors
    /// What the bus says.
    pub fn open(ports: &P, controller: Controller) -> Result<Self, P::Error> {
        Ok(Self {
            controller,
            outputs: ControllerOutputs::default(),
            arm: ports.reader(service::ARM_STATE)?,
            human: ports.reader(service::HUMAN)?,
            scene: ports.reader(service::SCENE)?,
            task: ports.reader(service::TASK)?,
            command: ports.writer(service::ARM_COMMAND)?,
            status: ports.writer(service::STATUS)?,
            unsent: 0,
        })
    }

    /// One cycle: reads, decides, publishes the command first.
    pub fn cycle(&mut self, now: Stamp) {
        let inputs = ControllerInputs {
            arm: self.arm.read(),
            human: self.human.read(),
            scene: self.scene.read(),
            task: self.task.read(),
        };
        self.controller.cycle(now, &inputs, &mut self.outputs);
        self.unsent += u64::from(self.command.publish(now, &self.outputs.command).is_err());
        self.unsent += u64::from(self.status.publish(now, &self.outputs.status).is_err());
    }

    /// Header of the last value heard of each input, in the order of [`service::inputs`].
    pub fn heard(&self) -> [Header; 4] {
        [self.arm.held().header, self.human.held().header, self.scene.held().header, self.task.held().header]
    }

    /// The role itself, for the records of its stops.
    pub fn controller(&mut self) -> &mut Controller {
        &mut self.controller
    }

    /// What was told to everyone in the last cycle.
    pub fn status(&self) -> &MotionStatus {
        &self.outputs.status
    }

    /// Messages that reached nobody because the bus had no room.
    pub fn unsent(&self) -> u64 {
        self.unsent
    }
}
