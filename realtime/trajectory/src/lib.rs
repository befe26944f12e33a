//! Jerk-limited online trajectory generation, from any state to any target state.
