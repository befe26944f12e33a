//! The depth camera: rays over the field of view, traced against the part's solid.
//!
//! Stands above a station and looks at the part's feature through a lens whose
//! field follows the feature's size, as [`half_width`] says. Each ray is traced
//! by relaxed sphere tracing (Keinert et al. 2014), gets Gaussian noise along
//! it that grows towards grazing incidence, may drop out there, and now and
//! then returns a stray value. What hides behind something is not seen, because
//! the ray ends before.
//!
//! Rays follow the R2 low-discrepancy sequence (Roberts 2018), shifted at
//! random: every prefix of a scan covers the field evenly.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};
use tandem_config::FeatureGeometry;
use tandem_msg::{CLOUD_POINTS, FeatureClass, PointCloud};

use super::solid::{Material, Solid, Surroundings};

/// Steps of R2: 1/ρ and 1/ρ² of the plastic number ρ.
const R2: [f64; 2] = [0.754_877_666_246_693, 0.569_840_290_998_053];
/// Steps after which a ray counts as lost.
const STEPS_MAX: u32 = 96;
/// A surface this near is hit, metres; a fifth of the best range noise.
const HIT: f32 = 6e-6;
/// Cosines of incidence below which points begin to be lost, and all are.
const GRAZING: [f32; 2] = [0.20, 0.06];

/// Depth of field to either side of the focus, in half widths of the view.
pub const DEPTH_OF_FIELD: f64 = 1.5;

/// What the camera is like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Standard deviation of the range at normal incidence, metres.
    pub range_sigma: f64,
    /// Share of points lost at any incidence.
    pub dropout: f64,
    /// Share of points with a stray range.
    pub outliers: f64,
}

impl Default for Camera {
    /// An industrial structured-light camera at 0.35 m.
    fn default() -> Self {
        Self { range_sigma: 50e-6, dropout: 0.01, outliers: 0.003 }
    }
}

/// Tilt of an inspection view off the feature's axis, radians: bores show their walls only aslant.
pub const TILT: f64 = 0.49;

/// Half the width of the view for a feature of this nominal geometry, metres: three times
/// its extent is in view.
pub fn half_width(feature: &FeatureGeometry) -> f64 {
    1.5 * extent(feature)
}

/// Pose in the feature frame of a camera that looks at a point `aim` of that frame (metres)
/// from `distance` metres, `tilt` off the feature's axis in the direction `azimuth` about it,
/// turned by `roll` about the view. Radians.
pub fn feature_from_camera(distance: f64, tilt: f64, azimuth: f64, roll: f64, aim: [f64; 3]) -> Isometry3<f64> {
    let about = UnitQuaternion::from_axis_angle;
    let (x, y, z) = (Vector3::x_axis(), Vector3::y_axis(), Vector3::z_axis());
    // Half a turn about x: camera z looks against feature z.
    let turn = about(&z, azimuth) * about(&y, tilt) * about(&x, std::f64::consts::PI) * about(&z, roll);
    let back = turn * Vector3::new(0.0, 0.0, -distance);
    Isometry3::from_parts(Translation3::from(Vector3::from(aim) + back), turn)
}

/// Size of a feature as the camera has to frame it, metres.
pub fn extent(feature: &FeatureGeometry) -> f64 {
    let f = feature;
    let size = match f.class {
        FeatureClass::ThreadedHole | FeatureClass::SmoothHole => f.diameter + 2.0 * f.chamfer,
        FeatureClass::ThreadedAxis | FeatureClass::SmoothAxis => f.diameter.max(0.8 * f.depth),
        FeatureClass::Cone => f.diameter.max(0.8 * f.depth),
        // A long slot just fits in.
        FeatureClass::Slot => (0.45 * f.length).max(2.0 * f.width),
        FeatureClass::Buckle => f.width.max(f.length).max(f.depth),
        // Nothing to frame: a piece of the surface.
        FeatureClass::Other => 0.016,
    };
    size.max(0.006)
}

/// A scene to be scanned, with the camera's place and field of view in it.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// The part.
    pub solid: &'a Solid,
    /// What is around it.
    pub surroundings: &'a Surroundings,
    /// Where the camera stands.
    pub feature_from_camera: Isometry3<f64>,
    /// Range of sharpest view, metres.
    pub focus: f64,
    /// Half the width of the square field of view at that range, metres. The depth of field
    /// is [`DEPTH_OF_FIELD`] times that to either side of the focus.
    pub half_width: f64,
}

/// What rays are cast at, and from where.
pub trait Scene {
    /// Where the camera stands; rays are traced in the frame this is given in.
    fn frame_from_camera(&self) -> Isometry3<f64>;
    /// Range of sharpest view and half the width of the field of view at that range, metres.
    fn field(&self) -> [f64; 2];
    /// What a ray from `origin` along the unit vector `along` meets between two ranges, metres.
    fn meet(&self, origin: [f32; 3], along: [f32; 3], near: f32, far: f32) -> Option<Meeting>;
}

