//! Progressive networks (Section 2.3, Fig. 7 of the paper): a precomputed policy, evaluated within a control cycle.
//!
//! A policy maps an observation to bounded increments of the joints. It has one or more
//! *columns*, each two fully connected layers of [`HIDDEN`] rectified units and a linear
//! output. A later column was trained while the earlier ones stood still, and sees their
//! hidden layers through *lateral connections*:
//!
//! ```text
//! column 1 (frozen)   x ── h1 ──────── h2 ── (its output is not used)
//!                          │ lateral   │ lateral
//! column 2            x ── h1 ────(+)─ h2 ─(+)─ output ── tanh ── times the largest step of each joint
//! ```
//!
//! [`Shape`] says what a policy consists of and how many numbers that is; [`Policy`] reads
//! them from one slice, as they lie in the file, without a copy.
//!
//! **Speed.** A step is bound by reading the weights. Each matrix lies input by input, so
//! the row of an input is added to all sums at once, and the rows of inputs that are zero (after a
//! rectifier, about half of them) are not read at all.
//!
//! **Determinism.** Every sum is taken in the order of its inputs, with a multiplication and an
//! addition for each, never fused, and the hyperbolic tangent is our own: the same policy and
//! observation give the same bits on every machine, whatever its vector width.
//!
//! **Invariant:** nothing here allocates, blocks, reads a clock or panics.

mod dense;
mod observe;
mod policy;
mod rollout;
mod shape;
mod stored;
mod tanh;

pub use observe::{
    DOF, Destination, FAR, OBSERVATION, OBSTACLES, Observation, SAFETY, SCALE, Surroundings, observe, slopes,
};
pub use policy::{Activations, NotFinite, Policy};
pub use rollout::{CAPTURE, REFUSED_MAX, Rollout, STEP, STEPS_MAX};
pub use shape::{Lateral, Shape, ShapeError};
pub use stored::{Policies, Stored};

/// Units of a hidden layer ("256, FC, relu" in Fig. 7).
pub const HIDDEN: usize = 256;
/// Units of an adapter, between the earlier columns and a layer of a later one.
pub const ADAPTER: usize = 64;
/// Most columns.
pub const COLUMNS_MAX: usize = 4;
/// Most numbers of an observation.
pub const INPUTS_MAX: usize = 128;
/// Most numbers of an action.
pub const OUTPUTS_MAX: usize = 8;
