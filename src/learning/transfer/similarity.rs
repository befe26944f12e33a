//! How alike the features of both domains are.

use tandem_msg::FEATURE_CLASSES;

use crate::learning::encoder::pass::FEATURES;

/// Weight of the nearest wrong class.
const WRONG: f32 = 0.5;

/// What each class looks like in the source: the mean of its features, in deviations from that of all.
#[derive(Clone, Debug)]
pub(crate) struct Prototypes {
    mean: Vec<f32>,
    inverse: Vec<f32>,
    /// Of unit length, by class code.
    classes: [Vec<f32>; FEATURE_CLASSES],
}

impl Prototypes {
    /// Of labelled features of the source.
    pub(crate) fn new(features: &[f32], labels: &[usize]) -> Self {
        let count = labels.len().max(1) as f32;
        let mut mean = vec![0.0_f32; FEATURES];
        for row in features.chunks_exact(FEATURES) {
            mean.iter_mut().zip(row).for_each(|(m, v)| *m += v / count);
        }
        let mut inverse = vec![0.0_f32; FEATURES];
        for row in features.chunks_exact(FEATURES) {
            inverse.iter_mut().zip(row).zip(&mean).for_each(|((s, v), m)| *s += (v - m) * (v - m) / count);
        }
        inverse.iter_mut().for_each(|s| *s = 1.0 / (s.sqrt() + 1e-3));
        let mut out = Self { mean, inverse, classes: std::array::from_fn(|_| vec![0.0; FEATURES]) };
        for (row, label) in features.chunks_exact(FEATURES).zip(labels) {
            let row = out.standard(row);
            out.classes[*label].iter_mut().zip(&row).for_each(|(c, v)| *c += v);
        }
        for class in &mut out.classes {
            let length = norm(class).max(1e-6);
            class.iter_mut().for_each(|v| *v /= length);
        }
        out
    }

    /// A feature vector in deviations from the source's mean.
    pub(crate) fn standard(&self, feature: &[f32]) -> Vec<f32> {
        feature.iter().zip(&self.mean).zip(&self.inverse).map(|((v, m), s)| (v - m) * s).collect()
    }

    /// Gradient by the feature itself of what has this one by its deviations.
    pub(crate) fn unstandard(&self, gradient: &mut [f32]) {
        gradient.iter_mut().zip(&self.inverse).for_each(|(g, s)| *g *= s);
    }

    /// Cosine of a feature vector with each class.
    //
    // Eq. (7): a is what the source's encoder makes of a class, b what the target's makes of one cloud.
    // Raw features are rectified, so all positive, and their cosine is near one whatever they show:
    // both are taken in deviations from the source's mean first. a is the prototype of the class.
    pub(crate) fn cosines(&self, feature: &[f32]) -> [f32; FEATURE_CLASSES] {
        let b = self.standard(feature);
        let length = norm(&b).max(1e-6);
        std::array::from_fn(|c| dot(&self.classes[c], &b) / length)
    }

    /// Δ_F of one cloud: its cosine with its class less half that with the nearest other, which extends
    /// Eq. (7) so that features that fit every class do not count as good ones. Without a
    /// label the nearest class is taken for its own.
    pub(crate) fn margin(&self, feature: &[f32], label: Option<usize>) -> f32 {
        let cosines = self.cosines(feature);
        let (own, wrong) = rivals(&cosines, label);
        cosines[own] - WRONG * cosines[wrong]
    }

    /// Loss −Δ_F, mean over the rows that have a label, and its gradient by the features.
    pub(crate) fn pull(&self, features: &[f32], labels: &[Option<usize>]) -> (f32, Vec<f32>) {
        let count = labels.iter().flatten().count().max(1) as f32;
        let mut gradient = vec![0.0; features.len()];
        let mut loss = 0.0;
        for ((row, label), out) in features.chunks_exact(FEATURES).zip(labels).zip(gradient.chunks_exact_mut(FEATURES))
        {
            if label.is_none() {
                continue;
            }
            let b = self.standard(row);
            let length = norm(&b).max(1e-6);
            let cosines = std::array::from_fn(|c| dot(&self.classes[c], &b) / length);
            let (own, wrong) = rivals(&cosines, *label);
            let along = cosines[own] - WRONG * cosines[wrong];
            loss -= along / count;
            for (i, out) in out.iter_mut().enumerate() {
                let toward = self.classes[own][i] - WRONG * self.classes[wrong][i];
                *out = -(toward - along * b[i] / length) / length / count;
            }
            self.unstandard(out);
        }
        (loss, gradient)
    }
}

/// Its own class, or the nearest, and the nearest other.
fn rivals(cosines: &[f32; FEATURE_CLASSES], label: Option<usize>) -> (usize, usize) {
    let nearest = |but: Option<usize>| {
        let all = (0..FEATURE_CLASSES).filter(|c| Some(*c) != but);
        all.max_by(|&a, &b| cosines[a].total_cmp(&cosines[b])).unwrap_or(0)
    };
    let own = label.unwrap_or_else(|| nearest(None));
    (own, nearest(Some(own)))
}

fn dot(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn norm(a: &[f32]) -> f32 {
    dot(a, a).sqrt()
}
