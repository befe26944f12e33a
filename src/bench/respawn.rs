//! A publisher that is killed and started anew on bare iceoryx2: what a respawn costs without any role.

use std::time::{Duration, Instant};

use tandem_bus::Instance;
use tandem_bus::direct::{DirectError, Obituary, PubSub};

use super::BenchError;
use super::exchange::peer::ready;
use super::exchange::{Peer, Place};

/// The service on which a death is told.
pub(super) const OBITUARY: &str = "bench/obituary";
const SERVICES: [&str; 2] = ["bench/respawn", "bench/unused"];
const PERIOD: Duration = Duration::from_millis(1);
/// How long another cleaner is waited for.
const CLEANING: Duration = Duration::from_millis(500);
/// Somebody who is not heard by then has failed.
const PATIENCE: Duration = Duration::from_secs(10);
/// Between two looks for dead nodes.
const LOOK: Duration = Duration::from_millis(2);

fn failed(error: DirectError) -> BenchError {
    BenchError::peer("iceoryx2", error.to_string())
}

/// Publishes every millisecond, for ever: the other process.
pub(super) fn publish(instance: &Instance) -> Result<(), BenchError> {
    // It is timed from its start, so it is taken for ready before it has opened anything.
    ready()?;
    let mut ports = PubSub::open(instance, SERVICES[0], SERVICES[1]).map_err(failed)?;
    loop {
        ports.send().map_err(failed)?;
        std::thread::sleep(PERIOD);
    }
}

/// From `kill -9` of such a publisher to the first sample of its successor.
pub(super) fn respawn() -> Result<Duration, BenchError> {
    let place = Place::new("respawn")?;
    let ports = PubSub::open(place.instance(), SERVICES[1], SERVICES[0]).map_err(failed)?;
    let mut first = Peer::start("publish", place.instance().root(), None)?;
    hear(&ports)?;
    let killed = Instant::now();
    first.kill();
    drop(first);
    place.instance().clean_dead(CLEANING);
    // What it had sent before its death is not its successor's.
    while ports.received().map_err(failed)? {}
    let _second = Peer::start("publish", place.instance().root(), None)?;
    hear(&ports)?;
    Ok(killed.elapsed())
}

fn hear(ports: &PubSub) -> Result<(), BenchError> {
    let began = Instant::now();
    while !ports.received().map_err(failed)? {
        if began.elapsed() > PATIENCE {
            return Err(BenchError::peer("the publisher", format!("is not heard within {PATIENCE:?}")));
        }
        std::thread::sleep(Duration::from_micros(100));
    }
    Ok(())
}

/// From `kill -9` of a process to iceoryx2's own word of it, when dead nodes are looked for every 2 ms.
pub(super) fn obituary() -> Result<Duration, BenchError> {
    let place = Place::new("obituary")?;
    let obituary = Obituary::open(place.instance(), OBITUARY).map_err(failed)?;
    let mut mortal = Peer::start("mortal", place.instance().root(), None)?;
    let killed = Instant::now();
    mortal.kill();
    while !obituary.heard(LOOK).map_err(failed)? {
        if killed.elapsed() > PATIENCE {
            return Err(BenchError::peer("iceoryx2", format!("has not told of the death within {PATIENCE:?}")));
        }
    }
    Ok(killed.elapsed())
}
