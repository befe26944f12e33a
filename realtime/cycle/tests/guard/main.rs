//! The allocation guard, in a binary that installs it.
#![allow(clippy::disallowed_types, clippy::disallowed_macros)] // Reason: here allocating is the point.

use core::hint::black_box; // An allocation nobody looks at may be left out by the compiler.
use core::time::Duration;

use tandem_cycle::guard::{Calls, CountingAllocator, counted};
use tandem_cycle::{FixedRate, Grid, Monotonic};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

#[test]
fn each_call_of_the_cycle_is_counted() {
    let (kept, calls) = counted(|| {
        let mut growing = black_box(vec![1_u64]);
        growing.push(2);
        drop(black_box(Box::new(3)));
        black_box(growing)
    });
    assert_eq!(kept, [1, 2]);
    assert_eq!(calls, Calls { allocations: 3, releases: 1 });
}

#[test]
fn what_happens_outside_or_on_another_thread_is_not() {
    let before = Box::new(3);
    let other = std::thread::spawn(|| *black_box(Box::new(1)));
    let (_, calls) = counted(|| black_box(1 + 1));
    assert_eq!((calls, *before, other.join().expect("it ends")), (Calls::default(), 3, 1));
}

#[test]
fn an_inner_count_is_part_of_the_outer() {
    let (inner, outer) = counted(|| {
        drop(black_box(Box::new(1)));
        counted(|| drop(black_box(Box::new(2)))).1
    });
    assert_eq!(inner, Calls { allocations: 1, releases: 1 });
    assert_eq!(outer, Calls { allocations: 2, releases: 2 });
}

/// The loop that holds every realtime role allocates nothing, from its first cycle on.
#[test]
fn the_loop_allocates_nothing() {
    let grid = Grid::new(Duration::from_millis(1), Duration::ZERO).expect("in range");
    let mut rate = FixedRate::new(grid, Monotonic);
    let ((), calls) = counted(|| {
        for _ in 0..20 {
            rate.wait();
        }
    });
    assert!(calls.is_none(), "{calls:?}");
}
