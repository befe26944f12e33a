//! `tandem doctor`: what this host offers a realtime loop and a cell, and how to mend what it lacks.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::exit;
use crate::doctor::{self, Verdict};

const HELP: &str = "Verdicts: ok; unknown: could not be found out; degraded: a cell runs, with less certainty; bad: a \
cell does not run. What comes first is to be mended first.\n\nExit codes: 0 nothing is bad, 1 something is bad, 2 usage";

#[derive(Args)]
#[command(after_help = HELP)]
pub(super) struct DoctorArgs {
    /// Cell file whose files, model and database are looked at too
    cell: Option<PathBuf>,
    /// Print one JSON object a line
    #[arg(long)]
    json: bool,
}

pub(super) fn doctor(args: &DoctorArgs) -> u8 {
    let checks = doctor::examine(args.cell.as_deref());
    let count = |verdict| checks.iter().filter(|check| check.verdict == verdict).count();
    for check in &checks {
        if args.json {
            let mut line = serde_json::to_value(check).unwrap_or_default();
            line["event"] = json!("check");
            anstream::println!("{line}");
        } else {
            anstream::println!("{:9} {:20} {}", word(check.verdict), check.name, check.found);
            if let Some(fix) = &check.fix {
                anstream::println!("{:30} {}", "", check.matters);
                anstream::println!("{:30} -> {fix}", "");
            }
        }
    }
    if !args.json {
        let verdicts = [Verdict::Ok, Verdict::Unknown, Verdict::Degraded, Verdict::Bad];
        let counts = verdicts.map(|verdict| format!("{} {}", count(verdict), word(verdict)));
        anstream::println!("\n{} checks: {}", checks.len(), counts.join(", "));
    }
    if count(Verdict::Bad) > 0 { exit::FAILED } else { exit::OK }
}

fn word(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Ok => "ok",
        Verdict::Unknown => "unknown",
        Verdict::Degraded => "degraded",
        Verdict::Bad => "BAD",
    }
}
