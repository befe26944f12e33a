//! How a [`Message`] lies in a sample of iceoryx2.

#![allow(unsafe_code)]

use std::fmt;

use iceoryx2::prelude::ZeroCopySend;
use tandem_msg::Message;

use crate::service::Kind;

/// A message as the payload of a sample; the same bytes.
#[repr(transparent)]
pub(crate) struct Wire<M>(pub(crate) M);

// SAFETY: the implementor of `Message` vouches that the type is `repr(C)`, of
// fixed size and without pointers, and `Wire` is transparent over it. The name
// is unique per message, and iceoryx2 compares size and alignment besides.
unsafe impl<M: Message> ZeroCopySend for Wire<M> {
    unsafe fn type_name() -> &'static str {
        M::NAME
    }
}

impl<M: Message> fmt::Debug for Wire<M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {:?}", M::NAME, self.0.header())
    }
}

/// A service of loans: each reader costs three more messages of memory in every writer.
pub(crate) fn loan<M: Message>() -> Kind {
    Kind { schema: schema_hash::<M>("loan"), subscribers_max: 4 }
}

/// A service of channels: the roles of a cell, and whoever looks on.
pub(crate) fn channel<M: Message>() -> Kind {
    Kind { schema: schema_hash::<M>("channel"), subscribers_max: 12 }
}

/// Fingerprint: name, way, size and alignment (FNV-1a).
fn schema_hash<M: Message>(kind: &str) -> u64 {
    let layout = [size_of::<M>() as u64, align_of::<M>() as u64];
    let bytes = M::NAME.bytes().chain(kind.bytes()).chain(layout.into_iter().flat_map(u64::to_le_bytes));
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}
