//! Perception: from a point cloud to a feature that may be acted on.
//!
//! The role waits for a cloud of a presented part, samples it ([`sample`]), asks the
//! trained model ([`model`], [`network`]) which class of feature it shows and which points
//! are of it, and fits pose and dimensions to those points ([`mod@fit`]). An answer whose
//! calibrated probability stays below the model's threshold, or that no shape can be
//! fitted to, is `Unsure`: a person is asked, nothing is papered over.
//!
//! **Invariant:** nothing here knows the plant; all it has is the cloud.
//! **Invariant:** the same cloud gives the same feature, bit for bit, on one machine.

pub mod card;
mod columns;
pub mod engine;
pub mod fit;
mod grid;
pub(crate) mod kernel;
pub mod model;
pub mod network;
mod ops;
pub mod sample;
pub mod sight;

use std::path::Path;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use tandem_msg::{
    Code, Coded, FEATURE_CLASSES, Feature, FeatureClass, FeatureDimensions, PointCloud, Pose, Recognition, Stamp,
};

pub use card::{Card, WindingCard};
pub use fit::{Fit, fit};
pub use model::{Answer, CARD_FILE, Model, ModelError, WEIGHTS_FILE};
pub use sample::{Sample, Sampler};
pub use sight::Sight;

/// Farthest point of a sound cloud, metres.
const RANGE_MAX: f32 = 10.0;

/// What was recognised in a cloud, in the camera frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Recognised {
    /// Most probable class.
    pub class: FeatureClass,
    /// Calibrated probabilities by class code.
    pub probabilities: [f32; FEATURE_CLASSES],
    /// Points segmented as the feature, of those sampled.
    pub segment_count: u32,
    /// Pose and dimensions; `None` when no shape fits.
    pub fit: Option<Fit>,
}

impl Recognised {
    /// Whether the answer may be acted on: probable enough, and a shape was fitted.
    pub fn is_sure(&self, threshold: f64) -> bool {
        f64::from(self.probabilities[self.class.code() as usize]) >= threshold && self.fit.is_some()
    }
}

/// The perception role.
#[derive(Debug)]
pub struct Perception {
    model: Model,
    sight: Sight,
    /// Sequence number and epoch of the last cloud looked at.
    last: (u64, u64),
}

impl Perception {
    /// The role on the model in a folder.
    ///
    /// # Errors
    /// [`ModelError`]: missing, corrupted, or made for another network.
    pub fn load(folder: &Path) -> Result<Self, ModelError> {
        Ok(Self { model: Model::load(folder)?, sight: Sight::default(), last: (0, 0) })
    }

    /// The model's card.
    pub fn card(&self) -> &Card {
        self.model.card()
    }

    /// One cycle: looks at the cloud if it is a new one of a presented part and writes what it
    /// shows; otherwise leaves `feature` as it is. `elapsed_ns` is left to the caller, who has a clock.
    pub fn cycle(&mut self, _now: Stamp, cloud: &PointCloud, feature: &mut Feature) {
        let this = (cloud.header.seq, cloud.header.epoch);
        if !cloud.header.heard() || this == self.last || cloud.request == 0 {
            return;
        }
        self.last = this;
        *feature = Feature {
            header: feature.header,
            cloud_seq: cloud.header.seq,
            request: cloud.request,
            recognition: Code::of(Recognition::NoPart),
            ..Feature::default()
        };
        let Some(points) = cloud.points.get(..cloud.point_count as usize) else {
            return;
        };
        if !cloud.base_from_camera.is_valid() || !sound(points) {
            return;
        }
        let Some(recognised) = self.recognise(points) else {
            return;
        };
        let sure = recognised.is_sure(self.card().threshold);
        feature.recognition = Code::of(if sure { Recognition::Sure } else { Recognition::Unsure });
        feature.class = Code::of(recognised.class);
        feature.segment_count = recognised.segment_count;
        feature.probabilities = recognised.probabilities;
        if let Some(Fit { camera_from_feature, dimensions, .. }) = recognised.fit {
            feature.dimensions = dimensions;
            feature.base_from_feature = pose(&(isometry(&cloud.base_from_camera) * camera_from_feature));
        }
    }

    /// Recognises the feature in a cloud (finite points, metres, camera frame, z along the
    /// view); `None` when there is too little to look at.
    pub fn recognise(&mut self, cloud: &[[f32; 3]]) -> Option<Recognised> {
        let seen = self.see(cloud)?;
        let mut logits = seen.logits();
        let mut class = class_of(&logits)?;
        let mut fit = seen.fit(cloud, class).filter(finite);
        let segment_count = seen.segment().iter().filter(|s| **s).count() as u32;
        if let Some(winding) = fit.and_then(|fit| fit.winding) {
            logits = weigh_winding(logits, class, winding, &self.card().winding);
            let weighed = class_of(&logits)?;
            if weighed != class {
                class = weighed;
                fit = self.sight.fit(cloud, class).filter(finite);
            }
        }
        let probabilities = self.model.probabilities(&logits);
        Some(Recognised { class, probabilities, segment_count, fit })
    }

    /// What was seen last.
    pub fn sight(&self) -> &Sight {
        &self.sight
    }

    /// What the network sees in a cloud, at first and closer where the feature is; `None` when
    /// there is too little to look at.
    pub fn see(&mut self, cloud: &[[f32; 3]]) -> Option<&Sight> {
        self.sight.see(&mut self.model, cloud).then_some(&self.sight)
    }
}

/// The class of the largest logit.
pub fn class_of(logits: &[f32; FEATURE_CLASSES]) -> Option<FeatureClass> {
    let best = (0..FEATURE_CLASSES).max_by(|&a, &b| logits[a].total_cmp(&logits[b]).then(b.cmp(&a)))?;
    FeatureClass::ALL.iter().copied().find(|class| class.code() as usize == best)
}

/// Logits after the evidence of a fitted wall: what 512 points cannot resolve, the periodicity
/// of all points along the helix may.
pub fn weigh_winding(
    mut logits: [f32; FEATURE_CLASSES],
    class: FeatureClass,
    winding: f64,
    card: &WindingCard,
) -> [f32; FEATURE_CLASSES] {
    let threaded = match class {
        FeatureClass::ThreadedHole | FeatureClass::SmoothHole => FeatureClass::ThreadedHole,
        FeatureClass::ThreadedAxis | FeatureClass::SmoothAxis => FeatureClass::ThreadedAxis,
        _ => return logits,
    };
    logits[threaded.code() as usize] += (card.gain * (winding - card.level)) as f32;
    logits
}

fn sound(points: &[[f32; 3]]) -> bool {
    points.iter().all(|p| p.iter().all(|v| v.abs() < RANGE_MAX))
}

fn finite(fit: &Fit) -> bool {
    let FeatureDimensions { diameter, depth, length, width, pitch } = fit.dimensions;
    pose(&fit.camera_from_feature).is_valid()
        && [diameter, depth, length, width, pitch].iter().all(|m| m.value.is_finite() && m.sigma.is_finite())
}

fn isometry(pose: &Pose) -> Isometry3<f64> {
    let [x, y, z, w] = pose.rotation;
    let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    Isometry3::from_parts(Translation3::from(pose.position), rotation)
}

fn pose(isometry: &Isometry3<f64>) -> Pose {
    let q = isometry.rotation.quaternion();
    Pose { position: isometry.translation.vector.into(), rotation: [q.i, q.j, q.k, q.w] }
}
