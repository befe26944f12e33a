//! The trainer trains, repeats, resumes; the shipped model is as good as its card says.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use candle_core::{D, Device, Tensor};
use nalgebra::{Isometry3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tandem_config::{Body, FeatureGeometry};
use tandem_msg::{Coded, FEATURE_CLASSES, Feature, FeatureClass, Header, PointCloud, Pose, Recognition, Stamp};

use super::dataset::{Example, Look, Split, example};
use super::domain::Domain;
use super::parameters::Parameters;
use super::part::Kind;
use super::pass::{Pass, SEGMENT, SEGMENT_STRIDE, SMOOTHING};
use super::train::{Run, TrainOptions, train};
use crate::perception::network::{CLASS_HIDDEN, Input, Network, Output};
use crate::perception::{CARD_FILE, Model, ModelError, Perception, Sampler, WEIGHTS_FILE};
use crate::plant::camera::{Camera, TILT, View, feature_from_camera, half_width};
use crate::plant::solid::{Solid, Surroundings};

#[global_allocator]
static ALLOCATOR: tandem_cycle::guard::CountingAllocator = tandem_cycle::guard::CountingAllocator;

fn shipped() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("config/models/s471")
}

fn examples(seed: u64, split: Split, count: u64) -> Vec<Example> {
    let (mut sampler, mut cloud) = (Sampler::new(), Vec::new());
    (0..count).map(|index| example(&Domain::source(), seed, split, index, &mut sampler, &mut cloud)).collect()
}

/// The loss in candle's operations: cross-entropy of smoothed classes, and of the points.
fn loss(output: &Output, looks: &[&Look]) -> candle_core::Result<Tensor> {
    let batch = looks.len();
    let mut labels = vec![SMOOTHING / FEATURE_CLASSES as f32; batch * FEATURE_CLASSES];
    for (b, look) in looks.iter().enumerate() {
        labels[b * FEATURE_CLASSES + look.class.code() as usize] += 1.0 - SMOOTHING;
    }
    let labels = Tensor::from_vec(labels, (batch, FEATURE_CLASSES), &Device::Cpu)?;
    let logits = &output.class_logits;
    let shifted = logits.broadcast_sub(&logits.max_keepdim(D::Minus1)?.detach())?;
    let log_sum = shifted.exp()?.sum_keepdim(D::Minus1)?.log()?;
    let class = (labels * shifted.broadcast_sub(&log_sum)?)?.sum_all()?.affine(-1.0 / batch as f64, 0.0)?;
    let segments = looks.iter().flat_map(|look| look.segment.iter().step_by(SEGMENT_STRIDE));
    let marks: Vec<f32> = segments.map(|s| f32::from(u8::from(*s))).collect();
    let marks = Tensor::from_vec(marks.clone(), marks.len(), &Device::Cpu)?;
    // log(1 + exp(x)) − x·y, written so that neither end overflows.
    let x = &output.segment_logits;
    let soft = (x.relu()? + (x.abs()?.neg()?.exp()? + 1.0)?.log()?)?;
    class + ((soft - (x * marks)?)?.mean_all()? * f64::from(SEGMENT))?
}

