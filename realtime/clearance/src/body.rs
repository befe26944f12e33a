//! The arm as capsules or hulls, and which of its links are checked against each other.

use core::fmt;

use nalgebra::Vector3;
use tandem_kinematics::JOINTS_MAX;

use crate::kernel::point_to_segment;
use crate::shapes::Shapes;

/// Capsules an arm has room for.
pub const LINK_CAPSULES_MAX: usize = 24;
/// Pairs of capsules that are checked against each other.
pub const SELF_PAIRS_MAX: usize = 192;
/// How far a hull may reach out of its capsule, metres: the rounding of files.
pub(crate) const HULL_OUTSIDE: f64 = 1e-6;

/// A sphere swept along a segment that moves with a link.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LinkCapsule {
    /// Link it moves with: 0 the base, i the link after joint i (counted from 1).
    pub link: usize,
    /// Ends of the segment in the frame of that link, metres; equal for a sphere.
    pub ends: [[f64; 3]; 2],
    /// Radius, metres.
    pub radius: f64,
    /// Whether it belongs to the tool, which may touch the objects a task names.
    pub tool: bool,
}

/// Why capsules make no arm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BodyError {
    /// More capsules than [`LINK_CAPSULES_MAX`], or none.
    CapsuleCount {
        /// Capsules given.
        count: usize,
    },
    /// More pairs of capsules than [`SELF_PAIRS_MAX`].
    PairCount {
        /// Pairs that the links' pairs come to.
        count: usize,
    },
    /// A capsule's link lies past what a chain can have.
    NoSuchLink {
        /// The link.
        link: usize,
    },
    /// A capsule's end is not finite, or its radius not above 0.
    Capsule {
        /// Index of the capsule.
        index: usize,
        /// Its radius.
        radius: f64,
    },
    /// The shape that shall stand for a capsule is no registered hull.
    NoSuchHull {
        /// Index of the capsule.
        index: usize,
        /// Number of the shape.
        shape: u32,
    },
    /// A hull reaches out of the capsule that it stands for.
    HullOutside {
        /// Index of the capsule.
        index: usize,
        /// How far, metres.
        outside: f64,
    },
}

impl fmt::Display for BodyError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::CapsuleCount { count } => {
                write!(f, "the arm's body has {count} capsules, allowed 1..={LINK_CAPSULES_MAX}")
            }
            Self::PairCount { count } => {
                write!(f, "the arm's body has {count} pairs of capsules to check, allowed 0..={SELF_PAIRS_MAX}")
            }
            Self::NoSuchLink { link } => write!(f, "a capsule or pair names link {link}, allowed 0..={JOINTS_MAX}"),
            Self::Capsule { index, radius } => {
                write!(f, "capsule {index}: radius = {radius} m, allowed above 0, with ends that are finite")
            }
            Self::NoSuchHull { index, shape } => {
                write!(f, "capsule {index}: shape {shape} stands for it, which is no registered hull")
            }
            Self::HullOutside { index, outside } => {
                write!(f, "capsule {index}: the hull that stands for it reaches {outside} m out of it, allowed 1e-6")
            }
        }
    }
}

impl core::error::Error for BodyError {}

/// The capsules of an arm and the pairs of them that must not touch.
#[derive(Clone, Copy, Debug)]
pub struct ArmBody {
    capsules: [LinkCapsule; LINK_CAPSULES_MAX],
    capsule_count: usize,
    /// Numbers of the hulls that stand for capsules; 0 for none.
    hulls: [u32; LINK_CAPSULES_MAX],
    self_pairs: [[u8; 2]; SELF_PAIRS_MAX],
    self_pair_count: usize,
}

impl ArmBody {
    /// An arm of `capsules`, whose links are checked against each other as `self_pairs` lists:
    /// pairs of link numbers, in any order; pairs that cannot meet, or always do, are left out of it.
    ///
    /// # Errors
    /// What [`BodyError`] names.
    pub fn new(capsules: &[LinkCapsule], self_pairs: &[[usize; 2]]) -> Result<Self, BodyError> {
        if capsules.is_empty() || capsules.len() > LINK_CAPSULES_MAX {
            return Err(BodyError::CapsuleCount { count: capsules.len() });
        }
        let mut body = Self {
            capsules: [LinkCapsule::default(); LINK_CAPSULES_MAX],
            capsule_count: capsules.len(),
            hulls: [0; LINK_CAPSULES_MAX],
            self_pairs: [[0; 2]; SELF_PAIRS_MAX],
            self_pair_count: 0,
        };
        for (index, capsule) in capsules.iter().enumerate() {
            if capsule.link > JOINTS_MAX {
                return Err(BodyError::NoSuchLink { link: capsule.link });
            }
            let finite = capsule.ends.iter().flatten().all(|x| x.is_finite());
            if !finite || !capsule.radius.is_finite() || capsule.radius <= 0.0 {
                return Err(BodyError::Capsule { index, radius: capsule.radius });
            }
            body.capsules[index] = *capsule;
        }
        if let Some(&link) = self_pairs.iter().flatten().find(|link| **link > JOINTS_MAX) {
            return Err(BodyError::NoSuchLink { link });
        }
        let mut count = 0;
        for a in 0..capsules.len() {
            for b in a + 1..capsules.len() {
                let links = [capsules[a].link, capsules[b].link];
                if !self_pairs.iter().any(|pair| *pair == links || *pair == [links[1], links[0]]) {
                    continue;
                }
                if count < SELF_PAIRS_MAX {
                    // Both are below LINK_CAPSULES_MAX, which fits a byte.
                    body.self_pairs[count] = [a as u8, b as u8];
                }
                count += 1;
            }
        }
        if count > SELF_PAIRS_MAX {
            return Err(BodyError::PairCount { count });
        }
        body.self_pair_count = count;
        Ok(body)
    }

