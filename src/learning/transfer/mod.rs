//! Transfer (Section 2.2, Fig. 6 of the paper): the encoder of the source product, adjusted until
//! both decoders of the source read the parts of another product.
//!
//! [`protocol`] says what is compared with what under which budget. A [`student`] is the network
//! on its way. [`rivals`] adjusts it by gradients of fixed losses: fine-tuning, DANN, DAN.
//! [`episode`] lets an agent choose among [`moves`] instead; the [`agent`] is a deep Q-network that has
//! learned to choose on shifts of the source that were made up, and comes to the target trained.
//! [`run`] does one transfer from files to files, [`compare`] all of them.
//!
//! **Invariant:** nothing here reads the target's test split but [`run`], once a run, at its end.
//! **Invariant:** seed, method and number of labels say what comes out, whatever runs beside it.

pub mod agent;
pub mod compare;
pub(crate) mod discrepancy;
pub(crate) mod discriminator;
pub(crate) mod episode;
pub(crate) mod moves;
pub mod protocol;
pub(crate) mod rivals;
pub mod run;
pub(crate) mod similarity;
pub(crate) mod student;

#[cfg(test)]
mod tests;
