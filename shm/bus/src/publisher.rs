//! The writing end of a channel.

#![allow(unsafe_code)]

use tandem_msg::{Header, Message, Stamp};

use crate::Write;
use crate::link::{Claim, Place};

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
    place: Place<M>,
    /// What is published next is put together here.
    staged: Box<M>,
    last: Header,
    _claim: Claim,
}

impl<M: Message> Publisher<M> {
    pub(crate) fn new(place: Place<M>, first: Header, claim: Claim) -> Self {
        Self { place, staged: Box::default(), last: first, _claim: claim }
    }

    /// Header of the last publication.
    pub fn last(&self) -> &Header {
        &self.last
    }
}

impl<M: Message> Write<M> for Publisher<M> {
    /// Never fails.
    ///
    /// # Realtime
    /// Copies the message once, into shared memory. Allocates nothing, makes no system call, whoever comes or goes.
    fn publish_with(&mut self, stamp: Stamp, fill: impl FnOnce(&mut M)) -> Result<Header, Unsent> {
        fill(&mut self.staged);
        self.last = self.last.next(stamp);
        *self.staged.header_mut() = self.last;
        // SAFETY: valid while its port is looked after, which is until our claim is dropped.
        unsafe { self.place.0.as_ref() }.publish(&self.staged);
        Ok(self.last)
    }
}
