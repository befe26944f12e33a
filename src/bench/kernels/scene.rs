//! A scene for the distances: boxes, cylinders and balls around an arm, and a person.

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use tandem_msg::{Capsule, Pose, SceneObject, ShapeKind};

pub(super) const OBJECTS: usize = 20;
pub(super) const CAPSULES: usize = 12;

/// Drawn from a seed; nothing reaches into the arm's base.
pub(super) fn draw(seed: u64) -> (Vec<SceneObject>, Vec<Capsule>) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let place = |random: &mut ChaCha8Rng, near: f64, far: f64| {
        let (angle, radius) = (random.random_range(0.0..core::f64::consts::TAU), random.random_range(near..far));
        [radius * f64::cos(angle), radius * f64::sin(angle), random.random_range(-0.4..1.2)]
    };
    let kinds = [ShapeKind::Box, ShapeKind::Cylinder, ShapeKind::Sphere];
    let objects = (0..OBJECTS).map(|index| SceneObject {
        id: index as u32 + 1,
        shape: kinds[index % kinds.len()].into(),
        size: [random.random_range(0.05..0.25), random.random_range(0.05..0.25), random.random_range(0.05..0.25)],
        base_from_object: Pose { position: place(&mut random, 0.6, 1.6), rotation: [0.0, 0.0, 0.0, 1.0] },
    });
    let objects = objects.collect();
    let person = (0..CAPSULES).map(|_| {
        let from = place(&mut random, 0.9, 1.8);
        let to = from.map(|value| value + random.random_range(-0.3..0.3));
        Capsule { ends: [from, to], radius: 0.08, velocity: [0.0; 3] }
    });
    let person = person.collect();
    (objects, person)
}
