//! `tandem eval safety`: measures what the controller does about people against what is demanded of it.

use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use comfy_table::{Table, presets};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;
use tandem_config::Cell;

use super::{check, exit};
use crate::evaluation::safety::{self, Arm, Behind, Tally, Terms};

#[derive(Args)]
pub(super) struct SafetyArgs {
    /// Cell file whose arm and controller are put to the test
    #[arg(default_value = "config/cells/s471.toml")]
    cell: PathBuf,
    /// Encounters with a person
    #[arg(long, default_value_t = 100_000, value_parser = clap::value_parser!(u64).range(1..=100_000_000))]
    runs: u64,
    /// Seed of the first encounter; each has the next
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Cell time of an encounter, s. The person is at the arm within one; in ten there are stops, waits and new starts
    #[arg(long, value_name = "SECONDS", default_value_t = 0.7, value_parser = seconds)]
    length: f64,
    /// A thousand encounters and a short look at everything else
    #[arg(long)]
    quick: bool,
    /// Where the picture of the walk-in goes
    #[arg(long, value_name = "FILE.svg", default_value = "reports/safety/walk-in.svg")]
    plot: PathBuf,
    /// Print one JSON object a row
    #[arg(long)]
    json: bool,
}

const WALK_IN: &str = "walk-in, lockstep cell";
const SLOWS: &str = "slows, waits, goes on";

/// One demand and what was measured.
struct Row {
    what: &'static str,
    demanded: &'static str,
    found: String,
    met: bool,
    numbers: serde_json::Value,
}

pub(super) fn safety(args: &SafetyArgs) -> u8 {
    let cell = match Cell::load(&args.cell, None) {
        Ok(cell) => cell,
        Err(faults) => return check::report_faults(&faults, args.json),
    };
    let arm = Arm { chain: cell.robot.chain, body: cell.robot.body, params: cell.controller };
    let runs = if args.quick { args.runs.min(1_000) } else { args.runs };
    let began = Instant::now();
    let cycles = (args.length / arm.params.period.as_secs_f64()).ceil() as u64;
    let run = |what, runs, blind| {
        let terms = Terms { cycles, blind };
        watched(what, runs, |tick| safety::campaign(&arm, args.seed, runs, terms, tick))
    };
    let tally = run("encounters", runs, false);
    let control = run("unwatched", (runs / 20).max(50), true);
    let mut rows = campaign_rows(&tally, &control);
    rows.extend(nuisance_rows(&arm, args));
    // What was measured until then is reported, whatever becomes of the walk-in.
    rows.push(walk_in_row(&cell, args).unwrap_or_else(|message| Row {
        what: WALK_IN,
        demanded: SLOWS,
        found: message,
        met: false,
        numbers: json!({}),
    }));
    report(args, &tally, &rows, began.elapsed().as_secs_f64());
    if rows.iter().all(|row| row.met) { exit::OK } else { exit::FAILED }
}

/// The length of an encounter.
fn seconds(text: &str) -> Result<f64, String> {
    const ALLOWED: std::ops::RangeInclusive<f64> = 0.1..=600.0;
    let length = text.parse().map_err(|_| format!("{text} is no number"))?;
    let allowed = || format!("allowed {} to {} s", ALLOWED.start(), ALLOWED.end());
    if ALLOWED.contains(&length) { Ok(length) } else { Err(allowed()) }
}

/// Runs something of many parts with a bar.
fn watched<T>(what: &str, length: u64, run: impl FnOnce(&(dyn Fn(u64) + Sync)) -> T) -> T {
    let style = ProgressStyle::with_template("{msg:12} {wide_bar} {pos}/{len} {eta}");
    let bar = ProgressBar::new(length).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    bar.set_message(what.to_owned());
    let result = run(&|done| {
        if done % 64 == 0 {
            bar.set_position(done);
        }
    });
    bar.finish_and_clear();
    result
}

fn campaign_rows(tally: &Tally, control: &Tally) -> Vec<Row> {
    let millimetres = |metres: Option<f64>| metres.map_or("-".to_owned(), |metres| format!("{:.0} mm", metres * 1e3));
    vec![
        Row {
            what: "contacts with a moving arm",
            demanded: "0",
            found: tally.contacts.to_string(),
            met: tally.contacts == 0,
            numbers: json!({"runs": tally.runs, "contacts": tally.contacts, "struck": tally.struck,
                "nearest_m": tally.distance, "failed_seeds": tally.failed}),
        },
        Row {
            what: "below the protective separation",
            demanded: "0",
            found: format!("{}, least to spare {}", tally.below, millimetres(tally.spare)),
            met: tally.below == 0,
            numbers: json!({"runs": tally.runs, "below": tally.below, "spare_min_m": tally.spare}),
        },
        Row {
            what: "the same, monitor off: contacts",
            demanded: "> 0",
            found: format!("{} of {}", control.contacts, control.runs),
            met: control.contacts > 0,
            numbers: json!({"runs": control.runs, "contacts": control.contacts, "below": control.below}),
        },
        Row {
            what: "stops longer than announced",
            demanded: "<= 5 ms",
            found: format!("{:.1} ms", tally.overrun * 1e3),
            met: tally.overrun <= 5e-3,
            numbers: json!({"overrun_max_s": tally.overrun}),
        },
    ]
}

