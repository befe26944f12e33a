//! Perception.

pub mod card;
pub(crate) mod grid;
pub mod model;
pub mod network;
pub(crate) mod ops;
pub mod sample;

pub use card::Card;
pub use model::{Answer, CARD_FILE, Model, ModelError, WEIGHTS_FILE};
pub use sample::{Sample, Sampler};
