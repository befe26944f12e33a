//! How long is one step of a policy? Beside candle and ONNX Runtime on the same weights, one thread
//! each, and beside the least it can take on this machine: reading the weights that a step reads.
#![allow(
    unsafe_code,
    clippy::disallowed_types,
    clippy::disallowed_macros,
    clippy::disallowed_methods,
    reason = "a bench"
)]

#[path = "../tests/policy/random.rs"]
mod random;

use candle_core::{Device, Result, Tensor};
use tandem_peers::{Bench, Contender, Program, per_call, python};
use tandem_policy::{ADAPTER, Activations, HIDDEN, Lateral, Policy, Shape};

/// Observations that take turns, so that no branch is learned by heart.
const OBSERVATIONS: usize = 64;

fn main() {
    let bench = Bench::new("policy_step");
    // SAFETY: there is no other thread yet. One thread each; candle's are faster alone, too.
    unsafe { std::env::set_var("RAYON_NUM_THREADS", "1") };
    let shape = Shape { inputs: 48, outputs: 6, columns: 2, lateral: Lateral::Adapter };
    let numbers = random::random(&shape, 7);
    let observations: Vec<Vec<f32>> =
        (0..OBSERVATIONS as u64).map(|o| (0..shape.inputs).map(|i| random::noise(o, i)).collect()).collect();
    let policy = Policy::new(shape, &numbers).expect("as many numbers as the shape has");
    let candle = Candle::new(&shape, &numbers).expect("candle takes the weights");
    agree(&shape, &policy, &candle, &observations);

    let mut onnx = bench.program("onnxruntime", || {
        let file = std::env::temp_dir().join(format!("tandem-policy-{}.f32", std::process::id()));
        let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        std::fs::write(&file, bytes).map_err(|error| tandem_peers::Absent(error.to_string()))?;
        let python = python("onnx", &["numpy", "onnx", "onnxruntime"])?;
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/benches/policy_step.py");
        let started = Program::start(python.command().arg(script).arg(&file));
        let _ = std::fs::remove_file(&file);
        started
    });

    let calls = if bench.is_brief() { 64 } else { 2_000 };
    let (mut room, mut narrow_room, mut action) = (Activations::default(), Activations::default(), [0.0; 6]);
    let mut step = |policy: &Policy<'_>, room: &mut Activations, call: u32| {
        policy.act(room, &observations[call as usize % OBSERVATIONS], &mut action).expect("finite");
        action[0]
    };
    let read = read_in_a_step(&shape, &numbers, &observations);
    eprintln!("a step reads {:.0} kB of {:.0} kB of weights", read as f64 * 4e-3, numbers.len() as f64 * 4e-3);
    let ours = |policy: Policy<'_>, room: &mut Activations| per_call(calls, |call| step(&policy, room, call)) * 1e-3;
    let ours = std::cell::RefCell::new(ours);
    let mut contenders = vec![
        Contender::new("ours", || (ours.borrow_mut())(policy, &mut room)),
        Contender::new("machine limit", || {
            // Another part each time, as another observation reads other rows.
            let part = |call: u32| call as usize % OBSERVATIONS * (numbers.len() - read) / OBSERVATIONS;
            per_call(calls, |call| sum(&numbers[part(call)..][..read])) * 1e-3
        }),
        Contender::new("ours, 128-bit", || (ours.borrow_mut())(policy.narrow(), &mut narrow_room)),
        Contender::new("candle", || {
            per_call(calls / 8, |call| candle.act(&observations[call as usize % OBSERVATIONS])) * 1e-3
        }),
    ];
    contenders.extend(onnx.as_mut().map(|onnx| Contender::new("onnxruntime", || onnx.round("step"))));
    bench.compare("two columns, adapters, 48 inputs", "us", contenders);
}

/// The peer on the same weights must say the same, or the comparison means nothing.
fn agree(shape: &Shape, policy: &Policy<'_>, candle: &Candle, observations: &[Vec<f32>]) {
    let mut room = Activations::default();
    for observation in observations {
        let mut action = vec![0.0; shape.outputs];
        policy.act(&mut room, observation, &mut action).expect("finite");
        for (ours, theirs) in action.iter().zip(candle.act(observation).expect("candle computes")) {
            assert!((ours - theirs).abs() < 1e-4, "{ours} and {theirs}");
        }
    }
}

