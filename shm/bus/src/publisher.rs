//! The writing end of a service.

#![allow(unsafe_code)]

use iceoryx2::port::publisher::Publisher as Port;
use iceoryx2::port::update_connections::UpdateConnections;
use iceoryx2::prelude::ipc;
use tandem_msg::{Header, Message, Stamp};

use crate::Write;
use crate::wire::Wire;

/// Why a message was not published. The next cycle publishes anew; count it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unsent {
    /// No slot was free.
    NoSlot,
    /// A reader's connection is broken; the others were served.
    Connection,
}

/// Writes one message type of one service.
pub struct Publisher<M: Message> {
    port: Port<ipc::Service, Wire<M>, ()>,
    last: Header,
}

impl<M: Message> Publisher<M> {
    pub(crate) fn new(port: Port<ipc::Service, Wire<M>, ()>, first: Header) -> Self {
        Self { port, last: first }
    }

    /// Connects to readers that came since the last call, so that the next publish
    /// need not: mapping their memory costs system calls. False when one failed.
    pub fn connect(&self) -> bool {
        self.port.update_connections().is_ok()
    }

    /// Header of the last publication.
    pub fn last(&self) -> &Header {
        &self.last
    }
}

impl<M: Message> Write<M> for Publisher<M> {
    /// # Realtime
    /// One small heap allocation by iceoryx2 0.10 for the loan; no system call unless a reader has come or gone.
    /// `fill` writes straight into shared memory: nothing is copied afterwards.
    fn publish_with(&mut self, stamp: Stamp, fill: impl FnOnce(&mut M)) -> Result<Header, Unsent> {
        let mut loan = self.port.loan_uninit().map_err(|_| Unsent::NoSlot)?;
        let header = self.last.next(stamp);
        // SAFETY: the slot is mapped shared memory that this loan alone may write; it
        // holds zeros from the kernel or an earlier message, and the implementor of
        // `Message` vouches that every bit pattern is a valid value.
        let slot: &mut M = unsafe { &mut *loan.payload_mut().as_mut_ptr().cast::<M>() };
        fill(slot);
        *slot.header_mut() = header;
        // SAFETY: initialised above, by the argument above.
        let sample = unsafe { loan.assume_init() };
        // A publication that reached only some readers has used its number.
        self.last = header;
        sample.send().map(|_| header).map_err(|_| Unsent::Connection)
    }
}
