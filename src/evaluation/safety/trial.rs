//! One encounter: an arm at work, a person who comes from anywhere, a tracker with one fault.

use nalgebra::Vector3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use tandem_clearance::{ArmBody, Monitor};
use tandem_controller::Params;
use tandem_kinematics::Chain;
use tandem_msg::{Header, StopState};

use super::person::Person;
use super::referee::{Referee, reach};
use super::tracking::{Fault, Tracking};
use super::world::{World, between, free_position, scene, transfer};

/// Cycles an arm may take until it moves.
const PREPARATION: u64 = 400;
/// What an exact monitor reckons for a stop from the slowest speed, s.
pub(super) const SLOWEST_STOP: f64 = 0.05;

/// The arm of the cell under test, and what its controller goes by.
#[derive(Clone)]
pub struct Arm {
    /// Joints.
    pub chain: Chain,
    /// Links.
    pub body: ArmBody,
    /// Parameters of the controller.
    pub params: Params,
}

impl Arm {
    /// A controller that plans as fast as it may: a trial is about what comes after.
    pub(super) fn hasty(&self) -> Params {
        Params { planning_work: 100, settle: std::time::Duration::ZERO, ..self.params }
    }
}

/// What all encounters of a campaign have in common.
#[derive(Clone, Copy, Debug)]
pub struct Terms {
    /// Cycles with the person there. In the time of one approach hardly anything but the approach happens; in a
    /// longer one the arm also stops, waits, starts again and plans anew with the person beside it.
    pub cycles: u64,
    /// The controller is told of nobody.
    pub blind: bool,
}

/// What became of one encounter.
#[derive(Clone, Copy, Debug)]
pub struct Outcome {
    /// What was wrong with the tracking.
    pub fault: Fault,
    /// Cycles with the person there, and those of them in which the arm moved.
    pub cycles: u64,
    /// Cycles in which the arm moved.
    pub moving: u64,
    /// The moving arm was touched.
    pub contact: bool,
    /// It was touched where it moved towards the person.
    pub struck: bool,
    /// Least distance beyond the protective one, while the arm moved towards that part, metres.
    pub spare: f64,
    /// Least distance of a moving arm, metres.
    pub distance: f64,
    /// Latched stops.
    pub stops: u32,
    /// Cycles in which the arm was kept from moving, and those of them in which an exact monitor would have let it.
    pub waiting: u64,
    /// Of the cycles waited, those in which an exact monitor would not have kept it.
    pub needless: u64,
    /// Longest time from a stop's beginning to standstill beyond what was announced, s.
    pub overrun: f64,
}

/// Runs the encounter of a seed.
pub fn encounter(arm: &Arm, seed: u64, terms: Terms) -> Outcome {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let params = arm.hasty();
    let scene = scene(&mut random, &arm.chain, &arm.body, &params.home, 20);
    let mut monitor = Monitor::new(arm.body);
    // What was added was accepted one by one.
    let _ = monitor.set_scene(scene.objects());
    let start = free_position(&mut random, &arm.chain, &monitor, &params.home);
    let fault = if terms.blind { Fault::None } else { Fault::draw(&mut random) };
    let sigma = [0.0, 0.002, 0.005, 0.01][(between(&mut random, 0.0, 4.0) as usize).min(3)];
    // A source that claims to be exact cannot be told from one that is frozen.
    let sigma = if matches!(fault, Fault::Frozen(_)) { f64::max(sigma, 0.002) } else { sigma };
    let header = Header { seq: 0, stamp: tandem_msg::Stamp(0), epoch: 1, config_hash: params.config_hash };
    let mut tracking = Tracking::new(fault, sigma, ChaCha8Rng::seed_from_u64(seed ^ 0x7ac4), header);
    let mut referee = Referee::new(monitor.clone());
    let mut world = World::new(arm.chain, arm.body, params, start, scene);
    let work = |world: &mut World, random: &mut ChaCha8Rng| {
        if world.idle() {
            let goal = free_position(random, &arm.chain, &monitor, &params.home);
            world.give(transfer(random, &arm.chain, &goal));
        }
    };
    for _ in 0..PREPARATION {
        work(&mut world, &mut random);
        let human = *tracking.tell(world.now.after(params.period), None);
        world.step(&human);
        if world.status().tcp_speed > 0.15 {
            break;
        }
    }
    let tcp = world.chain.forward(world.position()).base_from_tcp.translation.vector;
    let (angle, distance) = (between(&mut random, 0.0, std::f64::consts::TAU), between(&mut random, 1.0, 1.4));
    let from = |away: f64| {
        let ground = Vector3::new(tcp.x + away * angle.cos(), tcp.y + away * angle.sin(), -0.9);
        Person::new(ChaCha8Rng::seed_from_u64(seed ^ 0x9e50), ground, true)
    };
    // Nobody comes out of nothing: they begin where no arm owes them anything yet.
    let mut away = distance;
    let mut person = from(away);
    while referee.look(&world, &person.capsules).distance < distance {
        away += 0.1;
        person = from(away);
    }
    let mut outcome = Outcome {
        fault,
        cycles: 0,
        moving: 0,
        contact: false,
        struck: false,
        spare: f64::INFINITY,
        distance: f64::INFINITY,
        stops: 0,
        waiting: 0,
        needless: 0,
        overrun: 0.0,
    };
    let mut braking: Option<(u64, f64)> = None;
    for cycle in 0..terms.cycles {
        work(&mut world, &mut random);
        person.live(params.period.as_secs_f64(), &referee.target, &referee.distances);
        let told = (!terms.blind).then_some(&person);
        let human = *tracking.tell(world.now.after(params.period), told);
        let announced = world.status().stopping_time;
        world.step(&human);
        let seen = referee.look(&world, &person.capsules);
        outcome.cycles += 1;
        if world.moving() {
            outcome.moving += 1;
            outcome.contact |= seen.contact;
            outcome.struck |= seen.struck;
            outcome.spare = outcome.spare.min(seen.spare);
            outcome.distance = outcome.distance.min(seen.distance);
        }
        if world.status().stop.is(StopState::Stopping) {
            let (began, announced) = *braking.get_or_insert((cycle, announced));
            let took = (cycle - began) as f64 * params.period.as_secs_f64();
            outcome.overrun = outcome.overrun.max(took - announced);
        } else {
            braking = None;
        }
        if world.kept() {
            outcome.waiting += 1;
            outcome.needless += u64::from(seen.distance > reach(params.period.as_secs_f64() + SLOWEST_STOP));
        }
    }
    outcome.stops = world.status().stop_count;
    outcome
}
