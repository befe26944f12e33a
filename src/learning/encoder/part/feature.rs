//! Features in their forms.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use tandem_config::FeatureGeometry;
use tandem_msg::FeatureClass;

use super::{PRISMS, SIZE, log_uniform};
use crate::plant::solid::{Form, Hook, Other, Recess, Section};

/// Turns of a thread there are at least: less is a groove.
const TURNS_MIN: f64 = 2.5;

/// A feature of a class, and what its dimensions leave open.
pub(super) fn draw(class: FeatureClass, rng: &mut ChaCha8Rng) -> (FeatureGeometry, Form) {
    let mut g = FeatureGeometry {
        class,
        diameter: 0.0,
        depth: 0.0,
        length: 0.0,
        width: 0.0,
        pitch: 0.0,
        angle: 0.0,
        chamfer: 0.0,
    };
    let mut form = Form::default();
    let size = log_uniform(SIZE, rng);
    let of = |rng: &mut ChaCha8Rng, low: f64, high: f64| size * rng.random_range(low..high);
    match class {
        FeatureClass::ThreadedHole | FeatureClass::SmoothHole => {
            g.diameter = size;
            g.depth = size * log_uniform([0.25, 2.2], rng);
            g.chamfer = of(rng, -0.08, 0.12).max(0.0).min(0.3 * g.depth);
            if class == FeatureClass::ThreadedHole {
                g.pitch = of(rng, 0.08, 0.19).min((g.depth - g.chamfer) / TURNS_MIN);
            } else if rng.random_bool(0.12) {
                // Countersunk for a screw's head.
                g.chamfer = of(rng, 0.15, 0.45).min(0.5 * g.depth);
            } else if rng.random_bool(0.12) {
                form.counterbore = [of(rng, 1.35, 2.2), g.depth * rng.random_range(0.1..0.5)];
                g.chamfer = 0.0;
            }
            form.drilled = rng.random_bool(0.35);
        }
        FeatureClass::ThreadedAxis | FeatureClass::SmoothAxis => {
            g.diameter = size;
            g.depth = of(rng, 0.5, 2.8);
            g.chamfer = of(rng, -0.05, 0.12).max(0.0).min(0.4 * g.depth);
            if class == FeatureClass::ThreadedAxis {
                g.pitch = of(rng, 0.08, 0.19).min((g.depth - g.chamfer) / TURNS_MIN);
            }
            if rng.random_bool(0.2) {
                // A key's recess, or a tube.
                let (sides, share) = if rng.random_bool(0.5) { (6, [0.3, 0.6]) } else { (0, [0.3, 0.8]) };
                let across = (size - 2.0 * g.chamfer) * rng.random_range(share[0]..share[1]);
                form.recess = Some(Recess { across, depth: g.depth * rng.random_range(0.2..0.9), sides });
            }
        }
        FeatureClass::Slot => {
            g.length = size;
            g.width = size * log_uniform([0.06, 0.58], rng);
            g.depth = (g.width * rng.random_range(0.25..1.5)).min(0.6 * size);
            g.chamfer = (g.width * rng.random_range(-0.1..0.12)).max(0.0);
            form.section = match rng.random_range(0..10) {
                0 => Section::Tee(rng.random_range(0.2..0.6), rng.random_range(1.4..2.4)),
                1 => Section::Dovetail(rng.random_range(0.15..0.7)),
                _ => Section::Plain,
            };
            form.open = rng.random_bool(0.3);
            form.square = form.open || form.section != Section::Plain || rng.random_bool(0.25);
        }
        FeatureClass::Cone => {
            g.diameter = size;
            form.seat = rng.random_bool(0.4);
            g.angle = rng.random_range(0.10..if form.seat { 0.9 } else { 0.65 });
            // No sharper than a tip of an eighth of the diameter.
            let sharpest = 0.5 * size * 0.87 / g.angle.tan();
            g.depth = (size * rng.random_range(0.5..2.2)).min(sharpest);
            if form.seat && rng.random_bool(0.5) {
                // A screw's seat: the cone goes over into a bore.
                form.bore = size * rng.random_range(0.3..0.7);
                g.depth = 0.5 * (size - form.bore) / g.angle.tan();
            }
        }
        FeatureClass::Buckle => {
            form.hook = match rng.random_range(0..10) {
                0..4 => Hook::Single,
                4..7 => Hook::Pair { gap: rng.random_range(0.06..0.25), inward: false },
                7 => Hook::Pair { gap: 0.0, inward: false },
                _ => Hook::Pair { gap: rng.random_range(0.15..0.25), inward: true },
            };
            g.depth = size;
            g.width = of(rng, 0.35, 1.6);
            g.length = if form.hook == Hook::Single { of(rng, 0.3, 0.79) } else { of(rng, 0.81, 1.8) };
        }
        FeatureClass::Other => {
            form.other = match rng.random_range(0..20) {
                0..7 => Other::Bare,
                7 | 8 => {
                    let sides = PRISMS[rng.random_range(0..PRISMS.len())];
                    Other::Prism { across: size, height: of(rng, 0.15, 1.2), sides }
                }
                9 | 10 => {
                    let extents = [size, size * rng.random_range(0.2..1.0), size * rng.random_range(0.1..0.4)];
                    Other::Ribs { extents, count: rng.random_range(2..7) }
                }
                11 => {
                    let [long, tall] = [0.15, 0.3].map(|low| size * rng.random_range(low..1.0));
                    Other::Wedge([long, size, tall])
                }
                12 => Other::Torus(size, size * rng.random_range(0.08..0.35)),
                13..18 => {
                    let (length, width) = (size, size * rng.random_range(0.12..1.0));
                    let height = size * rng.random_range(0.1..0.9);
                    Other::Block([length, width, height], 0.15 * width.min(height) * rng.random::<f64>())
                }
                _ => Other::Dome(size, size * rng.random_range(0.12..0.5)),
            };
        }
    }
    (g, form)
}
