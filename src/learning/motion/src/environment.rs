//! The environment: a subtask of the cell, a step at a time. No step allocates.

#![allow(clippy::neg_cmp_op_on_partial_ord, reason = "`!(a > b)` is meant: what is no number fails the check")]

use tandem_clearance::Monitor;
use tandem_msg::{SCENE_OBJECTS_MAX, SceneObject};
use tandem_policy::{DOF, Destination, OBSERVATION, Observation, Rollout, SCALE, STEP, Surroundings};

use crate::world::{Joints, MARGIN, Scene, World};

/// Seconds a step takes: the arm's joints turn at about 1.5 rad/s.
pub const STEP_TIME: f64 = 0.08;
/// Distance from which an obstacle no longer counts in the reward, metres.
///
/// Eq. (15) adds 8 D_o for each obstacle, without a bound: with the sign of Eq. (13) mended, fleeing from
/// them would pay more than reaching the goal. Saturated here, all that pays is not to be near.
const DISTANCE_SAFE: f64 = 0.050;
/// Millimetres to thousands, so that values are about one: an affine change, which changes no policy.
const REWARD_SCALE: f64 = 1e-3;

/// Whether motions that are not clear are made.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shield {
    /// They are refused, as a protective stop would.
    On,
    /// They are made, and contacts counted.
    Off,
}

/// What came of a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stepped {
    /// Eq. (15), in thousands.
    pub reward: f64,
    /// The rest of the way is the controller's, and clear.
    pub arrived: bool,
    /// Nothing more comes of this episode.
    pub over: bool,
    /// The motion was refused.
    pub refused: bool,
    /// The arm, or what it carries, touched something on this step.
    pub contact: bool,
}

/// One scene under way.
#[derive(Clone, Debug)]
pub struct Environment<'w> {
    world: &'w World,
    monitor: Monitor,
    surroundings: Surroundings,
    destination: Destination,
    objects: [SceneObject; SCENE_OBJECTS_MAX],
    count: usize,
    person: Option<crate::world::Reaching>,
    rollout: Rollout,
    observation: Observation,
    time: f64,
    /// Whether motions that are not clear are refused.
    pub shield: Shield,
}

impl<'w> Environment<'w> {
    /// An environment in a scene.
    pub fn new(world: &'w World, scene: &Scene, shield: Shield) -> Self {
        let monitor = world.monitor.clone();
        let rollout = Rollout::begin(world.chain(), &monitor, &scene.start);
        let surroundings = Surroundings::default();
        let observation = rollout.observe(world.chain(), &monitor, &surroundings, &scene.destination);
        let mut environment = Self {
            world,
            monitor,
            surroundings,
            destination: scene.destination,
            objects: [SceneObject::default(); SCENE_OBJECTS_MAX],
            count: 0,
            person: None,
            rollout,
            observation,
            time: 0.0,
            shield,
        };
        environment.reset(scene, &scene.start, 0.0);
        environment
    }

    /// Begins anew in a scene, from a joint position and a time.
    pub fn reset(&mut self, scene: &Scene, start: &Joints, time: f64) {
        self.count = 0;
        for (slot, object) in self.objects.iter_mut().zip(&scene.objects) {
            *slot = *object;
            self.count += 1;
        }
        self.person = scene.person;
        self.destination = scene.destination;
        self.time = time;
        self.monitor.set_attached(scene.attached.as_ref());
        self.surroundings.set_scene(&scene.objects);
        self.surroundings.set_person(&[]);
        self.survey(true);
        self.rollout = Rollout::begin(self.world.chain(), &self.monitor, start);
        self.observation =
            self.rollout.observe(self.world.chain(), &self.monitor, &self.surroundings, &self.destination);
    }

    /// Brings the person to where they are now; without one, a scene is set once.
    fn survey(&mut self, anew: bool) {
        let mut count = self.count;
        if let Some(person) = &self.person {
            self.surroundings.set_person(&person.at(self.time));
            for object in person.objects(self.time, 0.0) {
                if let Some(slot) = self.objects.get_mut(count) {
                    *slot = object;
                    count += 1;
                }
            }
        } else if !anew {
            return;
        }
        // A scene that is refused counts as contact everywhere.
        let _ = self.monitor.set_scene(&self.objects[..count]);
    }

    /// What the policy sees, in the units of the files.
    pub fn observation(&self) -> &Observation {
        &self.observation
    }

    /// The same, as a network in training sees it.
    pub fn write_input(&self, input: &mut [f32]) {
        for ((to, from), scale) in input.iter_mut().zip(&self.observation.numbers).zip(&SCALE) {
            *to = from * scale;
        }
    }

    /// Where the arm stands.
    pub fn joints(&self) -> &Joints {
        self.rollout.joints()
    }

    /// Seconds since the scene began.
    pub fn time(&self) -> f64 {
        self.time
    }

    /// Steps made or refused.
    pub fn steps(&self) -> usize {
        self.rollout.steps()
    }

    /// The monitor, as it knows the scene now.
    pub fn monitor(&self) -> &Monitor {
        &self.monitor
    }

    /// Makes a step: `action` in shares of the largest increment.
    pub fn step(&mut self, action: &[f32; DOF]) -> Stepped {
        let chain = self.world.chain();
        self.time += STEP_TIME;
        self.survey(false);
        let increments = action.map(|share| share.clamp(-1.0, 1.0) * STEP);
        let from = *self.rollout.joints();
        let moved = self.rollout.advance(chain, &self.monitor, &increments, MARGIN);
        let mut contact = false;
        if !moved && self.shield == Shield::Off {
            let mut to = from;
            for ((to, by), joint) in to.iter_mut().zip(increments).zip(chain.joints()) {
                *to = (*to + f64::from(by)).clamp(joint.position_min, joint.position_max);
            }
            contact = !self.monitor.path_is_clear(chain, &from, &to, 0.0, 1e-4);
            self.rollout.jump(chain, &self.monitor, &to);
        }
        self.observation =
            self.rollout.observe(self.world.chain(), &self.monitor, &self.surroundings, &self.destination);
        let safety = if contact { -1.0 } else { self.rollout.safety() };
        let near = self.rollout.arrived(&self.destination);
        let arrived =
            near && self.monitor.path_is_clear(chain, self.rollout.joints(), &self.destination.joints, MARGIN, 0.005);
        Stepped {
            reward: reward(&self.observation, safety),
            arrived,
            over: arrived || self.rollout.stuck(),
            refused: !moved,
            contact,
        }
    }
}

/// The reward of a state.
fn reward(observation: &Observation, safety: f64) -> f64 {
    let near: f64 = observation.obstacles.iter().map(|distance| 8.0 * 1e3 * distance.min(DISTANCE_SAFE)).sum();
    // Eq. (15): r_t = 300 - D + S_r Σ 8 D_o, distances in millimetres.
    (300.0 - 1e3 * observation.distance + safety * near) * REWARD_SCALE
}

/// Numbers of an input in training.
pub const INPUTS: usize = OBSERVATION;
