//! What a product file says of a part's shape. Lengths in metres, angles in radians.

use tandem_msg::FeatureClass;

/// The body of a part, centred on the part frame.
#[derive(Clone, Debug, PartialEq)]
pub enum Body {
    /// Box.
    Box {
        /// Extents along x, y, z.
        size: [f64; 3],
    },
    /// Open-topped tray: a floor and four walls.
    Tray {
        /// Outer extents along x, y, z.
        size: [f64; 3],
        /// Thickness of the walls.
        wall: f64,
        /// Thickness of the floor.
        floor: f64,
    },
    /// Rectangular frame.
    Ring {
        /// Outer extents along x, y.
        outer: [f64; 2],
        /// Inner extents along x, y.
        inner: [f64; 2],
        /// Extent along z.
        height: f64,
    },
    /// Cylinder along z.
    Cylinder {
        /// Radius.
        radius: f64,
        /// Extent along z.
        height: f64,
    },
    /// Cable lying along y, with round ends; `length` includes them.
    Cable {
        /// Extent along y.
        length: f64,
        /// Radius of its cross section.
        radius: f64,
    },
}

/// The assembly feature of a part; zero where a dimension does not apply.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FeatureGeometry {
    /// Class.
    pub class: FeatureClass,
    /// Diameter of a hole or axis (major diameter of a thread), of the large end of a cone.
    pub diameter: f64,
    /// Depth of a hole or slot, height of an axis, cone or buckle.
    pub depth: f64,
    /// Length of a slot or buckle, along x.
    pub length: f64,
    /// Width of a slot or buckle, along y.
    pub width: f64,
    /// Pitch of a thread.
    pub pitch: f64,
    /// Half angle of a cone.
    pub angle: f64,
    /// Chamfer of the mouth or the end, 45 degrees.
    pub chamfer: f64,
}

impl FeatureGeometry {
    /// A feature of which nothing is known but its class.
    pub fn plain(class: FeatureClass) -> Self {
        Self { class, diameter: 0.0, depth: 0.0, length: 0.0, width: 0.0, pitch: 0.0, angle: 0.0, chamfer: 0.0 }
    }
}