/// Loss and gradient of the pass that trains are those of the network in candle, for every
/// variable; and no operation on the way cuts a gradient.
#[test]
fn the_pass_has_the_gradients_of_the_network() {
    let mut parameters = Parameters::fresh(1);
    let network = Network::new(&mut parameters).expect("fresh numbers have the right shapes");
    let examples = examples(1, Split::Train, 16);
    let looks: Vec<&Look> = examples.iter().map(|e| e.closer.as_ref().unwrap_or(&e.look)).collect();
    let samples: Vec<_> = looks.iter().map(|look| &look.sample).collect();
    let input = Input::of(&samples, SEGMENT_STRIDE, &Device::Cpu).expect("samples are well formed");
    let mask: Vec<f32> = (0..16 * CLASS_HIDDEN).map(|i| if i % 3 == 0 { 0.0 } else { 1.5 }).collect();
    let dropout = Tensor::from_vec(mask.clone(), (16, CLASS_HIDDEN), &Device::Cpu).expect("small");
    let output = network.forward(&input, Some(&dropout)).expect("shapes agree");
    let expected = loss(&output, &looks).expect("shapes agree");
    let gradients = expected.backward().expect("all operations have gradients");
    let expected = expected.to_scalar::<f32>().expect("a number");

    let run = Run::on(Parameters::fresh(1)).expect("the same numbers");
    let mut pass = Pass::default();
    pass.run(&run.plan, &run.parameters, &looks, &mask, 0);
    assert!((pass.loss - expected).abs() < 1e-4 * expected, "loss {} against {expected}", pass.loss);
    assert!(parameters.variables.len() > 40, "{} variables", parameters.variables.len());
    let numbers = |t: &Tensor| t.flatten_all().and_then(|t| t.to_vec1::<f32>()).expect("f32");
    for (name, span) in run.spans[0].iter() {
        let gradient = gradients.get(&parameters.variables[name]).unwrap_or_else(|| panic!("{name}: no gradient"));
        let (gradient, own) = (numbers(gradient), &pass.gradient[span.clone()]);
        let size = gradient.iter().map(|g| g * g).sum::<f32>().sqrt();
        let off = gradient.iter().zip(own).map(|(g, o)| (g - o) * (g - o)).sum::<f32>().sqrt();
        assert!(size > 0.0 && size.is_finite(), "{name}: gradient {size}");
        // Both in single precision, added up in different orders: a ReLU at its corner may fall to either side.
        assert!(off < 4e-3 * size, "{name}: {off} off a gradient of {size}");
    }
    // So are the statistics of the batch, from which the running ones start at 0 and 1.
    for (name, running) in network.statistics().expect("plain tensors") {
        let start = if name.ends_with("variance") { 1.0 } else { 0.0 };
        for (moved, batch) in numbers(&running).iter().zip(&pass.statistics[run.spans[1].of(&name)]) {
            let expected = start + 0.1 * (batch - start);
            assert!((moved - expected).abs() < 1e-3 * expected.abs().max(1.0), "{name}: {moved}, {expected}");
        }
    }
}

/// Inference without tensors answers what the network in candle does.
#[test]
fn the_engine_answers_what_the_network_does() {
    let folder = shipped();
    let tensors = candle_core::safetensors::load(folder.join(WEIGHTS_FILE), &Device::Cpu).expect("readable");
    let stored = || Parameters::stored(tensors.clone().into_iter().collect());
    let network = Network::new(&mut stored()).expect("the shipped weights fit");
    let mut engine = crate::perception::engine::Engine::new(&mut stored()).expect("the shipped weights fit");
    for example in examples(5, Split::Test, 24) {
        let input = Input::of(&[&example.look.sample], 1, &Device::Cpu).expect("samples are well formed");
        let output = network.forward(&input, None).expect("shapes agree");
        let (logits, segment) = engine.run(&example.look.sample);
        let expected = [output.class_logits.flatten_all(), Ok(output.segment_logits)]
            .map(|t| t.and_then(|t| t.to_vec1::<f32>()).expect("f32"));
        let pairs = logits.iter().zip(&expected[0]).chain(segment.iter().zip(&expected[1]));
        let off = pairs.map(|(own, theirs)| (own - theirs).abs() / theirs.abs().max(1.0)).fold(0.0, f32::max);
        assert!(off < 1e-4, "{}: {off} off", example.class);
    }
}

/// Trained twice from the same seed, by one thread and by two, the files are the same bytes.
#[test]
fn a_training_repeats_to_the_byte() {
    let files = [1, 2].map(|threads| {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let options = TrainOptions { threads, samples: 96, ..options(folder.path(), 2) };
        train(&options, &mut |_| {}).expect("it trains");
        [WEIGHTS_FILE, CARD_FILE].map(|name| std::fs::read(folder.path().join(name)).expect("it was written"))
    });
    assert!(files[0] == files[1]);
}

