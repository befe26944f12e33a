//! Paths of the planner, checked by an independent look at every place on them.
#![allow(clippy::disallowed_types, clippy::disallowed_macros, reason = "tests may allocate and print")]

mod reference;

use reference::{Joints, Lehmer, Robot};
use tandem_clearance::Monitor;
use tandem_cycle::guard::{CountingAllocator, counted};
use tandem_msg::{AttachedPart, Code, Pose, SceneObject, ShapeKind};
use tandem_planner::{Effort, Failure, Planner, Progress, Request};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

/// Nodes of the planners here.
const NODES: usize = 4_096;
/// Looks that one branch takes at most.
const BRANCH: u32 = 4_096;

/// Smallest clearance along a path, every joint sampled at least each hundredth of a radian.
fn clearance_along(robot: &Robot, monitor: &Monitor, path: &[Joints]) -> f64 {
    let mut least = f64::INFINITY;
    for pair in path.windows(2) {
        let turn = pair[0].iter().zip(&pair[1]).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let samples = (turn / 0.01).ceil().max(1.0) as u32;
        for k in 0..=samples {
            let share = f64::from(k) / f64::from(samples);
            let position = std::array::from_fn(|j| pair[0][j] + share * (pair[1][j] - pair[0][j]));
            least = least.min(monitor.clearance(&robot.chain.forward(&position)).distance);
        }
    }
    least
}

fn length(path: &[Joints]) -> f64 {
    path.windows(2).map(|p| p[0].iter().zip(&p[1]).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()).sum()
}

/// Two arms, scenes of every size, with a part in the hand and without: most pairs of free positions are
/// joined, every path begins and ends where it should, stays within the limits and keeps the margin
/// everywhere, to the arm itself as well.
#[test]
fn paths_keep_their_margin_everywhere() {
    let part = AttachedPart {
        present: 1,
        half_extents: [0.05, 0.03, 0.04],
        tcp_from_part: Pose { position: [0.0, 0.0, 0.12], ..Pose::IDENTITY },
        ..AttachedPart::default()
    };
    let mut planner = Planner::new(NODES);
    let mut draws = Lehmer(5);
    for name in ["ur5", "panda"] {
        let robot = Robot::new(name);
        let (mut asked, mut solved, mut bent) = (0_u32, 0_u32, 0_u32);
        for obstacles in [11, 21, 31, 50] {
            for (index, scene) in robot.scenes(obstacles).iter().take(5).enumerate() {
                let mut monitor = robot.monitor(scene);
                monitor.set_attached((index % 2 == 1).then_some(&part));
                for margin in [0.0, 0.02] {
                    let request = Request { margin, looks_max: 10_000, seed: index as u64, ..Request::default() };
                    let Some([from, to]) = robot.free_pair(&monitor, margin, &mut draws) else { continue };
                    asked += 1;
                    let Ok(path) = planner.solve(&robot.chain, &monitor, &[from], &[to], &request) else { continue };
                    solved += 1;
                    bent += u32::from(path.len() > 2);
                    let case = format!("{name}, {obstacles} obstacles, scene {scene}, margin {margin} m: {path:?}");
                    assert_eq!((path.first(), path.last()), (Some(&from), Some(&to)), "{case}");
                    assert!(path.iter().all(|position| robot.chain.is_within_limits(position, 0.0)), "{case}");
                    let clearance = clearance_along(&robot, &monitor, path);
                    assert!(clearance > margin, "{clearance} m, {case}");
                }
            }
        }
        assert!(3 * solved > asked && 4 * bent > solved, "{name}: {solved} of {asked} solved, {bent} around something");
    }
}

