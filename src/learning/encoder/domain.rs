//! What parts are like and how they are looked at: the ranges examples are drawn from.
//!
//! The source domain draws every part anew, from ranges wider than any product's. A product
//! has a few part types of its own, each of which comes in other sizes, and a scanner of its own.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use tandem_config::Product;
use tandem_msg::{CLOUD_POINTS, Coded, FeatureClass};

use super::dataset::drawn;
use super::part::{Kind, log_uniform};
use crate::perception::Sampler;

/// What one scanner does to a cloud beyond noise, always the same. Lengths in half widths of the view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scanner {
    /// Fewest and most points of a scan.
    pub points: [usize; 2],
    /// Step of the range it reads.
    pub step: f64,
    /// Bending of the range towards the edge of the view, away from the camera if positive.
    pub bowl: f64,
    /// Share of points that is missing, larger towards the darker side of the view.
    pub shade: f64,
    /// Direction of the darker side in the view, radians.
    pub dark: f64,
}

impl Scanner {
    /// A place in the camera frame as it is read, if it is; `focus` and `half_width` of the view, metres.
    pub(crate) fn read(&self, p: [f32; 3], half_width: f64, focus: f64, rng: &mut ChaCha8Rng) -> Option<[f32; 3]> {
        let (step, bowl) = ((half_width * self.step).max(1e-9) as f32, (half_width * self.bowl) as f32);
        let across = (focus / half_width) as f32;
        // Place in the view, -1 to 1.
        let [x, y] = [p[0] / p[2] * across, p[1] / p[2] * across];
        let (sin, cos) = (self.dark as f32).sin_cos();
        let dark = 0.5 + 0.35 * (x * cos + y * sin);
        if rng.random::<f32>() < self.shade as f32 * dark {
            return None;
        }
        let depth = p[2] + bowl * (0.5 * (x * x + y * y) - 0.33);
        let depth = (depth / step).round() * step;
        Some(p.map(|v| v * depth / p[2]))
    }
}

/// Part types of a shift that is made up, and how often each is looked at before it is taken.
const MADE_UP: usize = 11;
const GLANCES: usize = 5;

/// The ranges of a domain.
#[derive(Clone, Debug)]
pub struct Domain {
    /// Its part types; every part is one of its own when there are none.
    pub kinds: Vec<Kind>,
    /// Sizes of a part type, in its nominal one.
    pub scale: [f64; 2],
    /// Tilt of the view off the feature's axis, radians: straight from above a bore shows no wall.
    pub tilt: [f64; 2],
    /// Half the view in extents of the feature.
    pub view: [f64; 2],
    /// How far off the feature the camera may be aimed, in half widths of the view.
    pub aim: f64,
    /// Range noise in half widths of the view, and its limits in metres.
    pub noise: [f64; 2],
    /// The limits.
    pub noise_limits: [f64; 2],
    /// Largest share of points lost.
    pub dropout: f64,
    /// Largest share of stray points.
    pub outliers: f64,
    /// Share of views with nothing beside the part, and the most there is in the others.
    pub tidy: f64,
    /// The most there is in the others.
    pub clutter: usize,
    /// What else the scanner does; a plain one does nothing.
    pub scanner: Option<Scanner>,
    /// Tells the random streams of domains apart.
    pub stream: u64,
}

impl Domain {
    /// Where the encoder comes from: any part, the plant's camera.
    pub fn source() -> Self {
        Self {
            kinds: Vec::new(),
            scale: [1.0, 1.0],
            tilt: [0.22, 0.70],
            view: [1.1, 2.1],
            aim: 0.28,
            noise: [0.001, 0.0055],
            noise_limits: [20e-6, 250e-6],
            dropout: 0.08,
            outliers: 0.008,
            tidy: 0.35,
            clutter: 4,
            scanner: None,
            stream: 0,
        }
    }

    /// A product's part types under another scanner: coarse in range, bent towards the edges of its view,
    /// noisier, seen from farther away and from lower, with more lying about.
    pub fn product(product: &Product) -> Self {
        Self {
            kinds: product.parts.iter().map(Kind::of).collect(),
            scale: [0.75, 1.35],
            tilt: [0.35, 1.05],
            view: [1.5, 3.2],
            aim: 0.35,
            noise: [0.001, 0.010],
            noise_limits: [20e-6, 500e-6],
            dropout: 0.2,
            outliers: 0.03,
            tidy: 0.1,
            clutter: 7,
            scanner: Some(Scanner { points: [3_000, 8_000], step: 0.012, bowl: 0.15, shade: 0.6, dark: 0.0 }),
            stream: 0x5472_0000,
        }
    }

    /// A shift of the source that is made up: eleven part types of the generator's, some scanner.
    /// What agents of transfer learn on, since its labels cost nothing.
    pub fn made_up(rng: &mut ChaCha8Rng) -> Self {
        let noise = log_uniform([0.004, 0.013], rng);
        let view = rng.random_range(1.2..1.8);
        let scanner = Scanner {
            points: [rng.random_range(2_500..8_000), CLOUD_POINTS],
            step: rng.random_range(0.0..0.02),
            bowl: rng.random_range(-0.2..0.2),
            shade: rng.random_range(0.0..0.9),
            dark: rng.random_range(0.0..std::f64::consts::TAU),
        };
        let mut out = Self {
            kinds: Vec::new(),
            scale: [0.75, 1.35],
            tilt: [rng.random_range(0.2..0.5), rng.random_range(0.7..1.0)],
            view: [view, view + rng.random_range(0.4..1.5)],
            aim: rng.random_range(0.2..0.4),
            noise: [0.001, noise],
            noise_limits: [20e-6, 500e-6],
            dropout: rng.random_range(0.05..0.25),
            outliers: rng.random_range(0.003..0.03),
            tidy: rng.random_range(0.0..0.4),
            clutter: rng.random_range(3..7),
            scanner: Some(scanner),
            stream: rng.random(),
        };
        let mut kinds = Vec::with_capacity(MADE_UP);
        while kinds.len() < MADE_UP {
            let class = match FeatureClass::ALL.get(kinds.len()) {
                Some(class) => *class,
                None => FeatureClass::ALL[rng.random_range(0..FeatureClass::ALL.len())],
            };
            out.kinds = vec![Kind::draw(class, rng)];
            if out.shows(rng) {
                kinds.append(&mut out.kinds);
            }
        }
        Self { kinds, ..out }
    }

    /// Whether its first part type can mostly be seen: of a slot too narrow this scanner sees nothing.
    fn shows(&self, rng: &mut ChaCha8Rng) -> bool {
        let (mut sampler, mut cloud) = (Sampler::new(), Vec::new());
        let seen = (0..GLANCES).filter(|_| drawn(self, 0, rng, &mut sampler, &mut cloud).is_some());
        2 * seen.count() > GLANCES
    }

    /// Class of an example: classes or part types follow each other in turn.
    pub fn class(&self, index: u64) -> FeatureClass {
        match self.kinds.len() as u64 {
            0 => FeatureClass::ALL[(index % FeatureClass::ALL.len() as u64) as usize],
            count => self.kinds[(index % count) as usize].feature.class,
        }
    }
}
