//! `tandem train`: makes the trained models that ship in config/models.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

use tandem_config::Cell;
use tandem_motion as motion;

use super::{check, exit, transfer};
use crate::learning::encoder::{self, TrainOptions, TrainProgress};

#[derive(Args)]
pub(super) struct TrainArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    /// The encoder-decoder that recognises assembly features, on generated parts
    Encoder(EncoderArgs),
    /// That encoder brought to the parts of another product, with few labels or none
    Transfer(transfer::TransferArgs),
    /// The agent that chooses the moves of a transfer, on shifts that are made up
    Agent(transfer::AgentArgs),
    /// Policies that move the arm, for one subtask of a product: several seeds side by side
    Policy(PolicyArgs),
}

/// What is learned; the names of the paper.
#[derive(Clone, Copy, clap::ValueEnum)]
enum SubtaskName {
    Grasp,
    Transfer,
    Place,
    Assemble,
    /// One after the other
    All,
}

#[derive(Clone, Copy, clap::ValueEnum)]
pub(super) enum MethodName {
    /// Actor-critic of one column, from nothing
    Ac,
    /// A new column beside the frozen ones of the source product
    Pnn,
    /// The source product's column itself, trained on
    FineTuned,
}

impl MethodName {
    pub(super) fn method(self) -> motion::Method {
        match self {
            Self::Ac => motion::Method::Ac,
            Self::Pnn => motion::Method::Pnn,
            Self::FineTuned => motion::Method::FineTuned,
        }
    }
}

#[derive(Args)]
struct PolicyArgs {
    /// Cell file: arm, layout, and the products' folder
    #[arg(default_value = "config/cells/s471.toml")]
    cell: PathBuf,
    /// What is learned
    #[arg(long, value_enum)]
    subtask: SubtaskName,
    /// Product it is learned for [default: the cell file's]
    #[arg(long)]
    product: Option<String>,
    /// How it is learned; several, with commas between, in the same scenes and from the same demonstrations
    #[arg(long, value_enum, value_delimiter = ',', default_value = "ac")]
    method: Vec<MethodName>,
    /// Trainings, each with the next seed
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=100))]
    runs: u64,
    /// Seed of the first training
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Updates of each training
    #[arg(long, default_value_t = 2_000, value_parser = clap::value_parser!(u64).range(1..=10_000_000))]
    updates: u64,
    /// Scenes to train in
    #[arg(long, default_value_t = 2_000, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    scenes: u32,
    /// Product whose columns are built on
    #[arg(long, default_value = "s471")]
    source: String,
    /// Folder for checkpoints, curves and policies
    #[arg(long, default_value = "reports/policies")]
    out: PathBuf,
    /// Folder of the models a cell moves by: the policy that did best on validation is put there
    #[arg(long, value_name = "config/models")]
    install: Option<PathBuf>,
    /// Trainings at a time [default: all processors]
    #[arg(long)]
    threads: Option<std::num::NonZeroUsize>,
    /// Go on from the checkpoints of unfinished trainings
    #[arg(long)]
    resume: bool,
    /// Print the cards, one JSON object a line
    #[arg(long)]
    json: bool,
}

#[derive(Args)]
struct EncoderArgs {
    /// Training examples; a tenth as many more for validation, an eighth for the test
    #[arg(long, default_value_t = 40_000)]
    samples: usize,
    /// Passes over the examples
    #[arg(long, default_value_t = 18)]
    epochs: usize,
    /// Decides everything that is drawn
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Folder for weights, card and checkpoint
    #[arg(long, default_value = "reports/encoder")]
    out: PathBuf,
    /// Threads that scan and train; the model does not depend on it [default: all processors]
    #[arg(long)]
    threads: Option<std::num::NonZeroUsize>,
    /// Go on from the checkpoint of an unfinished run
    #[arg(long)]
    resume: bool,
    /// Print the card as one JSON object
    #[arg(long)]
    json: bool,
}

pub(super) fn train(args: &TrainArgs) -> u8 {
    match &args.what {
        What::Encoder(args) => train_encoder(args),
        What::Transfer(args) => transfer::transfer(args),
        What::Agent(args) => transfer::agent(args),
        What::Policy(args) => policy(args),
    }
}

fn policy(args: &PolicyArgs) -> u8 {
    let world = match Cell::load(&args.cell, args.product.as_deref()) {
        Ok(cell) => motion::World::new(cell),
        Err(faults) => return check::report_faults(&faults, args.json),
    };
    if world.chain().joint_count() != tandem_policy::DOF {
        let found = world.chain().joint_count();
        anstream::eprintln!(
            "{}: the arm has {found} joints, policies move {}",
            args.cell.display(),
            tandem_policy::DOF
        );
        return exit::CONFIG;
    }
    let subtasks = match args.subtask {
        SubtaskName::Grasp => vec![motion::Subtask::Grasp],
        SubtaskName::Transfer => vec![motion::Subtask::Transfer],
        SubtaskName::Place => vec![motion::Subtask::Place],
        SubtaskName::Assemble => vec![motion::Subtask::Assemble],
        SubtaskName::All => motion::Subtask::ALL.to_vec(),
    };
    let methods: Vec<_> = args.method.iter().map(|method| method.method()).collect();
    for subtask in subtasks {
        let course = motion::Course {
            subtask,
            methods: methods.clone(),
            seeds: (args.seed..args.seed.saturating_add(args.runs)).collect(),
            scenes: args.scenes as usize,
            updates: args.updates,
            tuning: motion::Tuning::default(),
            out: args.out.clone(),
            source: (args.source.clone(), 1),
            resume: args.resume,
            threads: args.threads.or(std::thread::available_parallelism().ok()).map_or(1, std::num::NonZeroUsize::get),
        };
        if let Err(error) = learn(&world, &course, args) {
            return failed(&error);
        }
    }
    exit::OK
}

