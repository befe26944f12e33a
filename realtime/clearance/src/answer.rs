//! What the queries answer with.

/// The smallest distance between the arm, or what it carries, and what it must not touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearance {
    /// Signed, metres: below 0 when they overlap; +∞ when there is nothing, −∞ when a number was not finite.
    pub distance: f64,
    /// Link of the arm (0 the base); the carried part counts as the last.
    pub link: usize,
    /// Object, by its id; 0 is the arm itself.
    pub object: u32,
    /// Nearest point of the arm, base frame, metres.
    pub point_on_arm: [f64; 3],
    /// Nearest point of the object, or of the other link.
    pub point_on_other: [f64; 3],
}

impl Clearance {
    /// Nothing is there.
    pub(crate) const NOTHING: Self =
        Self { distance: f64::INFINITY, link: 0, object: 0, point_on_arm: [0.0; 3], point_on_other: [0.0; 3] };
    /// A number was not finite.
    pub(crate) const CONTACT: Self = Self { distance: f64::NEG_INFINITY, ..Self::NOTHING };
}

/// The smallest distance between the arm, or what it carries, and a person.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Separation {
    /// Signed, metres: +∞ when nobody is in view, −∞ when a number was not finite.
    pub distance: f64,
    /// Link of the arm; the carried part counts as the last.
    pub link: usize,
    /// Capsule of the person, its index.
    pub capsule: usize,
    /// Unit vector from the arm to the person at the nearest points, base axes; zero when unknown.
    pub direction: [f64; 3],
    /// Velocity of that capsule, m/s.
    pub human_velocity: [f64; 3],
    /// Nearest point of the arm, base frame, metres.
    pub point_on_arm: [f64; 3],
}

impl Separation {
    /// Nobody is in view.
    pub(crate) const NOBODY: Self = Self {
        distance: f64::INFINITY,
        link: 0,
        capsule: 0,
        direction: [0.0; 3],
        human_velocity: [0.0; 3],
        point_on_arm: [0.0; 3],
    };
    /// A number was not finite.
    pub(crate) const LOST: Self = Self { distance: f64::NEG_INFINITY, ..Self::NOBODY };
}
