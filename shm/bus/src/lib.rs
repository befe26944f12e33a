//! The only code that names iceoryx2: publish, latest value, bounded open,
//! cleanup after a crash.
//!
//! A cell is an [`Instance`]: a name and a directory of its own. Every process
//! of the cell has one [`Node`] in it and from that node its ports. Messages that
//! a cycle reads or writes travel in channels, large ones are loaned:
//!
//! ```text
//! Publisher ──copy──▶ channel ──copy──▶ Latest       state, commands, tasks
//! Lender ──loan, fill, send──▶ sample ──▶ Borrower   point clouds, in place
//! ```
//! Both are services of iceoryx2, which finds the peers, checks that they are of
//! one build and configuration, gives the memory and takes it back after a crash.
//! A channel is one sample that is sent once and then written again and again: a
//! ring of slots, of which a reader copies the latest (`channel`). A publication
//! through iceoryx2 itself allocates (one loan, since 0.10) and connects to peers
//! where it is called; its blackboard does neither, but an entry whose writer was
//! killed stays locked for ever. A channel does neither and comes back.
//!
//! **Invariant:** a reader never waits for a writer nor a writer for a reader;
//! what a reader misses is overwritten.
//! **Invariant:** two instances never meet: each has its own prefix for shared
//! memory and its own root directory, and no configuration file of iceoryx2 is
//! ever looked for.
//! **Invariant:** nothing here cleans up by chance. What a dead process left is
//! removed when [`Instance::clean_dead`] is called, and everything when
//! [`Instance::remove`] is.
//!
//! **Invariant:** reading and writing a channel allocates nothing and makes no
//! system call, whoever comes, goes or dies: a thread beside it (`link`) connects.

mod channel;
pub mod direct;
mod error;
mod instance;
mod link;
mod loan;
mod memory;
mod node;
mod publisher;
mod reader;
mod service;
mod wire;

pub use error::{BusError, Intent};
pub use instance::{Cleaned, Instance, Leftover, leftovers};
pub use loan::{Borrower, Lender};
pub use memory::{Slot, SlotReader, SlotWriter};
pub use node::{Identity, Node};
pub use publisher::{Publisher, Unsent};
pub use reader::Latest;

use tandem_msg::{Header, Message, Stamp};

/// Writes one message type; the header is the bus's own work.
///
/// Implemented over shared memory ([`Publisher`], [`Lender`]) and inside one process
/// ([`SlotWriter`]); one set of tests holds for all.
pub trait Write<M: Message> {
    /// Publishes what `fill` writes. The header is set afterwards, whatever
    /// `fill` does to it. What `fill` leaves alone keeps an unspecified value.
    ///
    /// # Errors
    /// [`Unsent`] says whom it did not reach.
    fn publish_with(&mut self, stamp: Stamp, fill: impl FnOnce(&mut M)) -> Result<Header, Unsent>;

    /// Publishes a copy of `message`, but for its header.
    ///
    /// # Errors
    /// As [`Write::publish_with`].
    fn publish(&mut self, stamp: Stamp, message: &M) -> Result<Header, Unsent> {
        self.publish_with(stamp, |slot| *slot = *message)
    }

    /// Meets readers that have come and lets go of those that have gone, without publishing. For a writer that seldom
    /// publishes and connects where it does ([`Lender`]); nothing to do for others.
    fn tend(&mut self) {}
}

/// Reads the latest value of one message type.
pub trait Read<M: Message> {
    /// The latest value; a default one, whose header was never heard, before the first.
    /// A value of an older incarnation, or an older one of the same, never replaces a newer.
    fn read(&mut self) -> &M;

    /// The value the last [`Read::read`] gave.
    fn held(&self) -> &M;
}