/// Any number of threads trains the same network, bit for bit.
#[test]
fn threads_change_nothing() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let training = examples(3, Split::Train, 64);
    let [one, two] = [1, 2].map(|threads| {
        let options = TrainOptions { threads, ..options(folder.path(), 1) };
        let mut run = Run::begin(&options, Path::new("none")).expect("fresh");
        run.epoch(&training, &options, &mut |_| {});
        (run.parameters, run.statistics)
    });
    assert!(one == two);
    let made = super::dataset::examples(&Domain::source(), 3, Split::Train, 64, 2, &mut |_| {});
    assert!(made.iter().zip(&training).all(|(a, b)| a.look == b.look && a.closer == b.closer));
}

/// An example follows from seed, split and number alone, and shows its feature.
#[test]
fn examples_repeat_and_show_their_feature() {
    let (first, again) = (examples(9, Split::Test, 16), examples(9, Split::Test, 16));
    let other = examples(9, Split::Validation, 16);
    for ((a, b), c) in first.iter().zip(&again).zip(&other) {
        assert_eq!((&a.look, &a.closer), (&b.look, &b.closer));
        assert_ne!(a.look, c.look, "splits are disjoint");
        let shown = a.look.segment.iter().filter(|s| **s).count();
        assert!(a.class == FeatureClass::Other || shown >= 24, "{}: {shown} points", a.class);
    }
}

/// In whatever form a feature is drawn, sphere tracing never steps through it: no point within the distance of
/// another lies inside; and every form has a surface of its own.
#[test]
fn generated_parts_have_distances_that_are_lower_bounds() {
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    for number in 0..400 {
        let class = FeatureClass::ALL[number % FEATURE_CLASSES];
        let kind = Kind::draw(class, &mut rng);
        let solid = Solid::with_form(&kind.body, &kind.feature, &kind.form, &kind.part_from_feature);
        let size = kind.size as f32;
        for _ in 0..1000 {
            let a: [f32; 3] = [0; 3].map(|_| size * rng.random_range(-1.2..1.2));
            let d = solid.distance(a);
            let way: [f32; 3] = [0; 3].map(|_| rng.random_range(-1.0..1.0));
            let length = way.iter().map(|s| s * s).sum::<f32>().sqrt();
            if d <= 0.0 || !(0.1..=1.0).contains(&length) {
                continue;
            }
            let b = [0, 1, 2].map(|i| a[i] + way[i] / length * d * 0.999);
            let inside = solid.distance(b);
            assert!(inside > -4e-3 * size, "{kind:?}: {d} at {a:?}, but {inside} at {b:?}");
        }
    }
}

fn options(out: &Path, epochs: usize) -> TrainOptions {
    TrainOptions { samples: 64, epochs, seed: 3, out: out.to_owned(), resume: false, threads: 2 }
}

/// A small run learns what it is shown, and its model loads.
#[test]
fn a_small_run_beats_chance() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let mut losses = BTreeMap::new();
    let card = train(&options(folder.path(), 24), &mut |p| {
        if let super::TrainProgress::Step(epoch, _, _, loss) = p {
            losses.insert(*epoch, *loss);
        }
    })
    .expect("it trains");
    let (first, last) = (losses[&1], losses[&24]);
    println!("loss {first:.2} -> {last:.2}, accuracy on 64 others {:.2} (chance 0.125)", card.metrics.accuracy);
    assert!(last < 0.8 * first, "loss {first} -> {last}");
    assert!(card.metrics.accuracy > 0.2, "{}", card.metrics.accuracy);
    assert!(Perception::load(folder.path()).is_ok());
}

/// A run that went on from its checkpoint equals one that never stopped.
#[test]
fn a_resumed_run_is_the_same_run() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join("checkpoint");
    let options = TrainOptions { resume: true, ..options(folder.path(), 2) };
    let training = examples(3, Split::Train, 64);
    let numbers = |run: &Run| -> Vec<(String, Vec<f32>)> {
        let weights = run.weights().expect("plain tensors");
        weights.into_iter().map(|(n, t)| (n, t.flatten_all().and_then(|t| t.to_vec1()).expect("f32"))).collect()
    };
    let mut whole = Run::begin(&options, &file).expect("fresh");
    whole.epoch(&training, &options, &mut |_| {});
    whole.save(&file, &options).expect("saves");
    whole.epoch(&training, &options, &mut |_| {});
    let mut resumed = Run::begin(&options, &file).expect("resumes");
    resumed.epoch(&training, &options, &mut |_| {});
    assert!(numbers(&whole) == numbers(&resumed));

    let other = TrainOptions { seed: 4, ..options };
    assert!(Run::begin(&other, &file).is_err(), "a checkpoint of another seed is refused");
}

