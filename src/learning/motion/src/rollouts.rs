//! Many scenes at once, moved by one policy without noise.

use tandem_policy::DOF;

use crate::environment::{Environment, INPUTS, Shield};
use crate::network::Pass;
use crate::world::{Joints, Scene, World};

/// How one scene went.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Outcome {
    /// The goal was reached.
    pub arrived: bool,
    /// Something was touched.
    pub contact: bool,
    /// Steps.
    pub steps: usize,
    /// Motions refused.
    pub refused: usize,
    /// Sum of the rewards.
    pub reward: f64,
    /// Where the arm went; last the goal, where it was reached.
    pub path: Vec<Joints>,
}

/// What gives actions to states, as [`crate::Agent::act`].
pub type Act<'a> = dyn FnMut(&[f32], &mut Pass) + 'a;

/// Scenes moved through together: policies are quicker on many states at once.
const TOGETHER: usize = 128;

/// Moves through all scenes.
pub fn rollouts(world: &World, scenes: &[Scene], shield: Shield, act: &mut Act<'_>) -> Vec<Outcome> {
    scenes.chunks(TOGETHER).flat_map(|scenes| together(world, scenes, shield, act)).collect()
}

fn together(world: &World, scenes: &[Scene], shield: Shield, act: &mut Act<'_>) -> Vec<Outcome> {
    let mut environments: Vec<_> = scenes.iter().map(|scene| Environment::new(world, scene, shield)).collect();
    let begin = |scene: &Scene| Outcome { path: vec![scene.start], ..Outcome::default() };
    let mut outcomes: Vec<Outcome> = scenes.iter().map(begin).collect();
    let mut going: Vec<usize> = (0..scenes.len()).collect();
    let (mut states, mut pass) = (Vec::new(), Pass::default());
    while !going.is_empty() {
        states.resize(going.len() * INPUTS, 0.0);
        for (state, index) in states.chunks_exact_mut(INPUTS).zip(&going) {
            environments[*index].write_input(state);
        }
        act(&states, &mut pass);
        let mut actions = pass.output.chunks_exact(DOF);
        going.retain(|index| {
            let (environment, outcome) = (&mut environments[*index], &mut outcomes[*index]);
            let mut action = [0.0; DOF];
            action.copy_from_slice(actions.next().unwrap_or(&[0.0; DOF]));
            let stepped = environment.step(&action);
            outcome.steps += 1;
            outcome.reward += stepped.reward;
            outcome.refused += usize::from(stepped.refused);
            outcome.contact |= stepped.contact;
            outcome.arrived = stepped.arrived;
            if shield == Shield::Off || !stepped.refused {
                outcome.path.push(*environment.joints());
            }
            if stepped.arrived {
                outcome.path.push(scenes[*index].destination.joints);
            }
            !stepped.over
        });
    }
    outcomes
}
