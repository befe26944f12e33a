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
            anstream::println!("{:9} {:22} {}", check.verdict.name(), check.name, check.found);
            if check.verdict != Verdict::Ok {
                anstream::println!("{:9} {:22} -> {}", "", "", check.fix);
            }
        }
    }
    let failed = checks.iter().any(|check| check.verdict == Verdict::Failed);
    if failed { exit::FAILED } else { exit::OK }
}