/// The shipped model recognises fresh parts nearly as well as its card says.
#[test]
fn the_shipped_model_keeps_its_promise() {
    let mut perception = Perception::load(&shipped()).expect("the shipped model is sound");
    let promised = perception.card().metrics.accuracy;
    let (mut sampler, mut cloud) = (Sampler::new(), Vec::new());
    let (mut right, mut sure, mut sure_wrong, count) = (0, 0, 0, 240);
    for index in 0..count {
        // A seed no training uses.
        let truth = example(&Domain::source(), 0xf5e5, Split::Test, index, &mut sampler, &mut cloud);
        let Some(answer) = perception.recognise(&cloud) else {
            continue;
        };
        let hit = answer.class == truth.class;
        right += u32::from(hit);
        if f64::from(answer.probabilities[answer.class.code() as usize]) >= perception.card().threshold {
            sure += 1;
            sure_wrong += u32::from(!hit);
        }
    }
    let accuracy = f64::from(right) / count as f64;
    println!("accuracy {accuracy:.3} (card {promised:.3}), sure {sure} of {count}, wrong when sure {sure_wrong}");
    assert!(accuracy > promised - 0.05, "{accuracy} against the card's {promised}");
    assert!(sure_wrong * 25 <= sure, "{sure_wrong} of {sure} sure answers are wrong");
}

fn copy_of_shipped() -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    for name in [WEIGHTS_FILE, CARD_FILE] {
        std::fs::copy(shipped().join(name), folder.path().join(name)).expect("the shipped model is there");
    }
    folder
}

/// Any flipped byte of the weights, a missing file, a card that is none: all refused by name.
#[test]
fn damaged_models_are_refused() {
    let folder = copy_of_shipped();
    let file = folder.path().join(WEIGHTS_FILE);
    let sound = std::fs::read(&file).expect("readable");
    for at in (0..sound.len()).step_by(sound.len() / 12) {
        let mut damaged = sound.clone();
        damaged[at] ^= 0x10;
        std::fs::write(&file, &damaged).expect("writable");
        match Model::load(folder.path()) {
            Err(error @ ModelError::Hash { .. }) => {
                let text = error.to_string();
                assert!(text.contains(WEIGHTS_FILE) && text.contains("restore the file"), "{text}");
            }
            other => panic!("byte {at}: {other:?}"),
        }
    }
    std::fs::remove_file(&file).expect("removable");
    assert!(matches!(Model::load(folder.path()), Err(ModelError::Missing { .. })));
    std::fs::write(folder.path().join(CARD_FILE), "{}").expect("writable");
    assert!(matches!(Model::load(folder.path()), Err(ModelError::Card { .. })));
}

/// Weights of another shape, or with numbers that are none, are refused though their hash fits.
#[test]
fn foreign_models_are_refused() {
    let folder = copy_of_shipped();
    let file = folder.path().join(WEIGHTS_FILE);
    let card_file = folder.path().join(CARD_FILE);
    let sound = candle_core::safetensors::load(&file, &Device::Cpu).expect("readable");
    let name = "class.out.bias";
    for numbers in [vec![0.0_f32; 7], vec![f32::NAN; 8]] {
        let mut tensors = sound.clone();
        tensors.insert(name.into(), Tensor::new(numbers, &Device::Cpu).expect("small"));
        candle_core::safetensors::save(&tensors, &file).expect("writable");
        let mut card = crate::perception::Card::read(&card_file).expect("a card");
        card.weights_blake3 = blake3::hash(&std::fs::read(&file).expect("readable")).to_hex().to_string();
        card.write(&card_file).expect("writable");
        match Model::load(folder.path()) {
            Err(error @ ModelError::Shape { .. }) => {
                assert!(error.to_string().contains(name), "{error}")
            }
            other => panic!("{other:?}"),
        }
    }
}

