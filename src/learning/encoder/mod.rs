//! Training of the encoder and both decoders on generated parts.
//!
//! [`specimen`] draws parts and views, [`dataset`] scans them with the plant's depth
//! camera and samples the clouds exactly as perception does, [`train`] fits the network,
//! [`report`] measures it on parts it never saw.

mod adam;
mod dataset;
mod parameters;
mod report;
mod specimen;
mod train;

pub use dataset::{Example, Split, example};
pub use specimen::Specimen;
pub use train::{TrainError, TrainOptions, TrainProgress, train};
