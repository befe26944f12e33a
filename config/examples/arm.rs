//! Reads one URDF the way a cell does, says what became of it and how long that took.
//!
//! `cargo run --release -p tandem-config --example arm -- FILE [--package FOLDER]… [--srdf FILE] [--tcp LINK]
//! [--lock JOINT]… [--hulls]`
#![allow(clippy::disallowed_methods, clippy::disallowed_macros, reason = "a command prints and measures")]

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;
use tandem_config::{Collision, Robot, RobotOptions};

fn main() -> ExitCode {
    let mut file = None;
    let mut options = RobotOptions::default();
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        let mut value = || words.next().unwrap_or_default();
        match word.as_str() {
            "--package" => options.packages.push(value().into()),
            "--srdf" => {
                let name = PathBuf::from(value());
                match std::fs::read_to_string(&name) {
                    Ok(text) => options.srdf = Some((name, text)),
                    Err(error) => return refused(&format!("{}: {error}", name.display())),
                }
            }
            "--tcp" => options.tcp = Some(value()),
            "--lock" => options.locked.push(value()),
            "--hulls" => options.collision = Collision::Hulls,
            _ => file = Some(word),
        }
    }
    let Some(file) = file else { return refused("name a URDF file") };
    let began = Instant::now();
    match Robot::load(Path::new(&file), &options) {
        Ok(robot) => {
            let took = began.elapsed().as_secs_f64();
            let body = &robot.body;
            println!(
                "{}: {} joints, {} shapes, {} pairs of them checked, {} meshes, {took:.2} s",
                robot.name,
                robot.chain.joint_count(),
                body.capsules().len(),
                body.self_pairs().count(),
                robot.meshes.len(),
            );
            for note in &robot.notes {
                println!("  {note}");
            }
            ExitCode::SUCCESS
        }
        Err(faults) => refused(&faults.to_string()),
    }
}

fn refused(why: &str) -> ExitCode {
    eprintln!("{why}");
    ExitCode::FAILURE
}
