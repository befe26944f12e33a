//! The plant and its ports.

use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::Duration;

use tandem_bus::{Read, Write};
use tandem_msg::{
    CellRequest, CellState, Header, HumanState, JointCommand, JointState, OperatorEvent, PointCloud, Prompt, Stamp,
};

use super::{Ports, service};
use crate::plant::{Eye, Plant, PlantInputs, PlantOutputs, Shot};

/// Between two looks of an idle camera at who looks at its pictures.
const TEND: Duration = Duration::from_millis(50);

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
    camera: Camera<P>,
    unsent: u64,
}

/// Where pictures are taken.
enum Camera<P: Ports> {
    /// In the plant's cycle.
    Within(P::Lender<PointCloud>),
    /// By a [`CameraRole`] on another thread.
    Apart(SyncSender<(Stamp, Shot)>),
}

/// The plant's camera, to be run on a thread of its own.
pub struct CameraRole {
    eye: Eye,
    shots: Receiver<(Stamp, Shot)>,
}

impl CameraRole {
    /// Opens the camera's port.
    ///
    /// # Errors
    /// What the bus says.
    pub fn open<P: Ports>(&self, ports: &P) -> Result<P::Lender<PointCloud>, P::Error> {
        ports.lender(service::CLOUD)
    }

    /// Takes the pictures the plant asks for, until the plant is dropped.
    pub fn run(mut self, mut cloud: impl Write<PointCloud>) {
        loop {
            match self.shots.recv_timeout(TEND) {
                // Straight into the loaned sample: a cloud is never copied. One that is lost is missed by the
                // supervisor, which has the part scanned again.
                Ok((stamp, shot)) => drop(cloud.publish_with(stamp, |cloud| self.eye.scan(&shot, cloud))),
                Err(RecvTimeoutError::Timeout) => cloud.tend(),
                Err(RecvTimeoutError::Disconnected) => return,
            }
        }
    }
}

impl<P: Ports> PlantRole<P> {
    /// Opens the plant's ports.
    ///
    /// # Errors
    /// What the bus says.
    pub fn open(ports: &P, plant: Plant) -> Result<Self, P::Error> {
        let camera = Camera::Within(ports.lender(service::CLOUD)?);
        Self::with_camera(ports, plant, camera)
    }

    /// Opens the plant's ports but the camera's, which is handed back to be run on
    /// another thread; `None` when the plant has no camera any more.
    ///
    /// # Errors
    /// What the bus says.
    pub fn open_apart(ports: &P, mut plant: Plant) -> Result<(Self, Option<CameraRole>), P::Error> {
        // One picture may wait while one is taken.
        let (sender, shots) = sync_channel(1);
        let camera = plant.take_camera().map(|eye| CameraRole { eye, shots });
        Ok((Self::with_camera(ports, plant, Camera::Apart(sender))?, camera))
    }

    fn with_camera(ports: &P, plant: Plant, camera: Camera<P>) -> Result<Self, P::Error> {
        Ok(Self {
            camera,
            plant,
            outputs: PlantOutputs::default(),
            command: ports.reader(service::ARM_COMMAND)?,
            request: ports.reader(service::REQUEST)?,
            prompt: ports.reader(service::PROMPT)?,
            arm: ports.writer(service::ARM_STATE)?,
            human: ports.writer(service::HUMAN)?,
            cell: ports.writer(service::CELL)?,
            operator: ports.writer(service::OPERATOR)?,
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
            unsent += u64::from(match &mut self.camera {
                // The camera writes straight into the loaned sample: a cloud is never copied.
                Camera::Within(cloud) => cloud.publish_with(now, |cloud| self.plant.scan(cloud)).is_err(),
                Camera::Apart(shots) => shots.try_send((now, self.plant.shot())).is_err(),
            });
        }
        self.unsent += unsent;
    }

    /// Header of the last value heard of each input, in the order of [`service::inputs`].
    pub fn heard(&self) -> [Header; 3] {
        [self.command.held().header, self.request.held().header, self.prompt.held().header]
    }

    /// Messages that reached nobody because the bus had no room.
    pub fn unsent(&self) -> u64 {
        self.unsent
    }
}
