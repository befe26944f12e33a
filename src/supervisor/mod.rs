//! The supervisor role.
