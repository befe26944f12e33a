//! The camera in its place: which part it looks at, from where, and what lies around.
//!
//! It stands where the product file says for a part that lies exactly as it
//! should. The part does not lie exactly so, and how far it is off is for
//! perception to find out: the scan shows the part where it truly is.

use core::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::Isometry3;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use tandem_config::{Cell, FeatureGeometry, pose_of};
use tandem_msg::PointCloud;

use super::Shot;
use super::camera::{self, Camera, View};
use super::solid::{Clutter, Solid, Surroundings};

/// Most stray objects beside a part.
const CLUTTER_MAX: u32 = 2;

struct Subject {
    solid: Solid,
    feature: FeatureGeometry,
    part_from_feature: Isometry3<f64>,
    base_from_station: Isometry3<f64>,
    base_from_camera: Isometry3<f64>,
}

/// The camera of the cell, with a place for every part of the product.
pub struct Eye {
    camera: Camera,
    distance: f64,
    subjects: Vec<Subject>,
    random: ChaCha8Rng,
    request: u32,
    clutter: Vec<Clutter>,
}

impl Eye {
    /// The camera of a cell.
    pub(super) fn new(cell: &Cell, random: ChaCha8Rng) -> Self {
        let optics = &cell.layout.camera;
        let camera = Camera { range_sigma: optics.range_sigma, dropout: optics.dropout, ..Camera::default() };
        let subject = |part: &tandem_config::Part| {
            // A view straight along the axis shows no wall of a bore, so no part is looked at that way.
            let tilt = if part.view_tilt > 0.0 { part.view_tilt } else { camera::TILT };
            let turn = part.view_turn + FRAC_PI_2;
            let view = camera::feature_from_camera(optics.distance, tilt, turn, 0.0, [0.0; 3]);
            let base_from_station =
                cell.layout.stations.get(part.station).map_or_else(Isometry3::identity, |s| s.base_from_station);
            Subject {
                solid: Solid::new(&part.body, &part.feature, &part.part_from_feature),
                feature: part.feature,
                part_from_feature: part.part_from_feature,
                base_from_station,
                base_from_camera: base_from_station * part.station_from_part * part.part_from_feature * view,
            }
        };
        Self {
            camera,
            distance: optics.distance,
            subjects: cell.product.parts.iter().map(subject).collect(),
            random,
            request: 0,
            clutter: Vec::new(),
        }
    }

    /// Scans the presented part where it truly lies; nothing is seen when there is
    /// none. Only a new request finds new things beside it. Leaves the header alone.
    pub fn scan(&mut self, shot: &Shot, cloud: &mut PointCloud) {
        let &Shot { part, request } = shot;
        cloud.point_count = 0;
        cloud.request = 0;
        let Some((part, base_from_part)) = part else { return };
        let Some(subject) = self.subjects.get(part) else { return };
        if request != self.request {
            self.request = request;
            self.clutter = clutter(&subject.feature, &mut self.random);
        }
        let feature_from_base = (base_from_part * subject.part_from_feature).inverse();
        let surroundings =
            Surroundings::on_carrier(&(feature_from_base * subject.base_from_station)).with_clutter(&self.clutter);
        let view = View {
            solid: &subject.solid,
            surroundings: &surroundings,
            feature_from_camera: feature_from_base * subject.base_from_camera,
            focus: self.distance,
            half_width: camera::half_width(&subject.feature),
        };
        cloud.request = request;
        cloud.base_from_camera = pose_of(&subject.base_from_camera);
        self.camera.scan(&view, &mut self.random, cloud);
    }
}

/// Washers, caps and the like that lie about, clear of the feature.
fn clutter(feature: &FeatureGeometry, random: &mut ChaCha8Rng) -> Vec<Clutter> {
    let (size, view) = (camera::extent(feature), camera::half_width(feature));
    let count = random.random_range(0..=CLUTTER_MAX);
    (0..count)
        .map(|_| {
            let big = view * random.random_range(0.08..0.25);
            let away = 0.75 * size + 1.5 * big + view * random.random_range(0.0..0.8);
            let turn = random.random_range(0.0..TAU);
            let centre = [away * turn.cos(), away * turn.sin(), 0.0].map(|v| v as f32);
            if random.random_bool(0.5) {
                Clutter::Ball(centre, (0.8 * big) as f32)
            } else {
                Clutter::Post(centre, (0.6 * big) as f32, (0.5 * big) as f32)
            }
        })
        .collect()
}
