//! `tandem status`: a running cell at one instant.

use std::thread;
use std::time::Duration;

use clap::Args;
use comfy_table::{Table, presets};
use serde_json::json;
use tandem_cycle::{Clock as _, Monotonic};

use super::exit;
use crate::observe::{FindError, LoopView, ObserveError, Observer, Quantiles, View, find};

/// Between two looks, for the rates.
const BETWEEN: Duration = Duration::from_millis(300);

#[derive(Args)]
pub(super) struct StatusArgs {
    /// Cell file, cell or instance; may be left out when one cell is running
    cell: Option<String>,
    /// Print one JSON object
    #[arg(long)]
    json: bool,
}

pub(super) fn status(args: &StatusArgs) -> u8 {
    let mut observer = match open(args.cell.as_deref()) {
        Ok(observer) => observer,
        Err(code) => return code,
    };
    observer.look(Monotonic.now());
    thread::sleep(BETWEEN);
    let view = observer.look(Monotonic.now());
    if args.json {
        let mut line = serde_json::to_value(&view).unwrap_or_default();
        line["event"] = json!("status");
        anstream::println!("{line}");
    } else {
        print(&view);
    }
    exit::OK
}

/// Opens the cell that is meant; says on standard error why it cannot.
pub(super) fn open(wanted: Option<&str>) -> Result<Observer, u8> {
    let running = find(wanted).map_err(|error| {
        anstream::eprintln!("{error}");
        match error {
            FindError::NotRunning { .. } => exit::NOT_RUNNING,
            FindError::Ambiguous { .. } => exit::USAGE,
            FindError::Config(_) => exit::CONFIG,
        }
    })?;
    Observer::open(running).map_err(|error| {
        anstream::eprintln!("{error}");
        match error {
            ObserveError::Config(_) => exit::CONFIG,
            ObserveError::NoCellFile { .. } | ObserveError::Bus(_) => exit::FAILED,
        }
    })
}

fn print(view: &View) {
    anstream::println!("cell {}, product {}", view.instance, view.product);
    for line in [step(view), motion(view), arm(view)].into_iter().flatten() {
        anstream::println!("{line}");
    }
    anstream::println!("\n{}", loops(&view.loops));
    for one in view.loops.iter().filter(|one| !one.notices.is_empty()) {
        anstream::println!("{}: {}", one.role, one.notices);
    }
}

/// What is being done, in a line.
pub(super) fn step(view: &View) -> Option<String> {
    let step = &view.step;
    let mut line = format!("box {}", step.number);
    if let Some(part) = &step.part {
        line += &format!(", {part}");
    }
    line += &format!(": {} ({})", step.subtask, step.run);
    if let Some(feature) = step.feature {
        line += &format!(", seen: {feature} {:.1} %", step.confidence * 100.0);
    }
    if let Some(prompt) = step.prompt {
        line += &format!(", the person is asked to {prompt}");
    }
    (step.number > 0).then_some(line)
}

/// How the arm moves, in a line.
pub(super) fn motion(view: &View) -> Option<String> {
    let motion = view.motion.as_ref()?;
    let why = if motion.cause == "none" { String::new() } else { format!(" ({})", motion.cause) };
    let person = motion.separation_m.map_or("nobody in view".to_owned(), |distance| {
        format!("person at {distance:.2} m of {:.2} m owed", motion.separation_required_m)
    });
    Some(format!(
        "{}{why}, {} {:.1} of {:.1} s, {} stops, clearance {:.0} mm (least {:.0}), {person}, speed {:.0} %, TCP {:.2} m/s, {:.1} ms ago",
        motion.stop,
        motion.phase,
        motion.elapsed_s,
        motion.expected_s,
        motion.stops,
        motion.clearance_m * 1e3,
        motion.clearance_min_m * 1e3,
        motion.speed * 100.0,
        motion.tcp_speed_m_s,
        motion.age_ms,
    ))
}

/// The arm, in a line.
pub(super) fn arm(view: &View) -> Option<String> {
    let arm = view.arm.as_ref()?;
    let brakes = if arm.fault == "none" { "brakes open".to_owned() } else { format!("brakes closed: {}", arm.fault) };
    let part = if arm.holding { "holds a part" } else { "empty" };
    let fastest = arm.velocity_rad_s.iter().fold(0.0_f64, |fastest, velocity| fastest.max(velocity.abs()));
    Some(format!("arm: {brakes}, {} {part}, fastest joint {fastest:.2} rad/s, {:.1} ms ago", arm.tool, arm.age_ms))
}

/// Head of each column of [`row`].
pub(super) const COLUMNS: [&str; 13] = [
    "loop",
    "pid",
    "epoch",
    "Hz",
    "cycles",
    "missed",
    "overruns",
    "late p50/p99/p99.9/max µs",
    "busy p99/max µs",
    "oldest input p99",
    "alloc",
    "faults",
    "syscalls",
];

/// A loop's figures, in the order of [`COLUMNS`]; the last three are averages of a cycle.
pub(super) fn row(one: &LoopView) -> [String; 13] {
    let Quantiles { p50_us, p99_us, p99_9_us, max_us } = one.lateness;
    let each = |value: Option<f64>| value.map_or("-".to_owned(), |value| format!("{value:.2}"));
    let oldest = one.inputs.iter().map(|input| input.age.p99_us).fold(0.0, f64::max);
    [
        one.role.to_owned(),
        one.pid.to_string(),
        one.epoch.to_string(),
        format!("{:.0}/{:.0}", one.rate_hz, one.rate_wanted_hz),
        one.cycles.to_string(),
        one.missed.to_string(),
        one.overruns.to_string(),
        format!("{p50_us:.0}/{p99_us:.0}/{p99_9_us:.0}/{max_us:.0}"),
        format!("{:.0}/{:.0}", one.busy.p99_us, one.busy.max_us),
        format!("{:.1} ms", oldest / 1e3),
        each(one.per_cycle.allocations),
        each(one.per_cycle.page_faults),
        each(one.per_cycle.system_calls),
    ]
}

/// The realtime set-up a loop was granted, in a few words.
pub(super) fn set_up(one: &LoopView) -> String {
    let mut words = vec![one.fifo.map_or("normal scheduler".to_owned(), |priority| format!("FIFO {priority}"))];
    words.push(one.cpu.map_or("any processor".to_owned(), |cpu| format!("processor {cpu}")));
    words.push(if one.memory_locked { "locked" } else { "not locked" }.to_owned());
    if one.prefaulted_kb > 0 {
        words.push(format!("{} kB touched", one.prefaulted_kb));
    }
    words.push(format!("slack {} ns", one.timer_slack_ns));
    if let Some(latency) = one.dma_latency_us {
        words.push(format!("wakes within {latency} µs"));
    }
    words.join(", ")
}

fn loops(loops: &[LoopView]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_header(COLUMNS.into_iter().chain(["set-up"]));
    for one in loops {
        table.add_row(row(one).into_iter().chain([set_up(one)]));
    }
    table
}
