//! How long does the planner take, how often does it succeed, and how good are its paths?
//!
//! Random pairs of free positions of the UR5 in the reference scenes with 11 obstacles (a person of ten
//! capsules and a bench) and with 50. A pair counts when our own search of 10 s solves it. `cargo bench -p
//! tandem-planner` takes some minutes, nearly all of them for the pairs that nothing solves.
#![allow(clippy::disallowed_types, clippy::disallowed_methods, clippy::disallowed_macros, reason = "a bench measures")]

#[path = "../tests/reference/mod.rs"]
mod reference;

use std::time::{Duration, Instant};

use reference::{Joints, Lehmer, Robot};
use tandem_clearance::Monitor;
use tandem_peers::{Bench, Contender};
use tandem_planner::{Planner, Progress, Request};

/// What a search that may take its time is given.
const LONG: Duration = Duration::from_secs(10);
/// Seeds whose shortest path stands for the best there is.
const SEEDS: u64 = 20;
/// Ends of a pair keep this, metres.
const FREE: f64 = 0.015;

struct Case {
    monitor: Monitor,
    from: Joints,
    to: Joints,
    request: Request,
}

/// Microseconds for the search alone and with the shortening, or `None` when it was given up.
fn time(robot: &Robot, planner: &mut Planner, case: &Case) -> Option<[f64; 2]> {
    let began = Instant::now();
    planner.begin(&robot.chain, &case.monitor, &[case.from], &[case.to], &case.request);
    let mut searched = None;
    loop {
        let progress = planner.work(&robot.chain, &case.monitor, 16);
        let now = began.elapsed().as_secs_f64() * 1e6;
        if planner.effort().search_looks > 0 {
            searched.get_or_insert(now);
        }
        match progress {
            Progress::Searching => {}
            Progress::Found => return Some([searched.unwrap_or(now), now]),
            Progress::Failed(_) => return None,
        }
    }
}

/// Whether a search that goes on for 10 s finds a path.
fn solved_in_the_end(robot: &Robot, planner: &mut Planner, case: &Case, limit: Duration) -> bool {
    let request = Request { looks_max: u32::MAX, ..case.request };
    planner.begin(&robot.chain, &case.monitor, &[case.from], &[case.to], &request);
    let began = Instant::now();
    let mut progress = Progress::Searching;
    while progress == Progress::Searching && began.elapsed() < limit {
        progress = planner.work(&robot.chain, &case.monitor, 1_000);
    }
    progress == Progress::Found
}

fn length(path: &[Joints]) -> f64 {
    path.windows(2).map(|p| p[0].iter().zip(&p[1]).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()).sum()
}

fn at(sorted: &mut [f64], share: f64) -> f64 {
    sorted.sort_by(f64::total_cmp);
    sorted[((sorted.len() - 1) as f64 * share) as usize]
}

fn row(case: &str, value: f64, unit: &str) {
    println!(
        "{{\"bench\":\"planner\",\"case\":\"{case}\",\"ours\":{value:.4},\"peer\":null,\"peer_value\":null,\"unit\":\"{unit}\",\"ratio\":null}}"
    );
}

fn main() {
    let bench = Bench::new("planner");
    let (pairs, limit) = if bench.is_brief() { (6, Duration::from_millis(100)) } else { (60, LONG) };
    let robot = Robot::new("ur5");
    let mut planner = Planner::new(4_096);
    for obstacles in [11, 50] {
        let scenes = robot.scenes(obstacles);
        let mut draws = Lehmer(2_026);
        let mut solvable = Vec::new();
        let (mut asked, mut solved) = (0, 0);
        for k in 0..pairs {
            let monitor = robot.monitor(&scenes[k % scenes.len()]);
            let Some([from, to]) = robot.free_pair(&monitor, FREE, &mut draws) else { continue };
            asked += 1;
            let case = Case { monitor, from, to, request: Request { seed: k as u64, ..Request::default() } };
            // The same seed: what the short search solves the long one solves as well.
            let soon = time(&robot, &mut planner, &case).is_some();
            solved += u32::from(soon);
            if soon || solved_in_the_end(&robot, &mut planner, &case, limit) {
                solvable.push(case);
            }
        }
        let name = |what: &str| format!("ur5, {obstacles} obstacles, {} of {asked} pairs: {what}", solvable.len());
        row(&name("solved of those that 10 s solve"), f64::from(solved) / solvable.len() as f64, "share");

        let (mut longer, mut shortened) = (Vec::new(), Vec::new());
        for case in &solvable {
            let lengths: Vec<f64> = (0..SEEDS)
                .filter_map(|seed| {
                    let request = Request { seed: case.request.seed + 1_000 * seed, looks_max: 20_000, ..case.request };
                    let path = planner.solve(&robot.chain, &case.monitor, &[case.from], &[case.to], &request);
                    path.ok().map(length)
                })
                .collect();
            let best = lengths.iter().copied().fold(f64::INFINITY, f64::min);
            longer.extend(lengths.first().map(|first| first / best));
            shortened.push(planner.path().len() as f64);
        }
        row(&name("median length over the shortest of 20 seeds"), at(&mut longer, 0.5), "ratio");
        row(&name("p95 length over the shortest of 20 seeds"), at(&mut longer, 0.95), "ratio");

        let planner = &mut planner;
        let mut round = |part: usize, share: f64| {
            let mut times: Vec<f64> =
                solvable.iter().filter_map(|case| time(&robot, planner, case)).map(|time| time[part]).collect();
            at(&mut times, share)
        };
        for (part, what) in [(0, "search"), (1, "search and shortening")] {
            for (share, which) in [(0.5, "median"), (0.95, "p95")] {
                let ours = Contender::new("ours", || round(part, share));
                bench.compare(&name(&format!("{what}, {which}")), "us", vec![ours]);
            }
        }
    }
}
