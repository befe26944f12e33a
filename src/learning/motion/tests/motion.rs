//! What holds of networks, environment and training, on the shipped cell.

use std::path::Path;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tandem_config::Cell;
use tandem_cycle::guard::{CountingAllocator, counted};
use tandem_motion::{
    Agent, Environment, Extent, INPUTS, Lessons, Method, Network, Pass, Replay, Scene, Shield, Split, Subtask,
    TrainOptions, Tuning, World, demonstrations, duration, evaluate, manual, move_by, rollouts, scenes, train,
};
use tandem_policy::{Activations, DOF, Lateral, OBSERVATION, Policy, SCALE, STEP, slopes};

#[global_allocator]
static ALLOCATOR: CountingAllocator = CountingAllocator;

fn world(product: &str) -> World {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../config/cells/s471.toml");
    World::new(Cell::load(&file, Some(product)).expect("the shipped cell"))
}

fn numbers(count: usize, draws: &mut ChaCha8Rng) -> Vec<f32> {
    (0..count).map(|_| 2.0 * draws.random::<f32>() - 1.0).collect()
}

/// A weighted sum of the outputs.
fn loss(network: &Network, input: &[f32], weights: &[f32]) -> f64 {
    let mut pass = Pass::default();
    network.forward(input, &mut pass);
    pass.output.iter().zip(weights).map(|(a, b)| f64::from(a * b)).sum()
}

/// With both kinds of lateral connection, one column to three, gradients are those of differences: by the last
/// column's numbers and by the inputs, *through* the frozen columns.
#[test]
fn gradients_agree_with_differences_through_frozen_columns() {
    let mut draws = ChaCha8Rng::seed_from_u64(5);
    for lateral in [Lateral::Linear, Lateral::Adapter] {
        let mut network = Network::new(9, 2, lateral, &mut draws);
        for columns in 1..=3 {
            if columns > 1 {
                network.add_column(&mut draws);
            }
            // Louder than it begins, so that differences in single precision show.
            for number in network.trained_mut() {
                *number *= 3.0;
            }
            let input = numbers(5 * 9, &mut draws);
            let weights = numbers(5 * 2, &mut draws);
            let mut pass = Pass::default();
            network.forward(&input, &mut pass);
            let mut by_numbers = vec![0.0; network.trained().len()];
            let mut by_inputs = vec![0.0; 5 * 3];
            network.backward(&weights, &mut pass, Some(&mut by_numbers), Some((6, &mut by_inputs)));
            let step = 2e-3_f32;
            let scale = by_numbers.iter().chain(&by_inputs).fold(0.0_f32, |most, slope| most.max(slope.abs()));
            let agree = |found: f32, up: f64, down: f64, what: &str| {
                let wanted = (up - down) / (2.0 * f64::from(step));
                // A rectifier that switches within the step, and single precision, cost a little.
                let near = (f64::from(found) - wanted).abs() < 0.03 * wanted.abs() + 0.01 * f64::from(scale) + 2e-3;
                assert!(near, "{lateral:?}, {columns} columns, {what}: {found} against {wanted}");
            };
            for row in 0..5 {
                for column in 6..9 {
                    let at = |shift: f32| {
                        let mut moved = input.clone();
                        moved[row * 9 + column] += shift;
                        loss(&network, &moved, &weights)
                    };
                    agree(by_inputs[row * 3 + column - 6], at(step), at(-step), "an input");
                }
            }
            let count = network.trained().len();
            for _ in 0..60 {
                let index = draws.random_range(0..count);
                let mut at = |shift: f32| {
                    network.trained_mut()[index] += shift;
                    let value = loss(&network, &input, &weights);
                    network.trained_mut()[index] -= shift;
                    value
                };
                let (up, down) = (at(step), at(-step));
                agree(by_numbers[index], up, down, "a number");
            }
        }
    }
}

