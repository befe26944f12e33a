//! The shape of a part and of the one feature it is assembled by.

use crate::read::{Bound, Table, bound};
use tandem_msg::FeatureClass;

const SIZE: Bound = bound("size_m", "m", 0.0005, 1.0);
const OUTER: Bound = bound("outer_m", "m", 0.001, 1.0);
const INNER: Bound = bound("inner_m", "m", 0.001, 1.0);
const HEIGHT: Bound = bound("height_m", "m", 0.0005, 1.0);
const RADIUS: Bound = bound("radius_m", "m", 0.001, 0.5);
const LENGTH: Bound = bound("length_m", "m", 0.005, 1.0);
const WALL: Bound = bound("wall_m", "m", 0.001, 0.1);
const FLOOR: Bound = bound("floor_m", "m", 0.001, 0.1);

/// A box with its centre in the part frame, axes parallel to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cuboid {
    /// Centre, metres, in the part frame.
    pub centre: [f64; 3],
    /// Half extents along the part's axes, metres.
    pub half_extents: [f64; 3],
}

/// Shape of a part, centred on the part frame, z up when assembled. Metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Body {
    /// A block or plate.
    Box {
        /// Extents along x, y, z.
        size: [f64; 3],
    },
    /// An open-topped tray: a floor and four walls.
    Tray {
        /// Outer extents along x, y, z.
        size: [f64; 3],
        /// Thickness of the walls.
        wall: f64,
        /// Thickness of the floor.
        floor: f64,
    },
    /// A rectangular frame.
    Ring {
        /// Outer extents along x, y.
        outer: [f64; 2],
        /// Extents of the opening along x, y.
        inner: [f64; 2],
        /// Extent along z.
        height: f64,
    },
    /// A cylinder along z.
    Cylinder {
        /// Radius.
        radius: f64,
        /// Extent along z.
        height: f64,
    },
    /// A cable lying straight along y, with round ends; `length` includes them.
    Cable {
        /// Extent along y.
        length: f64,
        /// Radius of its cross section.
        radius: f64,
    },
}

impl Body {
    /// Half extents of the smallest box around the body, metres.
    pub fn half_extents(&self) -> [f64; 3] {
        match *self {
            Self::Box { size } | Self::Tray { size, .. } => size.map(|extent| extent / 2.0),
            Self::Ring { outer, height, .. } => [outer[0] / 2.0, outer[1] / 2.0, height / 2.0],
            Self::Cylinder { radius, height } => [radius, radius, height / 2.0],
            Self::Cable { length, radius } => [radius, length / 2.0, radius],
        }
    }

    /// Boxes that together cover the body and leave its cavities open: one for a solid
    /// body, four for a ring, five for a tray.
    pub fn cuboids(&self) -> Vec<Cuboid> {
        match *self {
            Self::Tray { size, wall, floor } => {
                let mut cuboids = frame([size[0], size[1]], [size[0] - 2.0 * wall, size[1] - 2.0 * wall], size[2]);
                cuboids.push(Cuboid {
                    centre: [0.0, 0.0, (floor - size[2]) / 2.0],
                    half_extents: [size[0] / 2.0, size[1] / 2.0, floor / 2.0],
                });
                cuboids
            }
            Self::Ring { outer, inner, height } => frame(outer, inner, height),
            _ => vec![Cuboid { centre: [0.0; 3], half_extents: self.half_extents() }],
        }
    }

