//! Signed distances of the eight feature classes, and how each joins its body.

use tandem_config::FeatureGeometry;
use tandem_msg::FeatureClass;

use super::Material;
use super::body::{cuboid, extrude, prism};
use super::form::{Form, Hook, Other, Recess, Section};
use super::thread::Thread;

/// 1/√2: the slope of a chamfer.
const DIAGONAL: f32 = core::f32::consts::FRAC_1_SQRT_2;

/// What a drill of 118° leaves: rise of the bottom towards the wall a metre, cosine of that slope.
const DRILL: [f32; 2] = [0.6, 0.857];

/// How far a feature that stands on the body reaches into it, metres.
const ROOT: f32 = 1e-4;

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
        /// Rise of the bottom towards the wall a metre, and the cosine of that slope.
        tip: [f32; 2],
        /// Radius and depth.
        counterbore: [f32; 2],
    },
    Axis {
        radius: f32,
        height: f32,
        chamfer: f32,
        thread: Option<Thread>,
        recess: Option<Recess>,
    },
    Slot {
        half_run: f32,
        radius: f32,
        depth: f32,
        chamfer: f32,
        section: Section,
        square: bool,
    },
    /// Frustum: radius at z = 0, change of radius a metre of z, end of it, cosine of the half angle.
    Cone {
        radius: f32,
        slope: f32,
        end: f32,
        cosine: f32,
        /// Radius of the bore below a seat.
        bore: f32,
    },
    /// Hook profile in the plane (x, z), half width along y; of two hooks where the profile begins from the
    /// middle, and the direction in which it runs.
    Buckle {
        profile: [[f32; 2]; 7],
        half_width: f32,
        pair: Option<[f32; 2]>,
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
    Prism {
        radius: f32,
        height: f32,
        sides: u8,
    },
    /// Half length along x, height, half width along y.
    Wedge {
        half: f32,
        height: f32,
        half_width: f32,
    },
    Torus {
        radius: f32,
        thickness: f32,
    },
    /// Ribs every so far along x, the outermost so far from the middle.
    Ribs {
        half: [f32; 3],
        every: f32,
        last: f32,
    },
}

