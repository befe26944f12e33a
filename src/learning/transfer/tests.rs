//! Gradients are those of their losses; the agent learns what can be learned; transfers repeat and gain.

use std::path::{Path, PathBuf};

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use tandem_msg::FEATURE_CLASSES;

use super::agent::{Agent, Memory};
use super::discrepancy::discrepancy;
use super::discriminator::Discriminator;
use super::episode::{Bank, Episode, STATE};
use super::moves::{Group, MOVES, Move, Sign, Spread};
use super::protocol::{Method, SHARD, Settings};
use super::rivals::classes;
use super::similarity::Prototypes;
use super::student::{Sets, Student, batch, draw};
use crate::learning::encoder::Domain;
use crate::learning::encoder::dataset::{Split, examples};
use crate::learning::encoder::pass::{Demand, FEATURES};

fn shipped(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("config/models").join(name)
}

fn normal(count: usize, rng: &mut ChaCha8Rng) -> Vec<f32> {
    (0..count).map(|_| StandardNormal.sample(rng)).collect()
}

/// Largest difference between a gradient and that of central differences, in its own length.
fn off(gradient: &[f32], at: &mut [f32], loss: &mut dyn FnMut(&[f32]) -> f32, step: f32) -> f32 {
    let length = gradient.iter().map(|g| g * g).sum::<f32>().sqrt();
    let mut worst = 0.0_f32;
    for i in (0..at.len()).step_by(at.len().div_ceil(60)) {
        let kept = at[i];
        at[i] = kept + step;
        let above = loss(at);
        at[i] = kept - step;
        let below = loss(at);
        at[i] = kept;
        worst = worst.max(((above - below) / (2.0 * step) - gradient[i]).abs());
    }
    worst / length
}

/// Discrepancy: nothing between samples of one distribution, more the farther apart two are; its gradient
/// shrinks it (the bandwidths count as given, so it is not the gradient of the whole).
#[test]
fn the_discrepancy_tells_distributions_apart() {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let (a, b) = (normal(64 * 8, &mut rng), normal(64 * 8, &mut rng));
    let moved = |by: f32| -> Vec<f32> { b.iter().map(|v| v + by).collect() };
    let values = [0.0, 0.3, 1.0].map(|by| discrepancy(&a, &moved(by), 8).0);
    assert!(values[0].abs() < 0.02 && values[1] > values[0] + 0.01 && values[2] > 4.0 * values[1], "{values:?}");
    let (mut ours, mut theirs) = (a.clone(), moved(1.0));
    for _ in 0..200 {
        let [da, db] = discrepancy(&ours, &theirs, 8).1;
        ours.iter_mut().zip(&da).for_each(|(v, d)| *v -= 10.0 * d);
        theirs.iter_mut().zip(&db).for_each(|(v, d)| *v -= 10.0 * d);
    }
    let after = discrepancy(&ours, &theirs, 8).0;
    assert!(after < 0.1 * values[2], "{} -> {after}", values[2]);
}

/// The pull's gradient is that of its loss.
#[test]
fn similarity_has_the_gradient_of_its_loss() {
    let mut rng = ChaCha8Rng::seed_from_u64(2);
    let labels: Vec<usize> = (0..64).map(|i| i % FEATURE_CLASSES).collect();
    let prototypes = Prototypes::new(&normal(64 * FEATURES, &mut rng), &labels);
    let mut rows = normal(3 * FEATURES, &mut rng);
    let asked = [Some(3), None, Some(0)];
    let (loss, gradient) = prototypes.pull(&rows, &asked);
    let direct: f32 =
        [0, 2].iter().map(|&i| -prototypes.margin(&rows[i * FEATURES..][..FEATURES], asked[i]) / 2.0).sum();
    assert!((loss - direct).abs() < 1e-5, "{loss} against {direct}");
    let wrong = off(&gradient, &mut rows, &mut |rows| prototypes.pull(rows, &asked).0, 1e-2);
    assert!(wrong < 2e-3, "{wrong} off");
    assert!(gradient[FEATURES..2 * FEATURES].iter().all(|g| *g == 0.0), "what has no label is not pulled");
}

