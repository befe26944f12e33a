//! The reading end of a service.

use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::ipc;
use iceoryx2::sample::Sample;
use tandem_msg::{Header, Message};

use crate::Read;
use crate::wire::Wire;

/// Writers of a service times its buffer, and one: no read takes in more than this.
const TAKEN_MAX: usize = 3;

/// The latest value of one service. Holds its slot of shared memory until a newer one comes,
/// also when the writer is dead.
pub struct Latest<M: Message> {
    port: Subscriber<ipc::Service, Wire<M>, ()>,
    held: Option<Sample<ipc::Service, Wire<M>, ()>>,
    /// What is read before anything was heard.
    never: Box<M>,
    failures: u64,
}

impl<M: Message> Latest<M> {
    pub(crate) fn new(port: Subscriber<ipc::Service, Wire<M>, ()>) -> Self {
        Self { port, held: None, never: Box::default(), failures: 0 }
    }

    /// Connects to writers that came since the last call, so that the next read need not.
    /// False when one failed.
    pub fn connect(&self) -> bool {
        self.port.update_connections().is_ok()
    }

    /// Reads that found a connection broken.
    pub fn failures(&self) -> u64 {
        self.failures
    }
}

impl<M: Message> Read<M> for Latest<M> {
    /// # Realtime
    /// Never blocks and allocates nothing; no system call unless a writer has come or gone.
    fn read(&mut self) -> &M {
        for _ in 0..TAKEN_MAX {
            match self.port.receive() {
                Ok(Some(sample)) => {
                    if newer(sample.payload().0.header(), self.held().header()) {
                        self.held = Some(sample);
                    }
                }
                Ok(None) => break,
                Err(_) => {
                    self.failures += 1;
                    break;
                }
            }
        }
        self.held()
    }

    fn held(&self) -> &M {
        self.held.as_ref().map_or(&*self.never, |sample| &sample.payload().0)
    }
}

/// Whether a value that has just come in replaces the one that is held.
pub(crate) fn newer(incoming: &Header, held: &Header) -> bool {
    (incoming.epoch, incoming.seq) > (held.epoch, held.seq) || !held.heard()
}
