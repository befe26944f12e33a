//! Examples made on the fly: number and seed say what each is.

use std::sync::atomic::{AtomicUsize, Ordering};

use nalgebra::Isometry3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use tandem_config::FeatureGeometry;
use tandem_msg::{CLOUD_POINTS, FeatureClass};

use super::domain::Domain;
use super::specimen::Specimen;
use crate::perception::sight::{Ball, Cut, ball};
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

/// A sample and what it shows.
#[derive(Clone, Debug, PartialEq)]
pub struct Look {
    /// What the network reads.
    pub sample: Sample,
    /// Whether each sampled point lies on the feature.
    pub segment: Vec<bool>,
    /// Class.
    pub class: FeatureClass,
}

/// A scanned part and the truth about it.
#[derive(Clone, Debug)]
pub struct Example {
    /// Class.
    pub class: FeatureClass,
    /// The whole view.
    pub look: Look,
    /// A closer look at about where the feature is, as perception would take it.
    pub closer: Option<Look>,
    /// Whether each point of the cloud lies on the feature.
    pub on_feature: Vec<bool>,
    /// The feature.
    pub feature: FeatureGeometry,
    /// Where the camera saw it.
    pub camera_from_feature: Isometry3<f64>,
}

/// Feature points an example shows at least.
const SHOWN_MIN: usize = 24;
/// What a first look gets wrong of where the feature is: spread of the middle in radii, range of the radius.
const MISPLACED: f32 = 0.08;
const MISJUDGED: [f32; 2] = [0.85, 1.3];

/// Example `index` of a split of a domain. The cloud (metres, camera
/// frame) is left in `cloud`.
///
/// Draws again, from the same stream, when hardly anything of the part came into view.
pub fn example(
    domain: &Domain,
    seed: u64,
    split: Split,
    index: u64,
    sampler: &mut Sampler,
    cloud: &mut Vec<[f32; 3]>,
) -> Example {
    // One generator a domain, seed and split, one stream an example: no two share numbers.
    let mut rng = ChaCha8Rng::seed_from_u64(seed.wrapping_mul(4).wrapping_add(split as u64) ^ domain.stream);
    rng.set_stream(index);
    loop {
        if let Some(example) = drawn(domain, index, &mut rng, sampler, cloud) {
            return example;
        }
    }
}

/// One draw of example `index`; `None` when hardly anything of the part came into view.
pub(super) fn drawn(
    domain: &Domain,
    index: u64,
    rng: &mut ChaCha8Rng,
    sampler: &mut Sampler,
    cloud: &mut Vec<[f32; 3]>,
) -> Option<Example> {
    let class = domain.class(index);
    let (mut on_feature, mut on_body) = (Vec::with_capacity(CLOUD_POINTS), Vec::with_capacity(CLOUD_POINTS));
    let specimen = Specimen::draw(domain, index, rng);
    let view: View<'_> = specimen.view();
    cloud.clear();
    let points = domain.scanner.map_or(CLOUD_POINTS, |s| rng.random_range(s.points[0]..=s.points[1]));
    specimen.camera.render(&view, points, rng, |p, m| {
        cloud.push(p);
        on_feature.push(m == Material::Feature);
        on_body.push(m == Material::Body);
    });
    if let Some(scanner) = &domain.scanner {
        let mut kept = 0;
        for i in 0..cloud.len() {
            let read = scanner.read(cloud[i], specimen.half_width, specimen.focus, rng);
            let Some(p) = read else { continue };
            (cloud[kept], on_feature[kept], on_body[kept]) = (p, on_feature[i], on_body[i]);
            kept += 1;
        }
        cloud.truncate(kept);
        on_feature.truncate(kept);
        on_body.truncate(kept);
    }
    let mut sample = Sample::default();
    if !sampler.sample(cloud, &mut sample) {
        return None;
    }
    let segment: Vec<bool> = sample.source.iter().map(|&i| on_feature[usize::from(i)]).collect();
    let shown = segment.iter().filter(|s| **s).count();
    if class != FeatureClass::Other && shown < SHOWN_MIN {
        return None;
    }
    let closer = place(cloud, &sample, &segment, &on_body, rng).and_then(|ball| {
        let (mut cut, mut sample) = (Cut::default(), Sample::default());
        cut.fill(cloud, &ball);
        if !sampler.sample(&cut.points, &mut sample) {
            return None;
        }
        let of = |i: u16| on_feature[usize::from(cut.index[usize::from(i)])];
        let segment = sample.source.iter().map(|&i| of(i)).collect();
        Some(Look { sample, segment, class })
    });
    Some(Example {
        class,
        look: Look { sample, segment, class },
        closer,
        on_feature,
        feature: specimen.feature,
        camera_from_feature: specimen.feature_from_camera.inverse(),
    })
}

/// Where a first look might see the feature: about where it is, or, where there is none, anywhere on the part.
fn place(
    cloud: &[[f32; 3]],
    sample: &Sample,
    segment: &[bool],
    on_body: &[bool],
    rng: &mut ChaCha8Rng,
) -> Option<Ball> {
    let jitter = |rng: &mut ChaCha8Rng| {
        let unit: f32 = StandardNormal.sample(rng);
        MISPLACED * unit
    };
    match ball(cloud, sample, segment, &mut Vec::new()) {
        Some(Ball { centre, radius }) => {
            let centre = centre.map(|c| c + radius * jitter(rng));
            Some(Ball { centre, radius: radius * rng.random_range(MISJUDGED[0]..MISJUDGED[1]) })
        }
        None if segment.iter().any(|s| *s) => None,
        None => {
            // Not on clutter: from close by a stray post is an axis.
            let body: Vec<u16> = sample.source.iter().copied().filter(|&i| on_body[usize::from(i)]).collect();
            if body.is_empty() {
                return None;
            }
            let near = body[rng.random_range(0..body.len())];
            Some(Ball { centre: cloud[usize::from(near)], radius: sample.scale * rng.random_range(0.3..0.8) })
        }
    }
}

/// The first `count` examples of a split, made by `threads` threads; `made` hears how many there are.
pub(crate) fn examples(
    domain: &Domain,
    seed: u64,
    split: Split,
    count: usize,
    threads: usize,
    made: &mut dyn FnMut(usize),
) -> Vec<Example> {
    let next = AtomicUsize::new(0);
    let work = |made: &mut dyn FnMut(usize)| {
        let (mut sampler, mut cloud, mut out) = (Sampler::new(), Vec::new(), Vec::new());
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            if index >= count {
                return out;
            }
            made(index);
            out.push((index, example(domain, seed, split, index as u64, &mut sampler, &mut cloud)));
        }
    };
    let mut all: Vec<(usize, Example)> = std::thread::scope(|scope| {
        let workers: Vec<_> = (1..threads).map(|_| scope.spawn(|| work(&mut |_| ()))).collect();
        let mut all = work(made);
        for worker in workers {
            match worker.join() {
                Ok(some) => all.extend(some),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
        all
    });
    all.sort_unstable_by_key(|(index, _)| *index);
    all.into_iter().map(|(_, example)| example).collect()
}