/// Where a ray ends.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Meeting {
    /// Range, metres.
    pub range: f32,
    /// Cosine of the angle of incidence.
    pub cosine: f32,
    /// What is there.
    pub material: Material,
}

impl Scene for View<'_> {
    fn frame_from_camera(&self) -> Isometry3<f64> {
        self.feature_from_camera
    }

    fn field(&self) -> [f64; 2] {
        [self.focus, self.half_width]
    }

    #[inline]
    fn meet(&self, origin: [f32; 3], along: [f32; 3], near: f32, far: f32) -> Option<Meeting> {
        let range = self.trace(origin, along, near, far)?;
        let at = |t: f32| [0, 1, 2].map(|i| origin[i] + t * along[i]);
        let hit = at(range);
        let (of_part, material) = self.solid.distance_and_material(hit);
        let of_scene = of_part.min(self.surroundings.distance(hit));
        // How fast the distance grows back along the ray.
        let back = 4.0 * HIT;
        let cosine = ((self.distance(at(range - back)) - of_scene) / back).clamp(0.0, 1.0);
        let material = if of_part > of_scene { Material::Surroundings } else { material };
        Some(Meeting { range, cosine, material })
    }
}

impl View<'_> {
    #[inline]
    fn distance(&self, p: [f32; 3]) -> f32 {
        self.solid.distance(p).min(self.surroundings.distance(p))
    }

    /// Range at which a ray from `origin` along the unit vector `along` meets a surface.
    #[inline]
    fn trace(&self, origin: [f32; 3], along: [f32; 3], near: f32, far: f32) -> Option<f32> {
        let at = |t: f32| [0, 1, 2].map(|i| origin[i] + t * along[i]);
        let (mut t, mut last, mut step, mut relaxation) = (near, 0.0_f32, 0.0_f32, 1.3_f32);
        for _ in 0..STEPS_MAX {
            let d = self.distance(at(t));
            if relaxation > 1.0 && d + last < step {
                // The two spheres do not meet: something may lie between. Go back, take plain steps.
                t += last - step;
                relaxation = 1.0;
                step = last;
                continue;
            }
            if d < HIT {
                // Inside something at the very start: it stands before the depth of field.
                return (t > near || d > -HIT).then_some(t + d);
            }
            step = d * relaxation;
            last = d;
            t += step;
            if t > far {
                return None;
            }
        }
        None
    }
}

impl Camera {
    /// Renders up to `points` points of the scene and hands each on, in the camera frame
    /// (metres), with what it belongs to; answers how many there were.
    ///
    /// Rays that return nothing are made up for by more rays, up to 1.5 times `points`.
    pub fn render(
        &self,
        scene: &impl Scene,
        points: usize,
        rng: &mut impl Rng,
        mut point: impl FnMut([f32; 3], Material),
    ) -> usize {
        let pose = scene.frame_from_camera();
        let [focus, half_width] = scene.field();
        let matrix = pose.rotation.to_rotation_matrix();
        let rotation: [[f32; 3]; 3] = [0, 1, 2].map(|r| [0, 1, 2].map(|c| matrix[(r, c)] as f32));
        let origin = [0, 1, 2].map(|i| pose.translation.vector[i] as f32);
        let half_tangent = half_width / focus;
        let depth = DEPTH_OF_FIELD * half_width;
        let (near, far) = ((focus - depth).max(0.2 * focus) as f32, (focus + depth) as f32);

        let mut place = [rng.random::<f64>(), rng.random::<f64>()];
        let mut seen = 0;
        for _ in 0..points + points / 2 {
            if seen == points {
                break;
            }
            place = [0, 1].map(|i| (place[i] + R2[i]).fract());
            let across = place.map(|v| ((2.0 * v - 1.0) * half_tangent) as f32);
            let scale = 1.0 / (1.0 + across[0] * across[0] + across[1] * across[1]).sqrt();
            let ray = [across[0] * scale, across[1] * scale, scale];
            let along = rotation.map(|r| r[0] * ray[0] + r[1] * ray[1] + r[2] * ray[2]);
            let Some(Meeting { range, cosine, material }) = scene.meet(origin, along, near, far) else {
                continue;
            };
            let lost = ((GRAZING[0] - cosine) / (GRAZING[0] - GRAZING[1])).clamp(0.0, 1.0);
            if rng.random::<f32>() < lost + self.dropout as f32 {
                continue;
            }
            let gauss: f32 = StandardNormal.sample(rng);
            let sigma = self.range_sigma as f32 * (0.5 + 0.5 / cosine.max(0.2));
            let stray = if rng.random::<f32>() < self.outliers as f32 {
                half_width as f32 * rng.random_range(-0.5..0.5)
            } else {
                0.0
            };
            let range = range + sigma * gauss + stray;
            point(ray.map(|v| v * range), material);
            seen += 1;
        }
        seen
    }

