//! How much faster than real time is a cell in lockstep? One box of the shipped cell a round.
//!
//! `cargo bench --bench lockstep` runs five rounds and prints the median; run by `cargo test` it
//! does a few seconds of cell time, once, so that it never rots.

use std::path::Path;
use std::time::Instant;

use tandem::lockstep::SimCell;
use tandem::strategy::store::{RunRecord, Store};
use tandem::supervisor::RunOptions;
use tandem_config::Cell;
use tandem_msg::Stamp;

/// Cell time of a brief round, nanoseconds.
const BRIEF: Stamp = Stamp(5_000_000_000);

fn main() {
    let brief = !std::env::args().any(|argument| argument == "--bench");
    let rounds = if brief { 1 } else { 5 };
    let mut speeds: Vec<f64> = (1..=rounds).map(|seed| round(seed, brief)).collect();
    speeds.sort_by(f64::total_cmp);
    let median = speeds[speeds.len() / 2];
    println!(
        "{{\"bench\":\"lockstep\",\"case\":\"s471-box\",\"ours\":{median:.1},\"peer\":null,\"peer_value\":null,\"unit\":\"cell seconds per second\",\"ratio\":null}}"
    );
}

/// Cell seconds per second of one box.
fn round(seed: u64, brief: bool) -> f64 {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/cells/s471.toml");
    let cell = Cell::load(&file, None).unwrap_or_else(|faults| panic!("{faults}"));
    let folder = tempfile::tempdir().expect("a temporary folder");
    let url = format!("sqlite://{}", folder.path().join("bench.db").display());
    let store = Store::open(&url).expect("an empty folder takes a database");
    store.seed(&cell.strategies).expect("the strategies are stored");
    let run_id = format!("bench-{seed}");
    let record = RunRecord {
        id: run_id.clone(),
        cell: cell.name.clone(),
        product: cell.product.name.clone(),
        config_hash: cell.hash,
        seed,
        boxes: 1,
        started_ns: 0,
    };
    store.begin(&record).expect("the run is recorded");
    let library = store.library().expect("the library is read");
    let options = RunOptions { boxes: 1, seed, run_id };
    let mut sim = SimCell::new(&cell, library, options).unwrap_or_else(|error| panic!("{error}"));
    let began = Instant::now();
    let enough = |sim: &SimCell| brief && sim.now() > BRIEF;
    sim.run(&store, &mut |_| {}, enough).unwrap_or_else(|error| panic!("{error}"));
    sim.now().as_secs_f64() / began.elapsed().as_secs_f64()
}
