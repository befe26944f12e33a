//! The latest value of one service, as it lies in shared memory.
//!
//! A ring of slots, each with the number of the publication it holds. The writer
//! fills the slot after the latest, then says that it is the latest. A reader
//! copies the latest slot and looks whether its number is still the same; it is,
//! unless the writer has gone round the whole ring meanwhile.
//!
//! ```text
//! latest = 6     slots  [ 4 ][ 5 ][ 6 ][ 3 → being written as 7 ]
//! ```
//! A writer that dies while it writes leaves a slot nobody looks at. Every access
//! is a plain load or store: no locked instruction, no system call, no waiting.

#![allow(unsafe_code)]

use std::cell::UnsafeCell;
use std::fmt;
use std::mem::MaybeUninit;
use std::sync::atomic::{AtomicU64, Ordering, fence};

use iceoryx2::prelude::ZeroCopySend;
use tandem_msg::Message;

/// Slots of a ring: a copy is disturbed only by a writer that publishes this often, less one, while it is made.
const SLOTS: usize = 4;
/// Copies that are tried before the reader keeps what it has.
const ATTEMPTS: usize = 4;
/// The number of a slot that is being written.
const WRITING: u64 = 0;

/// The ring of one writer.
#[repr(C)]
pub(crate) struct Channel<M> {
    /// Incarnation of the writer.
    epoch: u64,
    /// Publications so far, and number of the latest.
    latest: AtomicU64,
    slots: [Slot<M>; SLOTS],
}

#[repr(C)]
struct Slot<M> {
    number: AtomicU64,
    value: UnsafeCell<MaybeUninit<M>>,
}

/// What a look at a channel found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Look {
    /// Nothing that was not seen before.
    Same,
    /// The publication of that number was copied.
    Copied(u64),
    /// The writer went round the ring during every attempt.
    Torn,
}

// SAFETY: the values are only touched through atomics, word by word.
unsafe impl<M: Message> Sync for Channel<M> {}

// SAFETY: repr(C), of fixed size, without pointers; `Message` vouches for M. The name is that of M: iceoryx2
// compares size and alignment besides, and a service of loans has another schema.
unsafe impl<M: Message> ZeroCopySend for Channel<M> {
    unsafe fn type_name() -> &'static str {
        M::NAME
    }
}

impl<M: Message> fmt::Debug for Channel<M> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "channel of {}, epoch {}", M::NAME, self.epoch)
    }
}

impl<M: Message> Channel<M> {
    const WORDS: usize = {
        assert!(align_of::<M>() == align_of::<u64>() && size_of::<M>().is_multiple_of(size_of::<u64>()));
        size_of::<M>() / size_of::<u64>()
    };

    /// Makes a channel without publications where `place` points; touches all of its memory.
    ///
    /// # Safety
    /// `place` is valid for writing a channel, and nobody else uses it yet.
    pub(crate) unsafe fn initialise(place: *mut Self, epoch: u64) {
        // SAFETY: the caller's promise; zeros are valid for every field.
        unsafe {
            place.write_bytes(0, 1);
            (*place).epoch = epoch;
        }
    }

    /// Incarnation of the writer.
    pub(crate) fn epoch(&self) -> u64 {
        self.epoch
    }

    /// Whether the writer has published anything.
    pub(crate) fn has_published(&self) -> bool {
        self.latest.load(Ordering::Acquire) != 0
    }

    /// Publishes. By the one writer only.
    pub(crate) fn publish(&self, value: &M) {
        let number = self.latest.load(Ordering::Relaxed) + 1;
        let slot = &self.slots[number as usize % SLOTS];
        slot.number.store(WRITING, Ordering::Relaxed);
        // A reader that sees a word of the new value sees that the slot is being written.
        fence(Ordering::Release);
        let from: *const u64 = std::ptr::from_ref(value).cast();
        for word in 0..Self::WORDS {
            // SAFETY: within the value, which has no padding (`Message`).
            slot.word(word).store(unsafe { from.add(word).read() }, Ordering::Relaxed);
        }
        slot.number.store(number, Ordering::Release);
        self.latest.store(number, Ordering::Release);
    }

