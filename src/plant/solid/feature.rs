//! Signed distances of the eight feature classes, and how each joins its body.

use tandem_config::FeatureGeometry;
use tandem_msg::FeatureClass;

use super::Material;
use super::body::{cuboid, extrude};
use super::thread::Thread;

/// 1/√2: the slope of a chamfer.
const DIAGONAL: f32 = core::f32::consts::FRAC_1_SQRT_2;

/// How far a feature that stands on the body reaches into it, metres.
const ROOT: f32 = 1e-4;

/// What the dimensions leave open.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Form {
    /// A cone is a seat sunk into the part, not a pin.
    pub seat: bool,
    /// A buckle is two hooks that face away from each other.
    pub twin: bool,
    /// What stands on the surface when there is no feature of another class.
    pub other: Other,
}

impl Form {
    /// The form a feature of a product has.
    pub fn of(geometry: &FeatureGeometry) -> Self {
        Self { twin: geometry.length > 0.8 * geometry.depth, ..Self::default() }
    }
}

/// Forms of [`FeatureClass::Other`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Other {
    /// The bare surface.
    #[default]
    Bare,
    /// A rib or boss: extents along x, y, z and rounding of its edges, metres.
    Block([f64; 3], f64),
    /// The cap of a ball: diameter and height, metres.
    Dome(f64, f64),
}

/// A feature in its own frame.
#[derive(Clone, Debug)]
pub struct FeatureSolid {
    shape: Shape,
    /// Cut out of the body rather than set upon it.
    sunk: bool,
}

#[derive(Clone, Debug)]
enum Shape {
    /// Nothing: the bare surface.
    None,
    Hole {
        radius: f32,
        depth: f32,
        chamfer: f32,
        thread: Option<Thread>,
    },
    Axis {
        radius: f32,
        height: f32,
        chamfer: f32,
        thread: Option<Thread>,
    },
    Slot {
        half_run: f32,
        radius: f32,
        depth: f32,
        chamfer: f32,
    },
    /// Frustum: radius at z = 0, change of radius a metre of z, end of it, cosine of the half angle.
    Cone {
        radius: f32,
        slope: f32,
        end: f32,
        cosine: f32,
    },
    /// Hook profile in the plane (x, z), half width along y, half gap between two facing away, or none.
    Buckle {
        profile: [[f32; 2]; 7],
        half_width: f32,
        half_gap: Option<f32>,
        reach: f32,
    },
    /// Box with rounded edges, standing on the surface.
    Block {
        half: [f32; 3],
        rounding: f32,
    },
    /// Cap of a sphere with this radius and centre height.
    Dome {
        radius: f32,
        centre: f32,
    },
}

impl FeatureSolid {
    /// The solid of a feature in one of its forms.
    pub fn new(geometry: &FeatureGeometry, form: &Form) -> Self {
        let g = geometry;
        let f = |v: f64| v as f32;
        let (radius, depth, chamfer, pitch) = (f(0.5 * g.diameter), f(g.depth), f(g.chamfer), f(g.pitch));
        let (shape, sunk) = match g.class {
            FeatureClass::ThreadedHole => {
                (Shape::Hole { radius, depth, chamfer, thread: Some(Thread::internal(radius, pitch)) }, true)
            }
            FeatureClass::SmoothHole => (Shape::Hole { radius, depth, chamfer, thread: None }, true),
            FeatureClass::ThreadedAxis => {
                let thread = Some(Thread::external(radius, pitch));
                (Shape::Axis { radius, height: depth, chamfer, thread }, false)
            }
            FeatureClass::SmoothAxis => (Shape::Axis { radius, height: depth, chamfer, thread: None }, false),
            FeatureClass::Slot => {
                let radius = f(0.5 * g.width);
                (Shape::Slot { half_run: (f(0.5 * g.length) - radius).max(0.0), radius, depth, chamfer }, true)
            }
            FeatureClass::Cone => {
                // Either narrows away from the surface.
                let (slope, end) = (f(g.angle.tan()), depth);
                let (slope, end) = if form.seat { (slope, -end) } else { (-slope, end) };
                (Shape::Cone { radius, slope, end, cosine: f(g.angle.cos()) }, form.seat)
            }
            FeatureClass::Buckle => (buckle(g, form.twin), false),
            FeatureClass::Other => match form.other {
                Other::Bare => (Shape::None, false),
                Other::Block([x, y, z], rounding) => {
                    (Shape::Block { half: [f(0.5 * x), f(0.5 * y), f(z)], rounding: f(rounding) }, false)
                }
                Other::Dome(diameter, height) => {
                    let (radius, height) = (0.5 * diameter, height.min(0.5 * diameter));
                    let sphere = (radius * radius + height * height) / (2.0 * height.max(1e-6));
                    (Shape::Dome { radius: f(sphere), centre: f(height - sphere) }, false)
                }
            },
        };
        Self { shape, sunk }
    }

    /// Joins the feature to a body `body` metres away.
    #[inline]
    pub(crate) fn combine(&self, p: [f32; 3], body: f32) -> (f32, Material) {
        if self.sunk {
            let wall = -self.distance(p);
            if wall > body { (wall, Material::Feature) } else { (body, Material::Body) }
        } else {
            let feature = self.distance(p);
            if feature < body { (feature, Material::Feature) } else { (body, Material::Body) }
        }
    }

