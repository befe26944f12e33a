//! The plant and its ports.

use tandem_bus::{Read, Write};
use tandem_msg::{
    CellRequest, CellState, HumanState, JointCommand, JointState, OperatorEvent, PointCloud, Prompt, Stamp,
};

use super::{Ports, service};
use crate::plant::{Plant, PlantInputs, PlantOutputs};

/// The plant with its ports.
pub struct PlantRole<P: Ports> {
    plant: Plant,
    outputs: PlantOutputs,
    command: P::Reader<JointCommand>,
    request: P::Reader<CellRequest>,
    prompt: P::Reader<Prompt>,
    arm: P::Writer<JointState>,
    human: P::Writer<HumanState>,
    cell: P::Writer<CellState>,
    operator: P::Writer<OperatorEvent>,
    cloud: P::Writer<PointCloud>,
    unsent: u64,
}

impl<P: Ports> PlantRole<P> {
    /// Opens the plant's ports.
    ///
    /// # Errors
    /// What the bus says.
    pub fn open(ports: &P, plant: Plant) -> Result<Self, P::Error> {
        Ok(Self {
            plant,
            outputs: PlantOutputs::default(),
            command: ports.reader(service::ARM_COMMAND)?,
            request: ports.reader(service::REQUEST)?,
            prompt: ports.reader(service::PROMPT)?,
            arm: ports.writer(service::ARM_STATE)?,
            human: ports.writer(service::HUMAN)?,
            cell: ports.writer(service::CELL)?,
            operator: ports.writer(service::OPERATOR)?,
            cloud: ports.writer(service::CLOUD)?,
            unsent: 0,
        })
    }

    /// One cycle: reads, simulates, publishes.
    pub fn cycle(&mut self, now: Stamp) {
        let inputs =
            PlantInputs { command: self.command.read(), request: self.request.read(), prompt: self.prompt.read() };
        self.plant.cycle(now, &inputs, &mut self.outputs);
        let out = &self.outputs;
        let mut unsent = u64::from(self.arm.publish(now, &out.arm).is_err())
            + u64::from(self.human.publish(now, &out.human).is_err())
            + u64::from(self.cell.publish(now, &out.cell).is_err())
            + u64::from(self.operator.publish(now, &out.operator).is_err());
        if out.scan_due {
            // The camera writes straight into the loaned sample: a cloud is never copied.
            unsent += u64::from(self.cloud.publish_with(now, |cloud| self.plant.scan(cloud)).is_err());
        }
        self.unsent += unsent;
    }

    /// Messages that reached nobody because the bus had no room.
    pub fn unsent(&self) -> u64 {
        self.unsent
    }
}
