//! Why there is no trajectory.

use core::fmt;

/// Why an input has no trajectory. Each names the joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error {
    /// A start or target value is NaN or infinite.
    NotFinite {
        /// Index of the joint.
        joint: usize,
    },
    /// A limit is NaN, has the wrong sign, or an acceleration or jerk limit is zero.
    Limits {
        /// Index of the joint.
        joint: usize,
    },
    /// The target velocity lies outside the velocity limits.
    TargetVelocity {
        /// Index of the joint.
        joint: usize,
    },
    /// The target acceleration lies outside the acceleration limits, or cannot be reached or left
    /// without passing a velocity limit.
    TargetAcceleration {
        /// Index of the joint.
        joint: usize,
    },
    /// The joint may not move in the direction of its target: its velocity limit there is zero.
    Unreachable {
        /// Index of the joint.
        joint: usize,
    },
    /// The joint is to move on a straight line with others, but their states lie on none.
    NotStraight {
        /// Index of the joint.
        joint: usize,
    },
    /// The motion would pass a position limit.
    PositionLimit {
        /// Index of the joint.
        joint: usize,
    },
    /// The numbers are too large or too different in size for double precision.
    OutOfRange {
        /// Index of the joint.
        joint: usize,
    },
}

impl Error {
    /// Index of the joint that has no trajectory.
    #[must_use]
    pub const fn joint(&self) -> usize {
        match *self {
            Error::NotFinite { joint }
            | Error::Limits { joint }
            | Error::TargetVelocity { joint }
            | Error::TargetAcceleration { joint }
            | Error::Unreachable { joint }
            | Error::NotStraight { joint }
            | Error::PositionLimit { joint }
            | Error::OutOfRange { joint } => joint,
        }
    }
}

impl Error {
    /// The same of another joint.
    pub(crate) fn of(self, joint: usize) -> Self {
        match self {
            Error::NotFinite { .. } => Error::NotFinite { joint },
            Error::Limits { .. } => Error::Limits { joint },
            Error::TargetVelocity { .. } => Error::TargetVelocity { joint },
            Error::TargetAcceleration { .. } => Error::TargetAcceleration { joint },
            Error::Unreachable { .. } => Error::Unreachable { joint },
            Error::NotStraight { .. } => Error::NotStraight { joint },
            Error::PositionLimit { .. } => Error::PositionLimit { joint },
            Error::OutOfRange { .. } => Error::OutOfRange { joint },
        }
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let reason = match self {
            Error::NotFinite { .. } => "start or target is not finite",
            Error::Limits { .. } => {
                "a limit is NaN, has the wrong sign, or is zero (acceleration, jerk): lower limits are negative, upper ones positive"
            }
            Error::TargetVelocity { .. } => "the target velocity is outside the velocity limits",
            Error::TargetAcceleration { .. } => {
                "the target acceleration is outside its limits or leads past a velocity limit"
            }
            Error::Unreachable { .. } => "the velocity limit towards the target is zero",
            Error::NotStraight { .. } => "start and target do not lie on a straight line",
            Error::PositionLimit { .. } => "the motion would pass a position limit",
            Error::OutOfRange { .. } => "the numbers are too far apart for double precision",
        };
        write!(f, "joint {}: {reason}", self.joint())
    }
}

impl core::error::Error for Error {}
