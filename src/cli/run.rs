//! `tandem run`: starts a cell and assembles boxes.

use std::path::{Path, PathBuf};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

use clap::Args;
use comfy_table::{Table, presets};
use serde_json::json;
use tandem_config::Cell;
use tandem_cycle::Histogram;
use tandem_cycle::stats::Snapshot;
use tandem_msg::Coded;

use super::progress::Screen;
use super::{check, exit};
use crate::black_box;
use crate::live::{self, signals};
use crate::lockstep::SimCell;
use crate::strategy::Library;
use crate::strategy::store::{RunRecord, Store, StoreError, default_url};
use crate::supervisor::{Event, Outcome, Planned, RunOptions, Summary};

#[derive(Args)]
pub(super) struct RunArgs {
    /// Cell file, such as config/cells/s471.toml
    cell: PathBuf,
    /// Product instead of the one the cell file names: its name, or a .toml file
    #[arg(long)]
    product: Option<String>,
    /// Boxes to assemble
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    boxes: u32,
    /// Decides everything that varies: where parts lie, noise, what the person does
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// All roles in one process on a virtual clock: same decisions, far faster than real time
    #[arg(long)]
    lockstep: bool,
    /// Database instead of the one the cell file names: sqlite://FILE or mysql://USER@HOST/DATABASE
    #[arg(long, value_name = "URL")]
    store: Option<String>,
    /// Print one JSON object a line and a summary as the last
    #[arg(long)]
    json: bool,
}

/// How a run ended, in either shell.
struct Ended {
    outcome: Outcome,
    summary: Summary,
    /// Health of the loops; none in lockstep, where nothing is late.
    loops: Vec<Snapshot>,
    restarts: u32,
}

/// Why a run could not begin or not come to an end.
struct Refusal {
    message: String,
    exit_code: u8,
}

impl Refusal {
    fn failed(message: impl ToString) -> Self {
        Self { message: message.to_string(), exit_code: exit::FAILED }
    }
}

pub(super) fn run(args: &RunArgs) -> u8 {
    let cell = match Cell::load(&args.cell, args.product.as_deref()) {
        Ok(cell) => cell,
        Err(faults) => return check::report_faults(&faults, args.json),
    };
    if let Err(message) = check::refuse_unfit(&cell) {
        anstream::eprintln!("{message}");
        return exit::CONFIG;
    }
    let record = record(args, &cell);
    let (mut store, library) = match open_store(args.store.as_deref(), &cell, &record) {
        Ok(opened) => opened,
        Err(error) => {
            anstream::eprintln!("{error}");
            return exit::CONFIG;
        }
    };
    let stops = store_url(args.store.as_deref(), &cell).and_then(|url| black_box::folder(&url, &cell.name, &record.id));
    let stops = match stops {
        Ok(folder) => folder,
        Err(error) => {
            anstream::eprintln!("{error}");
            return exit::CONFIG;
        }
    };
    let options = RunOptions { boxes: args.boxes, seed: args.seed, run_id: record.id.clone() };
    let began = Instant::now();
    let mut screen = (!args.json).then(Screen::new);
    let mut on_event = |event: &Event| match &mut screen {
        Some(screen) => screen.show(event),
        None => anstream::println!("{}", serde_json::to_string(event).unwrap_or_default()),
    };
    let ended = if args.lockstep {
        lockstep(&cell, &mut store, library, options, &stops, &mut on_event)
    } else {
        live(&cell, args.product.as_deref(), &mut store, library, options, &stops, &mut on_event)
    };
    if let Some(screen) = &screen {
        screen.finish();
    }
    let word = ended.as_ref().map_or("failed", |ended| ended.outcome.name());
    if let Err(error) = store.end(&record.id, word) {
        anstream::eprintln!("{error}");
    }
    match ended {
        Ok(ended) => {
            let black_boxes = black_box::files(&stops);
            report(args, &ended, began.elapsed().as_secs_f64(), &black_boxes);
            for file in &black_boxes {
                anstream::eprintln!("black box of a stop: {}", file.display());
            }
            anstream::eprintln!("journal: `tandem journal show {}` (in {})", record.id, store.shown_url());
            exit_code(&ended.outcome)
        }
        Err(refusal) => {
            anstream::eprintln!("{}", refusal.message);
            refusal.exit_code
        }
    }
}

/// The database a cell keeps its library and journal in.
pub(super) fn store_url(chosen: Option<&str>, cell: &Cell) -> Result<String, StoreError> {
    match chosen.or(cell.store.url.as_deref()) {
        Some(url) => Ok(url.to_owned()),
        None => default_url(&cell.name),
    }
}

/// Opens the store, records that the run begins, and reads the library.
fn open_store(chosen: Option<&str>, cell: &Cell, record: &RunRecord) -> Result<(Store, Library), StoreError> {
    let store = Store::open(&store_url(chosen, cell)?)?;
    store.seed(&cell.strategies)?;
    store.begin(record)?;
    let library = store.library()?;
    Ok((store, library))
}

/// A run is named after the instant it began; two in one nanosecond have different processes.
fn record(args: &RunArgs, cell: &Cell) -> RunRecord {
    let since_epoch = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
    let started_ns = i64::try_from(since_epoch.as_nanos()).unwrap_or(i64::MAX);
    RunRecord {
        id: format!("{started_ns:x}-{:x}", std::process::id()),
        cell: cell.name.clone(),
        product: cell.product.name.clone(),
        config_hash: cell.hash,
        seed: args.seed,
        boxes: args.boxes,
        started_ns,
    }
}

