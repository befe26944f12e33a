//! `tandem check`: every file, model and database of a cell, read and checked; nothing starts.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;
use tandem_config::{Cell, Robot};

use super::exit;
use super::run::store_url;
use crate::lockstep::build_controller;
use crate::perception::Perception;
use crate::plant::Plant;
use crate::strategy::store::Store;

#[derive(Args)]
pub(super) struct CheckArgs {
    /// Cell file, such as config/cells/s471.toml
    cell: PathBuf,
    /// Product instead of the one the cell file names: its name, or a .toml file
    #[arg(long)]
    product: Option<String>,
    /// Database instead of the one the cell file names
    #[arg(long, value_name = "URL")]
    store: Option<String>,
    /// Print one JSON object a line
    #[arg(long)]
    json: bool,
}

/// One thing that was checked.
struct Finding {
    subject: &'static str,
    result: Result<String, String>,
}

pub(super) fn check(args: &CheckArgs) -> u8 {
    let cell = match Cell::load(&args.cell, args.product.as_deref()) {
        Ok(cell) => cell,
        Err(faults) => return report_faults(&faults, args.json),
    };
    let findings = examine(&cell, args.store.as_deref());
    let failed = findings.iter().filter(|finding| finding.result.is_err()).count();
    let print = |word: &str, subject: &str, text: &str| {
        if args.json {
            anstream::println!("{}", json!({"event": "checked", "subject": subject, "verdict": word, "text": text}));
        } else {
            anstream::println!("{word:8}{subject:12}{text}");
        }
    };
    for Finding { subject, result } in &findings {
        match result {
            Ok(text) => print("ok", subject, text),
            Err(text) => print("refused", subject, text),
        }
    }
    cell.robot.notes.iter().for_each(|note| print("note", "robot", note));
    if failed > 0 { exit::CONFIG } else { exit::OK }
}

/// Prints what was found wrong with a cell's files.
pub(super) fn report_faults(faults: &tandem_config::Faults, json: bool) -> u8 {
    if json {
        for fault in faults.iter() {
            let mut line = serde_json::to_value(fault).unwrap_or_default();
            line["event"] = json!("refused");
            anstream::println!("{line}");
        }
    } else {
        anstream::eprintln!("{faults}");
    }
    exit::CONFIG
}

/// Loads everything a run would load.
fn examine(cell: &Cell, store: Option<&str>) -> Vec<Finding> {
    let file = cell.file.display();
    let mut findings = vec![
        Finding { subject: "files", result: Ok(format!("{file}: configuration {:016x}", cell.hash)) },
        Finding {
            subject: "product",
            result: Ok(format!("{}: {} part types", cell.product.label, cell.product.parts.len())),
        },
        Finding { subject: "robot", result: Ok(robot(&cell.robot)) },
    ];
    findings.extend(roles(cell));
    let store = store_url(store, cell)
        .and_then(|url| Store::open(&url))
        .map(|store| format!("{} answers, its tables are up to date", store.shown_url()))
        .map_err(|error| error.to_string());
    findings.push(Finding { subject: "store", result: store });
    findings
}

/// The arm in a line.
fn robot(robot: &Robot) -> String {
    let monitor = robot.monitor();
    let (shapes, joints) = (monitor.body().capsules().len(), robot.chain.joint_count());
    let hulls = (0..shapes).filter(|capsule| monitor.hull_points(*capsule).next().is_some()).count();
    let pairs = monitor.body().self_pairs().count();
    let meshes = robot.meshes.len();
    let name = &robot.name;
    format!("{name}: {joints} joints, {shapes} shapes of which {hulls} hulls, {pairs} pairs checked, {meshes} meshes")
}

/// Builds the roles a run would build.
fn roles(cell: &Cell) -> [Finding; 3] {
    let model = Perception::load(&cell.perception.model);
    let model = model.map(|_| cell.perception.model.display().to_string()).map_err(|error| error.to_string());
    let controller = build_controller(cell).map(|_| "parameters accepted".to_owned()).map_err(|e| e.to_string());
    let plant = Plant::new(cell, 0).map(|_| "simulation builds".to_owned()).map_err(|error| error.to_string());
    [("model", model), ("controller", controller), ("plant", plant)]
        .map(|(subject, result)| Finding { subject, result })
}

/// Refuses a cell whose roles would refuse their files, before anything starts.
///
/// # Errors
/// What every role says, a line each.
pub(super) fn refuse_unfit(cell: &Cell) -> Result<(), String> {
    let refused: Vec<String> = roles(cell).into_iter().filter_map(|finding| finding.result.err()).collect();
    if refused.is_empty() { Ok(()) } else { Err(refused.join("\n")) }
}