    /// Scans into a point cloud, in place; `request` and `base_from_camera` stay as they are.
    pub fn scan(&self, view: &View<'_>, rng: &mut impl Rng, cloud: &mut PointCloud) {
        let points = &mut cloud.points;
        let mut next = 0;
        let seen = self.render(view, CLOUD_POINTS, rng, |p, _| {
            points[next] = p;
            next += 1;
        });
        cloud.point_count = seen as u32;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use std::time::Instant;
    use tandem_config::Body;
    use tandem_msg::Coded;

    fn geometry(class: FeatureClass) -> FeatureGeometry {
        let mut g = FeatureGeometry {
            class,
            diameter: 0.014,
            depth: 0.014,
            length: 0.0,
            width: 0.0,
            pitch: 0.0,
            angle: 0.0,
            chamfer: 0.001,
        };
        match class {
            FeatureClass::ThreadedHole | FeatureClass::ThreadedAxis => g.pitch = 0.002,
            FeatureClass::Slot => (g.length, g.width, g.depth) = (0.03, 0.008, 0.005),
            FeatureClass::Buckle => (g.length, g.width) = (0.02, 0.01),
            FeatureClass::Cone => g.angle = 0.3,
            _ => {}
        }
        g
    }

    /// Points of every class lie on its surface within the noise, the feature is in view, and
    /// what the scan took is printed.
    #[test]
    fn scans_show_the_surface_of_every_class() {
        for &class in FeatureClass::ALL {
            let feature = geometry(class);
            let body = Body::Box { size: [0.12, 0.10, 0.02] };
            let part_from_feature = Isometry3::translation(0.01, 0.0, 0.01);
            let solid = Solid::new(&body, &feature, &part_from_feature);
            let carrier = part_from_feature.inverse() * Isometry3::translation(0.0, 0.0, -0.01);
            let surroundings = Surroundings::on_carrier(&carrier);
            let pose = feature_from_camera(0.35, TILT, 0.4, 1.0, [0.001, -0.001, 0.0]);
            let view = View {
                solid: &solid,
                surroundings: &surroundings,
                feature_from_camera: pose,
                focus: 0.35,
                half_width: half_width(&feature),
            };
            let camera = Camera { outliers: 0.0, ..Camera::default() };
            let mut cloud = Box::new(PointCloud::default());
            let begin = Instant::now();
            camera.scan(&view, &mut ChaCha8Rng::seed_from_u64(1), &mut cloud);
            let took = begin.elapsed();
            let points = &cloud.points[..cloud.point_count as usize];
            assert!(points.len() > 9_500, "{class}: {} points", points.len());
            let off: Vec<f32> = points
                .iter()
                .map(|p| {
                    let p = pose * Point3::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]));
                    let p = [p.x as f32, p.y as f32, p.z as f32];
                    solid.distance(p).min(surroundings.distance(p)).abs()
                })
                .collect();
            let worst = off.iter().fold(0.0_f32, |w, d| w.max(*d));
            assert!(worst < 6.0 * 3.0 * 50e-6, "{class}: a point {worst} m off the surface");
            let mut on_feature = 0;
            camera.render(&view, 4_000, &mut ChaCha8Rng::seed_from_u64(1), |_, m| {
                on_feature += usize::from(m == Material::Feature);
            });
            println!("{class:>14}: {:.1} ms, {on_feature} of 4000 points on the feature", took.as_secs_f64() * 1e3);
            assert_eq!(on_feature > 150, class != FeatureClass::Other, "{class}: {on_feature}");
        }
    }

    /// The same seed renders the same cloud.
    #[test]
    fn scans_repeat() {
        let feature = geometry(FeatureClass::SmoothHole);
        let solid = Solid::new(&Body::Cylinder { radius: 0.02, height: 0.02 }, &feature, &Isometry3::identity());
        let view = View {
            solid: &solid,
            surroundings: &Surroundings::default(),
            feature_from_camera: feature_from_camera(0.3, 0.2, 0.0, 0.0, [0.0; 3]),
            focus: 0.3,
            half_width: 0.02,
        };
        let scan = |seed| {
            let mut cloud = Box::new(PointCloud::default());
            Camera::default().scan(&view, &mut ChaCha8Rng::seed_from_u64(seed), &mut cloud);
            (cloud.point_count, cloud.points)
        };
        assert!(scan(3) == scan(3));
        assert!(scan(3) != scan(4));
    }
}
