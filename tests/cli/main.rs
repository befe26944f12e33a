//! What a person types and what comes back: bad input refused by name and place before anything moves.

mod bench;
mod benches;
mod refusals;
mod running;
mod words;
