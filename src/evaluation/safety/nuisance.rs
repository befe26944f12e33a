//! What the monitor costs where nothing is wrong: stops nobody needed, and an arm that cannot make up its mind.

use nalgebra::Vector3;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use tandem_clearance::Monitor;
use tandem_controller::Params;
use tandem_msg::{
    Capsule, Code, Header, HumanState, MotionTask, RunMode, Scene, SceneObject, ShapeKind, Stamp, Subtask,
};

use super::person::Person;
use super::referee::{Referee, reach};
use super::tracking::{Fault, Tracking};
use super::trial::{Arm, SLOWEST_STOP};
use super::world::{World, between, free_position, pose, transfer};

/// Of the tracker in these trials, metres.
const SIGMA: f64 = 0.01;
/// Who has come this much farther off again has gone past, metres.
const PAST: f64 = 0.02;

/// Somebody walks past an arm at work, again and again, on lines that keep clear of it by half a metre or more.
/// Cycles in all, those in which the arm was kept from moving, those of them in which an exact monitor would not
/// have kept it, and latched stops.
pub fn passers_by(arm: &Arm, seed: u64, cycles: u64) -> [u64; 4] {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let params = arm.hasty();
    let monitor = Monitor::new(arm.body);
    let header = Header { seq: 0, stamp: Stamp(0), epoch: 1, config_hash: params.config_hash };
    let mut tracking = Tracking::new(Fault::None, SIGMA, ChaCha8Rng::seed_from_u64(seed ^ 0x7ac4), header);
    let mut referee = Referee::new(monitor.clone());
    let mut world = World::new(arm.chain, arm.body, params, params.home, Scene::default());
    let (mut waiting, mut needless) = (0, 0);
    let mut person: Option<(Person, f64)> = None;
    let dt = params.period.as_secs_f64();
    for _ in 0..cycles {
        if world.idle() {
            let goal = free_position(&mut random, &arm.chain, &monitor, &params.home);
            let task = transfer(&mut random, &arm.chain, &goal);
            world.give(task);
        }
        if person.as_ref().is_none_or(|(_, left)| *left <= 0.0) {
            let (angle, aside) = (between(&mut random, 0.0, std::f64::consts::TAU), between(&mut random, 0.9, 2.2));
            let (speed, along) = (between(&mut random, 0.5, 1.5), Vector3::new(-angle.sin(), angle.cos(), 0.0));
            let ground = Vector3::new(angle.cos(), angle.sin(), 0.0) * aside - along * 3.0 + Vector3::z() * -0.9;
            let mut walker = Person::new(ChaCha8Rng::seed_from_u64(seed ^ 0x9e50), ground, false);
            walker.walk_on(along * speed);
            person = Some((walker, 6.0 / speed));
        }
        if let Some((walker, left)) = &mut person {
            *left -= dt;
            walker.live(dt, &referee.target, &referee.distances);
        }
        let human = *tracking.tell(world.now.after(params.period), person.as_ref().map(|(walker, _)| walker));
        world.step(&human);
        let Some((walker, _)) = &person else { continue };
        let seen = referee.look(&world, &walker.capsules);
        if world.kept() {
            waiting += 1;
            needless += u64::from(seen.distance > reach(dt + SLOWEST_STOP));
        }
    }
    [cycles, waiting, needless, u64::from(world.status().stop_count)]
}

