//! A course of trainings of one subtask: several seeds side by side, their files, and the best of them.
//!
//! ```text
//! <out>/<product>/<subtask>-<method>-<seed>/checkpoint.safetensors   everything needed to go on
//!                                           curve.json               points of the curve
//!                                           <subtask>.safetensors    the policy
//!                                           <subtask>.json           its card
//! ```

use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use tandem_config::{PolicyCard, PolicyModel, Tensors};
use tandem_policy::Lateral;

use crate::agent::{Agent, Tuning};
use crate::bank::{Split, demonstrations, scenes};
use crate::train::{Lessons, Method, Point, TrainOptions, Trained, train};
use crate::world::{Subtask, World};

/// Scenes of a curve's points.
const VALIDATION: usize = 150;
/// File of a training under way, which is also what later columns build on.
const CHECKPOINT: &str = "checkpoint.safetensors";
/// File of a curve.
pub const CURVE: &str = "curve.json";

/// What a course is told.
#[derive(Clone, Debug)]
pub struct Course {
    /// What is learned.
    pub subtask: Subtask,
    /// How: each of these learns in the same scenes, from the same demonstrations.
    pub methods: Vec<Method>,
    /// One training of each method with each.
    pub seeds: Vec<u64>,
    /// Scenes to train in.
    pub scenes: usize,
    /// Updates of each training.
    pub updates: u64,
    /// Settings of the agents.
    pub tuning: Tuning,
    /// Folder of everything.
    pub out: PathBuf,
    /// Product whose columns are built on, by the methods that do, and the seed of their training.
    pub source: (String, u64),
    /// Go on from checkpoints.
    pub resume: bool,
    /// Trainings at a time.
    pub threads: usize,
}

/// What is told on the way.
#[derive(Clone, Copy, Debug)]
pub enum Progress<'a> {
    /// Scenes and demonstrations are being made.
    Preparing,
    /// So many demonstrated steps are there.
    Prepared(usize),
    /// The curve of a method and seed has another point.
    Point(Method, u64, &'a Point),
}

/// Folder of one training.
pub fn folder(out: &Path, product: &str, subtask: Subtask, method: Method, seed: u64) -> PathBuf {
    out.join(product).join(format!("{}-{}-{seed}", subtask.name(), method.name()))
}

/// Trains all methods with all seeds; their policies, in that order.
///
/// # Errors
/// Files cannot be written, or those of the source product are not there.
pub fn run(world: &World, course: &Course, progress: &(dyn Fn(Progress<'_>) + Sync)) -> io::Result<Vec<PolicyModel>> {
    let subtask = course.subtask;
    let source = if course.methods.iter().any(|method| *method != Method::Ac) {
        let (product, seed) = &course.source;
        Some(load(&folder(&course.out, product, subtask, Method::Ac, *seed))?)
    } else {
        None
    };
    progress(Progress::Preparing);
    let train_scenes = scenes(world, subtask, Split::Train, 0, course.scenes);
    let validation = scenes(world, subtask, Split::Validation, 0, VALIDATION);
    let shown = demonstrations(world, subtask, &train_scenes);
    progress(Progress::Prepared(shown.count()));
    let lessons = Lessons { world, scenes: &train_scenes, validation: &validation, shown: &shown };
    let each = |method: &Method| course.seeds.iter().map(|seed| (*method, *seed)).collect::<Vec<_>>();
    let trainings: Vec<(Method, u64)> = course.methods.iter().flat_map(each).collect();
    let next = AtomicUsize::new(0);
    let finished = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..course.threads.clamp(1, trainings.len().max(1)) {
            scope.spawn(|| {
                loop {
                    let index = next.fetch_add(1, Ordering::Relaxed);
                    let Some((method, seed)) = trainings.get(index) else { break };
                    let source = source.as_ref().filter(|_| *method != Method::Ac);
                    let result = one(&lessons, course, *method, *seed, source, progress);
                    finished.lock().unwrap_or_else(PoisonError::into_inner).push((index, result));
                }
            });
        }
    });
    let mut finished = finished.into_inner().unwrap_or_else(PoisonError::into_inner);
    finished.sort_by_key(|(index, _)| *index);
    finished.into_iter().map(|(_, result)| result).collect()
}

fn one(
    lessons: &Lessons<'_>,
    course: &Course,
    method: Method,
    seed: u64,
    source: Option<&(Agent, String)>,
    progress: &(dyn Fn(Progress<'_>) + Sync),
) -> io::Result<PolicyModel> {
    let into = folder(&course.out, &lessons.world.cell.product.name, course.subtask, method, seed);
    std::fs::create_dir_all(&into)?;
    let options = TrainOptions {
        subtask: course.subtask,
        method,
        seed,
        updates: course.updates,
        interval: (course.updates / 20).max(1),
        tuning: course.tuning,
        checkpoint: Some(into.join(CHECKPOINT)),
        resume: course.resume,
    };
    let mut tell = |point: &Point| progress(Progress::Point(method, seed, point));
    let Trained { agent, curve } = train(lessons, &options, source.map(|(agent, _)| agent), &mut tell)?;
    std::fs::write(into.join(CURVE), serde_json::to_string(&curve)?)?;
    let last = curve.last().copied().unwrap_or_default();
    let (shape, numbers) = agent.policy();
    let card = PolicyCard {
        format: PolicyCard::FORMAT,
        product: lessons.world.cell.product.name.clone(),
        subtask: course.subtask.name().into(),
        method: method.name().into(),
        columns: shape.columns,
        weights_blake3: String::new(),
        source_blake3: source.map(|(_, hash)| hash.clone()),
        seed,
        scenes: lessons.scenes.len(),
        demonstrated: lessons.shown.count(),
        episodes: last.episodes,
        corrections: last.corrections,
        updates: last.updates,
        validation_success: last.success,
    };
    let mut model = PolicyModel { card, shape, numbers };
    model.save(&into)?;
    Ok(model)
}

/// The agent of a finished training of one column, and its checkpoint's hash.
fn load(folder: &Path) -> io::Result<(Agent, String)> {
    let file = folder.join(CHECKPOINT);
    let missing = |error: io::Error| {
        let advice = "train the source product first, with --method ac";
        io::Error::new(error.kind(), format!("{}: {error}; {advice}", file.display()))
    };
    let hash = blake3::hash(&std::fs::read(&file).map_err(missing)?).to_hex().to_string();
    let tensors = Tensors::load(&file)?;
    let mut agent = Agent::new(Lateral::Adapter, &mut ChaCha8Rng::seed_from_u64(0));
    agent.take_networks(&tensors)?;
    Ok((agent, hash))
}
