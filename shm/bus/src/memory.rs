//! The bus inside one process: the same headers, the same latest value, no shared memory.

use std::cell::RefCell;
use std::rc::Rc;

use tandem_msg::{Header, Message, Stamp};

use crate::reader::newer;
use crate::{Identity, Read, Unsent, Write};

/// A service inside one process.
pub struct Slot<M: Message>(Rc<RefCell<M>>);

/// Writes one message type of one slot.
pub struct SlotWriter<M: Message> {
    slot: Rc<RefCell<M>>,
    last: Header,
}

/// The latest value of one slot.
pub struct SlotReader<M: Message> {
    slot: Rc<RefCell<M>>,
    held: Box<M>,
}

impl<M: Message> Default for Slot<M> {
    fn default() -> Self {
        Self(Rc::default())
    }
}

impl<M: Message> Slot<M> {
    /// The writing end for a writer of this identity.
    pub fn writer(&self, identity: &Identity) -> SlotWriter<M> {
        let last = Header { epoch: identity.epoch, config_hash: identity.config_hash, ..Header::default() };
        SlotWriter { slot: Rc::clone(&self.0), last }
    }

    /// A reading end.
    pub fn reader(&self) -> SlotReader<M> {
        SlotReader { slot: Rc::clone(&self.0), held: Box::default() }
    }
}

impl<M: Message> Write<M> for SlotWriter<M> {
    fn publish_with(&mut self, stamp: Stamp, fill: impl FnOnce(&mut M)) -> Result<Header, Unsent> {
        let mut slot = self.slot.try_borrow_mut().map_err(|_| Unsent::NoSlot)?;
        fill(&mut slot);
        self.last = self.last.next(stamp);
        *slot.header_mut() = self.last;
        Ok(self.last)
    }
}

impl<M: Message> Read<M> for SlotReader<M> {
    fn read(&mut self) -> &M {
        let slot = self.slot.borrow();
        if newer(slot.header(), self.held.header()) {
            *self.held = *slot;
        }
        drop(slot);
        &self.held
    }

    fn held(&self) -> &M {
        &self.held
    }
}
