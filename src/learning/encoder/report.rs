//! How good a model is, on examples it was not fitted on.

use std::path::Path;

use nalgebra::Vector3;
use tandem_msg::{Coded, FEATURE_CLASSES, FeatureClass, FeatureDimensions};

use super::dataset::{Example, Split, example};
use super::domain::Domain;
use super::train::TrainError;
use crate::perception::card::Metrics;
use crate::perception::engine::Engine;
use crate::perception::fit::quantile;
use crate::perception::model::softmax;
use crate::perception::{Card, Perception, Recognised, Sampler, Sight, WindingCard, class_of, weigh_winding};

/// What a network answers to a set of examples.
pub(crate) struct Answers {
    logits: Vec<[f32; FEATURE_CLASSES]>,
    classes: Vec<usize>,
    points_right: usize,
    points: usize,
}

impl Answers {
    pub(crate) fn of(engine: &mut Engine, examples: &[Example]) -> Self {
        let mut out = Self { logits: Vec::new(), classes: Vec::new(), points_right: 0, points: 0 };
        for example in examples {
            let (mut logits, segment) = {
                let (logits, segment) = engine.run(&example.look.sample);
                (*logits, segment)
            };
            out.points += segment.len();
            out.points_right += segment.iter().zip(&example.look.segment).filter(|(s, m)| (**s > 0.0) == **m).count();
            if let Some(closer) = &example.closer {
                let (again, _) = engine.run(&closer.sample);
                logits = std::array::from_fn(|c| 0.5 * (logits[c] + again[c]));
            }
            out.logits.push(logits);
            out.classes.push(example.class.code() as usize);
        }
        out
    }

    pub(crate) fn accuracy(&self) -> f64 {
        let right = self.logits.iter().zip(&self.classes).filter(|(l, c)| best(l) == **c).count();
        right as f64 / self.classes.len().max(1) as f64
    }

    pub(crate) fn point_accuracy(&self) -> f64 {
        self.points_right as f64 / self.points.max(1) as f64
    }
}

/// Index of the largest.
pub(crate) fn best(values: &[f32; FEATURE_CLASSES]) -> usize {
    (0..FEATURE_CLASSES).max_by(|&a, &b| values[a].total_cmp(&values[b]).then(b.cmp(&a))).unwrap_or(0)
}

/// Share of sure answers that may be wrong.
const WRONG_MAX: f64 = 0.025;

/// Calibrates on the validation split: the temperature and the weight of the winding with the
/// least negative log-likelihood, then the smallest probability above which at most one
/// answer in forty is wrong.
pub(crate) fn calibrate(
    folder: &Path,
    domain: &Domain,
    seed: u64,
    count: usize,
    card: &mut Card,
) -> Result<(), TrainError> {
    let mut perception = Perception::load(folder)?;
    let (mut sampler, mut cloud) = (Sampler::new(), Vec::new());
    let mut cases = Vec::with_capacity(count);
    for index in 0..count as u64 {
        let truth = example(domain, seed, Split::Validation, index, &mut sampler, &mut cloud);
        let Some(seen) = perception.see(&cloud) else { continue };
        let Some(class) = class_of(&seen.logits()) else { continue };
        let winding = seen.fit(&cloud, class).and_then(|fit| fit.winding);
        cases.push((seen.logits(), class, winding, truth.class.code() as usize));
    }
    let weighed = |card: &WindingCard| -> Vec<([f32; FEATURE_CLASSES], usize)> {
        let each = cases.iter().map(|(logits, class, winding, truth)| {
            (winding.map_or(*logits, |w| weigh_winding(*logits, *class, w, card)), *truth)
        });
        each.collect()
    };
    let cost = |cases: &[([f32; FEATURE_CLASSES], usize)], t: f64| -> f64 {
        cases.iter().map(|(l, c)| -f64::from(softmax(l, t)[*c]).max(1e-9).ln()).sum()
    };
    let mut best = (f64::MAX, WindingCard::default(), 1.0);
    for gain in [0.0, 2.0, 5.0, 10.0, 15.0, 20.0, 30.0, 40.0, 60.0] {
        for level in 1..16 {
            let card = WindingCard { gain, level: 0.025 * f64::from(level) };
            let cases = weighed(&card);
            for step in 0..=40 {
                let temperature = 0.2 * 20.0_f64.powf(f64::from(step) / 40.0);
                let cost = cost(&cases, temperature);
                if cost < best.0 {
                    best = (cost, card, temperature);
                }
            }
        }
    }
    (_, card.winding, card.temperature) = best;
    card.threshold = threshold(&weighed(&card.winding), card.temperature);
    Ok(())
}

fn threshold(cases: &[([f32; FEATURE_CLASSES], usize)], temperature: f64) -> f64 {
    let scored: Vec<(f64, bool)> = cases
        .iter()
        .map(|(logits, truth)| {
            let top = best(logits);
            (f64::from(softmax(logits, temperature)[top]), top == *truth)
        })
        .collect();
    (40..=98)
        .map(|percent| f64::from(percent) / 100.0)
        .find(|limit| {
            let sure = scored.iter().filter(|(p, _)| p >= limit);
            let (count, wrong) = sure.fold((0, 0), |(n, w), (_, right)| (n + 1, w + u32::from(!right)));
            f64::from(wrong) <= WRONG_MAX * f64::from(count)
        })
        .unwrap_or(0.99)
}

