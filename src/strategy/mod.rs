//! What is known about how parts are joined: reference table, strategy library, their store.
//!
//! A recognised feature and its parameters lead through the reference table to a mode
//! and a tool (Fig. 4); these, the verdict of the capability check and the part's
//! properties lead through the library to a strategy (Fig. 5). Both are pure functions
//! over rows in memory; only [`store`] touches a database, and only a thread that no
//! cycle waits for calls it.

mod journal;
mod library;
mod reference;
pub mod store;

pub use journal::{JournalEntry, StepState};
#[cfg(test)]
pub(crate) use library::tests as library_tests;
pub use library::{Library, Match, NoMatch, Situation};
pub use reference::{Joining, Seen, join};
