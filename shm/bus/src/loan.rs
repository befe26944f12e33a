//! Large messages: written and read where they lie, never copied.
//!
//! Each publication is a loaned sample of iceoryx2. A loan makes one small heap
//! allocation (since iceoryx2 0.10) and a peer that comes or goes is connected
//! where it is noticed, so both ends belong into a thread that need not be on time:
//! a camera's, perception's.

#![allow(unsafe_code)]

use iceoryx2::port::publisher::Publisher as Port;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::port::update_connections::UpdateConnections as _;
use iceoryx2::prelude::ipc;
use iceoryx2::sample::Sample;
use tandem_msg::{Header, Message, Stamp};

use crate::reader::newer;
use crate::wire::Wire;
use crate::{Read, Unsent, Write};

/// Writers of a service times its buffer, and one: no read takes in more than this.
const TAKEN_MAX: usize = 3;

/// Writes one message type of one service, in place. Bound to the thread it was opened on.
pub struct Lender<M: Message> {
    port: Port<ipc::Service, Wire<M>, ()>,
    last: Header,
}

/// The latest value of one service, where it lies. Holds its slot of shared memory until a newer one comes,
/// also when the writer is dead. Bound to the thread it was opened on.
pub struct Borrower<M: Message> {
    port: Subscriber<ipc::Service, Wire<M>, ()>,
    held: Option<Sample<ipc::Service, Wire<M>, ()>>,
    /// What is read before anything was heard.
    never: Box<M>,
    failures: u64,
}

impl<M: Message> Lender<M> {
    pub(crate) fn new(port: Port<ipc::Service, Wire<M>, ()>, first: Header) -> Self {
        Self { port, last: first }
    }
}

impl<M: Message> Borrower<M> {
    pub(crate) fn new(port: Subscriber<ipc::Service, Wire<M>, ()>) -> Self {
        Self { port, held: None, never: Box::default(), failures: 0 }
    }

    /// Reads that found a connection broken.
    pub fn failures(&self) -> u64 {
        self.failures
    }
}

impl<M: Message> Write<M> for Lender<M> {
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

    fn tend(&mut self) {
        // What failed is tried again with the next publication.
        let _ = self.port.update_connections();
    }
}

impl<M: Message> Read<M> for Borrower<M> {
    /// Never blocks; a few system calls when a writer has come or gone.
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
