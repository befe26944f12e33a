//! `tandem journal`: what was done to each box, by whom, when.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use comfy_table::{Table, presets};
use serde_json::json;

use super::{exit, table};
use crate::black_box;
use crate::strategy::JournalEntry;
use crate::strategy::store::{PastRun, Store, StoreError, default_url};

#[derive(Args)]
pub(super) struct JournalArgs {
    #[command(subcommand)]
    verb: Verb,
    /// Database instead of the cell's own
    #[arg(long, global = true, value_name = "URL")]
    store: Option<String>,
    /// Cell whose database is read: the name in its file
    #[arg(long, global = true, default_value = "s471")]
    cell: String,
    /// Print one JSON object a line
    #[arg(long, global = true)]
    json: bool,
}

#[derive(Subcommand)]
enum Verb {
    /// Every run, the newest first
    List,
    /// The steps of one run
    Show {
        /// Run, as `list` names it; the newest when left out
        run: Option<String>,
    },
    /// The steps of one run as CSV
    Export {
        /// Run, as `list` names it; the newest when left out
        run: Option<String>,
        /// File to write; standard output when left out
        #[arg(long, short)]
        output: Option<PathBuf>,
    },
}

pub(super) fn journal(args: &JournalArgs) -> u8 {
    match answer(args) {
        Ok(()) => exit::OK,
        Err(message) => {
            anstream::eprintln!("{message}");
            exit::FAILED
        }
    }
}

fn answer(args: &JournalArgs) -> Result<(), String> {
    let store = open(args).map_err(|error| error.to_string())?;
    match &args.verb {
        Verb::List => list(&store, args.json).map_err(|error| error.to_string()),
        Verb::Show { run } => {
            let steps = steps(&store, run.as_deref())?;
            show(&steps, args.json)?;
            name_black_boxes(args, &steps);
            Ok(())
        }
        Verb::Export { run, output } => export(&steps(&store, run.as_deref())?, output.as_ref()),
    }
}

fn open(args: &JournalArgs) -> Result<Store, StoreError> {
    match &args.store {
        Some(url) => Store::open(url),
        None => Store::open(&default_url(&args.cell)?),
    }
}

fn list(store: &Store, json: bool) -> Result<(), StoreError> {
    let runs = store.runs()?;
    if json {
        for PastRun { record, outcome } in &runs {
            anstream::println!(
                "{}",
                json!({"event": "run", "run": record.id, "cell": record.cell, "product": record.product,
                    "config_hash": format!("{:016x}", record.config_hash), "seed": record.seed, "boxes": record.boxes,
                    "started_ns": record.started_ns, "outcome": outcome})
            );
        }
        return Ok(());
    }
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_header([
        "run",
        "cell",
        "product",
        "boxes",
        "seed",
        "configuration",
        "outcome",
    ]);
    for PastRun { record, outcome } in &runs {
        table.add_row([
            record.id.clone(),
            record.cell.clone(),
            record.product.clone(),
            record.boxes.to_string(),
            record.seed.to_string(),
            format!("{:016x}", record.config_hash),
            outcome.clone(),
        ]);
    }
    anstream::println!("{table}");
    Ok(())
}

/// The steps of a run, or of the newest.
fn steps(store: &Store, run: Option<&str>) -> Result<Vec<JournalEntry>, String> {
    let run = match run {
        Some(run) => run.to_owned(),
        None => {
            let runs = store.runs().map_err(|error| error.to_string())?;
            runs.first().map(|run| run.record.id.clone()).ok_or("the journal is empty: nothing was run yet")?
        }
    };
    let steps = store.journal(&run).map_err(|error| error.to_string())?;
    if steps.is_empty() {
        return Err(format!("run {run}: no such run, or it never began a step; `tandem journal list` names all"));
    }
    Ok(steps)
}

fn show(steps: &[JournalEntry], json: bool) -> Result<(), String> {
    for step in steps.iter().filter(|_| json) {
        let mut line = serde_json::to_value(step).map_err(|error| error.to_string())?;
        line["event"] = json!("journal");
        anstream::println!("{line}");
    }
    if !json {
        anstream::println!("{}", table::steps(steps));
    }
    Ok(())
}

/// Names the files that say what led to the run's stops.
fn name_black_boxes(args: &JournalArgs, steps: &[JournalEntry]) {
    let url = args.store.clone().map_or_else(|| default_url(&args.cell), Ok);
    let Some(step) = steps.first() else { return };
    let Ok(folder) = url.and_then(|url| black_box::folder(&url, &args.cell, &step.run)) else { return };
    for file in black_box::files(&folder) {
        anstream::eprintln!("black box of a stop: {}", file.display());
    }
}

fn export(steps: &[JournalEntry], output: Option<&PathBuf>) -> Result<(), String> {
    let text = table::csv(steps);
    match output {
        None => anstream::print!("{text}"),
        Some(path) => std::fs::write(path, text).map_err(|error| format!("{}: {error}", path.display()))?,
    }
    Ok(())
}