    /// The capsules in use.
    pub fn capsules(&self) -> &[LinkCapsule] {
        &self.capsules[..self.capsule_count.min(LINK_CAPSULES_MAX)]
    }

    /// Lets a registered hull, in the frame of its link, stand for a capsule. The capsule must hold it: it
    /// still tells quickly what is far off, and counts wherever a monitor knows no shapes.
    ///
    /// # Errors
    /// A capsule that is not there. The hull is looked at by [`crate::Monitor::with_shapes`].
    pub fn refine(&mut self, index: usize, shape: u32) -> Result<(), BodyError> {
        if index >= self.capsule_count {
            return Err(BodyError::NoSuchHull { index, shape });
        }
        self.hulls[index] = shape;
        Ok(())
    }

    /// The hulls that stand for capsules, by the capsule's index.
    pub(crate) fn hulls(&self) -> &[u32] {
        &self.hulls[..self.capsule_count.min(LINK_CAPSULES_MAX)]
    }

    /// Whether every hull is registered and lies in its capsule.
    pub(crate) fn check_hulls(&self, shapes: &Shapes) -> Result<(), BodyError> {
        for (index, (shape, capsule)) in self.hulls().iter().zip(self.capsules()).enumerate() {
            if *shape == 0 {
                continue;
            }
            let hull = shapes.hull(*shape).ok_or(BodyError::NoSuchHull { index, shape: *shape })?;
            let ends = capsule.ends.map(Vector3::from);
            let from_axis = |point: Vector3<f64>| point_to_segment(&point, &ends).distance;
            let outside = hull.points().map(from_axis).fold(0.0, f64::max) - capsule.radius;
            if outside.is_nan() || outside > HULL_OUTSIDE {
                return Err(BodyError::HullOutside { index, outside });
            }
        }
        Ok(())
    }

    /// Pairs of indices into [`ArmBody::capsules`] that are checked against each other.
    pub fn self_pairs(&self) -> impl Iterator<Item = [usize; 2]> + '_ {
        self.self_pairs.iter().take(self.self_pair_count).map(|pair| pair.map(usize::from))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::disallowed_types, reason = "a test may allocate")]
    use super::*;

    const BALL: LinkCapsule = LinkCapsule { link: 1, ends: [[0.0; 3]; 2], radius: 0.1, tool: false };

    /// Each fault is named with its numbers.
    #[test]
    fn faults_are_named() {
        let of =
            |capsules: &[LinkCapsule], pairs: &[[usize; 2]]| ArmBody::new(capsules, pairs).unwrap_err().to_string();
        assert_eq!(of(&[], &[]), "the arm's body has 0 capsules, allowed 1..=24");
        assert_eq!(of(&[BALL; 25], &[]), "the arm's body has 25 capsules, allowed 1..=24");
        assert_eq!(of(&[BALL], &[[1, 9]]), "a capsule or pair names link 9, allowed 0..=8");
        let flat = LinkCapsule { radius: 0.0, ..BALL };
        assert_eq!(of(&[BALL, flat], &[]), "capsule 1: radius = 0 m, allowed above 0, with ends that are finite");
        let lost = LinkCapsule { ends: [[f64::NAN; 3]; 2], ..BALL };
        assert_eq!(of(&[lost], &[]), "capsule 0: radius = 0.1 m, allowed above 0, with ends that are finite");
        let many: [LinkCapsule; 24] = core::array::from_fn(|k| LinkCapsule { link: k % 2, ..BALL });
        let crowd: [LinkCapsule; 24] = core::array::from_fn(|k| LinkCapsule { link: k % 4, ..BALL });
        let all = [[0, 1], [2, 0], [0, 3], [1, 2], [1, 3], [2, 3]];
        assert_eq!(ArmBody::new(&many, &[[1, 0]]).map(|body| body.self_pairs().count()), Ok(144));
        assert_eq!(of(&crowd, &all), "the arm's body has 216 pairs of capsules to check, allowed 0..=192");
    }
}
