//! `tandem eval features`: how well features are recognised and measured on parts nothing was
//! fitted on, in the source domain and in the target, and what each way of transfer is worth (Fig. 9 of
//! the paper).

mod draw;

use std::path::PathBuf;

use clap::Args;
use serde_json::json;
use tandem_msg::{Coded, FeatureClass};

use super::{exit, transfer};
use crate::learning::encoder::{self, Domain};
use crate::learning::transfer::compare::{self, Row};
use crate::learning::transfer::protocol::{DATA_SEED, SEEDS, TEST};
use crate::learning::transfer::run::{Ground, Outcome};
use crate::perception::card::Metrics;
use crate::perception::{CARD_FILE, Card};

#[derive(Args)]
pub(super) struct FeaturesArgs {
    #[command(flatten)]
    between: transfer::Between,
    /// Folder of the target's model
    #[arg(long, default_value = "config/models/s472")]
    target: PathBuf,
    /// Seeds the transfers are compared over
    #[arg(long, default_value_t = SEEDS.len() as u64, value_parser = clap::value_parser!(u64).range(1..=SEEDS.len() as u64))]
    seeds: u64,
    /// Folder of the transfers; those found in it are not made again
    #[arg(long, default_value = "reports/transfer-runs")]
    runs: PathBuf,
    /// Transfers made at a time; what comes out does not depend on it [default: all processors]
    #[arg(long)]
    threads: Option<std::num::NonZeroUsize>,
    /// 160 examples of the source, 88 of the target, no transfer that is not there already
    #[arg(long)]
    quick: bool,
    /// Folder for the report: features.md and its pictures, metrics.json
    #[arg(long, default_value = "reports/features")]
    report: PathBuf,
    /// Print one JSON object a figure
    #[arg(long)]
    json: bool,
}

/// Everything a report tells.
struct Findings {
    quick: bool,
    /// Test examples of source and target.
    counts: [usize; 2],
    source: Metrics,
    /// Of the model that ships.
    target: Metrics,
    rows: Vec<Row>,
    outcomes: Vec<Outcome>,
}

pub(super) fn features(args: &FeaturesArgs) -> u8 {
    let findings = match find(args) {
        Ok(findings) => findings,
        Err(message) => {
            anstream::eprintln!("{message}");
            return exit::FAILED;
        }
    };
    if let Err(error) = draw::write(&args.report, &findings) {
        anstream::eprintln!("{}: {error}; choose a writable folder with --report", args.report.display());
        return exit::FAILED;
    }
    let mut figures: Vec<(String, f64, &str, Option<f64>)> = Vec::new();
    for (domain, metrics) in [("source", &findings.source), ("target", &findings.target)] {
        figures.extend(rows(metrics).into_iter().map(|(case, v, unit)| (format!("{case}-{domain}"), v, unit, None)));
    }
    for row in &findings.rows {
        let without = if row.labels == 0 { "-unlabelled" } else { "" };
        let case = format!("accuracy-target-{}{without}", row.method);
        figures.push((case, row.mean(), "accuracy", Some(row.spread())));
    }
    for (case, value, unit, spread) in figures {
        if args.json {
            let row = json!({"bench": "features", "case": case, "ours": value, "spread": spread, "peer": null, "peer_value": null, "unit": unit, "ratio": null});
            anstream::println!("{row}");
        } else {
            let spread = spread.map_or(String::new(), |s| format!(" ± {s:.4}"));
            anstream::println!("{case:<36} {value:9.4}{spread} {unit}");
        }
    }
    anstream::eprintln!("the report is in {}", args.report.display());
    exit::OK
}

fn find(args: &FeaturesArgs) -> Result<Findings, String> {
    let text = |error: encoder::TrainError| error.to_string();
    let between = &args.between;
    let product = between.product()?;
    let card = |folder: &PathBuf| Card::read(&folder.join(CARD_FILE)).map_err(|error| error.to_string());
    let (source_card, target_card) = (card(&between.source)?, card(&args.target)?);
    let counts = if args.quick { [160, 88] } else { [source_card.data.test, TEST] };
    let source =
        encoder::measure(&between.source, &Domain::source(), source_card.data.seed, counts[0]).map_err(text)?;
    let target = encoder::measure(&args.target, &Domain::product(&product), DATA_SEED, counts[1]).map_err(text)?;
    let jobs = compare::jobs(args.seeds as usize);
    let hash = &source_card.weights_blake3;
    let found = jobs.iter().filter_map(|&job| compare::done(&args.runs, job, hash));
    let mut outcomes: Vec<Outcome> = found.collect();
    if !args.quick && outcomes.len() < jobs.len() {
        let agent = between.agent()?;
        let threads = args.threads.or(std::thread::available_parallelism().ok()).map_or(1, std::num::NonZeroUsize::get);
        let ground = Ground::new(&between.source, &product, TEST, threads).map_err(text)?;
        let told = |outcome: &Outcome| {
            let Outcome { method, labels, seed, metrics, seconds, .. } = outcome;
            anstream::eprintln!(
                "{method}, {labels} labels a class, seed {seed}: {:.4} in {seconds:.0} s",
                metrics.accuracy
            );
        };
        outcomes = compare::complete(&ground, &agent, &jobs, &args.runs, threads, &told).map_err(text)?;
    }
    if target_card.architecture != source_card.architecture {
        return Err(format!("{} is for another network than {}", args.target.display(), between.source.display()));
    }
    Ok(Findings { quick: args.quick, counts, source, target, rows: compare::rows(&outcomes), outcomes })
}

fn rows(m: &Metrics) -> Vec<(&'static str, f64, &'static str)> {
    vec![
        ("accuracy", m.accuracy, "accuracy"),
        ("sure", m.sure, "share"),
        ("accuracy-when-sure", m.accuracy_when_sure, "accuracy"),
        ("calibration", m.calibration_error, "error"),
        ("segmentation", m.segment_iou, "IoU"),
        ("thread-confused", thread_confusion(m), "share"),
        ("diameter", m.diameter_error, "relative error, median"),
        ("depth", m.depth_error, "relative error, median"),
        ("length", m.length_error, "relative error, median"),
        ("width", m.width_error, "relative error, median"),
        ("pitch", m.pitch_error, "relative error, median"),
        ("pitch-measured", m.pitch_measured, "share"),
        ("position", m.position_error_m * 1e3, "mm, median"),
        ("axis", m.axis_error_rad.to_degrees(), "degrees, median"),
    ]
}

/// Share of threaded and smooth walls taken for each other.
fn thread_confusion(m: &Metrics) -> f64 {
    use FeatureClass as C;
    let of = |a: C, b: C| f64::from(m.confusion[a.code() as usize][b.code() as usize]);
    let pairs = [(C::ThreadedHole, C::SmoothHole), (C::ThreadedAxis, C::SmoothAxis)];
    let wrong: f64 = pairs.iter().map(|(a, b)| of(*a, *b) + of(*b, *a)).sum();
    let all: f64 = pairs.iter().flat_map(|(a, b)| [*a, *b]).map(|a| row(m, a)).sum();
    wrong / all.max(1.0)
}

fn row(m: &Metrics, class: FeatureClass) -> f64 {
    m.confusion[class.code() as usize].iter().map(|n| f64::from(*n)).sum()
}