/// What earlier columns know reaches the action's gradient: with the last column's own way cut, it is not zero.
#[test]
fn the_gradient_passes_through_what_is_frozen() {
    let mut draws = ChaCha8Rng::seed_from_u64(6);
    let mut critic = Network::new(8, 1, Lateral::Adapter, &mut draws);
    critic.trained_mut().iter_mut().for_each(|number| *number *= 2.0);
    critic.add_column(&mut draws);
    let first_layer = 9 * 256;
    critic.trained_mut()[..first_layer].fill(0.0);
    let input = numbers(4 * 8, &mut draws);
    let mut pass = Pass::default();
    critic.forward(&input, &mut pass);
    let mut by_inputs = vec![0.0; 4 * 2];
    critic.backward(&[1.0; 4], &mut pass, None, Some((6, &mut by_inputs)));
    assert!(by_inputs.iter().all(|slope| *slope != 0.0), "{by_inputs:?}");
}

/// Frozen columns stay as they were, to the bit, whatever the new one learns; α begins at a tenth and moves.
#[test]
fn only_the_last_column_learns() {
    let mut draws = ChaCha8Rng::seed_from_u64(7);
    let source = Agent::new(Lateral::Adapter, &mut draws);
    let mut agent = source.progressive(&mut draws);
    let replay = random_replay(&mut draws);
    let before = agent.networks().map(<[f32]>::to_vec);
    for _ in 0..4 {
        agent.update(&replay, &replay, &Tuning::default(), &mut draws);
    }
    for ((frozen, before), after) in source.networks().into_iter().zip(&before).zip(agent.networks()) {
        assert_eq!(&after[..frozen.len()], frozen);
        assert_ne!(&after[frozen.len()..], &before[frozen.len()..], "the new column learns");
    }
}

fn random_replay(draws: &mut ChaCha8Rng) -> Replay {
    let mut replay = Replay::new(256);
    for _ in 0..256 {
        let mut number = || 2.0 * draws.random::<f32>() - 1.0;
        replay.push(tandem_motion::Transition {
            state: std::array::from_fn(|_| number()),
            action: std::array::from_fn(|_| number()),
            reward: number(),
            next: std::array::from_fn(|_| number()),
            terminal: false,
        });
    }
    replay
}

/// A trained actor and the policy made of it act alike, to rounding, for one column and for two.
#[test]
fn the_precomputed_policy_acts_as_its_actor() {
    let mut draws = ChaCha8Rng::seed_from_u64(8);
    let mut agent = Agent::new(Lateral::Adapter, &mut draws);
    let replay = random_replay(&mut draws);
    for columns in 1..=2 {
        if columns == 2 {
            agent = agent.progressive(&mut draws);
        }
        for _ in 0..20 {
            agent.update(&replay, &replay, &Tuning::default(), &mut draws);
        }
        let (shape, numbers_of) = agent.policy();
        let policy = Policy::new(shape, &numbers_of).expect("a policy");
        assert_eq!(shape.columns, columns);
        let observation = numbers(OBSERVATION, &mut draws);
        let state: Vec<f32> = observation.iter().zip(&SCALE).map(|(a, b)| a * b).collect();
        let mut pass = Pass::default();
        agent.act(&state, &mut pass);
        let mut action = [0.0; DOF];
        policy.act(&mut Activations::default(), &observation, &mut action).expect("finite");
        for (own, acted) in pass.output.iter().zip(&action) {
            assert!((own * STEP - acted).abs() < 1e-5, "{own} {acted}");
        }
    }
}

fn few(world: &World, subtask: Subtask, count: usize) -> Vec<Scene> {
    scenes(world, subtask, Split::Train, 0, count)
}