/// Weights read in a step, on average: rows of zero inputs are skipped.
fn read_in_a_step(shape: &Shape, numbers: &[f32], observations: &[Vec<f32>]) -> usize {
    let candle = Candle::new(shape, numbers).expect("candle takes the weights");
    let active = |h: &[f32]| h.iter().filter(|h| **h != 0.0).count();
    let read: usize = observations
        .iter()
        .map(|observation| {
            let layers = candle.layers(observation).expect("candle computes");
            let (hidden, adapters) = (&layers.hidden, &layers.adapters);
            let mut read = 2 * shape.inputs * HIDDEN;
            read += (active(&hidden[0]) + active(&hidden[2])) * HIDDEN + active(&hidden[3]) * shape.outputs;
            read += (active(&hidden[0]) + active(&hidden[1])) * ADAPTER;
            read + active(&adapters[0]) * HIDDEN + active(&adapters[1]) * shape.outputs
        })
        .sum();
    read / observations.len()
}

/// Sum of the numbers, as fast as they can be read.
fn sum(numbers: &[f32]) -> f32 {
    #[inline(always)]
    fn lanes(numbers: &[f32]) -> f32 {
        let mut lanes = [0.0_f32; 64];
        for chunk in numbers.chunks_exact(64) {
            for (lane, number) in lanes.iter_mut().zip(chunk) {
                *lane += number;
            }
        }
        lanes.iter().sum()
    }
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2")]
        fn wide(numbers: &[f32]) -> f32 {
            lanes(numbers)
        }
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the processor was found to have AVX2.
            return unsafe { wide(numbers) };
        }
    }
    lanes(numbers)
}

/// The same two columns on candle's tensors.
struct Candle {
    tensors: Vec<Tensor>,
    inputs: usize,
}

struct Layers {
    /// Column 1 first: its two layers, then those of column 2.
    hidden: Vec<Vec<f32>>,
    adapters: Vec<Vec<f32>>,
    action: Vec<f32>,
}

impl Candle {
    fn new(shape: &Shape, numbers: &[f32]) -> Result<Self> {
        let (x, y) = (shape.inputs, shape.outputs);
        let column = [(x, HIDDEN), (1, HIDDEN), (HIDDEN, HIDDEN), (1, HIDDEN)];
        let lateral = |width| [(1, 1), (HIDDEN, ADAPTER), (ADAPTER, width)];
        let mut sizes = vec![(1, x), (1, x), (1, y)];
        sizes.extend(column);
        sizes.extend([(HIDDEN, y), (1, y)]);
        sizes.extend(column);
        sizes.extend(lateral(HIDDEN));
        sizes.extend([(HIDDEN, y), (1, y)]);
        sizes.extend(lateral(y));
        let mut at = 0;
        let tensors = sizes
            .into_iter()
            .map(|(rows, columns)| {
                let block = &numbers[at..at + rows * columns];
                at += rows * columns;
                Tensor::from_slice(block, (rows, columns), &Device::Cpu)
            })
            .collect::<Result<Vec<_>>>()?;
        assert_eq!(at, numbers.len(), "every number is in a tensor");
        Ok(Self { tensors, inputs: x })
    }

    fn layers(&self, observation: &[f32]) -> Result<Layers> {
        let t = &self.tensors;
        let x = Tensor::from_slice(observation, (1, self.inputs), &Device::Cpu)?.sub(&t[0])?.mul(&t[1])?;
        let dense = |x: &Tensor, at: usize| x.matmul(&t[at])?.add(&t[at + 1]);
        let adapter = |h: &Tensor, at: usize| h.broadcast_mul(&t[at])?.matmul(&t[at + 1])?.relu();
        let first = dense(&x, 3)?.relu()?;
        let second = dense(&first, 5)?.relu()?;
        let own = dense(&x, 9)?.relu()?;
        let low = adapter(&first, 13)?;
        let own_second = dense(&own, 11)?.add(&low.matmul(&t[15])?)?.relu()?;
        let high = adapter(&second, 18)?;
        let action = dense(&own_second, 16)?.add(&high.matmul(&t[20])?)?.tanh()?.mul(&t[2])?;
        let plain = |tensor: &Tensor| tensor.flatten_all()?.to_vec1::<f32>();
        Ok(Layers {
            hidden: [&first, &second, &own, &own_second].into_iter().map(plain).collect::<Result<_>>()?,
            adapters: [&low, &high].into_iter().map(plain).collect::<Result<_>>()?,
            action: plain(&action)?,
        })
    }

    fn act(&self, observation: &[f32]) -> Result<Vec<f32>> {
        Ok(self.layers(observation)?.action)
    }
}
