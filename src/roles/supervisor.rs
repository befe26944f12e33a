//! The supervisor and its ports.

use tandem_bus::{Read, Write};
use tandem_msg::{
    CellRequest, CellState, Feature, Header, HumanState, JointState, MotionStatus, MotionTask, OperatorEvent, Prompt,
    Scene, Stamp,
};

use super::{Ports, service};
use crate::supervisor::{RoleHealth, Summary, Supervisor, SupervisorInputs, SupervisorOutputs};

/// The supervisor with its ports.
pub struct SupervisorRole<P: Ports> {
    supervisor: Supervisor,
    outputs: SupervisorOutputs,
    arm: P::Reader<JointState>,
    human: P::Reader<HumanState>,
    feature: P::Reader<Feature>,
    status: P::Reader<MotionStatus>,
    operator: P::Reader<OperatorEvent>,
    cell: P::Reader<CellState>,
    task: P::Writer<MotionTask>,
    scene: P::Writer<Scene>,
    prompt: P::Writer<Prompt>,
    request: P::Writer<CellRequest>,
    unsent: u64,
}

/// What the shell knows and the messages do not say.
#[derive(Clone, Copy, Debug)]
pub struct Surroundings {
    /// Health of each role, by its code.
    pub roles: [RoleHealth; 4],
    /// Highest journal sequence number that is durable.
    pub journal_committed: u64,
    /// The run shall end: stop the arm first.
    pub halt: bool,
}

impl<P: Ports> SupervisorRole<P> {
    /// Opens the supervisor's ports.
    ///
    /// # Errors
    /// What the bus says.
    pub fn open(ports: &P, supervisor: Supervisor) -> Result<Self, P::Error> {
        Ok(Self {
            supervisor,
            outputs: SupervisorOutputs::default(),
            arm: ports.reader(service::ARM_STATE)?,
            human: ports.reader(service::HUMAN)?,
            feature: ports.reader(service::FEATURE)?,
            status: ports.reader(service::STATUS)?,
            operator: ports.reader(service::OPERATOR)?,
            cell: ports.reader(service::CELL)?,
            task: ports.writer(service::TASK)?,
            scene: ports.writer(service::SCENE)?,
            prompt: ports.writer(service::PROMPT)?,
            request: ports.writer(service::REQUEST)?,
            unsent: 0,
        })
    }

    /// One cycle: reads, decides, publishes. The events, journal entries and the
    /// outcome of this cycle are in the outputs that are returned.
    pub fn cycle(&mut self, now: Stamp, around: &Surroundings) -> &mut SupervisorOutputs {
        let inputs = SupervisorInputs {
            arm: self.arm.read(),
            human: self.human.read(),
            feature: self.feature.read(),
            motion: self.status.read(),
            operator: self.operator.read(),
            cell: self.cell.read(),
            roles: around.roles,
            journal_committed: around.journal_committed,
            halt: around.halt,
        };
        self.supervisor.cycle(now, &inputs, &mut self.outputs);
        let out = &self.outputs;
        self.unsent += u64::from(self.task.publish(now, &out.task).is_err())
            + u64::from(self.scene.publish(now, &out.scene).is_err())
            + u64::from(self.prompt.publish(now, &out.prompt).is_err())
            + u64::from(self.request.publish(now, &out.request).is_err());
        &mut self.outputs
    }

    /// Header of the last value heard of each input, in the order of [`service::inputs`]:
    /// first the arm's state, the feature and the controller's status.
    pub fn heard(&self) -> [Header; 6] {
        [
            self.arm.held().header,
            self.feature.held().header,
            self.status.held().header,
            self.human.held().header,
            self.operator.held().header,
            self.cell.held().header,
        ]
    }

    /// The measured state of the arm as it was last read.
    pub fn arm(&self) -> &JointState {
        self.arm.held()
    }

    /// The numbers of the run so far.
    pub fn summary(&self) -> Summary {
        self.supervisor.summary()
    }

    /// Messages that reached nobody because the bus had no room.
    pub fn unsent(&self) -> u64 {
        self.unsent
    }
}
