//! Training of the encoder and both decoders on generated parts.
//!
//! [`Specimen`] draws parts and views, [`example`] scans them with the plant's depth
//! camera and samples the clouds exactly as perception does, [`mod@train`] fits the network
//! and measures it on parts it never saw.

pub(crate) mod adam;
pub(crate) mod augment;
pub(crate) mod dataset;
mod domain;
pub(crate) mod parameters;
mod part;
pub(crate) mod pass;
pub(crate) mod report;
mod specimen;
pub(crate) mod train;

pub use dataset::{Example, Look, Split, example};
pub use domain::{Domain, Scanner};
pub use part::Kind;
pub use report::measure;
pub use specimen::Specimen;
pub use train::{TrainError, TrainOptions, TrainProgress, train};

#[cfg(test)]
mod tests;
