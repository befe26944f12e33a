//! `tandem doctor`: what this host offers a realtime loop, and how to mend what it lacks.

use clap::Args;
use serde_json::json;

use super::exit;
use crate::doctor::{self, Verdict};

#[derive(Args)]
pub(super) struct DoctorArgs {
    /// Print one JSON object a line
    #[arg(long)]
    json: bool,
}

pub(super) fn doctor(args: &DoctorArgs) -> u8 {
    let checks = doctor::examine();
    for check in &checks {
        if args.json {
            let mut line = serde_json::to_value(check).unwrap_or_default();
            line["event"] = json!("check");
            anstream::println!("{line}");
        } else {
            let word = match check.verdict {
                Verdict::Ok => "ok",
                Verdict::Degraded => "degraded",
                Verdict::Failed => "FAILED",
            };
            anstream::println!("{word:9} {:18} {}", check.name, check.found);
            if let Some(fix) = &check.fix {
                anstream::println!("{:28} {}", "", check.matters);
                anstream::println!("{:28} -> {fix}", "");
            }
        }
    }
    let failed = checks.iter().any(|check| check.verdict == Verdict::Failed);
    if failed { exit::FAILED } else { exit::OK }
}