/// The discriminator learns to tell two domains apart; its gradient by the rows, reversed, closes the gap.
#[test]
fn the_discriminator_tells_and_its_reversal_confounds() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut discriminator = Discriminator::new(1);
    let mut rows: Vec<Vec<f32>> = (0..32)
        .map(|i| normal(FEATURES, &mut rng).iter().map(|v| 0.3 * v + if i < 16 { 0.1 } else { -0.1 }).collect())
        .collect();
    let first = discriminator.learn(&rows, 16).0;
    let mut last = (first, Vec::new());
    for _ in 0..60 {
        last = discriminator.learn(&rows, 16);
    }
    assert!(last.0 < 0.2 * first, "{first} -> {}", last.0);
    for (row, d) in rows.iter_mut().zip(&last.1) {
        let length = d.iter().map(|d| d * d).sum::<f32>().sqrt().max(1e-9);
        row.iter_mut().zip(d).for_each(|(v, d)| *v += 3.0 * d / length);
    }
    let confounded = discriminator.learn(&rows, 16).0;
    assert!(confounded > last.0, "{} -> {confounded}", last.0);
}

/// Losses of features and hidden layer reach the weights: what a step along the pass's gradient gains
/// is what the gradient promises.
#[test]
fn losses_of_features_reach_the_weights() {
    let source = examples(&Domain::source(), 1, Split::Train, 32, 1, &mut |_| ());
    let mut student = Student::load(&shipped("s471")).expect("the shipped model");
    let bank = Bank::new(&student, &source).expect("plain tensors");
    let mut rng = ChaCha8Rng::seed_from_u64(4);
    let looks = batch(&source, SHARD, &mut rng);
    let labels = classes(&looks);
    student.see(1, &looks, 0);
    let (before, gradient) = bank.prototypes.pull(student.passes[1].features(), &labels);
    student.learn(1, &Demand { classes: vec![None; SHARD], features: Some(&gradient), ..Demand::default() });
    let gradient = student.passes[1].gradient.clone();
    let squares: f32 = gradient.iter().map(|g| g * g).sum();
    assert!(squares > 0.0);
    let step = 2e-3 / squares.sqrt();
    student.run.parameters.iter_mut().zip(&gradient).for_each(|(w, g)| *w -= step * g);
    student.see(1, &looks, 0);
    let after = bank.prototypes.pull(student.passes[1].features(), &labels).0;
    let (gained, promised) = (before - after, step * squares);
    assert!((gained / promised - 1.0).abs() < 0.2, "gained {gained}, promised {promised}");
    // The decoders hear nothing of a loss of the features.
    for (name, span) in student.run.spans[0].iter().filter(|(name, _)| !name.starts_with("encoder.")) {
        assert!(gradient[span.clone()].iter().all(|g| *g == 0.0), "{name}");
    }
}

/// Groups are disjoint and together the whole encoder; every number is a move of its own.
#[test]
fn moves_cover_the_encoder_and_nothing_else() {
    let student = Student::load(&shipped("s471")).expect("the shipped model");
    let spans = &student.run.spans[0];
    let spread = Spread::new(spans);
    let mut count = vec![0; spans.len()];
    for group in [Group::Embedding, Group::Attention, Group::Linear] {
        spread.of(group).for_each(|span| count[span.clone()].iter_mut().for_each(|c| *c += 1));
    }
    for (name, span) in spans.iter() {
        let expected = i32::from(name.starts_with("encoder."));
        assert!(count[span.clone()].iter().all(|c| *c == expected), "{name}");
    }
    let all: usize = spread.of(Group::All).map(ExactSizeIterator::len).sum();
    assert_eq!(all, count.iter().filter(|c| **c == 1).count());
    let moves: Vec<Move> = (0..MOVES).map(Move::of).collect();
    for (i, one) in moves.iter().enumerate() {
        assert!(moves[..i].iter().all(|other| other != one), "{one:?} twice");
    }
    assert!(moves.iter().any(|m| matches!(m, Move::Step(Group::All, Sign::Confident, _))));
}