    pub(crate) fn read(table: &Table<'_>) -> Self {
        let kinds = "box, tray, ring, cylinder, cable";
        let kind = table.text("kind").unwrap_or_default();
        match kind.as_str() {
            "tray" => {
                let size: [f64; 3] = table.numbers(&SIZE);
                let (wall, floor) = (table.number(&WALL), table.number(&FLOOR));
                if 2.0 * wall >= size[0].min(size[1]) {
                    table.refuse(WALL.key, &format!("{wall} m"), "less than half of size_m", "make the walls thinner");
                }
                if floor >= size[2] {
                    table.refuse(FLOOR.key, &format!("{floor} m"), "less than size_m[2]", "make the floor thinner");
                }
                Self::Tray { size, wall, floor }
            }
            "ring" => {
                let (outer, inner) = (table.numbers::<2>(&OUTER), table.numbers::<2>(&INNER));
                if inner[0] >= outer[0] || inner[1] >= outer[1] {
                    table.refuse(INNER.key, &format!("{inner:?} m"), "less than outer_m", "make the opening smaller");
                }
                Self::Ring { outer, inner, height: table.number(&HEIGHT) }
            }
            "cylinder" => Self::Cylinder { radius: table.number(&RADIUS), height: table.number(&HEIGHT) },
            "cable" => {
                let (length, radius) = (table.number(&LENGTH), table.number(&RADIUS));
                if length <= 2.0 * radius {
                    table.refuse(LENGTH.key, &format!("{length} m"), "more than 2 radius_m", "make the cable longer");
                }
                Self::Cable { length, radius }
            }
            "box" => Self::Box { size: table.numbers(&SIZE) },
            other => {
                if !other.is_empty() {
                    table.refuse("kind", &format!("\"{other}\""), kinds, "choose one of these names");
                }
                Self::Box { size: [0.01; 3] }
            }
        }
    }
}

/// The four bars of a rectangular frame.
fn frame(outer: [f64; 2], inner: [f64; 2], height: f64) -> Vec<Cuboid> {
    let bar = [(outer[0] - inner[0]) / 4.0, (outer[1] - inner[1]) / 4.0];
    let at = [(outer[0] + inner[0]) / 4.0, (outer[1] + inner[1]) / 4.0];
    [-1.0, 1.0]
        .into_iter()
        .flat_map(|side| {
            [
                Cuboid { centre: [side * at[0], 0.0, 0.0], half_extents: [bar[0], outer[1] / 2.0, height / 2.0] },
                Cuboid { centre: [0.0, side * at[1], 0.0], half_extents: [inner[0] / 2.0, bar[1], height / 2.0] },
            ]
        })
        .collect()
}

/// The feature a part is assembled by. Metres and radians, 0 where a quantity does not apply.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FeatureGeometry {
    /// Its class.
    pub class: FeatureClass,
    /// Diameter of a hole or axis, or of the large end of a cone.
    pub diameter: f64,
    /// Depth of a hole or slot, height of an axis, cone or buckle.
    pub depth: f64,
    /// Length of a slot or buckle.
    pub length: f64,
    /// Width of a slot or buckle.
    pub width: f64,
    /// Pitch of a thread.
    pub pitch: f64,
    /// Half angle of a cone, radians.
    pub angle: f64,
    /// Chamfer of an edge.
    pub chamfer: f64,
}

const CLASS_DIAMETER: Bound = bound("diameter_m", "m", 0.002, 0.12);
const CLASS_DEPTH: Bound = bound("depth_m", "m", 0.001, 0.12);
const CLASS_LENGTH: Bound = bound("length_m", "m", 0.002, 0.4);
const CLASS_WIDTH: Bound = bound("width_m", "m", 0.001, 0.2);
const CLASS_PITCH: Bound = bound("pitch_m", "m", 0.0003, 0.01);
const CLASS_ANGLE: Bound = bound("angle_rad", "rad", 0.02, 1.4);
const CLASS_CHAMFER: Bound = bound("chamfer_m", "m", 0.0, 0.01);

impl FeatureGeometry {
    /// Reads the quantities that the class has; the others are unknown keys.
    pub(crate) fn read(table: &Table<'_>) -> Self {
        use FeatureClass as C;
        let class = table.named("class").unwrap_or(C::Other);
        let when = |has: bool, bound: &Bound| if has { table.number(bound) } else { 0.0 };
        let round = matches!(class, C::ThreadedHole | C::SmoothHole | C::ThreadedAxis | C::SmoothAxis | C::Cone);
        let long = matches!(class, C::Slot | C::Buckle);
        Self {
            class,
            diameter: when(round, &CLASS_DIAMETER),
            depth: when(round || long, &CLASS_DEPTH),
            length: when(long, &CLASS_LENGTH),
            width: when(long, &CLASS_WIDTH),
            pitch: when(matches!(class, C::ThreadedHole | C::ThreadedAxis), &CLASS_PITCH),
            angle: when(class == C::Cone, &CLASS_ANGLE),
            chamfer: table.number_or(&CLASS_CHAMFER, 0.0),
        }
    }
}