/// One course, with a line for every point of its curves.
fn learn(world: &motion::World, course: &motion::Course, args: &PolicyArgs) -> std::io::Result<()> {
    let product = &world.cell.product.name;
    let what = format!("{product} {}", course.subtask.name());
    let bar = ProgressBar::new(course.updates * (course.methods.len() * course.seeds.len()) as u64).with_style(
        ProgressStyle::with_template("{msg:40} {wide_bar} {pos}/{len} {eta}")
            .unwrap_or_else(|_| ProgressStyle::default_bar()),
    );
    let done = std::sync::Mutex::new(std::collections::BTreeMap::new());
    let result = motion::run(world, course, &|progress| match progress {
        motion::Progress::Preparing => bar.set_message(format!("{what}: drawing scenes")),
        motion::Progress::Prepared(steps) => bar.set_message(format!("{what}: {steps} steps shown")),
        motion::Progress::Point(method, seed, point) => {
            let mut done = done.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            done.insert((method.name(), seed), point.updates);
            bar.set_position(done.values().sum());
            let line = format!(
                "{what} {} seed {seed}: {} updates, {} episodes, reached {:.3}, contact {:.3}, reward {:.3} (validation, nothing refused)",
                method.name(),
                point.updates,
                point.episodes,
                point.success,
                point.contact,
                point.reward
            );
            if bar.is_hidden() { anstream::eprintln!("{line}") } else { bar.println(line) }
        }
    });
    bar.finish_and_clear();
    let mut models = result?;
    for model in &models {
        let mut card = serde_json::to_value(&model.card)?;
        card["event"] = json!("trained");
        if args.json { anstream::println!("{card}") } else { anstream::println!("{card:#}") }
    }
    let best = models.iter_mut().max_by(|a, b| a.card.validation_success.total_cmp(&b.card.validation_success));
    match (best, &args.install) {
        (Some(best), Some(folder)) => best.save(&folder.join(product)),
        _ => Ok(()),
    }
}

fn train_encoder(args: &EncoderArgs) -> u8 {
    let options = TrainOptions {
        samples: args.samples,
        epochs: args.epochs,
        seed: args.seed,
        out: args.out.clone(),
        resume: args.resume,
        threads: args.threads.or(std::thread::available_parallelism().ok()).map_or(1, std::num::NonZeroUsize::get),
    };
    let bar = ProgressBar::new(0).with_style(
        ProgressStyle::with_template("{msg:28} {wide_bar} {pos}/{len} {eta}")
            .unwrap_or_else(|_| ProgressStyle::default_bar()),
    );
    let result = encoder::train(&options, &mut |progress| show(&bar, args.epochs, progress));
    bar.finish_and_clear();
    match result.map(|card| serde_json::to_value(&card)) {
        Ok(Ok(mut card)) => {
            if args.json {
                card["event"] = json!("trained");
                anstream::println!("{card}");
            } else {
                anstream::println!("{card:#}");
                anstream::eprintln!("weights and card are in {}", args.out.display());
            }
            exit::OK
        }
        Ok(Err(error)) => failed(&error),
        Err(error) => failed(&error),
    }
}

fn failed(error: &dyn std::fmt::Display) -> u8 {
    anstream::eprintln!("{error}");
    exit::FAILED
}

fn show(bar: &ProgressBar, epochs: usize, progress: &TrainProgress) {
    match progress {
        TrainProgress::Data(made, total) => {
            bar.set_message("scanning examples");
            bar.set_length(*total as u64);
            bar.set_position(*made as u64);
        }
        TrainProgress::Step(epoch, step, steps, loss) => {
            bar.set_message(format!("epoch {epoch}/{epochs}, loss {loss:.3}"));
            bar.set_length((epochs * steps) as u64);
            bar.set_position(((epoch - 1) * steps + step) as u64);
        }
        TrainProgress::Epoch { epoch, accuracy, points, clouds_a_second } => {
            let line = format!(
                "epoch {epoch}: accuracy {accuracy:.4}, points {points:.4} (validation), {clouds_a_second:.0} clouds/s"
            );
            if bar.is_hidden() { anstream::eprintln!("{line}") } else { bar.println(line) }
        }
        TrainProgress::Test => bar.set_message("measuring on the test split"),
    }
}