fn lockstep(
    cell: &Cell,
    store: &mut Store,
    library: Library,
    options: RunOptions,
    stops: &Path,
    on_event: &mut dyn FnMut(&Event),
) -> Result<Ended, Refusal> {
    let mut sim = SimCell::new(cell, library, options).map_err(Refusal::failed)?;
    sim.keep_stops(stops);
    signals::listen().map_err(|error| Refusal::failed(format!("signals cannot be handled: {error}")))?;
    let outcome = loop {
        let ended = sim.run(store, on_event, |_| signals::asked() > 0).map_err(Refusal::failed)?;
        match ended {
            Some(outcome) => break outcome,
            None => sim.halt(),
        }
    };
    Ok(Ended { outcome, summary: sim.summary(), loops: Vec::new(), restarts: 0 })
}

fn live(
    cell: &Cell,
    product: Option<&str>,
    store: &mut Store,
    library: Library,
    options: RunOptions,
    stops: &Path,
    on_event: &mut dyn FnMut(&Event),
) -> Result<Ended, Refusal> {
    let ended = live::run(cell, product, library, store, options, Some(stops), on_event)
        .map_err(|error| Refusal { message: error.to_string(), exit_code: error.exit_code() })?;
    Ok(Ended { outcome: ended.outcome, summary: ended.summary, loops: ended.loops, restarts: ended.restarts })
}

/// Prints the summary: the last line of `--json`, or a table.
fn report(args: &RunArgs, ended: &Ended, wall_time_s: f64, black_boxes: &[PathBuf]) {
    let Ended { outcome, summary, loops, restarts } = ended;
    if args.json {
        for stats in loops {
            anstream::println!("{}", loop_line(stats));
        }
        let mut line = serde_json::to_value(summary).unwrap_or_default();
        line["event"] = json!("summary");
        line["outcome"] = json!(outcome.name());
        line["wall_time_s"] = json!(wall_time_s);
        line["black_boxes"] = json!(black_boxes);
        anstream::println!("{line}");
    } else {
        anstream::println!("\n{}", table(summary, *restarts, wall_time_s));
        if !loops.is_empty() {
            anstream::println!("\n{}", loop_table(loops));
        }
    }
    if *outcome != Outcome::Completed {
        anstream::eprintln!("{outcome}");
    }
}

/// How a role's loop kept its time.
fn loop_line(of: &Snapshot) -> serde_json::Value {
    let record = &of.record;
    let role = of.role.get().map_or("unknown", Coded::name);
    let quantiles = |histogram: &Histogram| {
        let us = |q| histogram.quantile_ns(q) as f64 * 1e-3;
        json!({"p50": us(0.5), "p99": us(0.99), "p99.9": us(0.999), "max": us(1.0)})
    };
    json!({"event": "loop", "role": role, "cycles": record.cycles, "missed": record.missed, "overruns": record.overruns,
        "lateness_us": quantiles(&record.lateness), "busy_us": quantiles(&record.busy),
        "fifo": of.obtained.priority, "memory_locked": of.obtained.locked})
}

fn loop_table(loops: &[Snapshot]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_header([
        "loop",
        "cycles",
        "missed",
        "wake-up p99",
        "latest",
        "cycle p99",
        "longest",
        "scheduling",
    ]);
    for of in loops {
        let record = &of.record;
        let ms = |ns: u64| format!("{:.2} ms", ns as f64 * 1e-6);
        table.add_row([
            of.role.get().map_or("unknown", Coded::name).to_owned(),
            record.cycles.to_string(),
            record.missed.to_string(),
            ms(record.lateness.quantile_ns(0.99)),
            ms(record.lateness.max_ns()),
            ms(record.busy.quantile_ns(0.99)),
            ms(record.busy.max_ns()),
            if of.obtained.priority.is_some() { "realtime" } else { "normal" }.to_owned(),
        ]);
    }
    table
}

/// Who planned the ways across.
fn planned(planned: &Planned) -> String {
    let share = planned.policy_share().map_or(String::new(), |share| format!("{:.0} % by policy: ", 1e2 * share));
    format!("{share}policy {}, manual {}, sampled {}", planned.policy, planned.manual, planned.rrt_connect)
}

fn table(summary: &Summary, restarts: u32, wall_time_s: f64) -> Table {
    let clearance = summary.min_clearance_m.map_or("the arm did not move".to_owned(), |m| format!("{:.0} mm", m * 1e3));
    let rows = [
        ("boxes completed", format!("{} of {}", summary.boxes_completed, summary.boxes_requested)),
        ("steps done", summary.steps_done.to_string()),
        ("attempts failed", summary.steps_failed.to_string()),
        ("fallback plans", summary.fallbacks.to_string()),
        ("ways across", planned(&summary.planned)),
        ("ways changed", summary.ways_changed.to_string()),
        ("protective stops", summary.stops.to_string()),
        ("contacts", summary.contacts.to_string()),
        ("restarted processes", restarts.to_string()),
        ("smallest clearance", clearance),
        ("cell time", format!("{:.1} s", summary.sim_time_s)),
        ("wall time", format!("{wall_time_s:.1} s ({:.0}x)", summary.sim_time_s / wall_time_s)),
        ("seed", summary.seed.to_string()),
    ];
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_header(["product", summary.product.as_str()]);
    for (name, value) in rows {
        table.add_row([name.to_owned(), value]);
    }
    table
}

fn exit_code(outcome: &Outcome) -> u8 {
    match outcome {
        Outcome::Completed => exit::OK,
        Outcome::Failed { .. } => exit::FAILED,
        Outcome::Interrupted => exit::INTERRUPTED,
        Outcome::Fault { .. } => exit::FAULT,
        Outcome::TimedOut { .. } => exit::TIMED_OUT,
    }
}
