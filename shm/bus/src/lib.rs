//! The only code that names iceoryx2: publish, latest value, bounded open,
//! cleanup after a crash.
//!
//! A cell is an [`Instance`]: a name and a directory of its own. Every process
//! of the cell opens one [`Node`] in it and from that node its ports: a
//! [`Publisher`] for each message it writes, a [`Latest`] for each it reads.
//!
//! ```text
//! Publisher --loan, fill, header, send--> one slot of history --> Latest (buffer 1, oldest dropped)
//! ```
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
//! Since iceoryx2 0.10 every loan makes one small heap allocation, so a publish
//! costs one; reading costs none.

pub mod direct;
mod error;
mod instance;
mod memory;
mod node;
mod publisher;
mod reader;
mod wire;

pub use error::{BusError, Intent};
pub use instance::{Cleaned, Instance, Leftover, leftovers};
pub use memory::{Slot, SlotReader, SlotWriter};
pub use node::{Identity, Node};
pub use publisher::{Publisher, Unsent};
pub use reader::Latest;

use tandem_msg::{Header, Message, Stamp};

/// Writes one message type; the header is the bus's own work.
///
/// Implemented over shared memory ([`Publisher`]) and inside one process
/// ([`SlotWriter`]); one set of tests holds for both.
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
}

/// Reads the latest value of one message type.
pub trait Read<M: Message> {
    /// The latest value; a default one, whose header was never heard, before the first.
    /// A value of an older incarnation, or an older one of the same, never replaces a newer.
    fn read(&mut self) -> &M;

    /// The value the last [`Read::read`] gave.
    fn held(&self) -> &M;
}