    /// Copies the latest value, when its number is not `seen`.
    pub(crate) fn look(&self, seen: u64, copy: &mut M) -> Look {
        for _ in 0..ATTEMPTS {
            let number = self.latest.load(Ordering::Acquire);
            if number == seen {
                return Look::Same;
            }
            let slot = &self.slots[number as usize % SLOTS];
            if slot.number.load(Ordering::Acquire) == number {
                let to: *mut u64 = std::ptr::from_mut(copy).cast();
                for word in 0..Self::WORDS {
                    // SAFETY: within the copy; the implementor of `Message` vouches that every bit pattern is valid.
                    unsafe { to.add(word).write(slot.word(word).load(Ordering::Relaxed)) };
                }
                fence(Ordering::Acquire);
                if slot.number.load(Ordering::Relaxed) == number {
                    return Look::Copied(number);
                }
            }
        }
        Look::Torn
    }

    /// Reads a byte of each page, so that a later look finds them mapped.
    pub(crate) fn touch(&self) {
        const PAGE: usize = 4096;
        let first: *const u8 = std::ptr::from_ref(self).cast();
        for offset in (0..size_of::<Self>()).step_by(PAGE) {
            // SAFETY: within the channel; whatever is read is ignored.
            unsafe { first.add(offset).read_volatile() };
        }
    }
}

impl<M> Slot<M> {
    fn word(&self, index: usize) -> &AtomicU64 {
        // SAFETY: `index` is below the number of words of M (`publish`, `look`); AtomicU64 has the layout of u64, to
        // whose alignment M is aligned; every access to the value goes through here.
        unsafe { &*self.value.get().cast::<AtomicU64>().add(index) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tandem_msg::{Header, JointState, Stamp};

    fn channel(epoch: u64) -> Box<Channel<JointState>> {
        let mut place = Box::<Channel<JointState>>::new_uninit();
        // SAFETY: a fresh box.
        unsafe { Channel::initialise(place.as_mut_ptr(), epoch) };
        // SAFETY: initialised above.
        unsafe { place.assume_init() }
    }

    fn value(seq: u64) -> JointState {
        let header = Header { seq, stamp: Stamp(seq), ..Header::default() };
        JointState { header, position: [seq as f64; 8], effort: [seq as f64; 8], ..JointState::default() }
    }

    #[test]
    fn each_publication_is_seen_once() {
        let channel = channel(7);
        let mut copy = JointState::default();
        assert_eq!((channel.epoch(), channel.look(0, &mut copy)), (7, Look::Same));
        for number in 1..=10 {
            channel.publish(&value(number));
            assert_eq!((channel.look(number - 1, &mut copy), copy), (Look::Copied(number), value(number)));
            assert_eq!(channel.look(number, &mut copy), Look::Same);
        }
    }

    /// A writer that died with its slot half written: the value before it stays readable, and a successor's channel is another.
    #[test]
    fn a_half_written_slot_is_never_looked_at() {
        let channel = channel(1);
        channel.publish(&value(1));
        channel.slots[2].number.store(WRITING, Ordering::Relaxed);
        channel.slots[2].word(3).store(u64::MAX, Ordering::Relaxed);
        let mut copy = JointState::default();
        assert_eq!((channel.look(0, &mut copy), copy), (Look::Copied(1), value(1)));
    }

    /// Under a writer that never pauses, no reader ever sees a value that was not published whole, nor one older than the last.
    #[test]
    fn no_copy_is_torn() {
        const PUBLICATIONS: u64 = 300_000;
        let channel = channel(1);
        std::thread::scope(|scope| {
            scope.spawn(|| (1..=PUBLICATIONS).for_each(|number| channel.publish(&value(number))));
            let mut copy = JointState::default();
            let mut seen = 0;
            while seen < PUBLICATIONS {
                if let Look::Copied(number) = channel.look(seen, &mut copy) {
                    assert_eq!(copy, value(number));
                    assert!(number > seen, "{number} after {seen}");
                    seen = number;
                }
            }
        });
    }
}
