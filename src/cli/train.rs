//! `tandem train`: makes the trained models that ship in config/models.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

use super::{exit, transfer};
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
}

#[derive(Args)]
struct EncoderArgs {
    /// Training examples; a tenth as many more for validation, an eighth for the test
    #[arg(long, default_value_t = 8_000)]
    samples: usize,
    /// Passes over the examples
    #[arg(long, default_value_t = 16)]
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