/// Somebody walks straight at a slow long motion, at this speed, until they stand at the arm: how often the arm
/// changes between moving and waiting, or between being stopped and not. It keeps to its way: one that goes round
/// somebody may stand to turn off, which is no wavering.
pub fn crossing(arm: &Arm, seed: u64, speed: f64) -> u32 {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let params = Params { renewal_period: std::time::Duration::ZERO, ..arm.hasty() };
    let header = Header { seq: 0, stamp: Stamp(0), epoch: 1, config_hash: params.config_hash };
    let mut tracking = Tracking::new(Fault::None, SIGMA, ChaCha8Rng::seed_from_u64(seed ^ 0x7ac4), header);
    let mut referee = Referee::new(Monitor::new(arm.body));
    let mut world = World::new(arm.chain, arm.body, params, params.home, Scene::default());
    let mut goal = params.home;
    goal[0] += 2.5;
    world.give(MotionTask { speed: 0.2, ..transfer(&mut random, &arm.chain, &goal) });
    // It takes a moment to plan; an arm that finds no way is idle and never counted.
    while world.status().tcp_speed < 0.05 && !world.idle() {
        let human = *tracking.tell(world.now.after(params.period), None);
        world.step(&human);
    }
    let tcp = world.chain.forward(world.position()).base_from_tcp.translation.vector;
    let angle = between(&mut random, 0.0, std::f64::consts::TAU);
    let away = Vector3::new(angle.cos(), angle.sin(), 0.0);
    let ground = Vector3::new(tcp.x, tcp.y, -0.9) + away * 2.2;
    let mut person = Person::new(ChaCha8Rng::seed_from_u64(seed ^ 0x9e50), ground, false);
    let (mut changes, mut last, mut nearest) = (0, true, f64::INFINITY);
    let dt = params.period.as_secs_f64();
    while !world.idle() {
        let seen = referee.look(&world, &person.capsules);
        nearest = seen.distance.min(nearest);
        if nearest < 0.05 || seen.distance > nearest + PAST {
            break;
        }
        person.walk_on(-away * speed);
        person.live(dt, &referee.target, &referee.distances);
        let human = *tracking.tell(world.now.after(params.period), Some(&person));
        world.step(&human);
        let free = !world.waits();
        changes += u32::from(free != last);
        last = free;
    }
    changes
}

/// What stands five centimetres behind the arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Behind {
    /// Nothing: the comparison.
    Nothing,
    /// An obstacle.
    Obstacle,
    /// A hand.
    Hand,
}

/// The arm withdraws straight from what is behind it: the peak of its TCP's speed, m/s, and the time it takes, s.
pub fn withdrawal(arm: &Arm, behind: Behind) -> [f64; 2] {
    let params = arm.hasty();
    let start = params.home;
    let poses = arm.chain.forward(&start);
    let tcp = poses.base_from_tcp;
    // Beyond the tip of the tool, whatever its length.
    let mut monitor = Monitor::new(arm.body);
    let clear = |monitor: &mut Monitor, away: f64| {
        let centre = tcp * nalgebra::Point3::new(0.0, 0.0, away);
        let ball = Capsule { ends: [centre.coords.into(); 2], radius: 0.05, velocity: [0.0; 3] };
        monitor.set_human(&[ball]);
        (monitor.separation(&poses).distance, ball)
    };
    let (mut near, mut far) = (0.0, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (near + far);
        if clear(&mut monitor, middle).0 < 0.05 { near = middle } else { far = middle }
    }
    let ball = clear(&mut monitor, far).1;
    let mut scene = Scene::default();
    let mut human = HumanState {
        header: Header { seq: 0, stamp: Stamp(0), epoch: 1, config_hash: params.config_hash },
        position_sigma: 0.002,
        ..HumanState::default()
    };
    match behind {
        Behind::Nothing => {}
        Behind::Obstacle => {
            let base_from_object = tandem_msg::Pose { position: ball.ends[0], ..tandem_msg::Pose::IDENTITY };
            let size = [0.05, 0.0, 0.0];
            scene.objects[0] = SceneObject { id: 1, shape: Code::of(ShapeKind::Sphere), size, base_from_object };
            scene.object_count = 1;
        }
        Behind::Hand => {
            human.capsules[0] = ball;
            human.capsule_count = 1;
        }
    }
    let mut world = World::new(arm.chain, arm.body, params, start, scene);
    let goal = tcp * nalgebra::Translation3::new(0.0, 0.0, -0.25);
    // Already on the line of its approach, the arm goes straight along it.
    world.give(MotionTask {
        subtask: Code::of(Subtask::Transfer),
        run: Code::of(RunMode::Run),
        base_from_tcp: pose(&goal),
        approach: 0.0,
        speed: 1.0,
        scene_version: 1,
        ..MotionTask::default()
    });
    let (mut peak, mut moving) = (0.0_f64, 0_u64);
    for cycle in 0..4_000_u64 {
        human.header.seq += 1;
        human.header.stamp = world.now.after(params.period);
        // A tracker is never still.
        human.capsules[0].ends[0][2] = ball.ends[0][2] + 1e-6 * (cycle % 2) as f64;
        world.step(&human);
        peak = peak.max(world.status().tcp_speed);
        moving += u64::from(world.moving());
        if world.idle() {
            break;
        }
    }
    [peak, moving as f64 * params.period.as_secs_f64()]
}
