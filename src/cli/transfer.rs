//! `tandem train transfer` and `tandem train agent`: the encoder of one product brought to another.

use std::path::{Path, PathBuf};

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;
use tandem_config::{Cell, Product};

use super::exit;
use crate::learning::transfer::agent::{AGENT_FILE, Agent};
use crate::learning::transfer::protocol::{BUDGET, LABELS, Method, Settings, TUNING_SEED};
use crate::learning::transfer::run::Ground;

/// From which source to which target.
#[derive(Args)]
pub(super) struct Between {
    /// Folder of the source's model
    #[arg(long, default_value = "config/models/s471")]
    pub(super) source: PathBuf,
    /// The cell the target product is made in
    #[arg(long, default_value = "config/cells/s471.toml")]
    pub(super) cell: PathBuf,
    /// Target product of that cell
    #[arg(long, default_value = "s472")]
    pub(super) product: String,
    /// Folder of the agent that was trained by `tandem train agent`
    #[arg(long, default_value = "config/models/agent")]
    pub(super) agent: PathBuf,
}

impl Between {
    /// The target product.
    pub(super) fn product(&self) -> Result<Product, String> {
        Cell::load(&self.cell, Some(&self.product)).map(|cell| cell.product).map_err(|faults| faults.to_string())
    }

    /// The trained agent.
    pub(super) fn agent(&self) -> Result<Agent, String> {
        let file = self.agent.join(AGENT_FILE);
        Agent::load(&file).map_err(|error| format!("{}: {error}; make one with `tandem train agent`", file.display()))
    }
}

#[derive(Args)]
pub(super) struct TransferArgs {
    /// How: source, adabn, finetune, dann, dan, dqn, random, greedy
    #[arg(long, default_value = "dqn")]
    method: Method,
    /// Labelled target examples a class that may be used
    #[arg(long, default_value_t = LABELS, value_parser = labels)]
    labels: usize,
    /// Decides everything that is drawn
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Looks that may be spent: one forward counts one, forward and backward three
    #[arg(long, default_value_t = BUDGET as u64, value_parser = clap::value_parser!(u64).range(1_000..=1_000_000))]
    budget: u64,
    #[command(flatten)]
    between: Between,
    /// Folder for weights and card
    #[arg(long, default_value = "reports/transfer")]
    out: PathBuf,
    /// Try the method's settings on validation instead, and tell how each did
    #[arg(long)]
    tune: bool,
    /// Print the outcome as JSON
    #[arg(long)]
    json: bool,
}

fn labels(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(count @ 0..=50) => Ok(count),
        _ => Err("allowed: 0..=50".to_owned()),
    }
}

#[derive(Args)]
pub(super) struct AgentArgs {
    /// Shifts of the source that are made up for it
    #[arg(long, default_value_t = 32, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    episodes: u64,
    /// Decides everything that is drawn
    #[arg(long, default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    between: Between,
    /// Folder for the agent
    #[arg(long, default_value = "reports/agent")]
    out: PathBuf,
    /// Print one JSON object an episode
    #[arg(long)]
    json: bool,
}

pub(super) fn transfer(args: &TransferArgs) -> u8 {
    finished(try_transfer(args))
}

pub(super) fn agent(args: &AgentArgs) -> u8 {
    finished(try_agent(args))
}

fn finished(result: Result<(), String>) -> u8 {
    match result {
        Ok(()) => exit::OK,
        Err(message) => {
            anstream::eprintln!("{message}");
            exit::FAILED
        }
    }
}

fn bar() -> ProgressBar {
    let style = ProgressStyle::with_template("{msg:28} {wide_bar} {percent} % {eta}");
    ProgressBar::new(1000).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}

fn threads() -> usize {
    std::thread::available_parallelism().map_or(1, std::num::NonZeroUsize::get)
}

fn ground(between: &Between, tests: usize) -> Result<Ground, String> {
    Ground::new(&between.source, &between.product()?, tests, threads()).map_err(|error| error.to_string())
}

fn try_transfer(args: &TransferArgs) -> Result<(), String> {
    let agent = (args.method == Method::Dqn).then(|| args.between.agent()).transpose()?;
    let bar = bar();
    bar.set_message("scanning parts");
    let ground = ground(&args.between, 0)?;
    bar.set_message(format!("{}, {} labels a class", args.method, args.labels));
    let settings = if args.tune { Settings::grid(args.method).to_vec() } else { vec![Settings::of(args.method)] };
    let seed = if args.tune { TUNING_SEED } else { args.seed };
    for settings in settings {
        let settings = Settings { looks: args.budget as usize, ..settings };
        let run = ground.transfer((args.method, args.labels, seed), settings, agent.as_ref(), &args.out, &mut |done| {
            bar.set_position((1000.0 * done) as u64);
        });
        let outcome = run.map_err(|error| error.to_string())?;
        let [loss, accuracy] = outcome.validation;
        if args.json {
            let mut line = serde_json::to_value(&outcome).map_err(|error| error.to_string())?;
            line["event"] = json!("transferred");
            anstream::println!("{line}");
        } else {
            let Settings { rate, weight, .. } = settings;
            anstream::println!(
                "{}, {} labels a class, seed {seed}, rate {rate}, weight {weight}: accuracy {accuracy:.4}, loss {loss:.4} (validation), {:.0} s",
                args.method,
                args.labels,
                outcome.seconds
            );
        }
    }
    if !args.tune {
        bar.set_message("calibrating");
        let card = ground.calibrate(&args.out).map_err(|error| error.to_string())?;
        anstream::eprintln!(
            "accuracy {:.4} (test); weights and card are in {}",
            card.metrics.accuracy,
            args.out.display()
        );
    }
    bar.finish_and_clear();
    Ok(())
}

fn try_agent(args: &AgentArgs) -> Result<(), String> {
    let bar = bar();
    bar.set_message("scanning parts");
    let ground = ground(&args.between, 0)?;
    bar.set_message("at school");
    let episodes = args.episodes as usize;
    let mut show = |episode: usize, [first, last, loss]: [f32; 3]| {
        bar.set_position((1000 * episode / episodes) as u64);
        if args.json {
            anstream::println!(
                "{}",
                json!({"event": "episode", "episode": episode, "before": first, "after": last, "loss": loss})
            );
        } else {
            let line =
                format!("episode {episode}: {first:.3} to {last:.3} of about 2 (looks held back), loss {loss:.4}");
            if bar.is_hidden() { anstream::eprintln!("{line}") } else { bar.println(line) }
        }
    };
    ground.school(episodes, args.seed, &args.out, &mut show).map_err(|error| error.to_string())?;
    bar.finish_and_clear();
    anstream::eprintln!("the agent is in {}", Path::new(&args.out).join(AGENT_FILE).display());
    Ok(())
}
