//! Demonstrations: ways the sampling planner finds, cut into the steps a policy could make.

use tandem_planner::{Planner, Request};
use tandem_policy::{DOF, STEP};

use crate::world::{Joints, MARGIN_PLANNED, Scene, World, apart};

/// Looks a search may take: a few milliseconds.
const LOOKS_MAX: u32 = 3_000;
/// Clearance of a way, metres: wide where there is room, as a learner is not exact.
const MARGINS: [f64; 2] = [0.060, MARGIN_PLANNED];
/// Searches of which the quickest way counts.
const SEARCHES: u64 = 3;
/// What a person is kept off further, metres: they move on meanwhile.
const PERSON_MORE: f64 = 0.05;
/// A step of a demonstration, as a share of the largest.
const STRIDE: f64 = 0.95;

/// A way from a joint position to the goal of a scene at a time; the quickest of a few.
pub(crate) fn way(
    world: &World,
    scene: &Scene,
    from: &Joints,
    time: f64,
    planner: &mut Planner,
    seed: u64,
) -> Option<Vec<Joints>> {
    let monitor = world.monitor_of(scene, time, PERSON_MORE);
    MARGINS.iter().find_map(|margin| {
        let mut best: Option<(f64, Vec<Joints>)> = None;
        for search in 0..SEARCHES {
            let seed = seed.wrapping_add(search);
            let request = Request { margin: *margin, resolution: 0.005, looks_max: LOOKS_MAX, seed };
            let path = planner.solve(world.chain(), &monitor, &[*from], &[scene.destination.joints], &request).ok()?;
            let length: f64 = path.windows(2).map(|pair| apart(&pair[0], &pair[1])).sum();
            if best.as_ref().is_none_or(|(shortest, _)| length < *shortest) {
                best = Some((length, path.to_vec()));
            }
            if path.len() == 2 {
                break;
            }
        }
        best.map(|(_, path)| path)
    })
}

/// The next increment along a way: to the farthest point of it that one step reaches, as shares of the
/// largest step; or a `share` of that. `at` is how far along the way the arm has come, in corners and shares of the next stretch.
pub(crate) fn action(way: &[Joints], from: &Joints, at: &mut f64, share: f64) -> [f32; DOF] {
    let point = |along: f64| -> Joints {
        let index = (along as usize).min(way.len() - 2);
        let share = along - index as f64;
        core::array::from_fn(|k| way[index][k] + share * (way[index + 1][k] - way[index][k]))
    };
    let end = (way.len() - 1) as f64;
    let reach = f64::from(STEP) * STRIDE * share;
    let mut next = *at;
    loop {
        let step = 0.02_f64.min(end - next);
        if step <= 0.0 || apart(&point(next + step), from) > reach {
            break;
        }
        next += step;
    }
    if next <= *at {
        next = (*at + 0.02).min(end);
    }
    *at = next;
    let to = point(next);
    core::array::from_fn(|k| (((to[k] - from[k]) / f64::from(STEP)) as f32).clamp(-0.98, 0.98))
}
