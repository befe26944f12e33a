//! Times tandem-trajectory against ruckig (its C++, and the crate that binds it) and rsruckig.
//!
//! All solve the same random inputs (ruckig's benchmark distribution). Blocks of 256 inputs go through the
//! libraries in turn, in rotating order, in three passes; an input's time is its least over the passes, less
//! that of an empty measurement. Only ratios within one run mean anything.
//!
//! One JSON object a line on standard output, the table on standard error.
//! `cargo bench -p tandem-trajectory --bench peers [-- INPUTS]` builds and runs this.

mod contenders;
mod cpp;
mod inputs;

use contenders::{Binding, Contender, Cpp, Port, Tandem};
use inputs::{Problem, Source};
use std::time::Instant;

const BLOCK: usize = 256;
const PASSES: usize = 3;
/// Times at which a trajectory is evaluated, of every eighth one.
const INSTANTS: usize = 64;
const EVALUATED: usize = 8;

/// The least nanoseconds of each input, for one library and one question.
#[derive(Clone)]
struct Times(Vec<f64>);

impl Times {
    fn new(count: usize) -> Self {
        Times(vec![f64::INFINITY; count])
    }

    fn record(&mut self, index: usize, start: Instant) {
        let nanos = start.elapsed().as_nanos() as f64;
        self.0[index] = self.0[index].min(nanos);
    }

    /// What each call took, of `calls` in a measurement, without the time of measuring nothing.
    fn figures(&self, empty: f64, calls: f64) -> Figures {
        let measured = self.0.iter().filter(|time| time.is_finite());
        let mut times: Vec<f64> = measured.map(|time| (time - empty).max(0.0) / calls).collect();
        times.sort_by(f64::total_cmp);
        let at = |share: f64| times[((times.len() - 1) as f64 * share) as usize];
        let mean = times.iter().sum::<f64>() / times.len() as f64;
        Figures { mean, median: at(0.5), p99: at(0.99), p999: at(0.999), most: at(1.0) }
    }
}

struct Figures {
    mean: f64,
    median: f64,
    p99: f64,
    p999: f64,
    most: f64,
}

/// The table of one question, and its rows: the mean against each other library, and our own tail.
fn report(case: &str, names: &[&str], figures: &[Figures]) {
    for (name, Figures { mean, median, p99, p999, most }) in names.iter().zip(figures) {
        let ratio = figures[0].mean / mean;
        let tail = p999 / mean;
        eprintln!(
            "{case:<26} {name:<18} mean {mean:>8.1}  median {median:>8.1}  p99 {p99:>8.1}  p99.9 {p999:>8.1}  max {most:>8.1} ns  p99.9/mean {tail:>5.2}  ours/this {ratio:>5.3}"
        );
    }
    let ours = figures[0].mean;
    for (name, other) in names.iter().zip(figures).skip(1) {
        println!(
            r#"{{"bench":"trajectory","case":"{case}, mean","ours":{ours:.1},"peer":"{name}","peer_value":{:.1},"unit":"ns","ratio":{:.4}}}"#,
            other.mean,
            ours / other.mean
        );
    }
    println!(
        r#"{{"bench":"trajectory","case":"{case}, p99.9","ours":{:.1},"peer":"own mean","peer_value":{ours:.1},"unit":"ns","ratio":{:.4}}}"#,
        figures[0].p999,
        figures[0].p999 / ours
    );
}

fn compare<const N: usize>(count: usize, velocity: bool, empty: f64) {
    let mut source = Source::new(1000 + N as u64);
    let problems: Vec<[Problem; N]> = (0..count).map(|_| std::array::from_fn(|_| source.problem())).collect();
    let mut contenders: [Box<dyn Contender>; 4] = [
        Box::new(Tandem::new(&problems, velocity)),
        Box::new(Cpp::new(&problems, velocity)),
        Box::new(Binding::new(&problems, velocity)),
        Box::new(Port::new(&problems, velocity)),
    ];
    let shares: Vec<f64> = (0..INSTANTS).map(|_| source.uniform(0.0, 1.0)).collect();
    let [mut solve, mut random, mut rising] = [(); 3].map(|()| vec![Times::new(count); contenders.len()]);
    let mut durations = vec![[None; 2]; count];
    for pass in 0..PASSES {
        for (block, begin) in (0..count).step_by(BLOCK).enumerate() {
            for turn in 0..contenders.len() {
                let which = (turn + block + pass) % contenders.len();
                let contender = &mut contenders[which];
                // Once untimed: what the library before has left of the caches is no property of this one.
                contender.calculate(begin);
                for index in begin..(begin + BLOCK).min(count) {
                    let start = Instant::now();
                    contender.calculate(index);
                    solve[which].record(index, start);
                    let duration = contender.duration();
                    if let Some(found) = durations[index].get_mut(which) {
                        *found = duration;
                    }
                    let Some(duration) = duration.filter(|_| index % EVALUATED == 0) else { continue };
                    let mut times: Vec<f64> = shares.iter().map(|share| share * duration).collect();
                    let start = Instant::now();
                    contender.at_random(&times);
                    random[which].record(index, start);
                    times.sort_by(f64::total_cmp);
                    let start = Instant::now();
                    contender.at_rising(&times);
                    rising[which].record(index, start);
                }
            }
        }
    }
    let names = contenders.each_ref().map(|contender| contender.name());
    let case = format!("{} {N} joint{}", if velocity { "velocity" } else { "position" }, if N == 1 { "" } else { "s" });
    for (times, what, calls) in
        [(solve, "", 1), (random, ", random times", INSTANTS), (rising, ", rising times", INSTANTS)]
    {
        let figures: Vec<Figures> = times.iter().map(|times| times.figures(empty, calls as f64)).collect();
        report(&format!("{case}{what}"), &names, &figures);
    }
    let differs = |[ours, theirs]: &&[Option<f64>; 2]| match (ours, theirs) {
        (Some(ours), Some(theirs)) => (ours - theirs).abs() > 1e-8 * theirs.max(1.0),
        _ => true,
    };
    let differing = durations.iter().filter(differs).count();
    eprintln!("durations that differ from those of the C++ by more than 1e-8: {differing} of {count}\n");
}

/// What a measurement of nothing takes.
fn empty() -> f64 {
    let nothing = |_| Instant::now().elapsed().as_nanos() as f64;
    (0..10_000).map(nothing).fold(f64::INFINITY, f64::min)
}

fn main() {
    let count = std::env::args().find_map(|count| count.parse().ok()).unwrap_or(20_000);
    let empty = empty();
    eprintln!(
        "{count} inputs a case, {PASSES} passes, least of each input; an empty measurement, {empty} ns, is subtracted\n"
    );
    for velocity in [false, true] {
        compare::<1>(count, velocity, empty);
        compare::<3>(count, velocity, empty);
        compare::<6>(count, velocity, empty);
        compare::<7>(count, velocity, empty);
    }
}
