//! A page of statistics mapped from its file.

#![allow(unsafe_code)]

use core::ops::Deref;
use core::ptr::NonNull;
use std::fs::File;
use std::io;

use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};

use super::page::Page;

const LENGTH: usize = size_of::<Page>();

/// The mapping; undone when dropped.
pub(super) struct Mapping(NonNull<Page>);

// SAFETY: a page is made of atomics only, and the mapping belongs to the process, not to a thread.
unsafe impl Send for Mapping {}
// SAFETY: as above.
unsafe impl Sync for Mapping {}

impl Mapping {
    /// Maps a file that is at least as long as a page.
    pub(super) fn of(file: &File, writable: bool) -> io::Result<Self> {
        let protection = if writable { ProtFlags::READ | ProtFlags::WRITE } else { ProtFlags::READ };
        // Populated at once: the first cycle finds every page of memory there.
        let flags = MapFlags::SHARED | MapFlags::POPULATE;
        // SAFETY: a new mapping at an address of the kernel's choice.
        let address = unsafe { mmap(core::ptr::null_mut(), LENGTH, protection, flags, file, 0) }?;
        NonNull::new(address.cast()).map(Self).ok_or_else(|| io::ErrorKind::OutOfMemory.into())
    }
}

impl Deref for Mapping {
    type Target = Page;

    fn deref(&self) -> &Page {
        // SAFETY: mapped with this length for as long as `self` lives, aligned to a memory page. Every field is an atomic,
        // for which any bits are valid; of a read-only mapping only the methods that load are used (`Reader`).
        unsafe { self.0.as_ref() }
    }
}

impl Drop for Mapping {
    fn drop(&mut self) {
        // SAFETY: what `of` mapped, and nobody can hold a reference any more.
        let _ = unsafe { munmap(self.0.as_ptr().cast(), LENGTH) };
    }
}