impl FeatureSolid {
    /// The solid of a feature in one of its forms.
    pub fn new(geometry: &FeatureGeometry, form: &Form) -> Self {
        let g = geometry;
        let f = |v: f64| v as f32;
        let (radius, depth, chamfer, pitch) = (f(0.5 * g.diameter), f(g.depth), f(g.chamfer), f(g.pitch));
        let (shape, sunk) = match g.class {
            FeatureClass::ThreadedHole | FeatureClass::SmoothHole => {
                let thread = (g.class == FeatureClass::ThreadedHole).then(|| Thread::internal(radius, pitch));
                let tip = if form.drilled { DRILL } else { [0.0, 1.0] };
                let counterbore = [f(0.5 * form.counterbore[0]), f(form.counterbore[1])];
                (Shape::Hole { radius, depth, chamfer, thread, tip, counterbore }, true)
            }
            FeatureClass::ThreadedAxis | FeatureClass::SmoothAxis => {
                let thread = (g.class == FeatureClass::ThreadedAxis).then(|| Thread::external(radius, pitch));
                (Shape::Axis { radius, height: depth, chamfer, thread, recess: form.recess }, false)
            }
            FeatureClass::Slot => {
                let radius = f(0.5 * g.width);
                let half_run = f(if form.open { g.length } else { 0.5 * g.length });
                let half_run = (half_run - radius).max(0.0);
                (Shape::Slot { half_run, radius, depth, chamfer, section: form.section, square: form.square }, true)
            }
            FeatureClass::Cone => {
                // Either narrows away from the surface.
                let (slope, end) = (f(g.angle.tan()), depth);
                let (slope, end) = if form.seat { (slope, -end) } else { (-slope, end) };
                (Shape::Cone { radius, slope, end, cosine: f(g.angle.cos()), bore: f(0.5 * form.bore) }, form.seat)
            }
            FeatureClass::Buckle => (buckle(g, form.hook), false),
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
                Other::Prism { across, height, sides } => {
                    (Shape::Prism { radius: f(0.5 * across), height: f(height), sides }, false)
                }
                Other::Wedge([x, y, z]) => {
                    (Shape::Wedge { half: f(0.5 * x), height: f(z), half_width: f(0.5 * y) }, false)
                }
                Other::Torus(diameter, thickness) => {
                    (Shape::Torus { radius: f(0.5 * diameter), thickness: f(0.5 * thickness) }, false)
                }
                Other::Ribs { extents: [x, y, z], count } => {
                    // As much gap as rib.
                    let count = f32::from(count.max(2));
                    let rib = f(x) / (2.0 * count - 1.0);
                    let half = [0.5 * rib, f(0.5 * y), f(z)];
                    (Shape::Ribs { half, every: 2.0 * rib, last: 0.5 * (count - 1.0) }, false)
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
            Shape::Hole { radius, depth, chamfer, thread, tip: [rise, cosine], counterbore } => {
                let rho = (x * x + y * y).sqrt();
                let bore = thread.as_ref().map_or(rho - radius, |t| t.bore(x, y, z, rho));
                let bottom = (-depth - z - rise * (radius - rho).max(0.0)) * cosine;
                let cut = countersunk(bore.max(bottom), rho - radius, z, *chamfer);
                cut.min((rho - counterbore[0]).max(-counterbore[1] - z))
            }
            Shape::Axis { radius, height, chamfer, thread, recess } => {
                let rho = (x * x + y * y).sqrt();
                let rod = thread.as_ref().map_or(rho - radius, |t| t.rod(x, y, z, rho));
                let bevel = (rho - radius + z - height + chamfer) * DIAGONAL;
                // The profile above the end is none: its distance must not be added to the height.
                let end = z - height;
                let trunk = if thread.is_some() { rod.max(end) } else { extrude(rod, end) };
                let whole = trunk.max(bevel).max(-z - ROOT);
                recess.as_ref().map_or(whole, |r| {
                    let wall = prism([x, y], 0.5 * r.across as f32, r.sides);
                    whole.max(-wall.max(height - r.depth as f32 - z))
                })
            }
            Shape::Slot { half_run, radius, depth, chamfer, section, square } => {
                let along = (x.abs() - half_run).max(0.0);
                let end = x.abs() - half_run - radius;
                let wall = if *square { end.max(y.abs() - radius) } else { (along * along + y * y).sqrt() - radius };
                let cut = match section {
                    Section::Plain => wall.max(-depth - z),
                    Section::Tee(neck, foot) => {
                        let below = (y.abs() - radius * *foot as f32).max(end).max(z + depth * *neck as f32);
                        wall.min(below).max(-depth - z)
                    }
                    Section::Dovetail(slope) => {
                        let slope = *slope as f32;
                        let wall = (y.abs() - radius + slope * z.min(0.0)) / (1.0 + slope * slope).sqrt();
                        wall.max(end).max(-depth - z)
                    }
                };
                countersunk(cut, wall, z, *chamfer)
            }
            Shape::Cone { radius, slope, end, cosine, bore } => {
                let rho = (x * x + y * y).sqrt();
                let flank = (rho - radius - slope * z) * cosine;
                // A pin ends above, a seat below.
                if *end > 0.0 {
                    flank.max(z - end).max(-z - ROOT)
                } else {
                    let cut = flank.max(end - z);
                    if *bore > 0.0 { cut.min(rho - bore) } else { cut }
                }
            }
            Shape::Buckle { profile, half_width, pair, reach } => {
                let bound = (x * x + y * y + z * z).sqrt() - reach;
                if bound > 0.5 * reach {
                    return bound;
                }
                let along = pair.map_or(x, |[from, way]| way * (x.abs() - from));
                let across = polygon([along, z], profile);
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
            Shape::Wedge { half, height, half_width } => {
                let flank = (x.abs() * height + z * half - half * height) / (half * half + height * height).sqrt();
                flank.max(y.abs() - half_width).max(-z - ROOT)
            }
            Shape::Torus { radius, thickness } => {
                let across = (x * x + y * y).sqrt() - radius;
                let up = z - 0.8 * thickness;
                (across * across + up * up).sqrt() - thickness
            }
            Shape::Prism { radius, height, sides } => prism([x, y], *radius, *sides).max(z - height).max(-z - ROOT),
            Shape::Ribs { half, every, last } => {
                // Ribs stand at whole steps from the first.
                let nearest = ((x / every + last).round().clamp(0.0, 2.0 * last) - last) * every;
                cuboid([x - nearest, y, z], *half).max(-z - ROOT)
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

/// Snap hooks of height `depth`, `width` along y, `length` along x over all.
fn buckle(g: &FeatureGeometry, hook: Hook) -> Shape {
    let (height, length) = (g.depth as f32, g.length as f32);
    let each = match hook {
        Hook::Single => length,
        Hook::Pair { gap, .. } => (0.5 - gap as f32) * length,
    };
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
    // A single hook stands about the origin.
    let shift = if hook == Hook::Single { -0.5 * length } else { 0.0 };
    let profile = profile.map(|[x, z]| [x + shift, z]);
    let pair = match hook {
        Hook::Single => None,
        Hook::Pair { inward: false, .. } => Some([0.5 * length - each, 1.0]),
        Hook::Pair { inward: true, .. } => Some([0.5 * length, -1.0]),
    };
    let reach = (0.25 * length * length + height * height + half_width * half_width).sqrt();
    Shape::Buckle { profile, half_width, pair, reach }
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
