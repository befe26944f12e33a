//! Poses, Jacobians and inverse kinematics of six and of seven joints, beside pinocchio (C++, headers
//! only, compiled for this machine) and crate `k`.
#![allow(clippy::disallowed_types, clippy::disallowed_methods, clippy::disallowed_macros, reason = "a bench measures")]

#[path = "../tests/reference/mod.rs"]
mod reference;

use std::hint::black_box;
use std::path::Path;
use std::process::Command;
use std::time::Instant;

use nalgebra::Isometry3;
use tandem_kinematics::{Chain, IkFailure, JOINTS_MAX};
use tandem_peers::{Absent, Bench, Contender, Program, per_call};

/// Poses of the comparison of inverse kinematics.
const GOALS: usize = 2_000;

fn main() {
    let bench = Bench::new("kinematics");
    let mut pinocchio = bench.program("pinocchio", pinocchio);
    let mut k = bench.program("k", k);
    for (robot, count) in reference::ROBOTS {
        let chain = reference::chain(robot);
        let rows = reference::rows(&format!("{robot}_fk.csv"));
        let positions: Vec<_> = rows.iter().map(|row| reference::positions(row, count)).collect();
        let each = |call: &dyn Fn(&[f64; JOINTS_MAX])| {
            let count = positions.len();
            per_call(20 * count as u32, |index| call(black_box(&positions[index as usize % count])))
        };
        let ask = |peer: &mut Program, case: &str| peer.round(&format!("{robot} {case}"));

        let mut contenders = vec![Contender::new("forward", || each(&|q| _ = black_box(chain.forward(q))))];
        contenders.extend(pinocchio.as_mut().map(|peer| Contender::new("pinocchio", || ask(peer, "forward"))));
        contenders.extend(k.as_mut().map(|peer| Contender::new("k", || ask(peer, "forward"))));
        bench.compare(&format!("{robot}: poses of all links"), "ns", contenders);

        // pinocchio has two ways to the same Jacobian; which is faster differs from run to run.
        let better = |peer: &mut Program| ask(peer, "jacobian").min(ask(peer, "frame_jacobian"));
        let mut contenders = vec![Contender::new("tcp_jacobian", || each(&|q| _ = black_box(chain.tcp_jacobian(q))))];
        contenders.extend(pinocchio.as_mut().map(|peer| Contender::new("pinocchio", || better(peer))));
        contenders.extend(k.as_mut().map(|peer| Contender::new("k", || ask(peer, "jacobian"))));
        bench.compare(&format!("{robot}: pose and Jacobian"), "ns", contenders);

        let mut contenders = vec![Contender::new("jacobian", || each(&|q| _ = black_box(chain.jacobian(q))))];
        contenders.extend(pinocchio.as_mut().map(|peer| Contender::new("pinocchio", || better(peer))));
        bench.compare(&format!("{robot}: poses of all links and Jacobian"), "ns", contenders);

        inverse(&bench, robot, &chain);
    }
}

/// Times of single questions: the median of a round, and the share of them that is solved.
fn inverse(bench: &Bench, robot: &str, chain: &Chain) {
    type Solve = fn(&Chain, &Isometry3<f64>, &[f64; JOINTS_MAX]) -> Result<[f64; JOINTS_MAX], IkFailure>;
    let goals = if bench.is_brief() { GOALS / 20 } else { GOALS };
    let search: Solve = |chain, goal, seed| chain.search(goal, seed);
    let closed: Solve = |chain, goal, seed| chain.inverse(goal, seed);
    let mut cases = vec![("numeric, near seed", 0.6, search), ("numeric, any seed", f64::INFINITY, search)];
    if robot == "ur5" {
        cases.push(("closed form, all branches", f64::INFINITY, closed));
    }
    for (case, width, solve) in cases {
        let questions: Vec<_> = (0..goals).map(|index| question(chain, index as u64, width)).collect();
        let mut solved = 0;
        let round = || {
            solved = 0;
            let mut times: Vec<f64> = Vec::new();
            for (goal, seed) in &questions {
                let began = Instant::now();
                let answer = black_box(solve(chain, black_box(goal), black_box(seed)));
                times.push(began.elapsed().as_nanos() as f64 / 1e3);
                solved += usize::from(answer.is_ok_and(|q| reaches(chain, &q, goal)));
            }
            times.sort_by(f64::total_cmp);
            times[times.len() / 2]
        };
        bench.compare(&format!("{robot}: inverse, {case}"), "us", vec![Contender::new("ours", round)]);
        println!(
            "{{\"bench\":\"kinematics\",\"case\":\"{robot}: inverse, {case}, solved of {goals}\",\"ours\":{:.2},\"peer\":null,\"peer_value\":null,\"unit\":\"%\",\"ratio\":null}}",
            100.0 * solved as f64 / goals as f64
        );
    }
}

/// A pose the robot can take, and a seed at most `width`/2 a joint from the position it has there.
fn question(chain: &Chain, index: u64, width: f64) -> (Isometry3<f64>, [f64; JOINTS_MAX]) {
    let mut state = 2 * index * JOINTS_MAX as u64;
    let mut share = || {
        state += 1;
        // A Weyl sequence, mixed: the finaliser of MurmurHash3.
        let mut bits = state.wrapping_mul(0x9E37_79B9_7F4A_7C15);
        bits = (bits ^ (bits >> 33)).wrapping_mul(0xFF51_AFD7_ED55_8CCD);
        bits = (bits ^ (bits >> 33)).wrapping_mul(0xC4CE_B9FE_1A85_EC53);
        ((bits ^ (bits >> 33)) >> 11) as f64 / (1_u64 << 53) as f64
    };
    let position = reference::within_limits(chain, &std::array::from_fn(|_| share()));
    let mut seed = reference::within_limits(chain, &std::array::from_fn(|_| share()));
    if width.is_finite() {
        for ((seed, q), joint) in seed.iter_mut().zip(position).zip(chain.joints()) {
            *seed = (q + width * (share() - 0.5)).clamp(joint.position_min, joint.position_max);
        }
    }
    (chain.forward(&position).base_from_tcp, seed)
}

fn reaches(chain: &Chain, position: &[f64; JOINTS_MAX], goal: &Isometry3<f64>) -> bool {
    let pose = chain.forward(position).base_from_tcp;
    (pose.translation.vector - goal.translation.vector).norm() < 1e-5
        && pose.rotation.angle_to(&goal.rotation) < 1e-4
        && chain.is_within_limits(position, 0.0)
}

fn pinocchio() -> Result<Program, Absent> {
    let python = tandem_peers::python("pinocchio", &["pin==4.1.0", "cmeel-eigen==3.4.1"])?;
    let headers = python.packages()?.join("cmeel.prefix/include");
    let flags = [
        format!("-isystem{}", headers.display()),
        format!("-isystem{}", headers.join("eigen3").display()),
        "-DBOOST_MPL_LIMIT_LIST_SIZE=30".into(),
        "-DBOOST_MPL_CFG_NO_PREPROCESSED_HEADERS".into(),
    ];
    let program = tandem_peers::cpp(&peers().join("pinocchio.cpp"), &flags)?;
    Program::start(Command::new(program).arg(reference::folder()))
}

fn k() -> Result<Program, Absent> {
    let program = tandem_peers::cargo(&peers().join("Cargo.toml"))?;
    Program::start(Command::new(program).arg(reference::folder()))
}

fn peers() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/peers"))
}
