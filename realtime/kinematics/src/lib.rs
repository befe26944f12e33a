//! Serial chains: forward kinematics, Jacobian, inverse kinematics.