/// In a game with a known best policy, where what pays at once is not what pays in the end, the Q-network
/// finds it.
#[test]
fn the_agent_learns_to_choose() {
    let mut agent = Agent::new(5);
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let place = |at: f32| {
        let mut state = [0.0; STATE];
        state[0] = at;
        state
    };
    // At 0, move 2 pays 0.3 and ends; move 3 pays nothing and leads to 1, where move 2 pays 1 and ends.
    for _ in 0..600 {
        let action = rng.random_range(2..4);
        let stays = action == 3;
        agent.remember(Memory {
            state: place(0.0),
            action,
            reward: if stays { 0.0 } else { 0.3 },
            next: place(1.0),
            allowed: if stays { vec![2, 3] } else { Vec::new() },
        });
        let action = rng.random_range(2..4);
        let reward = if action == 2 { 1.0 } else { 0.0 };
        agent.remember(Memory { state: place(1.0), action, reward, next: place(0.0), allowed: Vec::new() });
    }
    let (first, last) = (agent.learn(20), agent.learn(1500));
    assert_eq!([agent.choose(&place(0.0), &[2, 3]), agent.choose(&place(1.0), &[2, 3])], [3, 2]);
    assert!(last < first, "loss {first} -> {last}");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("agent");
    agent.save(&file).expect("writable");
    let read = Agent::load(&file).expect("just written");
    assert_eq!(read.choose(&place(0.0), &[2, 3]), 3);
}

/// An episode repeats bit for bit, leaves the decoders alone, and undoing goes back to the best.
#[test]
fn episodes_repeat_and_freeze_the_decoders() {
    let source = examples(&Domain::source(), 1, Split::Train, 64, 1, &mut |_| ());
    let domain = Domain::made_up(&mut ChaCha8Rng::seed_from_u64(6));
    let [labelled, unlabelled] = draw(&domain, 6, 1, 32);
    let sets = Sets { labelled: &labelled, unlabelled: &unlabelled };
    assert!(FEATURE_CLASSES <= sets.labelled.len() && sets.unlabelled.len() == 32);
    let load = || Student::load(&shipped("s471")).expect("the shipped model");
    let bank = Bank::new(&load(), &source).expect("plain tensors");
    let play = || {
        let mut episode =
            Episode::begin(load(), (&bank, &source), sets, &[], Settings::of(Method::Dqn), 7).expect("plain tensors");
        // All groups by each kind of sign, then the mean and the statistics.
        let numbers = [3 + 3, 3 + 7, 3 + 11, 3 + 15, 2, 0];
        for number in numbers {
            episode.make(number).expect("plain tensors");
        }
        (episode.state(), episode.finish())
    };
    let ((state, student), (again, other)) = (play(), play());
    assert_eq!(state, again);
    assert!(student.run.parameters == other.run.parameters && student.run.statistics == other.run.statistics);
    let start = load();
    for (name, span) in start.run.spans[0].iter() {
        let same = start.run.parameters[span.clone()] == student.run.parameters[span.clone()];
        assert_eq!(same, !name.starts_with("encoder."), "{name}");
    }
}

/// What ships for the second product is what the cell uses for it, and recognises its parts nearly as well
/// as its card says.
#[test]
fn the_shipped_transfer_keeps_its_promise() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/cells/s471.toml");
    let cell = tandem_config::Cell::load(&file, Some("s472")).unwrap_or_else(|faults| panic!("{faults}"));
    assert_eq!(cell.perception.model, shipped("s472"));
    let promised = crate::perception::Model::load(&shipped("s472")).expect("it ships").card().metrics.accuracy;
    // A seed no training and no report uses.
    let domain = Domain::product(&cell.product);
    let metrics = crate::learning::encoder::measure(&shipped("s472"), &domain, 0xf5e5, 165).expect("it ships");
    println!("accuracy {:.3} (card {promised:.3})", metrics.accuracy);
    assert!(metrics.accuracy > promised - 0.1, "{} against the card's {promised}", metrics.accuracy);
    assert!(Agent::load(&shipped("agent").join(super::agent::AGENT_FILE)).is_ok());
    assert!(Method::ALL.iter().all(|method| method.name().parse() == Ok(*method)));
}
