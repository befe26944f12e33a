//! One transfer from files to files, and the schooling of the agent.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};
use tandem_config::Product;

use super::agent::{AGENT_FILE, Agent, Memory};
use super::episode::{Bank, Episode};
use super::protocol::{DATA_SEED, LABELS, Method, SOURCE, Settings, TEST, UNLABELLED, VALIDATION};
use super::rivals::{Material, REFRESH, adapt};
use super::student::{Sets, Student, batch, draw, verdict};
use crate::learning::encoder::Domain;
use crate::learning::encoder::dataset::{Example, Split, example, examples};
use crate::learning::encoder::report::{self, Tally};
use crate::learning::encoder::train::TrainError;
use crate::perception::card::{Card, DataCard, Metrics};
use crate::perception::{CARD_FILE, Model, Perception, Sampler};

/// Validation examples looked at on the way, and how often.
const WATCHED: usize = 88;
const WATCHES: f64 = 4.0;
/// Examples whose labels only the reward knows, while the agent learns.
const HELD: usize = 88;
/// Labels and unlabelled examples of a shift that was made up.
const SCHOOL: [usize; 2] = [LABELS, 128];
/// Steps of the Q-network after each episode at school, and after the last.
const LESSONS: [usize; 2] = [100, 1500];
/// Episodes played side by side by the same agent.
const CLASSMATES: usize = 2;
/// Mixed into the seed of what is drawn at school: none of it is drawn again.
const SCHOOL_SEED: u64 = 0x5c00_1000;

/// What all transfers from one source to one target share.
#[derive(Debug)]
pub struct Ground {
    folder: PathBuf,
    card: Card,
    target: Domain,
    source: Vec<Example>,
    bank: Bank,
    validation: Vec<Example>,
    test: Vec<(Example, Vec<[f32; 3]>)>,
    /// What was drawn last, for which seed and number of labels.
    drawn: Mutex<Vec<((u64, usize), Drawn)>>,
}

/// Labelled and unlabelled examples, shared by the methods of a seed.
type Drawn = Arc<[Vec<Example>; 2]>;

/// Seeds whose examples are kept.
const KEPT: usize = 2;

/// One transfer, and what came of it.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Outcome {
    /// How.
    pub method: Method,
    /// Labels a class.
    pub labels: usize,
    /// Decides what is drawn.
    pub seed: u64,
    /// With which settings.
    pub settings: Settings,
    /// Of the source's weights.
    pub source_blake3: String,
    /// On the way: share of the budget, loss and accuracy on validation.
    pub trace: Vec<[f64; 3]>,
    /// Loss and accuracy on validation at the end.
    pub validation: [f64; 2],
    /// On the target's test split, cloud to feature; read once.
    pub metrics: Metrics,
    /// It took, measurements included.
    pub seconds: f64,
}

impl Ground {
    /// Scans what is shared. Without `tests` the test split is not even drawn.
    ///
    /// # Errors
    /// [`TrainError`]: the source model is refused.
    pub fn new(folder: &Path, product: &Product, tests: usize, threads: usize) -> Result<Self, TrainError> {
        let card = Model::load(folder)?.card().clone();
        let student = Student::load(folder)?;
        let target = Domain::product(product);
        let source = examples(&Domain::source(), card.data.seed, Split::Train, SOURCE, threads, &mut |_| ());
        let (mut sampler, mut cloud) = (Sampler::new(), Vec::new());
        let test = (0..tests as u64)
            .map(|index| {
                let truth = example(&target, DATA_SEED, Split::Test, index, &mut sampler, &mut cloud);
                (truth, cloud.clone())
            })
            .collect();
        Ok(Self {
            folder: folder.to_owned(),
            bank: Bank::new(&student, &source)?,
            validation: examples(&target, DATA_SEED, Split::Validation, VALIDATION, threads, &mut |_| ()),
            card,
            target,
            source,
            test,
            drawn: Mutex::default(),
        })
    }

    /// Hash of the source's weights.
    pub fn source_blake3(&self) -> &str {
        &self.card.weights_blake3
    }

