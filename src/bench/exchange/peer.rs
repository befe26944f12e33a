//! The other process of a bench.

use std::io::Write as _;
use std::path::Path;

use clap::ValueEnum as _;
use tandem_bus::direct::Mortal;
use tandem_cycle::setup::acquire;

use super::{ENDING, Place, REST_OF_PEER, RESTING, Way, open};
use crate::bench::{BenchError, loops, respawn};

/// Does a task of a bench until told to end, or killed.
///
/// # Errors
/// The task is unknown, or cannot be done.
pub fn run(task: &str, root: &Path, cpu: Option<u32>) -> Result<(), BenchError> {
    die_with_parent()?;
    let instance = Place::at(root)?;
    match task {
        "mortal" => {
            let _place = Mortal::open(&instance, respawn::OBITUARY)
                .map_err(|error| BenchError::peer(task, error.to_string()))?;
            ready()?;
            loop {
                std::thread::park();
            }
        }
        "publish" => {
            // As a role's loop is set up.
            let _ = acquire(&loops::wish(cpu));
            respawn::publish(&instance)
        }
        way => {
            let way = Way::from_str(way, false).map_err(|_| BenchError::peer(task, "is no task"))?;
            let _ = acquire(&loops::wish(cpu));
            let mut end = open(way, &instance, false)?;
            ready()?;
            end.connect()?;
            loop {
                let number = end.receive()?;
                if number & ENDING != 0 {
                    return Ok(());
                }
                end.send(number)?;
                if number & RESTING != 0 {
                    std::thread::sleep(REST_OF_PEER);
                }
            }
        }
    }
}

/// Says that it may begin.
pub(in crate::bench) fn ready() -> Result<(), BenchError> {
    let mut output = std::io::stdout();
    writeln!(output, "ready").and_then(|()| output.flush()).map_err(BenchError::io("standard output"))
}

fn die_with_parent() -> Result<(), BenchError> {
    let signal = Some(rustix::process::Signal::KILL);
    rustix::process::set_parent_process_death_signal(signal).map_err(|cause| BenchError::io("prctl")(cause.into()))
}
