//! Serial chains: forward kinematics, Jacobian, inverse kinematics.
//!
//! A [`Chain`] is a fixed-size value: up to [`JOINTS_MAX`] moving joints (fixed
//! ones are folded away by whoever reads the robot's file) and a tool frame. It
//! answers three questions: where are the links ([`Chain::forward`]), how does
//! the TCP move when the joints do ([`Chain::jacobian`]), and which joint
//! positions bring the TCP to a pose ([`Chain::inverse`]).
//!
//! Six-joint arms whose joints 2, 3 and 4 are parallel, as the UR series, and those
//! whose last three axes meet, as most industrial arms, are recognised by their
//! geometry and solved in closed form, all branches; every other chain is solved by
//! damped least squares with a fixed sequence of restarts. The same question always
//! gets the same answer.
//!
//! **Invariant:** nothing here allocates, blocks, reads a clock or panics, and
//! every loop has a constant bound. A position that is not finite comes back as
//! poses that are not finite, or as [`IkFailure::NotFinite`].
//!
//! Units: radians and metres (a prismatic joint's position is in metres).

mod chain;
mod forward;
mod inverse;
mod sin_cos;
mod tcp;

pub use chain::{Chain, ChainError, Joint, JointKind};
pub use forward::{Jacobian, LinkPoses, manipulability};
pub use inverse::{Branches, IkFailure};

/// Joints a chain has room for; the same number as the messages have.
pub const JOINTS_MAX: usize = 8;