    /// The examples of a seed. With no labels the unlabelled ones are the same as with [`LABELS`].
    fn examples(&self, seed: u64, labels: usize) -> Drawn {
        let key = (seed, if labels == 0 { LABELS } else { labels });
        let mut drawn = self.drawn.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, known)) = drawn.iter().find(|(known, _)| *known == key) {
            return known.clone();
        }
        let new: Drawn = Arc::new(draw(&self.target, seed, key.1, UNLABELLED));
        drawn.push((key, new.clone()));
        if drawn.len() > KEPT {
            drawn.remove(0);
        }
        new
    }

    /// Brings the source to the target, writes the model to `out` and measures it there; `progress`
    /// hears the share done.
    ///
    /// # Errors
    /// [`TrainError`]: files that cannot be written.
    ///
    /// # Panics
    /// When the method is [`Method::Dqn`] and there is no agent.
    pub fn transfer(
        &self,
        job: (Method, usize, u64),
        settings: Settings,
        agent: Option<&Agent>,
        out: &Path,
        progress: &mut dyn FnMut(f64),
    ) -> Result<Outcome, TrainError> {
        let (method, labels, seed) = job;
        let begin = Instant::now();
        let drawn = self.examples(seed, labels);
        let sets = Sets { labelled: if labels == 0 { &[] } else { &drawn[0] }, unlabelled: &drawn[1] };
        let mut trace = Vec::new();
        let mut watch = |done: f64, student: &Student| -> Result<(), TrainError> {
            progress(done);
            if done >= trace.len() as f64 / WATCHES {
                let [loss, right] = verdict(&mut student.engine()?, &self.validation[..WATCHED]);
                trace.push([done, loss, right]);
            }
            Ok(())
        };
        let mut student = Student::load(&self.folder)?;
        match method {
            Method::Source => {}
            Method::Adabn => {
                let mut rng = ChaCha8Rng::seed_from_u64(seed);
                let looks = batch(sets.unlabelled, 4 * REFRESH, &mut rng);
                student.refresh(&looks);
            }
            Method::Finetune | Method::Dann | Method::Dan => {
                let material = Material { source: &self.source, sets, prototypes: &self.bank.prototypes };
                adapt(method, settings, &mut student, &material, seed, &mut watch)?;
            }
            Method::Dqn | Method::Random | Method::Greedy => {
                let mut episode = Episode::begin(student, (&self.bank, &self.source), sets, &[], settings, seed)?;
                while !episode.over() {
                    match (method, agent) {
                        (Method::Greedy, _) => episode.make_best_of_some()?,
                        (Method::Random, _) => {
                            let action = episode.any();
                            episode.make(action)?;
                        }
                        (_, Some(agent)) => {
                            let action = agent.choose(&episode.state(), &episode.allowed());
                            episode.make(action)?;
                        }
                        (_, None) => panic!("the Q-network comes to the target trained"),
                    }
                    watch(episode.done(), &episode.student)?;
                }
                student = episode.finish();
            }
        }
        let validation = verdict(&mut student.engine()?, &self.validation);
        trace.push([1.0, validation[0], validation[1]]);
        let mut card = Card {
            weights_blake3: student.run.export(out)?,
            data: DataCard {
                generator: format!(
                    "product parts under another scanner; encoder {} transferred by {method} with {labels} labels a class",
                    &self.card.weights_blake3[..16]
                ),
                seed,
                train: sets.labelled.len() + sets.unlabelled.len(),
                validation: VALIDATION,
                test: self.test.len(),
                epochs: settings.looks / UNLABELLED,
            },
            metrics: Metrics::default(),
            ..self.card.clone()
        };
        card.write(&out.join(CARD_FILE))?;
        let mut perception = Perception::load(out)?;
        let mut tally = Tally::default();
        for (truth, cloud) in &self.test {
            if let Some(recognised) = perception.recognise(cloud) {
                tally.add(truth, perception.sight(), &recognised, card.threshold);
            }
        }
        card.metrics = tally.metrics();
        card.write(&out.join(CARD_FILE))?;
        Ok(Outcome {
            method,
            labels,
            seed,
            settings,
            source_blake3: self.card.weights_blake3.clone(),
            trace,
            validation,
            metrics: card.metrics,
            seconds: begin.elapsed().as_secs_f64(),
        })
    }

    /// Chooses how far the model in a folder is to be trusted, on the target's validation split.
    ///
    /// # Errors
    /// [`TrainError`]: files that cannot be read or written.
    pub fn calibrate(&self, folder: &Path) -> Result<Card, TrainError> {
        let mut card = Card::read(&folder.join(CARD_FILE))?;
        report::calibrate(folder, &self.target, DATA_SEED, 2 * VALIDATION, &mut card)?;
        card.write(&folder.join(CARD_FILE))?;
        card.metrics = report::measure(folder, &self.target, DATA_SEED, TEST)?;
        card.write(&folder.join(CARD_FILE))?;
        Ok(card)
    }

    /// Lets an agent learn to choose, on `episodes` shifts of the source that are made up, a quarter of
    /// them without labels, and writes it to `out`. `progress` hears episode, Δ_F of looks held back and the
    /// mean probability of their own classes together, before and after, and the Q-network's loss.
    ///
    /// # Errors
    /// [`TrainError`]: the file cannot be written.
    pub fn school(
        &self,
        episodes: usize,
        seed: u64,
        out: &Path,
        progress: &mut dyn FnMut(usize, [f32; 3]),
    ) -> Result<Agent, TrainError> {
        let mut agent = Agent::new(seed);
        for first in (0..episodes).step_by(CLASSMATES) {
            let numbers = first..episodes.min(first + CLASSMATES);
            let played: Vec<Result<Played, TrainError>> = std::thread::scope(|scope| {
                let agent = &agent;
                // Nothing but chance at first, one choice in ten of it after two thirds.
                let exploration = (1.0 - 1.35 * first as f64 / episodes as f64).clamp(0.1, 1.0);
                let play = move |number| scope.spawn(move || self.play(number, seed, agent, exploration));
                let players: Vec<_> = numbers.clone().map(play).collect();
                let joined = players.into_iter().map(|player| player.join());
                joined.map(|result| result.unwrap_or_else(|panic| std::panic::resume_unwind(panic))).collect()
            });
            for (number, played) in numbers.zip(played) {
                let Played { memories, truth: [before, after] } = played?;
                memories.into_iter().for_each(|memory| agent.remember(memory));
                let loss = agent.learn(LESSONS[0]);
                progress(number + 1, [before, after, loss]);
            }
        }
        agent.learn(LESSONS[1]);
        std::fs::create_dir_all(out).map_err(|source| TrainError::File { file: out.to_owned(), source })?;
        agent.save(&out.join(AGENT_FILE))?;
        Ok(agent)
    }

    /// One transfer to a shift that is made up, for what can be learned from it.
    fn play(&self, number: usize, seed: u64, agent: &Agent, exploration: f64) -> Result<Played, TrainError> {
        let lot = SCHOOL_SEED + seed * 10_000 + number as u64;
        let domain = Domain::made_up(&mut ChaCha8Rng::seed_from_u64(lot));
        let labels = if number % 4 == 3 { 0 } else { SCHOOL[0] };
        let [labelled, unlabelled] = draw(&domain, lot, labels, SCHOOL[1]);
        let sets = Sets { labelled: &labelled, unlabelled: &unlabelled };
        let held = examples(&domain, lot, Split::Validation, HELD, 1, &mut |_| ());
        let (student, settings) = (Student::load(&self.folder)?, Settings::of(Method::Dqn));
        let mut episode = Episode::begin(student, (&self.bank, &self.source), sets, &held, settings, lot)?;
        let before = episode.truth();
        let mut memories = Vec::new();
        while !episode.over() {
            memories.push(episode.practise(agent, exploration)?);
        }
        Ok(Played { memories, truth: [before, episode.truth()] })
    }
}

/// What came of a transfer at school.
struct Played {
    memories: Vec<Memory>,
    /// Of the looks held back, before and after.
    truth: [f32; 2],
}