fn nuisance_rows(arm: &Arm, args: &SafetyArgs) -> Vec<Row> {
    let (walks, cycles) = if args.quick { (4, 10_000) } else { (40, 60_000) };
    let mut sums = [0_u64; 4];
    for walk in 0..walks {
        let counts = safety::passers_by(arm, args.seed.wrapping_add(walk), cycles);
        sums.iter_mut().zip(counts).for_each(|(sum, count)| *sum += count);
    }
    let [all, waiting, needless, stops] = sums;
    let share = needless as f64 / all as f64;
    let crossings = if args.quick { 20 } else { 400 };
    let changes: Vec<u32> = (0..crossings)
        .map(|k| safety::crossing(arm, args.seed.wrapping_add(k), [0.2, 0.5, 1.0, 1.6][k as usize % 4]))
        .collect();
    let most = changes.iter().copied().max().unwrap_or(0);
    let [free, obstacle, hand] =
        [Behind::Nothing, Behind::Obstacle, Behind::Hand].map(|behind| safety::withdrawal(arm, behind));
    let away = |what: &'static str, [peak, time]: [f64; 2]| Row {
        what,
        demanded: "not slowed",
        found: format!("{:.1} % of the speed, {:.1} % of the time", 100.0 * peak / free[0], 100.0 * time / free[1]),
        met: peak >= 0.999 * free[0] && time <= 1.001 * free[1],
        numbers: json!({"peak_m_s": peak, "free_peak_m_s": free[0], "time_s": time, "free_time_s": free[1]}),
    };
    vec![
        Row {
            what: "needless standing, passers-by",
            demanded: "<= 5 %",
            found: format!("{:.2} % of {all} cycles ({waiting} standing, {stops} stops)", 100.0 * share),
            met: share <= 0.05,
            numbers: json!({"cycles": all, "standing": waiting, "needless": needless, "stops": stops}),
        },
        Row {
            what: "mode changes at a crossing",
            demanded: "<= 1",
            found: format!("at most {most} in {crossings} crossings"),
            met: most <= 1,
            numbers: json!({"crossings": crossings, "changes_max": most, "changes": changes.iter().sum::<u32>()}),
        },
        away("away from an obstacle at 5 cm", obstacle),
        away("away from a hand at 5 cm", hand),
    ]
}

fn walk_in_row(cell: &Cell, args: &SafetyArgs) -> Result<Row, String> {
    /// Runs that are looked through.
    const RUNS: u64 = 10;
    for seed in (args.seed..).take(RUNS as usize) {
        let Some(found) = safety::walk_in(cell, seed).map_err(|error| error.to_string())? else { continue };
        found.figure().save(&args.plot).map_err(|error| format!("{}: {error}", args.plot.display()))?;
        let [stood, resumed] = found.stood;
        let [before, after] = found.speeds;
        return Ok(Row {
            what: WALK_IN,
            demanded: SLOWS,
            found: format!(
                "{before:.2} m/s, stood {:.1} s, {after:.2} m/s; nearest while moving {:.2} m",
                resumed - stood,
                found.distance
            ),
            met: found.distance > 0.0,
            numbers: json!({"seed": seed, "stood_s": found.stood, "speeds_m_s": found.speeds,
                "nearest_moving_m": found.distance, "plot": args.plot}),
        });
    }
    Err(format!("in {RUNS} runs of the cell nobody walked in on a moving arm"))
}

fn report(args: &SafetyArgs, tally: &Tally, rows: &[Row], wall_time_s: f64) {
    if args.json {
        for row in rows {
            let mut line = row.numbers.clone();
            line["what"] = json!(row.what);
            line["demanded"] = json!(row.demanded);
            line["met"] = json!(row.met);
            anstream::println!("{line}");
        }
        return;
    }
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_header(["", "demanded", "measured", ""]);
    for row in rows {
        table.add_row([row.what, row.demanded, &row.found, if row.met { "met" } else { "MISSED" }]);
    }
    let faults: Vec<_> = tally.faults.iter().map(|(name, count)| format!("{count} {name}")).collect();
    anstream::println!("{table}\n");
    anstream::println!(
        "{} encounters of {} s, all in {wall_time_s:.0} s: {} cycles, the arm moving in {}, {} stops; tracking {}",
        tally.runs,
        args.length,
        tally.cycles,
        tally.moving,
        tally.stops,
        faults.join(", ")
    );
    if !tally.failed.is_empty() {
        anstream::println!(
            "seeds that failed: {:?} (repeat one with --runs 1 --seed N, and the same --length)",
            tally.failed
        );
    }
    anstream::println!("picture: {}", args.plot.display());
}
