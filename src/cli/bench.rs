//! `tandem bench`: prints what was measured, beside its baselines.

use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::{Args, Subcommand};
use comfy_table::{CellAlignment, Table, presets};
use serde_json::json;

use super::exit;
use crate::bench::{self, Bench, BenchError, Endurance, Options, QUANTILES, Report, Shell};

#[derive(Args)]
pub(super) struct BenchArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Subcommand)]
enum What {
    /// How late loops wake, beside cyclictest and a bare loop; the controller of a live cell, read and not read
    Jitter(Wanted),
    /// What a message to another process costs, beside raw shared memory, a futex and iceoryx2; sensor to arm, by hops
    Latency(Wanted),
    /// kill -9 of the controller: death noticed, arm braked, successor in command
    Recovery(Wanted),
    /// What a control cycle computes, part by part and as a whole
    Kernels(Wanted),
    /// Kills all roles of live cells, many times; nothing may be left or have grown
    Soak(SoakArgs),
    /// Runs a cell for long; no number may be lost, nothing be asked of the system, nothing become slower
    Endurance(EnduranceArgs),
}

#[derive(Args)]
struct SoakArgs {
    /// Kills in all
    #[arg(long, default_value_t = 1_000, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    kills: u32,
    #[command(flatten)]
    long: Long,
}

#[derive(Args)]
struct EnduranceArgs {
    /// Cycles of the controller
    #[arg(long, default_value_t = 1_000_000, value_parser = clap::value_parser!(u64).range(100..=1_000_000_000))]
    cycles: u64,
    /// In one process on a virtual clock, as fast as it goes
    #[arg(long)]
    lockstep: bool,
    /// Period of the controller instead of the cell file's, microseconds
    #[arg(long, value_parser = clap::value_parser!(u32).range(250..=10_000))]
    period_us: Option<u32>,
    #[command(flatten)]
    long: Long,
}

/// What the benches ask that run until they are done.
#[derive(Args)]
struct Long {
    /// The cell
    #[arg(long, value_name = "CELL.toml", default_value = "config/cells/s471.toml")]
    cell: PathBuf,
    /// Print one JSON object a line
    #[arg(long)]
    json: bool,
}

#[derive(Args)]
struct Wanted {
    /// How long each case is measured in each round, seconds
    #[arg(long, default_value_t = 1.0, value_parser = seconds)]
    seconds: f64,
    /// How often the cases take turns
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    rounds: u32,
    /// Processor of the measured loop; the last when left out
    #[arg(long)]
    cpu: Option<u32>,
    /// The cell that is run live, or whose arm and model are measured
    #[arg(long, value_name = "CELL.toml", default_value = "config/cells/s471.toml")]
    cell: PathBuf,
    /// Leave out what needs a live cell
    #[arg(long)]
    no_cell: bool,
    /// Save the histogram of each case in this folder, as HdrHistogram's tools write them
    #[arg(long, value_name = "FOLDER")]
    save: Option<PathBuf>,
    /// Draw the distributions into this file
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// Print one JSON object a line
    #[arg(long)]
    json: bool,
}

fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.01..=3_600.0).contains(&value) => Ok(value),
        _ => Err("not a number of seconds from 0.01 to 3600".to_owned()),
    }
}

pub(super) fn bench(args: &BenchArgs) -> u8 {
    match &args.what {
        What::Jitter(wanted) => taking_turns(Bench::Jitter, wanted),
        What::Latency(wanted) => taking_turns(Bench::Latency, wanted),
        What::Recovery(wanted) => taking_turns(Bench::Recovery, wanted),
        What::Kernels(wanted) => taking_turns(Bench::Kernels, wanted),
        What::Soak(wanted) => until_done(Bench::Soak { kills: wanted.kills }, &wanted.long),
        What::Endurance(wanted) => {
            let shell = if wanted.lockstep { Shell::Lockstep } else { Shell::Live };
            let period = wanted.period_us.map(|us| Duration::from_micros(us.into()));
            until_done(Bench::Endurance(Endurance { shell, cycles: wanted.cycles, period }), &wanted.long)
        }
    }
}

fn taking_turns(what: Bench, wanted: &Wanted) -> u8 {
    let options = Options {
        time: Duration::from_secs_f64(wanted.seconds),
        rounds: wanted.rounds,
        cpu: wanted.cpu,
        cell: (!wanted.no_cell).then(|| wanted.cell.clone()),
        tell: |_| {},
    };
    measured(what, &options, wanted.json).map_or_else(|code| code, |report| keep(&report, wanted))
}

/// Fails when something that was counted is not within what it is held to.
fn until_done(what: Bench, wanted: &Long) -> u8 {
    let tell = |word: &str| anstream::eprintln!("{word}");
    let options = Options { time: Duration::ZERO, rounds: 1, cpu: None, cell: Some(wanted.cell.clone()), tell };
    measured(what, &options, wanted.json)
        .map_or_else(|code| code, |report| if report.holds() { exit::OK } else { exit::FAILED })
}

/// Runs a bench and prints what it found; else says why it could not be run.
fn measured(what: Bench, options: &Options, json: bool) -> Result<Report, u8> {
    match bench::run(what, options) {
        Ok(report) => {
            if json {
                print_json(&report);
            } else {
                print(&report);
            }
            Ok(report)
        }
        Err(error) => {
            anstream::eprintln!("{error}");
            Err(if matches!(error, BenchError::Config(_)) { exit::CONFIG } else { exit::FAILED })
        }
    }
}

