//! Side-by-side benches: our code and what people use today, in one interleaved run.
//!
//! On a shared machine an absolute time means nothing, and two runs of the same program differ by
//! a third. So contenders take turns, round by round, in rotating order, and only ratios of one
//! run count: that of the medians of the rounds, and that of the least ones.
//!
//! ```no_run
//! use tandem_peers::{Bench, Contender, Program, per_call};
//!
//! let bench = Bench::new("roots");
//! let mut numpy = bench.program("numpy", || {
//!     let python = tandem_peers::python("numpy", &["numpy"])?;
//!     Program::start(python.command().arg("benches/roots.py"))
//! });
//! let mut contenders = vec![Contender::new("ours", || per_call(1_000, |k| f64::from(k).sqrt()))];
//! contenders.extend(numpy.as_mut().map(|numpy| Contender::new("numpy", || numpy.round("sqrt"))));
//! bench.compare("square root", "ns", contenders);
//! ```
//!
//! A peer that lives in a crate is simply called. Any other is a [`Program`] that answers one
//! round a line; [`python`], [`pytorch`], [`cpp`] and [`cargo`] make one from public packages, below
//! `target/peers`, once. What cannot be had (no compiler, no network) is skipped aloud.
//!
//! `cargo bench` measures. A bench that `cargo test` runs (`harness = false`, `test = true`)
//! is brief: one round, programs are left out, nothing is installed.

mod compare;
mod install;
mod program;

pub use compare::{Bench, Contender, Row, per_call};
pub use install::{Python, cargo, cpp, python, pytorch};
pub use program::{Absent, Program};
