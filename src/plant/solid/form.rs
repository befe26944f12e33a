//! The forms a feature comes in: what its dimensions leave open.

use tandem_config::FeatureGeometry;

/// What the dimensions leave open.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Form {
    /// A blind hole ends in the cone of a drill, half angle 59°, below its depth.
    pub drilled: bool,
    /// Step around the mouth of a hole: diameter and depth, metres; none if zero.
    pub counterbore: [f64; 2],
    /// Recess in the end of an axis, as a key or a tube needs it.
    pub recess: Option<Recess>,
    /// How a slot is cut.
    pub section: Section,
    /// A slot's ends are square rather than round.
    pub square: bool,
    /// A slot runs out of the part at both ends.
    pub open: bool,
    /// A cone is a seat sunk into the part, not a pin.
    pub seat: bool,
    /// Diameter of the bore below a seat, metres; none if zero.
    pub bore: f64,
    /// What a buckle snaps with.
    pub hook: Hook,
    /// What stands on the surface when there is no feature of another class.
    pub other: Other,
    /// A cylindrical body is a prism of so many sides about the cylinder; round if zero.
    pub sides: u8,
}

impl Form {
    /// The form a feature of a product has.
    pub fn of(geometry: &FeatureGeometry) -> Self {
        let twin = geometry.length > 0.8 * geometry.depth;
        Self { hook: if twin { Hook::Pair { gap: 0.14, inward: false } } else { Hook::Single }, ..Self::default() }
    }

    /// The same in another size.
    #[must_use]
    pub fn scaled(&self, by: f64) -> Self {
        let other = match self.other {
            Other::Bare => Other::Bare,
            Other::Block(extents, rounding) => Other::Block(extents.map(|v| v * by), rounding * by),
            Other::Dome(diameter, height) => Other::Dome(diameter * by, height * by),
            Other::Prism { across, height, sides } => Other::Prism { across: across * by, height: height * by, sides },
            Other::Ribs { extents, count } => Other::Ribs { extents: extents.map(|v| v * by), count },
            Other::Wedge(extents) => Other::Wedge(extents.map(|v| v * by)),
            Other::Torus(diameter, thickness) => Other::Torus(diameter * by, thickness * by),
        };
        let bore = self.bore * by;
        let recess = self.recess.map(|r| Recess { across: r.across * by, depth: r.depth * by, ..r });
        Self { other, recess, bore, counterbore: self.counterbore.map(|v| v * by), ..*self }
    }
}

/// Recess of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Recess {
    /// Across flats, or diameter, metres.
    pub across: f64,
    /// Metres.
    pub depth: f64,
    /// Round if zero.
    pub sides: u8,
}

/// Cross section of a slot.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Section {
    /// Upright walls.
    #[default]
    Plain,
    /// Wider below: share of the depth that is neck, width of the foot in widths of the neck.
    Tee(f64, f64),
    /// Walls that lean outwards below, tangent of their angle.
    Dovetail(f64),
}

/// Forms of a snap buckle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Hook {
    /// One hook.
    #[default]
    Single,
    /// Two, with half the gap between them in lengths over all; noses outwards or inwards.
    Pair {
        /// 0 when they are grown together, as an arrow.
        gap: f64,
        /// Noses look at each other.
        inward: bool,
    },
}

/// Forms of [`tandem_msg::FeatureClass::Other`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Other {
    /// The bare surface.
    #[default]
    Bare,
    /// A rib or boss: extents along x, y, z and rounding of its edges, metres.
    Block([f64; 3], f64),
    /// The cap of a ball: diameter and height, metres.
    Dome(f64, f64),
    /// A head of so many sides: across flats and height, metres.
    Prism {
        /// Metres.
        across: f64,
        /// Metres.
        height: f64,
        /// At least three.
        sides: u8,
    },
    /// Ribs in a row along x: extents of the row, half of it gaps, metres.
    Ribs {
        /// Metres.
        extents: [f64; 3],
        /// At least two.
        count: u8,
    },
    /// An edge along y: extents along x, y, z, metres.
    Wedge([f64; 3]),
    /// A ring that lies on the surface: diameter of its middle line and thickness, metres.
    Torus(f64, f64),
}
