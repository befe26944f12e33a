//! What learning is compared with: a hand-made path, and a sampling planner's.

use nalgebra::{Isometry3, Translation3};
use tandem_clearance::Monitor;
use tandem_planner::Planner;
use tandem_policy::DOF;

use crate::environment::{Environment, Shield};
use crate::expert;
use crate::rollouts::Outcome;
use crate::world::{Joints, MARGIN, Scene, World, apart};

/// The hand-made path: up above both ends by the cell's `via_rise`, across, down. Fixed before anything was trained;
/// it does not look where it goes.
pub fn manual(world: &World, scene: &Scene) -> Vec<Joints> {
    let chain = world.chain();
    let (start, goal) = (scene.start, scene.destination.joints);
    let [from, to] = [start, goal].map(|q| chain.forward(&q).base_from_tcp);
    let top = from.translation.z.max(to.translation.z) + world.cell.controller.via_rise;
    let raised = |pose: &Isometry3<f64>| {
        let at = pose.translation.vector;
        Isometry3::from_parts(Translation3::new(at.x, at.y, top), pose.rotation)
    };
    let mut path = vec![start];
    // Out of reach up there: without.
    path.extend(chain.inverse(&raised(&from), &start).ok());
    path.extend(chain.inverse(&raised(&to), &goal).ok());
    path.push(goal);
    path
}

/// The sampling planner's way, from what stands there when it sets out; the quickest of a few.
pub fn planned(world: &World, scene: &Scene, planner: &mut Planner, seed: u64) -> Option<Vec<Joints>> {
    expert::way(world, scene, &scene.start, 0.0, planner, seed)
}

/// Moves along a path, a step at a time, while the scene goes on. Refused steps are tried again.
pub fn follow(world: &World, scene: &Scene, path: &[Joints], shield: Shield) -> Outcome {
    let mut environment = Environment::new(world, scene, shield);
    let mut outcome = Outcome { path: path.to_vec(), ..Outcome::default() };
    let mut at = 0.0;
    loop {
        let begun = at;
        let action: [f32; DOF] = expert::action(path, environment.joints(), &mut at, 1.0);
        let stepped = environment.step(&action);
        if stepped.refused && shield == Shield::On {
            at = begun;
        }
        outcome.steps += 1;
        outcome.reward += stepped.reward;
        outcome.refused += usize::from(stepped.refused);
        outcome.contact |= stepped.contact;
        if stepped.over {
            outcome.arrived = stepped.arrived;
            return outcome;
        }
    }
}

/// A path without the corners it can do without: from each position straight to the farthest that is reached clear.
pub fn shortened(world: &World, monitor: &Monitor, path: &[Joints]) -> Vec<Joints> {
    let chain = world.chain();
    let mut short = vec![path[0]];
    let mut at = 0;
    while at + 1 < path.len() {
        let clear = |to: &usize| monitor.path_is_clear(chain, &path[at], &path[*to], MARGIN, 0.005);
        let next = (at + 2..path.len()).rev().find(clear).unwrap_or(at + 1);
        if apart(&path[at], &path[next]) > 1e-6 {
            short.push(path[next]);
        }
        at = next;
    }
    short
}