/// The same request gives the same path and takes the same effort, whatever was planned before and
/// however the work is sliced; another seed goes another way.
#[test]
fn slices_change_nothing() {
    let robot = Robot::new("ur5");
    let mut planners = [Planner::new(NODES), Planner::new(NODES), Planner::new(NODES)];
    let mut draws = Lehmer(11);
    let (mut compared, mut differ) = (0, 0);
    for scene in robot.scenes(50).iter().cycle().take(40) {
        let monitor = robot.monitor(scene);
        let request = Request { looks_max: 5_000, seed: 4, ..Request::default() };
        let Some([from, to]) = robot.free_pair(&monitor, 0.02, &mut draws) else { continue };
        let mut answers: Vec<(Progress, Vec<Joints>, Effort)> = Vec::new();
        for (planner, slice) in planners.iter_mut().zip([u32::MAX, 1, 37]) {
            planner.begin(&robot.chain, &monitor, &[from], &[to], &request);
            let mut progress = Progress::Searching;
            while progress == Progress::Searching {
                let before = planner.effort().looks;
                progress = planner.work(&robot.chain, &monitor, slice);
                let spent = planner.effort().looks - before;
                assert!(slice == u32::MAX || spent <= slice + 1 + (NODES / 1_024) as u32, "{spent} looks of {slice}");
            }
            answers.push((progress, planner.path().to_vec(), planner.effort()));
        }
        assert_eq!(answers[0], answers[1]);
        assert_eq!(answers[0], answers[2]);
        if answers[0].1.len() > 2 {
            compared += 1;
            let other = Request { seed: 5, ..request };
            let path = planners[0].solve(&robot.chain, &monitor, &[from], &[to], &other).unwrap_or_default();
            differ += u32::from(path != answers[0].1);
        }
    }
    assert!(compared >= 3 && differ >= 1, "{compared} bent paths, {differ} with another seed");
}

