//! Counts what a cycle allocates, and what its thread asks of the kernel.
//!
//! A binary installs [`CountingAllocator`] and wraps each cycle in [`counted`]:
//!
//! ```
//! use tandem_cycle::guard::{self, CountingAllocator};
//!
//! #[global_allocator]
//! static ALLOCATOR: CountingAllocator = CountingAllocator;
//!
//! let (sum, calls) = guard::counted(|| 1 + 1);
//! assert_eq!((sum, calls), (2, guard::Calls::default()));
//! let (_, calls) = guard::counted(|| Box::new(1));
//! assert_eq!(calls.allocations, 1);
//! ```

#![allow(unsafe_code)]

mod watch;

pub use watch::{Usage, Watch};

use core::cell::Cell;
use std::alloc::{GlobalAlloc, Layout, System};

/// Calls into the allocator by one thread.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Calls {
    /// `alloc`, `alloc_zeroed` and `realloc`.
    pub allocations: u64,
    /// `dealloc`.
    pub releases: u64,
}

impl Calls {
    const NONE: Self = Self { allocations: 0, releases: 0 };

    /// Nothing was asked of the allocator.
    pub fn is_none(&self) -> bool {
        *self == Self::NONE
    }
}

thread_local! {
    // Constant and without a destructor, so that using them never allocates.
    static CALLS: Cell<Calls> = const { Cell::new(Calls::NONE) };
    static ARMED: Cell<bool> = const { Cell::new(false) };
}

/// The system's allocator, counting the calls of threads inside [`counted`].
pub struct CountingAllocator;

/// Runs `cycle` and says what it asked of the allocator on this thread. Always
/// nothing unless [`CountingAllocator`] is the global allocator.
pub fn counted<R>(cycle: impl FnOnce() -> R) -> (R, Calls) {
    /// Puts the outer state back, also when the cycle unwinds.
    struct Outer(bool, Calls);
    impl Drop for Outer {
        fn drop(&mut self) {
            ARMED.set(self.0);
            // What the inner one counted is part of the outer one's.
            let inner = CALLS.get();
            let sum = |outer: u64, inner: u64| if self.0 { outer + inner } else { outer };
            CALLS.set(Calls {
                allocations: sum(self.1.allocations, inner.allocations),
                releases: sum(self.1.releases, inner.releases),
            });
        }
    }
    let outer = Outer(ARMED.replace(true), CALLS.replace(Calls::NONE));
    let result = cycle();
    let calls = CALLS.get();
    drop(outer);
    (result, calls)
}

fn note(change: impl FnOnce(&mut Calls)) {
    // A thread that is being torn down has no cycle.
    let _ = ARMED.try_with(|armed| {
        if armed.get() {
            CALLS.with(|calls| {
                let mut value = calls.get();
                change(&mut value);
                calls.set(value);
            });
        }
    });
}

// SAFETY: every call is handed to `System` unchanged; the counting touches only
// thread-local cells that are constant-initialised and have no destructor.
unsafe impl GlobalAlloc for CountingAllocator {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        note(|calls| calls.allocations += 1);
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        note(|calls| calls.allocations += 1);
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        note(|calls| calls.allocations += 1);
        // SAFETY: the caller's promise is passed on.
        unsafe { System.realloc(pointer, layout, size) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        note(|calls| calls.releases += 1);
        // SAFETY: the caller's promise is passed on.
        unsafe { System.dealloc(pointer, layout) }
    }
}
