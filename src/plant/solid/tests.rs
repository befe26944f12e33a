//! Every class has the shape it is named after, and distances never step through it.

use super::*;
use nalgebra::Isometry3;
use tandem_msg::FeatureClass;

/// A 60 mm plate, 20 mm thick, with the feature in the middle of its top.
fn on_plate(class: FeatureClass) -> (Solid, FeatureGeometry) {
    let mut feature = FeatureGeometry {
        class,
        diameter: 0.012,
        depth: 0.010,
        length: 0.0,
        width: 0.0,
        pitch: 0.0,
        angle: 0.0,
        chamfer: 0.0,
    };
    match class {
        FeatureClass::ThreadedHole | FeatureClass::ThreadedAxis => feature.pitch = 0.00175,
        FeatureClass::Slot | FeatureClass::Buckle => (feature.length, feature.width) = (0.020, 0.008),
        FeatureClass::Cone => feature.angle = 0.2,
        _ => {}
    }
    let body = Body::Box { size: [0.06, 0.06, 0.02] };
    (Solid::new(&body, &feature, &Isometry3::translation(0.0, 0.0, 0.01)), feature)
}

#[test]
fn sunk_features_are_air_and_raised_ones_material() {
    use FeatureClass as C;
    for (class, at, inside) in [
        (C::Other, [0.0, 0.0, -0.005], true),
        (C::ThreadedHole, [0.0, 0.0, -0.005], false),
        (C::SmoothHole, [0.0055, 0.0, -0.009], false),
        (C::SmoothHole, [0.0, 0.0, -0.0105], true),
        (C::ThreadedAxis, [0.0, 0.0, 0.009], true),
        (C::SmoothAxis, [0.0, 0.0059, 0.009], true),
        (C::SmoothAxis, [0.0, 0.0, 0.0101], false),
        (C::Slot, [0.009, 0.0, -0.005], false),
        (C::Slot, [0.0, 0.0045, -0.005], true),
        (C::Cone, [0.0059, 0.0, 0.0002], true),
        (C::Cone, [0.0059, 0.0, 0.005], false),
        (C::Buckle, [0.0055, 0.0, 0.005], true),
        (C::Buckle, [0.0, 0.0, 0.005], false),
        (C::Buckle, [0.0055, 0.005, 0.005], false),
    ] {
        let (solid, _) = on_plate(class);
        assert_eq!(solid.distance(at) < 0.0, inside, "{class} at {at:?}: {}", solid.distance(at));
    }
}

/// Radius of the wall by bisection from the axis, at height z and direction phi.
fn wall(solid: &Solid, z: f32, phi: f32, outwards: bool) -> f32 {
    let (mut low, mut high) = (0.0_f32, 0.01_f32);
    for _ in 0..40 {
        let mid = 0.5 * (low + high);
        if (solid.distance([mid * phi.cos(), mid * phi.sin(), z]) > 0.0) == outwards {
            low = mid;
        } else {
            high = mid;
        }
    }
    0.5 * (low + high)
}

/// A turn of the thread advances by one pitch, right-handed, between minor and major radius.
#[test]
fn threads_are_helical_by_their_pitch() {
    for (class, z, height, air_inside) in
        [(FeatureClass::ThreadedHole, -0.005, 0.5413, true), (FeatureClass::ThreadedAxis, 0.005, 0.6134, false)]
    {
        let (solid, feature) = on_plate(class);
        let pitch = feature.pitch as f32;
        let radii: Vec<f32> = (0..64).map(|k| wall(&solid, z + pitch * k as f32 / 64.0, 0.3, air_inside)).collect();
        let (low, high) = radii.iter().fold((1.0_f32, 0.0_f32), |(l, h), r| (l.min(*r), h.max(*r)));
        assert!((high - 0.006).abs() < 2e-5, "{class}: major radius {high}");
        assert!((high - low - height * pitch).abs() < 4e-5, "{class}: height {}", high - low);
        for k in 0..16 {
            let turn = k as f32 / 16.0;
            let (plain, turned) = (
                wall(&solid, z, 0.0, air_inside),
                wall(&solid, z + turn * pitch, turn * core::f32::consts::TAU, air_inside),
            );
            assert!((plain - turned).abs() < 1e-5, "{class} after {turn} turns: {plain} against {turned}");
        }
    }
}

/// No point within the distance of another lies inside: sphere tracing never steps through.
#[test]
fn distances_are_lower_bounds() {
    use rand::{RngExt, SeedableRng};
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
    for &class in <FeatureClass as tandem_msg::Coded>::ALL {
        let (solid, _) = on_plate(class);
        for _ in 0..50_000 {
            let a: [f32; 3] = [0; 3].map(|_| rng.random_range(-0.02..0.02));
            let d = solid.distance(a);
            let way: [f32; 3] = [0; 3].map(|_| rng.random_range(-1.0..1.0));
            let length = way.iter().map(|s| s * s).sum::<f32>().sqrt();
            if d <= 0.0 || length > 1.0 {
                continue;
            }
            let b = [0, 1, 2].map(|i| a[i] + way[i] / length * d * 0.999);
            assert!(solid.distance(b) > -2e-5, "{class}: {d} at {a:?}, but {} at {b:?}", solid.distance(b));
        }
    }
}
