//! Examples made on the fly: number and seed say what each is.

use nalgebra::Isometry3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use tandem_config::FeatureGeometry;
use tandem_msg::{CLOUD_POINTS, Coded, FeatureClass};

use super::specimen::Specimen;
use crate::perception::{Sample, Sampler};
use crate::plant::camera::View;
use crate::plant::solid::Material;

/// Which of the disjoint sets an example belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Split {
    /// Fitted on.
    Train,
    /// Choices are made on it: best epoch, temperature, threshold.
    Validation,
    /// Reported once.
    Test,
}

/// A sampled cloud and the truth about it.
#[derive(Clone, Debug)]
pub struct Example {
    /// What the network reads.
    pub sample: Sample,
    /// Class.
    pub class: FeatureClass,
    /// Whether each sampled point lies on the feature.
    pub segment: Vec<bool>,
    /// The feature.
    pub feature: FeatureGeometry,
    /// Where the camera saw it.
    pub camera_from_feature: Isometry3<f64>,
}

/// Example `index` of a split; classes follow each other in turn. The cloud (metres, camera
/// frame) is left in `cloud`.
///
/// Draws again, from the same stream, when hardly anything of the part came into view.
pub fn example(seed: u64, split: Split, index: u64, sampler: &mut Sampler, cloud: &mut Vec<[f32; 3]>) -> Example {
    // One generator a seed and split, one stream an example: no two share numbers.
    let mut rng = ChaCha8Rng::seed_from_u64(seed.wrapping_mul(4).wrapping_add(split as u64));
    rng.set_stream(index);
    let class = FeatureClass::ALL[(index % FeatureClass::ALL.len() as u64) as usize];
    let mut materials = Vec::with_capacity(CLOUD_POINTS);
    loop {
        let specimen = Specimen::draw(class, &mut rng);
        let view: View<'_> = specimen.view();
        cloud.clear();
        materials.clear();
        specimen.camera.render(&view, CLOUD_POINTS, &mut rng, |p, m| {
            cloud.push(p);
            materials.push(m);
        });
        let Some(sample) = sampler.sample(cloud) else {
            continue;
        };
        let segment: Vec<bool> =
            sample.source.iter().map(|&i| materials[usize::from(i)] == Material::Feature).collect();
        let shown = segment.iter().filter(|s| **s).count();
        if class != FeatureClass::Other && shown < 24 {
            continue;
        }
        return Example {
            sample,
            class,
            segment,
            feature: specimen.feature,
            camera_from_feature: specimen.feature_from_camera.inverse(),
        };
    }
}
