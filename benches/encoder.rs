//! How long does recognition take? Down-sampling and network beside PyTorch and ONNX Runtime on the same weights
//! and the same samples, one thread each; and where the time of a whole recognition goes.
//!
//! The peers get their inputs ready-made: gathered into groups, normalisation folded into the weights. What is
//! called `cloud` is down-sampling (ours, for everyone) and network; in `cloud against their network` the peer
//! has no down-sampling to do at all.

use std::cell::RefCell;
use std::io::Write;
use std::path::Path;

use tandem::learning::encoder::{Domain, Split, example};
use tandem::perception::{Model, Perception, Sample, Sampler, model};
use tandem_peers::{Absent, Bench, Contender, Program, Python, per_call, python};

/// Clouds that take turns.
const CLOUDS: u64 = 16;

fn main() {
    let bench = Bench::new("encoder");
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = root.join("config/models/s471");
    let mut model = Model::load(&folder).unwrap_or_else(|error| panic!("{error}"));
    let mut perception = Perception::load(&folder).unwrap_or_else(|error| panic!("{error}"));
    let mut sampler = Sampler::new();
    let clouds: Vec<Vec<[f32; 3]>> = (0..CLOUDS)
        .map(|index| {
            let mut cloud = Vec::new();
            example(&Domain::source(), 1, Split::Test, index, &mut sampler, &mut cloud);
            cloud
        })
        .collect();
    let samples: Vec<Sample> = clouds
        .iter()
        .map(|cloud| {
            let mut sample = Sample::default();
            assert!(sampler.sample(cloud, &mut sample), "the cloud of an example can be sampled");
            sample
        })
        .collect();

    let file = std::env::temp_dir().join(format!("tandem-encoder-{}.bin", std::process::id()));
    let peer = |name: &str, python: &dyn Fn() -> Result<Python, Absent>| {
        bench.program(name, || {
            write(&file, &samples, &folder).map_err(|error| Absent(error.to_string()))?;
            let script = root.join("benches/encoder.py");
            let weights = folder.join(model::WEIGHTS_FILE);
            Program::start(python()?.command().arg(script).arg(name).arg(weights).arg(&file))
        })
    };
    let onnx = peer("onnxruntime", &|| python("onnx", &["numpy", "onnx", "onnxruntime", "safetensors"]));
    let torch = peer("pytorch", &|| tandem_peers::pytorch("pytorch", &["numpy", "safetensors"]));
    let _ = std::fs::remove_file(&file);
    let peers: Vec<(&str, RefCell<Program>)> = [("onnxruntime", onnx), ("pytorch", torch)]
        .into_iter()
        .filter_map(|(name, peer)| Some((name, RefCell::new(peer?))))
        .collect();

    // Few, so that the least of the passes is one that nobody interrupted.
    let calls = if bench.is_brief() { 2 } else { CLOUDS as u32 };
    let of = |call: u32| call as usize % CLOUDS as usize;
    let room = RefCell::new((sampler, Sample::default(), model::Answer::default()));
    let sample = || {
        let (sampler, out, _) = &mut *room.borrow_mut();
        per_call(calls, |call| sampler.sample(&clouds[of(call)], out)) * 1e-6
    };
    let mut network = || {
        let answer = &mut room.borrow_mut().2;
        per_call(calls, |call| model.answer(&samples[of(call)], answer)) * 1e-6
    };
    // Their rounds answer milliseconds a cloud.
    let theirs = |peer: &RefCell<Program>| peer.borrow_mut().round("network");

    let mut contenders = vec![Contender::new("ours", &mut network)];
    contenders.extend(peers.iter().map(|(name, peer)| Contender::new(name, move || theirs(peer))));
    bench.compare("network", "ms", contenders);

    let mut contenders = vec![Contender::new("ours", || sample() + network())];
    contenders.extend(peers.iter().map(|(name, peer)| Contender::new(name, move || sample() + theirs(peer))));
    bench.compare("cloud", "ms", contenders);

    let mut contenders = vec![Contender::new("ours", || sample() + network())];
    contenders.extend(peers.iter().map(|(name, peer)| Contender::new(name, move || theirs(peer))));
    bench.compare("cloud against their network", "ms", contenders);

    // Where a recognition's time goes: two looks of down-sampling and network, then the fits.
    bench.compare("down-sampling", "ms", vec![Contender::new("ours", sample)]);
    let seeing = || per_call(calls, |call| perception.see(&clouds[of(call)]).is_some()) * 1e-6;
    bench.compare("two looks", "ms", vec![Contender::new("ours", seeing)]);
    let whole = || per_call(calls, |call| perception.recognise(&clouds[of(call)]).is_some()) * 1e-6;
    bench.compare("recognition", "ms", vec![Contender::new("ours", whole)]);
}

/// What the peers read, little-endian: the number of samples, then of each its points, indices and shares as 32-bit
/// numbers, and our logits, which theirs have to agree with.
fn write(file: &Path, samples: &[Sample], folder: &Path) -> std::io::Result<()> {
    let mut out = std::io::BufWriter::new(std::fs::File::create(file)?);
    let mut model = Model::load(folder).map_err(std::io::Error::other)?;
    out.write_all(&(samples.len() as u32).to_le_bytes())?;
    for sample in samples {
        let mut answer = model::Answer::default();
        model.answer(sample, &mut answer);
        let indices = sample.centres.iter().chain(sample.groups.as_flattened()).chain(sample.home.as_flattened());
        let numbers = |out: &mut dyn Write, numbers: &[f32]| -> std::io::Result<()> {
            numbers.iter().try_for_each(|number| out.write_all(&number.to_le_bytes()))
        };
        numbers(&mut out, sample.points.as_flattened())?;
        for index in indices {
            out.write_all(&u32::from(*index).to_le_bytes())?;
        }
        numbers(&mut out, sample.share.as_flattened())?;
        numbers(&mut out, &answer.logits)?;
    }
    out.flush()
}