/// Drawn scenes are what they are said to be, for both products and all subtasks: start and goal clear, the way
/// clear all along, most straight lines not; and the same again when drawn again.
#[test]
fn scenes_need_a_way_around_and_have_one() {
    let (mut blocked, mut all) = (0, 0);
    for product in ["s471", "s472"] {
        let world = world(product);
        for subtask in Subtask::ALL {
            let drawn = few(&world, subtask, 6);
            for scene in &drawn {
                let monitor = world.monitor_of(scene, 0.0, 0.0);
                assert_eq!(scene.way.first(), Some(&scene.start));
                assert_eq!(scene.way.last(), Some(&scene.destination.joints));
                for pair in scene.way.windows(2) {
                    assert!(monitor.path_is_clear(world.chain(), &pair[0], &pair[1], 0.02, 0.002));
                }
                let ends = [scene.start, scene.destination.joints];
                let straight = monitor.path_is_clear(world.chain(), &ends[0], &ends[1], 0.0, 0.002);
                assert_eq!(straight, !scene.straight_blocked);
                blocked += usize::from(scene.straight_blocked);
                all += 1;
            }
            let again = few(&world, subtask, 6);
            assert!(drawn.iter().zip(&again).all(|(a, b)| a.start == b.start && a.objects == b.objects));
        }
    }
    println!("the straight joint line is blocked in {blocked} of {all} scenes");
    assert!(2 * blocked > all, "{blocked} of {all}");
}

/// What a policy is told of how the clearance grows with each joint is what differences of the clearance say, wherever the same
/// pair stays the nearest.
#[test]
fn slopes_agree_with_differences() {
    const STEP: f64 = 1e-5;
    let world = world("s472");
    let chain = world.chain();
    let mut compared = 0;
    for subtask in [Subtask::Grasp, Subtask::Transfer] {
        for scene in few(&world, subtask, 4) {
            let monitor = world.monitor_of(&scene, 0.0, 0.0);
            let at = |q: &[f64; tandem_kinematics::JOINTS_MAX]| monitor.scene_clearance(&chain.forward(q));
            for pair in scene.way.windows(2) {
                for share in [0.1, 0.4, 0.7] {
                    let q = std::array::from_fn(|k| pair[0][k] + share * (pair[1][k] - pair[0][k]));
                    let here = at(&q);
                    let slopes = slopes(chain, &chain.forward(&q), &here);
                    for joint in 0..DOF {
                        let [mut up, mut down] = [q; 2];
                        up[joint] += STEP;
                        down[joint] -= STEP;
                        let [up, down] = [at(&up), at(&down)];
                        let same = |c: &tandem_clearance::Clearance| (c.link, c.object) == (here.link, here.object);
                        let [rise, fall] = [up.distance - here.distance, here.distance - down.distance];
                        // Where an edge passes a corner the clearance has a kink.
                        if same(&up) && same(&down) && (rise - fall).abs() < 1e-8 {
                            let wanted = (up.distance - down.distance) / (2.0 * STEP);
                            assert!((slopes[joint] - wanted).abs() < 2e-3, "joint {joint}: {} {wanted}", slopes[joint]);
                            compared += 1;
                        }
                    }
                }
            }
        }
    }
    assert!(compared > 50, "{compared}");
}

/// Eq. (13) and (15) as mended: nearer to the goal pays more, being refused pays less, and no distance from
/// obstacles beyond the safe one pays anything. A step is refused exactly where it would come too near, allocates
/// nothing, and the same steps give the same states.
#[test]
fn steps_are_rewarded_refused_and_repeated_as_they_should() {
    let world = world("s472");
    let drawn = few(&world, Subtask::Transfer, 3);
    let mut draws = ChaCha8Rng::seed_from_u64(9);
    for scene in &drawn {
        let actions: Vec<[f32; DOF]> =
            (0..200).map(|_| std::array::from_fn(|_| 2.0 * draws.random::<f32>() - 1.0)).collect();
        let walk = || {
            let mut environment = Environment::new(&world, scene, Shield::On);
            let mut states = Vec::new();
            for action in &actions {
                let (stepped, allocations) = counted(|| environment.step(action));
                assert_eq!(allocations, tandem_cycle::guard::Calls::default());
                assert!(!stepped.contact, "a shielded step touches nothing");
                assert!(stepped.reward <= 0.3 + 7.0 * 8.0 * 0.05 + 1e-9, "{}", stepped.reward);
                states.push((*environment.joints(), stepped));
                if stepped.over {
                    environment.reset(scene, &scene.start, 0.0);
                }
            }
            states
        };
        assert_eq!(walk(), walk());
    }
}