fn geometry(class: FeatureClass, [diameter, depth, length, width, pitch, angle]: [f64; 6]) -> FeatureGeometry {
    FeatureGeometry { class, diameter, depth, length, width, pitch, angle, chamfer: 0.0 }
}

/// A cloud of a threaded bore in a plate, as the plant's camera sees it, from a known place.
fn cloud_of_a_bore(request: u32, seq: u64) -> (Box<PointCloud>, Isometry3<f64>) {
    let feature = geometry(FeatureClass::ThreadedHole, [0.016, 0.014, 0.0, 0.0, 0.002, 0.0]);
    let part_from_feature = Isometry3::translation(0.0, 0.0, 0.01);
    let solid = Solid::new(&Body::Box { size: [0.2, 0.2, 0.02] }, &feature, &part_from_feature);
    let carrier = part_from_feature.inverse() * Isometry3::translation(0.0, 0.0, -0.01);
    let surroundings = Surroundings::on_carrier(&carrier);
    let base_from_feature = Isometry3::new(Vector3::new(0.4, -0.5, 0.07), Vector3::new(0.02, 0.0, 0.3));
    let pose = feature_from_camera(0.35, TILT, 0.7, 0.0, [0.002, 0.001, 0.0]);
    let view = View {
        solid: &solid,
        surroundings: &surroundings,
        feature_from_camera: pose,
        focus: 0.35,
        half_width: half_width(&feature),
    };
    let mut cloud = Box::new(PointCloud::default());
    Camera::default().scan(&view, &mut ChaCha8Rng::seed_from_u64(4), &mut cloud);
    let base_from_camera = base_from_feature * pose;
    let q = base_from_camera.rotation.quaternion();
    cloud.base_from_camera =
        Pose { position: base_from_camera.translation.vector.into(), rotation: [q.i, q.j, q.k, q.w] };
    cloud.request = request;
    cloud.header = Header { seq, ..Header::default() };
    (cloud, base_from_feature)
}

/// The role answers a new cloud of a presented part once, repeatably, in the base frame.
#[test]
fn perception_answers_new_clouds_only_and_repeatably() {
    let mut perception = Perception::load(&shipped()).expect("the shipped model is sound");
    let mut feature = Feature::default();
    let (nothing, _) = cloud_of_a_bore(0, 1);
    perception.cycle(Stamp(1), &nothing, &mut feature);
    assert_eq!(feature, Feature::default(), "nothing is presented");

    let (cloud, base_from_feature) = cloud_of_a_bore(7, 2);
    perception.cycle(Stamp(2), &cloud, &mut feature);
    assert_eq!((feature.request, feature.cloud_seq), (7, 2));
    assert_eq!(feature.class.get(), Some(FeatureClass::ThreadedHole), "{feature:?}");
    assert_eq!(feature.recognition.get(), Some(Recognition::Sure), "{feature:?}");
    let off = Vector3::from(feature.base_from_feature.position) - base_from_feature.translation.vector;
    assert!(off.norm() < 1.5e-3, "{off:?}");
    let sum: f32 = feature.probabilities.iter().sum();
    assert!((sum - 1.0).abs() < 1e-5, "{sum}");

    let first = feature;
    feature.segment_count = 0;
    perception.cycle(Stamp(3), &cloud, &mut feature);
    assert_eq!(feature.segment_count, 0, "the same cloud is not looked at twice");
    let mut again = Feature::default();
    Perception::load(&shipped()).expect("sound").cycle(Stamp(9), &cloud, &mut again);
    assert_eq!(first, again);
}

/// Sampling, both looks and the fits of every class allocate nothing once as large a cloud was seen.
#[test]
fn a_recognition_allocates_nothing() {
    let mut perception = Perception::load(&shipped()).expect("the shipped model loads");
    let (mut sampler, mut clouds, mut classes) = (Sampler::new(), Vec::new(), [0; FEATURE_CLASSES]);
    for index in 0..40 {
        let mut cloud = Vec::new();
        example(&Domain::source(), 11, Split::Test, index, &mut sampler, &mut cloud);
        clouds.push(cloud);
    }
    clouds.sort_by_key(|cloud| std::cmp::Reverse(cloud.len()));
    for (i, cloud) in clouds.iter().enumerate() {
        let (seen, calls) = tandem_cycle::guard::counted(|| perception.recognise(cloud));
        let seen = seen.expect("there is enough to see");
        classes[seen.class.code() as usize] += 1;
        assert!(i == 0 || calls.is_none(), "cloud {i}, {}: {calls:?}", seen.class);
    }
    assert!(classes.iter().filter(|count| **count > 0).count() >= 7, "{classes:?}");
}