/// A search is given up when its looks are spent: what overruns is the branch in hand.
#[test]
fn the_budget_is_kept() {
    let robot = Robot::new("ur5");
    let mut monitor = Monitor::new(robot.body);
    // A slab under the arm's elbow, all around: nothing gets from above it to below.
    let slab = |id, x: f64, y: f64, half: [f64; 3]| SceneObject {
        id,
        shape: Code::of(ShapeKind::Box),
        size: half,
        base_from_object: Pose { position: [x, y, -0.14], ..Pose::IDENTITY },
    };
    monitor.set_scene(&[slab(1, 0.0, 0.0, [2.0, 2.0, 0.02])]).expect("one slab is a scene");
    let up = [0.0, -1.57, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let down = [0.0, 1.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let mut planner = Planner::new(NODES);
    let request = Request::default();
    assert_eq!(planner.solve(&robot.chain, &monitor, &[up], &[down], &request), Err(Failure::GoalBlocked));
    assert_eq!(planner.solve(&robot.chain, &monitor, &[down], &[up], &request), Err(Failure::StartBlocked));
    assert_eq!(planner.solve(&robot.chain, &monitor, &[[f64::NAN; 8]], &[up], &request), Err(Failure::StartBlocked));
    assert_eq!(planner.solve(&robot.chain, &monitor, &[up], &[], &request), Err(Failure::GoalBlocked));
    assert_eq!(planner.path(), [[0.0; 8]; 0]);

    let mut draws = Lehmer(3);
    let (mut solved, mut spent) = (0, 0);
    for scene in robot.scenes(50).iter().cycle().take(30) {
        let monitor = robot.monitor(scene);
        let Some([from, to]) = robot.free_pair(&monitor, 0.02, &mut draws) else { continue };
        let request = Request { looks_max: 500, ..request };
        match planner.solve(&robot.chain, &monitor, &[from], &[to], &request) {
            Ok(_) => {
                solved += 1;
                assert!(planner.effort().search_looks < 500 + BRANCH, "{:?}", planner.effort());
            }
            Err(failure) => {
                spent += 1;
                assert_eq!(failure, Failure::Spent);
                assert!((500..500 + BRANCH).contains(&planner.effort().looks), "{:?}", planner.effort());
            }
        }
    }
    assert!(solved > 2 && spent > 2, "{solved} solved, {spent} given up");
}

/// Of several starts and goals those that are blocked are left out, and any of the rest will do.
#[test]
fn any_start_and_any_goal_will_do() {
    let robot = Robot::new("ur5");
    let scene = &robot.scenes(21)[0];
    let monitor = robot.monitor(scene);
    let mut draws = Lehmer(2);
    let free: Vec<Joints> = (0..4).filter_map(|_| robot.free(&monitor, 0.02, &mut draws)).collect();
    let in_the_bench = [0.0, 1.2, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    assert!(!monitor.is_clear(&robot.chain.forward(&in_the_bench), 0.0));
    let mut planner = Planner::new(NODES);
    let starts = [in_the_bench, free[0], free[1]];
    let goals = [[f64::INFINITY; 8], free[2], in_the_bench, free[3]];
    let path = planner.solve(&robot.chain, &monitor, &starts, &goals, &Request::default()).expect("there is a way");
    assert!(free[..2].contains(&path[0]) && free[2..].contains(&path[path.len() - 1]), "{path:?}");
    assert!(clearance_along(&robot, &monitor, path) > 0.01);
}

/// Trees that fill up are grown anew, and the search goes on.
#[test]
fn full_trees_are_grown_anew() {
    let robot = Robot::new("ur5");
    let mut draws = Lehmer(9);
    let mut small = Planner::new(24);
    let (mut restarts, mut solved) = (0, 0);
    for scene in robot.scenes(31).iter().take(10) {
        let monitor = robot.monitor(scene);
        let Some([from, to]) = robot.free_pair(&monitor, 0.02, &mut draws) else { continue };
        let request = Request { looks_max: 20_000, ..Request::default() };
        if let Ok(path) = small.solve(&robot.chain, &monitor, &[from], &[to], &request) {
            assert!(clearance_along(&robot, &monitor, path) > request.margin);
            solved += 1;
        }
        assert!(small.effort().nodes <= 48, "{:?}", small.effort());
        restarts += small.effort().restarts;
    }
    assert!(restarts > 0 && solved > 0, "{restarts} restarts, {solved} solved");
}

/// Shortening pays: paths are not longer than those of three other seeds by much, on the whole.
#[test]
fn paths_are_short() {
    let robot = Robot::new("ur5");
    let mut draws = Lehmer(21);
    let mut planner = Planner::new(NODES);
    let (mut lengths, mut best) = (0.0, 0.0);
    for scene in robot.scenes(31).iter().take(10) {
        let monitor = robot.monitor(scene);
        let Some([from, to]) = robot.free_pair(&monitor, 0.02, &mut draws) else { continue };
        let mut tried = Vec::new();
        for seed in 0..4 {
            let request = Request { looks_max: 5_000, seed, ..Request::default() };
            if let Ok(path) = planner.solve(&robot.chain, &monitor, &[from], &[to], &request) {
                tried.push(length(path));
            }
        }
        lengths += tried.iter().sum::<f64>() / tried.len().max(1) as f64;
        best += if tried.is_empty() { 0.0 } else { tried.iter().copied().fold(f64::INFINITY, f64::min) };
    }
    assert!(best > 10.0 && lengths < 1.5 * best, "{lengths} rad, shortest {best} rad");
}

/// Beginning and working allocate nothing.
#[test]
fn a_search_allocates_nothing() {
    let robot = Robot::new("panda");
    let monitor = robot.monitor(&robot.scenes(50)[0]);
    let mut draws = Lehmer(13);
    let mut planner = Planner::new(64);
    let mut outcomes = [0; 2];
    for seed in 0..10 {
        let Some([from, to]) = robot.free_pair(&monitor, 0.02, &mut draws) else { continue };
        let request = Request { looks_max: 3_000, seed, ..Request::default() };
        let (solved, calls) = counted(|| planner.solve(&robot.chain, &monitor, &[from], &[to], &request).is_ok());
        assert!(calls.is_none(), "{calls:?}");
        outcomes[usize::from(solved)] += 1;
    }
    assert!(outcomes.iter().all(|count| *count > 0), "{outcomes:?}");
}