/// Saves and draws what was asked for.
fn keep(report: &Report, wanted: &Wanted) -> u8 {
    let refused = |path: &Path, error: &dyn std::fmt::Display| {
        anstream::eprintln!("{}: {error}", path.display());
        exit::FAILED
    };
    if let Some(folder) = &wanted.save {
        for series in &report.series {
            match series.save(folder, report.bench.name()) {
                Ok(path) => anstream::eprintln!("saved {}", path.display()),
                Err(error) => return refused(folder, &error),
            }
        }
    }
    if let Some(file) = &wanted.plot {
        if let Err(error) = report.distributions().save(file) {
            return refused(file, &error);
        }
        anstream::eprintln!("drawn {}", file.display());
    }
    exit::OK
}

fn print_json(report: &Report) {
    let bench = report.bench.name();
    let mut conditions = serde_json::to_value(&report.conditions).unwrap_or_default();
    conditions["event"] = json!("conditions");
    conditions["bench"] = json!(bench);
    conditions["notes"] = json!(report.notes);
    anstream::println!("{conditions}");
    for series in &report.series {
        let mut line =
            json!({"event": "series", "bench": bench, "case": series.case, "samples": series.samples(), "unit": "us"});
        for (quantile, name) in QUANTILES {
            line[name.replace('.', "_")] = json!(series.quantile_ns(quantile) / 1e3);
        }
        anstream::println!("{line}");
    }
    for finding in &report.findings {
        let mut line = serde_json::to_value(finding).unwrap_or_default();
        line["event"] = json!("finding");
        line["bench"] = json!(bench);
        line["holds"] = json!(finding.holds());
        anstream::println!("{line}");
    }
    for row in &report.rows {
        anstream::println!("{}", serde_json::to_value(row).unwrap_or_default());
    }
}

fn print(report: &Report) {
    let c = &report.conditions;
    let setting = match c.fifo {
        Some(priority) => format!("SCHED_FIFO {priority}"),
        None => "WITHOUT realtime permission".to_owned(),
    };
    let locked = if c.memory_locked { "memory locked" } else { "memory not locked" };
    let cpu = c.cpu.map_or(String::new(), |cpu| format!(", processor {cpu}"));
    anstream::println!(
        "{}, {} processors, {}\nload {:.1} to {:.1}, steal {:.2} %, {setting}, {locked}{cpu}\n",
        c.machine,
        c.processors,
        c.kernel,
        c.load[0],
        c.load[1],
        c.steal_share * 100.0
    );
    let tables = [
        (!report.series.is_empty()).then(|| distributions(report)),
        (!report.rows.is_empty()).then(|| comparisons(report)),
        (!report.findings.is_empty()).then(|| findings(report)),
    ];
    let tables: Vec<String> = tables.into_iter().flatten().map(|table| table.to_string()).collect();
    anstream::println!("{}", tables.join("\n\n"));
    for note in &report.notes {
        anstream::println!("- {note}");
    }
}

/// Each case: its quantiles, microseconds.
fn distributions(report: &Report) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING);
    let names = QUANTILES.map(|(_, name)| name);
    table.set_header([report.bench.name()].into_iter().chain(names).chain(["µs of"]));
    for series in &report.series {
        let values = QUANTILES.map(|(quantile, _)| digits(series.quantile_ns(quantile) / 1e3));
        table.add_row([series.case.clone()].into_iter().chain(values).chain([series.samples().to_string()]));
    }
    align(&mut table, QUANTILES.len() + 1);
    table
}

/// Each comparison: the ratios of its quantiles.
fn comparisons(report: &Report) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING);
    let names = QUANTILES.map(|(_, name)| name);
    table.set_header(["ratio", "to"].into_iter().chain(names));
    for rows in report.rows.chunks(QUANTILES.len()) {
        let [first, ..] = rows else { continue };
        let Some(peer) = &first.peer else { continue };
        let case = first.case.rsplit_once(", ").map_or(first.case.as_str(), |(case, _)| case);
        let ratios = rows.iter().map(|row| row.ratio.map_or("-".to_owned(), |ratio| format!("{ratio:.3}")));
        table.add_row([case.to_owned(), peer.clone()].into_iter().chain(ratios));
    }
    for column in table.column_iter_mut().skip(2) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

/// Each number that was counted, and what it is held to.
fn findings(report: &Report) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING);
    table.set_header([report.bench.name(), "found", "allowed", ""]);
    for finding in &report.findings {
        let number = |value: f64| if value.fract() == 0.0 { format!("{value:.0}") } else { format!("{value:.3}") };
        let allowed = finding.allowed.map_or("-".to_owned(), |allowed| format!("{} {}", number(allowed), finding.unit));
        let found = format!("{} {}", number(finding.found), finding.unit);
        let word = if finding.holds() { "" } else { "EXCEEDED" };
        table.add_row([finding.what.clone(), found, allowed, word.to_owned()]);
    }
    align(&mut table, 2);
    table
}

fn align(table: &mut Table, columns: usize) {
    for column in table.column_iter_mut().skip(1).take(columns) {
        column.set_cell_alignment(CellAlignment::Right);
    }
}

/// Three digits that count.
fn digits(value: f64) -> String {
    match value {
        v if v >= 100.0 => format!("{v:.0}"),
        v if v >= 10.0 => format!("{v:.1}"),
        v => format!("{v:.2}"),
    }
}

/// The other process of a bench.
#[derive(Args)]
pub(super) struct PeerArgs {
    /// What to do
    task: String,
    /// The folder of the bench
    place: PathBuf,
    /// Processor to run on
    #[arg(long)]
    cpu: Option<u32>,
}

pub(super) fn peer(args: &PeerArgs) -> u8 {
    match bench::peer::run(&args.task, &args.place, args.cpu) {
        Ok(()) => exit::OK,
        Err(error) => {
            anstream::eprintln!("{error}");
            exit::FAILED
        }
    }
}