/// A faulty camera gets no answer, and no panic.
#[test]
fn unsound_clouds_show_no_part() {
    let mut perception = Perception::load(&shipped()).expect("the shipped model is sound");
    let (sound, _) = cloud_of_a_bore(1, 1);
    let faults: [fn(&mut PointCloud); 6] = [
        |c| c.points[17][1] = f32::NAN,
        |c| c.points[17][1] = f32::INFINITY,
        |c| c.point_count = u32::MAX,
        |c| c.point_count = 100,
        |c| c.points = [[0.1; 3]; tandem_msg::CLOUD_POINTS],
        |c| c.base_from_camera.rotation = [0.0; 4],
    ];
    for (k, fault) in faults.iter().enumerate() {
        let mut cloud = sound.clone();
        cloud.header.seq = 10 + k as u64;
        fault(&mut cloud);
        let mut feature = Feature::default();
        perception.cycle(Stamp(1), &cloud, &mut feature);
        assert_eq!(feature.recognition.get(), Some(Recognition::NoPart), "fault {k}: {feature:?}");
        assert_eq!(feature.cloud_seq, cloud.header.seq);
    }
}

/// Every part of the shipped product, eight looks each, a little off its place, as the cell's camera sees it:
/// at least nine in ten are recognised.
#[test]
fn the_parts_of_the_s471_box_are_recognised() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/cells/s471.toml");
    let cell = tandem_config::Cell::load(&file, None).expect("the shipped cell is sound");
    let mut perception = Perception::load(&shipped()).expect("the shipped model is sound");
    let (looks, mut right) = (8, 0);
    for part in &cell.product.parts {
        let solid = Solid::new(&part.body, &part.feature, &part.part_from_feature);
        let feature_from_carrier = part.part_from_feature.inverse() * part.station_from_part.inverse();
        let surroundings = Surroundings::on_carrier(&feature_from_carrier);
        let tilt = if part.view_tilt > 0.0 { part.view_tilt } else { TILT };
        let (mut hits, mut sure, mut worst) = (0, 0, 0.0_f64);
        for look in 0..looks {
            let mut rng = ChaCha8Rng::seed_from_u64(100 + look);
            let swing = 0.7 * look as f64;
            let azimuth = part.view_turn + std::f64::consts::FRAC_PI_2 + 0.03 * swing.sin();
            let aim = [0.002 * swing.sin(), 0.002 * swing.cos(), 0.0];
            let distance = cell.layout.camera.distance;
            let pose = feature_from_camera(distance, tilt, azimuth, 0.0, aim);
            let view = View {
                solid: &solid,
                surroundings: &surroundings,
                feature_from_camera: pose,
                focus: distance,
                half_width: half_width(&part.feature),
            };
            let mut cloud = Vec::new();
            let camera = Camera { range_sigma: cell.layout.camera.range_sigma, ..Camera::default() };
            camera.render(&view, tandem_msg::CLOUD_POINTS, &mut rng, |p, _| cloud.push(p));
            let answer = perception.recognise(&cloud).expect("enough points");
            if answer.class == part.feature.class {
                let probability = f64::from(answer.probabilities[answer.class.code() as usize]);
                hits += 1;
                sure += u32::from(probability >= perception.card().threshold && answer.fit.is_some());
                if let Some(fit) = answer.fit {
                    worst = worst.max((pose * fit.camera_from_feature).translation.vector.norm());
                }
            }
        }
        println!("{:>22}: {hits} of {looks} right, {sure} sure, worst position error {:.2} mm", part.name, worst * 1e3);
        right += hits;
    }
    let all = looks as usize * cell.product.parts.len();
    assert!(10 * right >= 9 * all, "{right} of {all} right");
}
