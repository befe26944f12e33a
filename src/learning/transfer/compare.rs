//! Every method under every seed, side by side; what is done already is read back.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::agent::Agent;
use super::protocol::{Method, SEEDS, Settings};
use super::run::{Ground, Outcome};
use crate::learning::encoder::train::TrainError;

/// One method with one number of labels, over the seeds.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// How.
    pub method: Method,
    /// Labels a class.
    pub labels: usize,
    /// Test accuracy of each seed.
    pub accuracies: Vec<f64>,
}

impl Row {
    /// Mean over the seeds.
    pub fn mean(&self) -> f64 {
        self.accuracies.iter().sum::<f64>() / self.accuracies.len().max(1) as f64
    }

    /// Standard deviation over the seeds.
    pub fn spread(&self) -> f64 {
        let mean = self.mean();
        let squares: f64 = self.accuracies.iter().map(|a| (a - mean) * (a - mean)).sum();
        (squares / self.accuracies.len().saturating_sub(1).max(1) as f64).sqrt()
    }
}

/// Every run of the comparison.
pub fn jobs(seeds: usize) -> Vec<(Method, usize, u64)> {
    let mut jobs = Vec::new();
    for &seed in &SEEDS[..seeds.min(SEEDS.len())] {
        for method in Method::ALL {
            jobs.extend(method.labels().iter().map(|&labels| (method, labels, seed)));
        }
    }
    jobs
}

fn file_name((method, labels, seed): (Method, usize, u64)) -> String {
    format!("{method}-{labels}-{seed}")
}

/// The outcome of a job in a folder, if it is of this source.
pub fn done(folder: &Path, job: (Method, usize, u64), source_blake3: &str) -> Option<Outcome> {
    let text = std::fs::read_to_string(folder.join(file_name(job) + ".json")).ok()?;
    let outcome: Outcome = serde_json::from_str(&text).ok()?;
    (outcome.source_blake3 == source_blake3 && outcome.settings == Settings::of(job.0)).then_some(outcome)
}

/// Makes the runs that are missing in `folder`, `threads` at a time; `progress` hears of each.
///
/// # Errors
/// [`TrainError`] of the first that fails.
pub fn complete(
    ground: &Ground,
    agent: &Agent,
    jobs: &[(Method, usize, u64)],
    folder: &Path,
    threads: usize,
    progress: &(dyn Fn(&Outcome) + Sync),
) -> Result<Vec<Outcome>, TrainError> {
    let next = AtomicUsize::new(0);
    let results = Mutex::new(BTreeMap::new());
    let work = || -> Result<(), TrainError> {
        loop {
            let index = next.fetch_add(1, Ordering::Relaxed);
            let Some(&job) = jobs.get(index) else { return Ok(()) };
            let outcome = match done(folder, job, ground.source_blake3()) {
                Some(outcome) => outcome,
                None => {
                    let out = folder.join(file_name(job));
                    let settings = Settings::of(job.0);
                    let outcome = ground.transfer(job, settings, Some(agent), &out, &mut |_| ())?;
                    let file = folder.join(file_name(job) + ".json");
                    let text = serde_json::to_string(&outcome).unwrap_or_default();
                    std::fs::write(&file, text).map_err(|source| TrainError::File { file, source })?;
                    progress(&outcome);
                    outcome
                }
            };
            results.lock().unwrap_or_else(std::sync::PoisonError::into_inner).insert(index, outcome);
        }
    };
    std::fs::create_dir_all(folder).map_err(|source| TrainError::File { file: folder.to_owned(), source })?;
    std::thread::scope(|scope| {
        let workers: Vec<_> = (1..threads).map(|_| scope.spawn(work)).collect();
        let mut result = work();
        for worker in workers {
            match worker.join() {
                Ok(other) => result = result.and(other),
                Err(panic) => std::panic::resume_unwind(panic),
            }
        }
        result
    })?;
    Ok(results.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner).into_values().collect())
}

/// Rows of a comparison, in the order of [`Method::ALL`].
pub fn rows(outcomes: &[Outcome]) -> Vec<Row> {
    let mut rows: BTreeMap<(Method, usize), Row> = BTreeMap::new();
    for outcome in outcomes {
        let (method, labels) = (outcome.method, outcome.labels);
        let row = rows.entry((method, labels)).or_insert_with(|| Row { method, labels, accuracies: Vec::new() });
        row.accuracies.push(outcome.metrics.accuracy);
    }
    rows.into_values().collect()
}
