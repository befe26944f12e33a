//! Two lanes in shared memory, one each way: what any message between processes comes down to.

#![allow(unsafe_code)]

use std::fs::{File, OpenOptions};
use std::io;
use std::path::Path;
use std::ptr::NonNull;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};

use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};
use rustix::thread::futex;
use rustix::time::Timespec;

/// Longest sleep, so that a wake-up that was missed costs no more.
const NAP: Timespec = Timespec { tv_sec: 0, tv_nsec: 100_000_000 };
/// Words of a message.
const WORDS: usize = 12;

/// One way. Its own cache lines: two, as processors fetch them in pairs.
#[repr(C, align(128))]
struct Way {
    /// Counts the messages.
    count: AtomicU32,
    words: [AtomicU64; WORDS],
}

#[repr(C)]
struct Both([Way; 2]);

/// The mapping; undone when dropped.
pub(super) struct Lanes(NonNull<Both>);

impl Lanes {
    /// Maps the file; `create` makes it first.
    pub(super) fn open(path: &Path, create: bool) -> io::Result<Self> {
        let file: File = if create {
            let file = OpenOptions::new().read(true).write(true).create(true).truncate(true).open(path)?;
            file.set_len(size_of::<Both>() as u64)?;
            file
        } else {
            OpenOptions::new().read(true).write(true).open(path)?
        };
        let protection = ProtFlags::READ | ProtFlags::WRITE;
        // SAFETY: a new mapping at an address of the kernel's choice, of a file that long.
        let address = unsafe {
            mmap(std::ptr::null_mut(), size_of::<Both>(), protection, MapFlags::SHARED | MapFlags::POPULATE, file, 0)
        }?;
        NonNull::new(address.cast()).map(Self).ok_or_else(|| io::ErrorKind::OutOfMemory.into())
    }
}

impl Drop for Lanes {
    fn drop(&mut self) {
        // SAFETY: what `open` mapped; references to it end with `self`.
        let _ = unsafe { munmap(self.0.as_ptr().cast(), size_of::<Both>()) };
    }
}

/// One end: which lane it writes, and what it has read of the other.
pub(super) struct Side {
    lanes: Lanes,
    out: usize,
    seen: u32,
}

impl Side {
    pub(super) fn new(lanes: Lanes, first: bool) -> Self {
        Self { lanes, out: usize::from(!first), seen: 0 }
    }

    fn way(&self, index: usize) -> &Way {
        // SAFETY: mapped with this length for as long as `self` lives, at the start of a page; atomics only.
        &unsafe { self.lanes.0.as_ref() }.0[index]
    }

    /// Writes a message.
    pub(super) fn send(&self, number: u64) {
        let way = self.way(self.out);
        way.words.iter().for_each(|word| word.store(number, Ordering::Relaxed));
        way.count.store(way.count.load(Ordering::Relaxed).wrapping_add(1), Ordering::Release);
    }

    /// The message, when there is a new one. The writer waits for the answer, so it is whole.
    pub(super) fn received(&mut self) -> Option<u64> {
        let way = self.way(1 - self.out);
        let count = way.count.load(Ordering::Acquire);
        if count == self.seen {
            return None;
        }
        let number = way.words.iter().fold(0, |all, word| all | word.load(Ordering::Relaxed));
        self.seen = count;
        Some(number)
    }

    /// Wakes the other side.
    pub(super) fn wake(&self) {
        // Only a wrong address could fail.
        let _ = futex::wake(&self.way(self.out).count, futex::Flags::empty(), 1);
    }

    /// Sleeps until there may be a new message.
    pub(super) fn sleep(&self) {
        // It has come meanwhile, or the nap is over: the caller looks.
        let _ = futex::wait(&self.way(1 - self.out).count, futex::Flags::empty(), self.seen, Some(&NAP));
    }
}
