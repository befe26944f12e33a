//! Interleaved rounds and the table they make.

use std::hint::black_box;
use std::time::Instant;

use crate::{Absent, Program};

/// Rounds of a full comparison.
const ROUNDS: usize = 15;

/// Nanoseconds a call of `call(0..count)`: the least of three passes, as what else runs only adds.
pub fn per_call<T>(count: u32, mut call: impl FnMut(u32) -> T) -> f64 {
    let mut pass = || {
        let began = Instant::now();
        for index in 0..count {
            black_box(call(black_box(index)));
        }
        began.elapsed().as_nanos() as f64 / f64::from(count.max(1))
    };
    pass().min(pass()).min(pass())
}

/// One who takes part in a comparison: its name, and what measures one round of it.
pub struct Contender<'a> {
    name: &'a str,
    round: Box<dyn FnMut() -> f64 + 'a>,
}

impl<'a> Contender<'a> {
    /// A contender whose `round` answers one figure, in the unit of the comparison.
    pub fn new(name: &'a str, round: impl FnMut() -> f64 + 'a) -> Self {
        Self { name, round: Box::new(round) }
    }
}

/// What came out for one peer.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Name of the peer, or none when we stood alone.
    pub peer: Option<String>,
    /// Our figure: median of the rounds.
    pub ours: f64,
    /// The peer's, likewise.
    pub peer_value: Option<f64>,
    /// Ours over the peer's, of the medians.
    pub ratio: Option<f64>,
    /// Ours over the peer's, of the least rounds.
    pub ratio_least: Option<f64>,
}

/// One bench target.
pub struct Bench {
    name: String,
    brief: bool,
}

impl Bench {
    /// The bench `name`; brief unless `cargo bench` started it.
    pub fn new(name: &str) -> Self {
        Self { name: name.to_owned(), brief: !std::env::args().any(|argument| argument == "--bench") }
    }

    /// Whether this is the short run of the tests: one round, nothing installed.
    pub fn is_brief(&self) -> bool {
        self.brief
    }

    /// A peer that is a program; `None`, and a line that says why, when it cannot be had or the run is brief.
    pub fn program(&self, name: &str, start: impl FnOnce() -> Result<Program, Absent>) -> Option<Program> {
        let started = if self.brief { Err(Absent("only cargo bench starts it".into())) } else { start() };
        started.map_err(|absent| eprintln!("{}: SKIPPED peer {name}: {absent}", self.name)).ok()
    }

    /// Lets the contenders take turns and reports the first against each of the others: a JSON
    /// object a peer to standard output, a table to standard error. With one contender peer fields are null.
    ///
    /// # Panics
    /// Without a contender, or when a round's figure is not finite.
    pub fn compare(&self, case: &str, unit: &str, mut contenders: Vec<Contender<'_>>) -> Vec<Row> {
        let count = contenders.len();
        assert!(count > 0, "{}: {case}: nobody to measure", self.name);
        let mut figures = vec![Vec::new(); count];
        for round in 0..if self.brief { 1 } else { ROUNDS } {
            for turn in 0..count {
                let who = (turn + round) % count;
                let figure = (contenders[who].round)();
                assert!(figure.is_finite(), "{}: {case}: {} answered {figure}", self.name, contenders[who].name);
                figures[who].push(figure);
            }
        }
        for figures in &mut figures {
            figures.sort_by(f64::total_cmp);
        }
        let names: Vec<&str> = contenders.iter().map(|contender| contender.name).collect();
        let rows = rows(&names, &figures);
        for row in &rows {
            println!("{}", row.json(&self.name, case, unit));
        }
        self.print_table(case, unit, &names, &figures);
        rows
    }

