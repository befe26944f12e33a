//! One calculation beside ruckig's C++, its crate and rsruckig.
//!
//! The peers are a crate of their own (`peers/`), so that only who compares compiles C++: `cargo bench`
//! builds and runs that. In the tests this runs our own side once, briefly.
#![allow(clippy::disallowed_types, clippy::disallowed_macros, clippy::disallowed_methods, reason = "a bench may")]

use std::{path::Path, process::Command};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    if std::env::args().any(|argument| argument == "--bench") {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("peers");
        let status = Command::new(env!("CARGO"))
            .args(["run", "--release", "--manifest-path"])
            .arg(folder.join("Cargo.toml"))
            .arg("--target-dir")
            .arg(folder.join("../../../target/peers/trajectory"))
            .arg("--")
            .args(arguments)
            // An incremental build is for editing, not for measuring.
            .env("CARGO_PROFILE_RELEASE_INCREMENTAL", "false")
            .status()?;
        return if status.success() { Ok(()) } else { Err(format!("the peers ended with {status}").into()) };
    }
    let mut input = tandem_trajectory::Input::<7>::default();
    for (joint, target) in input.target.iter_mut().enumerate() {
        target.position = joint as f64 - 3.0;
    }
    let begin = std::time::Instant::now();
    let rounds = 1000;
    for _ in 0..rounds {
        std::hint::black_box(tandem_trajectory::Trajectory::calculate(std::hint::black_box(&input))?);
    }
    let ours = begin.elapsed().as_nanos() / rounds;
    println!(
        r#"{{"bench":"trajectory","case":"from rest to rest, 7 joints","ours":{ours},"peer":null,"peer_value":null,"unit":"ns","ratio":null}}"#
    );
    eprintln!("the peers are skipped: `cargo bench -p tandem-trajectory --bench peers` builds them");
    Ok(())
}
