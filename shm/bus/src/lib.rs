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

mod error;
mod instance;
mod node;
mod publisher;
mod reader;
mod wire;

pub use error::{BusError, Intent};
pub use instance::{Cleaned, Instance, Leftover, leftovers};
pub use node::{Identity, Node};
pub use publisher::{Publisher, Unsent};
pub use reader::Latest;
