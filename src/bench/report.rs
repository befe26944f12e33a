//! What a bench found.

use serde::Serialize;

use super::conditions::{Conditions, Ticks};
use super::{Bench, QUANTILES, Series};
use crate::plot::{Figure, Line, Panel};

/// One figure beside its baseline.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Which bench.
    pub bench: &'static str,
    /// What was measured, and which quantile of it.
    pub case: String,
    /// Our figure.
    pub ours: f64,
    /// The baseline, if there is one.
    pub peer: Option<String>,
    /// Its figure.
    pub peer_value: Option<f64>,
    /// Of both figures.
    pub unit: &'static str,
    /// Ours by the baseline's.
    pub ratio: Option<f64>,
}

/// A number that was counted, and what it is held to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// What was counted.
    pub what: String,
    /// The number.
    pub found: f64,
    /// It may be as large as that; none = it is only told.
    pub allowed: Option<f64>,
    /// Of both.
    pub unit: &'static str,
}

impl Finding {
    /// Whether it is within what is allowed.
    pub fn holds(&self) -> bool {
        self.allowed.is_none_or(|allowed| self.found <= allowed)
    }
}

/// What a bench found, and under what conditions.
#[derive(Clone, Debug)]
pub struct Report {
    /// Which bench.
    pub bench: Bench,
    /// Under what conditions.
    pub conditions: Conditions,
    /// Every case, baselines too, in the order they took turns.
    pub series: Vec<Series>,
    /// Every comparison.
    pub rows: Vec<Row>,
    /// Numbers that are held to something.
    pub findings: Vec<Finding>,
    /// What else has to be known to read the figures: what is absent, missed cycles, and the like.
    pub notes: Vec<String>,
    ticks: Ticks,
}

impl Report {
    pub(super) fn begin(bench: Bench) -> Self {
        Self {
            bench,
            conditions: Conditions::now(),
            series: Vec::new(),
            rows: Vec::new(),
            findings: Vec::new(),
            notes: Vec::new(),
            ticks: Ticks::now(),
        }
    }

    /// The distribution of every case: how many microseconds are not exceeded by all but one in ten, hundred, thousand.
    pub fn distributions(&self) -> Figure {
        /// Steps of the common axis, and how many make a factor of ten.
        const STEPS: u32 = 40;
        const STEPS_A_DECADE: f64 = 10.0;
        let line = |series: &Series| {
            let whole = series.whole();
            let decades = (0..=STEPS).map(|step| f64::from(step) / STEPS_A_DECADE);
            // Past the last sample there is nothing to show.
            let shown = decades.take_while(|decades| 10_f64.powf(*decades) <= whole.len() as f64);
            let point = |decades: f64| {
                let value = whole.value_at_quantile(1.0 - 10_f64.powf(-decades)).max(1);
                [decades, (value as f64 * 1e-3).log10()]
            };
            Line { name: series.case.clone(), points: shown.map(point).collect() }
        };
        Figure {
            title: format!("tandem bench {}", self.bench.name()),
            x_label: "all but one in ten to the power of".to_owned(),
            panels: vec![Panel {
                y_label: "log10 of microseconds".to_owned(),
                y_max: None,
                lines: self.series.iter().filter(|series| !series.is_empty()).map(line).collect(),
            }],
            bands: Vec::new(),
        }
    }

    pub(super) fn end(&mut self) {
        self.conditions.end(self.ticks);
    }

    pub(super) fn note(&mut self, note: impl Into<String>) {
        self.notes.push(note.into());
    }

    pub(super) fn finding(&mut self, what: impl Into<String>, found: f64, allowed: Option<f64>, unit: &'static str) {
        self.findings.push(Finding { what: what.into(), found, allowed, unit });
    }

    /// Whether everything that is held to something is within it.
    pub fn holds(&self) -> bool {
        self.findings.iter().all(Finding::holds)
    }

    /// Adds a series; one in which nothing was measured is left out.
    pub(super) fn add(&mut self, series: Series) {
        if !series.is_empty() {
            self.series.push(series);
        }
    }

    fn find(&self, case: &str) -> Option<&Series> {
        self.series.iter().find(|series| series.case == case)
    }

    /// Sets a case beside its baseline, quantile by quantile; alone when the baseline is absent.
    pub(super) fn compare(&mut self, case: &str, peer: Option<&str>) {
        let Some(ours) = self.find(case) else { return };
        let peer = peer.and_then(|peer| self.find(peer));
        let rows: Vec<Row> = QUANTILES
            .iter()
            .map(|(quantile, name)| {
                let value = ours.quantile_ns(*quantile) / 1e3;
                let peer_value = peer.map(|peer| peer.quantile_ns(*quantile) / 1e3);
                Row {
                    bench: self.bench.name(),
                    case: format!("{case}, {name}"),
                    ours: value,
                    peer: peer.map(|peer| peer.case.clone()),
                    peer_value,
                    unit: "us",
                    // Below the clock's resolution there is nothing to divide by.
                    ratio: peer_value.filter(|peer| *peer > 0.0).map(|peer| value / peer),
                }
            })
            .collect();
        self.rows.extend(rows);
    }

    /// Sets a case beside a value that was not measured but designed, in microseconds.
    pub(super) fn compare_with(&mut self, case: &str, peer: &str, designed: f64) {
        let Some(ours) = self.find(case) else { return };
        let values = QUANTILES.map(|(quantile, name)| (format!("{case}, {name}"), ours.quantile_ns(quantile) / 1e3));
        for (case, value) in values {
            self.figure(case, value, Some((peer, designed)), "us");
        }
    }

    /// Adds one figure.
    fn figure(&mut self, case: impl Into<String>, ours: f64, peer: Option<(&str, f64)>, unit: &'static str) {
        self.rows.push(Row {
            bench: self.bench.name(),
            case: case.into(),
            ours,
            peer: peer.map(|(name, _)| name.to_owned()),
            peer_value: peer.map(|(_, value)| value),
            unit,
            ratio: peer.map(|(_, value)| value).filter(|value| *value > 0.0).map(|value| ours / value),
        });
    }
}