    /// Signed distance to the feature's own volume: the material of an axis, the air of a hole.
    #[inline]
    fn distance(&self, p: [f32; 3]) -> f32 {
        let [x, y, z] = p;
        match &self.shape {
            Shape::None => f32::INFINITY,
            Shape::Hole { radius, depth, chamfer, thread } => {
                let rho = (x * x + y * y).sqrt();
                let bore = thread.as_ref().map_or(rho - radius, |t| t.bore(x, y, z, rho));
                countersunk(bore.max(-depth - z), rho - radius, z, *chamfer)
            }
            Shape::Axis { radius, height, chamfer, thread } => {
                let rho = (x * x + y * y).sqrt();
                let rod = thread.as_ref().map_or(rho - radius, |t| t.rod(x, y, z, rho));
                let bevel = (rho - radius + z - height + chamfer) * DIAGONAL;
                // The profile above the end is none: its distance must not be added to the height.
                let end = z - height;
                let trunk = if thread.is_some() { rod.max(end) } else { extrude(rod, end) };
                trunk.max(bevel).max(-z - ROOT)
            }
            Shape::Slot { half_run, radius, depth, chamfer } => {
                let along = (x.abs() - half_run).max(0.0);
                let wall = (along * along + y * y).sqrt() - radius;
                countersunk(wall.max(-depth - z), wall, z, *chamfer)
            }
            Shape::Cone { radius, slope, end, cosine } => {
                let rho = (x * x + y * y).sqrt();
                let flank = (rho - radius - slope * z) * cosine;
                // A pin ends above, a seat below.
                if *end > 0.0 { flank.max(z - end).max(-z - ROOT) } else { flank.max(end - z) }
            }
            Shape::Buckle { profile, half_width, half_gap, reach } => {
                let bound = (x * x + y * y + z * z).sqrt() - reach;
                if bound > 0.5 * reach {
                    return bound;
                }
                let across = match half_gap {
                    Some(gap) => polygon([x.abs() - gap, z], profile),
                    None => polygon([x, z], profile),
                };
                extrude(across, y.abs() - half_width)
            }
            Shape::Block { half, rounding } => {
                let inner = half.map(|h| h - rounding);
                (cuboid(p, inner) - rounding).max(-z - ROOT)
            }
            Shape::Dome { radius, centre } => {
                let h = z - centre;
                ((x * x + y * y + h * h).sqrt() - radius).max(-z - ROOT)
            }
        }
    }
}

/// Widens the mouth of a cut at z = 0 by a chamfer; `wall` is the distance past the plain wall.
#[inline]
fn countersunk(cut: f32, wall: f32, z: f32, chamfer: f32) -> f32 {
    if chamfer <= 0.0 {
        return cut;
    }
    cut.min(((wall - chamfer - z) * DIAGONAL).max(-chamfer - z))
}

/// Snap hooks of height `depth`, `width` along y, `length` along x over all: one, or a pair
/// whose noses look away from each other.
fn buckle(g: &FeatureGeometry, twin: bool) -> Shape {
    let (height, length) = (g.depth as f32, g.length as f32);
    let each = if twin { 0.36 * length } else { length };
    let (thick, overhang) = (0.55 * each, 0.45 * each);
    let nose = (0.4 * height).min(2.0 * overhang);
    // Counter-clockwise from the foot; the nose looks towards +x.
    let profile = [
        [0.0, -ROOT],
        [thick, -ROOT],
        [thick, height - nose],
        [thick + overhang, height - nose + 0.1 * overhang],
        [thick + overhang, height - 0.6 * nose],
        [0.7 * thick, height],
        [0.0, height],
    ];
    let half_width = 0.5 * g.width as f32;
    let half_gap = twin.then_some(0.5 * length - each);
    // A single hook stands about the origin.
    let shift = if twin { 0.0 } else { -0.5 * length };
    let profile = profile.map(|[x, z]| [x + shift, z]);
    let reach = (0.25 * length * length + height * height + half_width * half_width).sqrt();
    Shape::Buckle { profile, half_width, half_gap, reach }
}

/// Signed distance to a simple polygon.
#[inline]
fn polygon(p: [f32; 2], corners: &[[f32; 2]; 7]) -> f32 {
    let mut squared = f32::INFINITY;
    let mut inside = false;
    let mut previous = corners[6];
    for &corner in corners {
        let edge = [previous[0] - corner[0], previous[1] - corner[1]];
        let to = [p[0] - corner[0], p[1] - corner[1]];
        let t = ((to[0] * edge[0] + to[1] * edge[1]) / (edge[0] * edge[0] + edge[1] * edge[1])).clamp(0.0, 1.0);
        let gap = [to[0] - t * edge[0], to[1] - t * edge[1]];
        squared = squared.min(gap[0] * gap[0] + gap[1] * gap[1]);
        if (corner[1] > p[1]) != (previous[1] > p[1]) && to[0] < edge[0] * to[1] / edge[1] {
            inside = !inside;
        }
        previous = corner;
    }
    if inside { -squared.sqrt() } else { squared.sqrt() }
}
