//! What was measured of one case: a histogram a round.

use std::fmt::Write as _;
use std::io;
use std::path::{Path, PathBuf};

use hdrhistogram::Histogram;

/// The quantiles that are told, and their names.
pub const QUANTILES: [(f64, &str); 4] = [(0.5, "p50"), (0.99, "p99"), (0.999, "p99.9"), (1.0, "max")];
/// Three digits from 1 ns to 100 s.
const DIGITS: u8 = 3;
const LARGEST_NS: u64 = 100_000_000_000;
/// Points in each halving of the distance to 100 %, in a file.
const POINTS: u32 = 5;

/// A histogram of durations whose memory has been touched: recording in it neither allocates nor faults.
pub(super) fn histogram() -> Histogram<u64> {
    let mut histogram = Histogram::new_with_bounds(1, LARGEST_NS, DIGITS).expect("bounds a histogram can have");
    histogram.reset();
    histogram
}

/// The rounds of one case, nanoseconds.
#[derive(Clone, Debug)]
pub struct Series {
    /// What was measured.
    pub case: String,
    rounds: Vec<Histogram<u64>>,
}

impl Series {
    pub(super) fn new(case: impl Into<String>) -> Self {
        Self { case: case.into(), rounds: Vec::new() }
    }

    /// Adds a round; one in which nothing was measured is none.
    pub(super) fn add(&mut self, round: Histogram<u64>) {
        if !round.is_empty() {
            self.rounds.push(round);
        }
    }

    /// Nothing was measured.
    pub fn is_empty(&self) -> bool {
        self.rounds.is_empty()
    }

    /// How many durations were measured.
    pub fn samples(&self) -> u64 {
        self.rounds.iter().map(Histogram::len).sum()
    }

    /// Median over the rounds of a round's quantile, nanoseconds; of the maximum the largest of all.
    pub fn quantile_ns(&self, quantile: f64) -> f64 {
        let mut values: Vec<u64> = self.rounds.iter().map(|round| round.value_at_quantile(quantile)).collect();
        values.sort_unstable();
        match values.as_slice() {
            [] => f64::NAN,
            all if quantile >= 1.0 => all[all.len() - 1] as f64,
            all if all.len() % 2 == 1 => all[all.len() / 2] as f64,
            all => (all[all.len() / 2 - 1] + all[all.len() / 2]) as f64 / 2.0,
        }
    }

    /// All rounds together.
    pub fn whole(&self) -> Histogram<u64> {
        let mut whole = histogram();
        for round in &self.rounds {
            whole.add(round).expect("the same bounds");
        }
        whole
    }

    /// All rounds together as text, a line for each step of the distribution: value in nanoseconds, share of all that are
    /// not larger, how many these are, and 1/(1 - share). This is the format HdrHistogram's own tools write and plot.
    pub fn to_hgrm(&self) -> String {
        let whole = self.whole();
        let mut text =
            format!("{:>12} {:>14} {:>10} {:>14}\n\n", "Value", "Percentile", "TotalCount", "1/(1-Percentile)");
        for step in whole.iter_quantiles(POINTS) {
            let share = step.quantile_iterated_to();
            let _ = write!(
                text,
                "{:12.3} {share:2.12} {:10}",
                step.value_iterated_to() as f64,
                whole.count_between(0, step.value_iterated_to())
            );
            if share < 1.0 {
                let _ = write!(text, " {:14.2}", 1.0 / (1.0 - share));
            }
            text.push('\n');
        }
        let _ = writeln!(text, "#[Mean    = {:12.3}, StdDeviation   = {:12.3}]", whole.mean(), whole.stdev());
        let _ = writeln!(text, "#[Max     = {:12.3}, Total count    = {:12}]", whole.max() as f64, whole.len());
        let _ = writeln!(text, "#[Buckets = {:12}, SubBuckets     = {:12}]", whole.buckets(), 1 << (DIGITS * 4 - 1));
        text
    }

    /// Writes [`Self::to_hgrm`] into a folder, as `<bench>-<case>.hgrm`.
    ///
    /// # Errors
    /// The folder cannot be written to.
    pub fn save(&self, folder: &Path, bench: &str) -> io::Result<PathBuf> {
        let plain = |c: char| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' };
        let case: String = self.case.chars().map(plain).collect();
        std::fs::create_dir_all(folder)?;
        let path = folder.join(format!("{bench}-{case}.hgrm"));
        std::fs::write(&path, self.to_hgrm())?;
        Ok(path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn round(values: &[u64]) -> Histogram<u64> {
        let mut round = histogram();
        values.iter().for_each(|value| round.record(*value).expect("in bounds"));
        round
    }

    /// One round in which the machine did something else does not move the quantiles; the maximum tells of it.
    #[test]
    fn a_quantile_is_the_median_of_the_rounds() {
        let mut series = Series::new("case");
        for value in [10, 11, 900] {
            series.add(round(&[value]));
        }
        series.add(round(&[]));
        assert_eq!((series.quantile_ns(0.5), series.quantile_ns(1.0), series.samples()), (11.0, 900.0, 3));
        series.add(round(&[13]));
        assert_eq!(series.quantile_ns(0.99), 12.0);
    }

    /// What is saved can be read back: the last line holds the maximum and all that were counted.
    #[test]
    fn a_saved_series_holds_the_distribution() {
        let folder = tempfile::TempDir::new().expect("a temporary folder");
        let mut series = Series::new("bare loop, 1 kHz");
        series.add(round(&(1..=1_000).collect::<Vec<_>>()));
        let path = series.save(folder.path(), "jitter").expect("writable");
        assert_eq!(path.file_name().and_then(|name| name.to_str()), Some("jitter-bare-loop--1-khz.hgrm"));
        let text = std::fs::read_to_string(path).expect("written");
        let rows: Vec<Vec<f64>> = text
            .lines()
            .skip(2)
            .filter(|line| !line.starts_with('#'))
            .map(|line| line.split_whitespace().map(|field| field.parse().expect("a number")).collect())
            .collect();
        let median = rows.iter().find(|row| row[1] >= 0.5).expect("half of all");
        assert_eq!(median[0], 500.0, "{text}");
        let last = rows.last().expect("a line");
        assert_eq!((last[0], last[1], last[2]), (1000.0, 1.0, 1000.0), "{text}");
    }
}