/// Trained for a moment, a policy beats one that was not; and a training that was broken off and gone on with gives
/// the same numbers as one that was not, to the bit.
#[test]
fn training_helps_and_resumes_to_the_bit() {
    let world = world("s471");
    let drawn = few(&world, Subtask::Grasp, 24);
    let validation = scenes(&world, Subtask::Grasp, Split::Validation, 0, 16);
    let shown = demonstrations(&world, Subtask::Grasp, &drawn);
    let lessons = Lessons { world: &world, scenes: &drawn, validation: &validation, shown: &shown };
    let file = std::env::temp_dir().join(format!("tandem-motion-{}.safetensors", std::process::id()));
    let options = |updates, resume| TrainOptions {
        subtask: Subtask::Grasp,
        method: Method::Ac,
        seed: 1,
        updates,
        interval: 100,
        tuning: Tuning::default(),
        checkpoint: Some(file.clone()),
        resume,
    };
    let whole = train(&lessons, &options(200, false), None, &mut |_| {}).expect("a training");
    // The rate follows the whole length, so the part is a part of the same training.
    std::fs::remove_file(&file).expect("a checkpoint");
    let mut stopped = 0;
    let part = TrainOptions { updates: 200, ..options(200, false) };
    let broken = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        train(&lessons, &part, None, &mut |_| {
            stopped += 1;
            assert!(stopped < 2, "broken off");
        })
    }));
    assert!(broken.is_err());
    let resumed = train(&lessons, &options(200, true), None, &mut |_| {}).expect("a training");
    std::fs::remove_file(&file).expect("a checkpoint");
    assert_eq!(whole.agent.networks(), resumed.agent.networks());
    assert_eq!(whole.curve, resumed.curve);
    let untrained = Agent::new(Lateral::Adapter, &mut ChaCha8Rng::seed_from_u64(1));
    let reached = |agent: &Agent| {
        let outcomes = rollouts(&world, &validation, Shield::On, &mut |states, pass| agent.act(states, pass));
        outcomes.iter().filter(|outcome| outcome.arrived).count()
    };
    let (before, after) = (reached(&untrained), reached(&whole.agent));
    assert!(after > before, "{after} against {before} of {}", validation.len());
}

/// Every method is measured alone and shielded, no shielded motion touches anything, and hand-made paths take what
/// their stops cost.
#[test]
fn the_report_measures_all_methods() {
    let world = world("s472");
    let drawn = scenes(&world, Subtask::Transfer, Split::Test, 1, 4);
    let agent = Agent::new(Lateral::Adapter, &mut ChaCha8Rng::seed_from_u64(2));
    let (shape, numbers) = agent.policy();
    let candidate = tandem_motion::Candidate { method: "ac".into(), seed: 2, shape, numbers };
    assert_eq!(move_by(&world, &drawn, Shield::On, &candidate).len(), drawn.len());
    let rows = evaluate(&world, "transfer", &drawn, std::slice::from_ref(&candidate), Extent::All);
    assert_eq!(rows.len(), 2 * 3);
    assert!(rows.iter().filter(|row| row.shielded).all(|row| row.contact.count == 0), "{rows:#?}");
    let shielded = evaluate(&world, "transfer", &drawn, &[candidate], Extent::ShieldedPolicies);
    assert_eq!(shielded[0].reached, rows[rows.len() - 1].reached);
    for scene in &drawn {
        let path = manual(&world, scene);
        let stopping = duration(world.chain(), &path, true).expect("a duration");
        let passing = duration(world.chain(), &path, false).expect("a duration");
        assert!(passing <= stopping + 1e-9, "{passing} {stopping}");
    }
    assert_eq!(INPUTS, OBSERVATION);
}