/// Measures the model in a folder on the test split, as it is used in a cell: cloud to feature.
///
/// # Errors
/// [`TrainError::Model`] when the model is refused.
pub fn measure(folder: &Path, domain: &Domain, seed: u64, count: usize) -> Result<Metrics, TrainError> {
    let mut perception = Perception::load(folder)?;
    let threshold = perception.card().threshold;
    let (mut sampler, mut cloud) = (Sampler::new(), Vec::new());
    let mut tally = Tally::default();
    for index in 0..count as u64 {
        let truth = example(domain, seed, Split::Test, index, &mut sampler, &mut cloud);
        let Some(recognised) = perception.recognise(&cloud) else { continue };
        tally.add(&truth, perception.sight(), &recognised, threshold);
    }
    Ok(tally.metrics())
}

/// Sums over a test split.
#[derive(Default)]
pub(crate) struct Tally {
    count: f64,
    confusion: [[u32; FEATURE_CLASSES]; FEATURE_CLASSES],
    sure: f64,
    sure_right: f64,
    /// Count, sum of probabilities, right answers, by tenths of probability.
    bins: [[f64; 3]; 10],
    points_right: f64,
    points: f64,
    ious: Vec<f64>,
    position: Vec<f64>,
    axis: Vec<f64>,
    /// Relative errors of diameter, depth, length, width, pitch.
    dimensions: [Vec<f64>; 5],
    threads: f64,
    pitches: f64,
}

impl Tally {
    pub(crate) fn add(&mut self, truth: &Example, seen: &Sight, answer: &Recognised, threshold: f64) {
        self.count += 1.0;
        let right = answer.class == truth.class;
        self.confusion[truth.class.code() as usize][answer.class.code() as usize] += 1;
        let probability = f64::from(answer.probabilities[answer.class.code() as usize]);
        let sure = probability >= threshold && answer.fit.is_some();
        let [n, p, r] = &mut self.bins[((probability * 10.0) as usize).min(9)];
        *n += 1.0;
        *p += probability;
        *r += f64::from(u8::from(right));
        if sure {
            self.sure += 1.0;
            self.sure_right += f64::from(u8::from(right));
        }
        let (mut both, mut either) = (0.0, 0.0);
        for (point, said) in seen.segment().iter().enumerate() {
            let is = truth.on_feature[seen.source(point)];
            self.points += 1.0;
            self.points_right += f64::from(u8::from(*said == is));
            both += f64::from(u8::from(*said && is));
            either += f64::from(u8::from(*said || is));
        }
        if truth.look.segment.iter().any(|s| *s) {
            self.ious.push(both / f64::max(either, 1.0));
        }
        // Where there is nothing to locate, there is no error of locating it.
        if let (true, true, Some(fit)) = (right && sure, truth.class != FeatureClass::Other, &answer.fit) {
            let (is, said) = (&truth.camera_from_feature, &fit.camera_from_feature);
            self.position.push((is.translation.vector - said.translation.vector).norm());
            self.axis.push((is * Vector3::z()).angle(&(said * Vector3::z())));
            self.add_dimensions(truth, &fit.dimensions);
        }
    }

    fn add_dimensions(&mut self, truth: &Example, said: &FeatureDimensions) {
        use FeatureClass as C;
        let g = &truth.feature;
        let long = matches!(truth.class, C::Slot | C::Buckle);
        let threaded = matches!(truth.class, C::ThreadedHole | C::ThreadedAxis);
        let pairs = [
            (g.diameter, said.diameter, !long),
            (g.depth, said.depth, true),
            (g.length, said.length, long),
            (g.width, said.width, long),
            (g.pitch, said.pitch, threaded),
        ];
        for ((is, said, applies), errors) in pairs.into_iter().zip(&mut self.dimensions) {
            if applies && said.value > 0.0 {
                errors.push((said.value / is - 1.0).abs());
            }
        }
        if threaded {
            self.threads += 1.0;
            self.pitches += f64::from(u8::from(said.pitch.value > 0.0));
        }
    }

    pub(crate) fn metrics(mut self) -> Metrics {
        let right: u32 = (0..FEATURE_CLASSES).map(|c| self.confusion[c][c]).sum();
        let count = self.count.max(1.0);
        let calibration = self.bins.iter().map(|[_, p, r]| (p - r).abs()).sum::<f64>() / count;
        let [diameter, depth, length, width, pitch] = &mut self.dimensions;
        Metrics {
            accuracy: f64::from(right) / count,
            sure: self.sure / count,
            accuracy_when_sure: self.sure_right / self.sure.max(1.0),
            calibration_error: calibration,
            point_accuracy: self.points_right / self.points.max(1.0),
            segment_iou: self.ious.iter().sum::<f64>() / self.ious.len().max(1) as f64,
            confusion: self.confusion,
            position_error_m: quantile(&mut self.position, 0.5),
            position_error_p90_m: quantile(&mut self.position, 0.9),
            axis_error_rad: quantile(&mut self.axis, 0.5),
            axis_error_p90_rad: quantile(&mut self.axis, 0.9),
            diameter_error: quantile(diameter, 0.5),
            depth_error: quantile(depth, 0.5),
            length_error: quantile(length, 0.5),
            width_error: quantile(width, 0.5),
            pitch_error: quantile(pitch, 0.5),
            pitch_measured: self.pitches / self.threads.max(1.0),
        }
    }
}