    fn print_table(&self, case: &str, unit: &str, names: &[&str], figures: &[Vec<f64>]) {
        eprintln!("{}: {case} [{unit}], {} round(s)", self.name, figures[0].len());
        for (name, figures) in names.iter().zip(figures) {
            eprintln!("    {name:<24} median {:>12.3}   least {:>12.3}", median(figures), figures[0]);
        }
        for row in rows(names, figures) {
            if let (Some(peer), Some(ratio), Some(least)) = (row.peer, row.ratio, row.ratio_least) {
                eprintln!("    {:<24} {ratio:>19.3}   of the least {least:>5.3}", format!("{} / {peer}", names[0]));
            }
        }
    }
}

/// The first against each other one; figures are sorted and not empty.
fn rows(names: &[&str], figures: &[Vec<f64>]) -> Vec<Row> {
    let ours = median(&figures[0]);
    if names.len() == 1 {
        return vec![Row { peer: None, ours, peer_value: None, ratio: None, ratio_least: None }];
    }
    let against = |(name, peer): (&&str, &Vec<f64>)| Row {
        peer: Some((*name).to_owned()),
        ours,
        peer_value: Some(median(peer)),
        ratio: Some(ours / median(peer)),
        ratio_least: Some(figures[0][0] / peer[0]),
    };
    names.iter().zip(figures).skip(1).map(against).collect()
}

fn median(sorted: &[f64]) -> f64 {
    sorted[sorted.len() / 2]
}

impl Row {
    fn json(&self, bench: &str, case: &str, unit: &str) -> String {
        let number = |value: Option<f64>| match value {
            Some(value) if value.is_finite() => format!("{value:.4}"),
            _ => "null".to_owned(),
        };
        let peer = self.peer.as_ref().map_or("null".to_owned(), |peer| format!("{peer:?}"));
        format!(
            "{{\"bench\":{bench:?},\"case\":{case:?},\"ours\":{},\"peer\":{peer},\"peer_value\":{},\"unit\":{unit:?},\"ratio\":{},\"ratio_least\":{}}}",
            number(Some(self.ours)),
            number(self.peer_value),
            number(self.ratio),
            number(self.ratio_least)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Everyone has as many turns as everyone else, and each begins in turn.
    #[test]
    fn contenders_take_turns() {
        let order = std::cell::RefCell::new(Vec::new());
        let contender = |name| {
            let order = &order;
            Contender::new(name, move || {
                order.borrow_mut().push(name);
                if name == "a" { 1.0 } else { 4.0 }
            })
        };
        let bench = Bench { name: "turns".into(), brief: false };
        let rows = bench.compare("order", "ns", vec![contender("a"), contender("b"), contender("c")]);
        let order = order.borrow();
        assert_eq!(order.len(), 3 * ROUNDS);
        assert_eq!(order[..6], ["a", "b", "c", "b", "c", "a"]);
        assert_eq!(rows.len(), 2);
        assert_eq!((rows[1].peer.as_deref(), rows[1].ratio, rows[1].ratio_least), (Some("c"), Some(0.25), Some(0.25)));
        assert_eq!(
            rows[0].json("turns", "order", "ns"),
            r#"{"bench":"turns","case":"order","ours":1.0000,"peer":"b","peer_value":4.0000,"unit":"ns","ratio":0.2500,"ratio_least":0.2500}"#
        );
    }

    /// Alone, the peer's fields are null; the median is that of the rounds.
    #[test]
    fn one_contender_stands_alone() {
        let mut next = 0.0;
        let counting = Contender::new("ours", || {
            next += 1.0;
            next
        });
        let rows = Bench { name: "alone".into(), brief: false }.compare("count", "1", vec![counting]);
        assert_eq!(
            rows[0].json("alone", "count", "1"),
            r#"{"bench":"alone","case":"count","ours":8.0000,"peer":null,"peer_value":null,"unit":"1","ratio":null,"ratio_least":null}"#
        );
    }

    /// The brief run starts no program.
    #[test]
    fn a_brief_run_installs_nothing() {
        let bench = Bench { name: "brief".into(), brief: true };
        assert!(bench.program("peer", || panic!("the brief run must not come here")).is_none());
    }
}
