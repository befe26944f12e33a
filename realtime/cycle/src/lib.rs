//! The fixed-rate loop: grid, clock, missed cycles, realtime set-up, allocation guard.
