//! Where a role's ports come from.

use std::any::Any;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::convert::Infallible;
use std::rc::Rc;

use tandem_bus::{
    Borrower, BusError, Identity, Latest, Lender, Node, Publisher, Read, Slot, SlotReader, SlotWriter, Write,
};
use tandem_msg::Message;

/// Opens the ports of one role.
pub trait Ports {
    /// The writing end of a service.
    type Writer<M: Message>: Write<M>;
    /// The reading end of a service.
    type Reader<M: Message>: Read<M>;
    /// The writing end of a service whose messages are written in place.
    type Lender<M: Message>: Write<M>;
    /// The reading end of such a service.
    type Borrower<M: Message>: Read<M>;
    /// Why a port could not be opened.
    type Error;

    /// Opens a service to write.
    ///
    /// # Errors
    /// What the bus says.
    fn writer<M: Message>(&self, service: &str) -> Result<Self::Writer<M>, Self::Error>;

    /// Opens a service to read.
    ///
    /// # Errors
    /// What the bus says.
    fn reader<M: Message>(&self, service: &str) -> Result<Self::Reader<M>, Self::Error>;

    /// Opens a service to write in place: for large messages, outside a realtime loop.
    ///
    /// # Errors
    /// What the bus says.
    fn lender<M: Message>(&self, service: &str) -> Result<Self::Lender<M>, Self::Error>;

    /// Opens a service to read in place: for large messages, outside a realtime loop.
    ///
    /// # Errors
    /// What the bus says.
    fn borrower<M: Message>(&self, service: &str) -> Result<Self::Borrower<M>, Self::Error>;
}

impl Ports for Node {
    type Writer<M: Message> = Publisher<M>;
    type Reader<M: Message> = Latest<M>;
    type Lender<M: Message> = Lender<M>;
    type Borrower<M: Message> = Borrower<M>;
    type Error = BusError;

    fn writer<M: Message>(&self, service: &str) -> Result<Publisher<M>, BusError> {
        self.publisher(service)
    }

    fn reader<M: Message>(&self, service: &str) -> Result<Latest<M>, BusError> {
        self.latest(service)
    }

    fn lender<M: Message>(&self, service: &str) -> Result<Lender<M>, BusError> {
        self.lender(service)
    }

    fn borrower<M: Message>(&self, service: &str) -> Result<Borrower<M>, BusError> {
        self.borrower(service)
    }
}

/// The services of a cell inside one process, seen by one role.
#[derive(Clone)]
pub struct MemoryPorts {
    slots: Rc<RefCell<BTreeMap<String, Box<dyn Any>>>>,
    identity: Identity,
}

impl MemoryPorts {
    /// A bus without services; they come into being when they are opened.
    pub fn new(identity: Identity) -> Self {
        Self { slots: Rc::default(), identity }
    }

    /// The same services, seen by another role or another incarnation of it.
    #[must_use]
    pub fn seen_by(&self, identity: Identity) -> Self {
        Self { slots: Rc::clone(&self.slots), identity }
    }

    fn slot<M: Message, T>(&self, service: &str, open: impl FnOnce(&Slot<M>) -> T) -> T {
        let mut slots = self.slots.borrow_mut();
        let slot = slots.entry(service.to_owned()).or_insert_with(|| Box::new(Slot::<M>::default()));
        open(slot.downcast_ref().expect("a service carries one type of message"))
    }
}

impl Ports for MemoryPorts {
    type Writer<M: Message> = SlotWriter<M>;
    type Reader<M: Message> = SlotReader<M>;
    type Lender<M: Message> = SlotWriter<M>;
    type Borrower<M: Message> = SlotReader<M>;
    type Error = Infallible;

    fn writer<M: Message>(&self, service: &str) -> Result<SlotWriter<M>, Infallible> {
        Ok(self.slot(service, |slot: &Slot<M>| slot.writer(&self.identity)))
    }

    fn reader<M: Message>(&self, service: &str) -> Result<SlotReader<M>, Infallible> {
        Ok(self.slot(service, |slot: &Slot<M>| slot.reader()))
    }

    fn lender<M: Message>(&self, service: &str) -> Result<SlotWriter<M>, Infallible> {
        self.writer(service)
    }

    fn borrower<M: Message>(&self, service: &str) -> Result<SlotReader<M>, Infallible> {
        self.reader(service)
    }
}
