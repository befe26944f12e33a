//! What transfer is usually done with: gradient steps on the source, the few labels, and a loss that
//! brings the domains together.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use tandem_msg::Coded;

use super::discrepancy::discrepancy;
use super::discriminator::Discriminator;
use super::protocol::{COST, Method, SHARD, Settings};
use super::similarity::Prototypes;
use super::student::{Sets, Student, batch};
use crate::learning::encoder::adam::Adam;
use crate::learning::encoder::dataset::{Example, Look};
use crate::learning::encoder::pass::{Demand, FEATURES};
use crate::perception::network::CLASS_HIDDEN;

/// Looks spent on statistics at the end, by every method.
pub(crate) const REFRESH: usize = 128;
const DECAY: f32 = 0.01;
const CLIP: f32 = 5.0;

/// Labels of looks that may be read.
pub(crate) fn classes(looks: &[Look]) -> Vec<Option<usize>> {
    looks.iter().map(|look| Some(look.class.code() as usize)).collect()
}

/// What there is to learn from.
pub(crate) struct Material<'a> {
    /// All labelled.
    pub(crate) source: &'a [Example],
    /// Of the target.
    pub(crate) sets: Sets<'a>,
    /// Of the source.
    pub(crate) prototypes: &'a Prototypes,
}

/// Adjusts the student by [`Method::Finetune`], [`Method::Dann`] or [`Method::Dan`]; all weights, as
/// these methods do. `watch` hears the share done.
pub(crate) fn adapt<E>(
    method: Method,
    settings: Settings,
    student: &mut Student,
    material: &Material<'_>,
    seed: u64,
    watch: &mut dyn FnMut(f64, &Student) -> Result<(), E>,
) -> Result<(), E> {
    let &Material { source, sets, prototypes } = material;
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let count = student.run.parameters.len();
    let (mut adam, decays) = (Adam::new(DECAY, count), vec![false; count]);
    let mut discriminator = Discriminator::new(seed);
    let steps = settings.looks.saturating_sub(COST[0] * REFRESH) / (2 * SHARD * COST[1]);
    for step in 0..steps {
        let done = step as f32 / steps as f32;
        let ours = batch(source, SHARD, &mut rng);
        let labelled = match (method, sets.labelled.is_empty()) {
            (_, true) => 0,
            (Method::Finetune, _) => SHARD,
            _ => SHARD / 2,
        };
        let mut theirs = batch(sets.labelled, labelled, &mut rng);
        theirs.extend(batch(sets.unlabelled, SHARD - labelled, &mut rng));
        let phase = step % 2;
        student.see(0, &ours, phase);
        student.see(1, &theirs, phase);
        let [a, b] = &student.passes;
        let (features, hidden) = match method {
            Method::Dan => {
                let features = discrepancy(a.features(), b.features(), FEATURES).1;
                let hidden = discrepancy(a.hidden(), b.hidden(), CLASS_HIDDEN).1;
                let scaled = |mut g: Vec<f32>| {
                    g.iter_mut().for_each(|v| *v *= settings.weight);
                    g
                };
                (features.map(scaled), Some(hidden.map(scaled)))
            }
            Method::Dann => {
                let rows = |pass: &[f32]| -> Vec<Vec<f32>> {
                    pass.chunks_exact(FEATURES).map(|row| prototypes.standard(row)).collect()
                };
                let mut all = rows(a.features());
                all.extend(rows(b.features()));
                let (_, gradients) = discriminator.learn(&all, SHARD);
                // The reversal grows as the discriminator becomes worth listening to (Ganin et al. 2016).
                let reversal = settings.weight * (2.0 / (1.0 + (-10.0 * done).exp()) - 1.0);
                let mut gradients = gradients.into_iter().map(|mut row| {
                    prototypes.unstandard(&mut row);
                    row.iter_mut().for_each(|v| *v *= -reversal);
                    row
                });
                let ours: Vec<f32> = gradients.by_ref().take(SHARD).flatten().collect();
                ([ours, gradients.flatten().collect()], None)
            }
            _ => ([Vec::new(), Vec::new()], None),
        };
        let given = |i: usize| (!features[i].is_empty()).then(|| features[i].as_slice());
        let demand = Demand {
            classes: classes(&ours),
            segmented: SHARD,
            features: given(0),
            hidden: hidden.as_ref().map(|h| h[0].as_slice()),
        };
        student.learn(0, &demand);
        let mut labels = classes(&theirs);
        labels[labelled..].fill(None);
        let demand = Demand {
            classes: labels,
            segmented: labelled,
            features: given(1),
            hidden: hidden.as_ref().map(|h| h[1].as_slice()),
        };
        student.learn(1, &demand);
        let [a, b] = &mut student.passes;
        a.gradient.iter_mut().zip(&b.gradient).for_each(|(a, b)| *a += b);
        // A cosine from the full rate to nothing, after a short rise.
        let rate = settings.rate * (0.5 + 0.5 * (std::f32::consts::PI * done).cos()) * (done / 0.05).min(1.0);
        adam.step(&mut student.run.parameters, &a.gradient, &decays, rate, CLIP);
        student.follow();
        watch(f64::from(done), student)?;
    }
    let looks = batch(sets.unlabelled, REFRESH, &mut rng);
    student.refresh(&looks);
    watch(1.0, student)
}
