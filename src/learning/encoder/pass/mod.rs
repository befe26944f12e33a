//! Forward and backward pass of the network over one shard of a batch.
//!
//! [`crate::perception::network`] defines the network in candle, whose gradients are taken
//! operation by operation. Training needs the same numbers several times faster: here every
//! product runs on the kernels of inference, normalisation is fused with its ReLU, and what the
//! backward pass needs is kept in buffers that are made once. A test holds outputs and
//! gradients of both together.
//!
//! A shard has its own batch statistics, so that shards can be computed by different threads and
//! added up in a fixed order: the result does not depend on the number of threads.

mod backward;
mod forward;
mod norm;

use std::collections::BTreeMap;
use std::ops::Range;

use tandem_msg::Coded;

use super::dataset::Look;
use crate::perception::kernel::Panels;
use crate::perception::network::{CLASS_HIDDEN, EMBED, FUSED, KEY_WIDTH, LAYERS, SEGMENT_HIDDEN, WIDTH, member};
use crate::perception::sample::{CENTRES, HOMES};
use norm::Normalised;

/// Share of the label spread over all classes.
pub(crate) const SMOOTHING: f32 = 0.05;
/// Weight of the segmentation.
pub(crate) const SEGMENT: f32 = 0.5;
/// Every so many points of a cloud are segmented in training; which of them changes with the look.
pub(crate) const SEGMENT_STRIDE: usize = 2;

/// Where each tensor lies in one flat vector, in the order of their names.
#[derive(Clone, Debug, Default)]
pub(crate) struct Spans {
    spans: BTreeMap<String, Range<usize>>,
    len: usize,
}

impl Spans {
    pub(crate) fn add(&mut self, name: &str, len: usize) {
        self.spans.insert(name.to_owned(), self.len..self.len + len);
        self.len += len;
    }

    pub(crate) fn of(&self, name: &str) -> Range<usize> {
        self.spans.get(name).cloned().unwrap_or_else(|| panic!("the network has a tensor {name}"))
    }

    pub(crate) fn len(&self) -> usize {
        self.len
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = (&String, &Range<usize>)> {
        self.spans.iter()
    }
}

/// A linear layer with normalisation and ReLU: spans of its numbers, and of its statistics.
#[derive(Clone, Debug)]
struct Block {
    weight: Range<usize>,
    gain: Range<usize>,
    bias: Range<usize>,
    mean: Range<usize>,
    variance: Range<usize>,
    output: usize,
}

#[derive(Clone, Debug)]
struct Attention {
    key: Range<usize>,
    value: Range<usize>,
    place: Range<usize>,
    offset: Block,
}

/// The network's tensors by their place.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    embed: [Block; 2],
    attention: Vec<Attention>,
    fuse: Block,
    class_hidden: Block,
    class_out: Range<usize>,
    class_bias: Range<usize>,
    segment_token: Range<usize>,
    segment_cloud: Range<usize>,
    segment_point: Block,
    segment_hidden: Block,
    segment_out: Range<usize>,
    segment_bias: Range<usize>,
    parameters: usize,
    statistics: usize,
}

impl Plan {
    pub(crate) fn new(parameters: &Spans, statistics: &Spans) -> Self {
        let of = |name: &str| parameters.of(name);
        let block = |name: &str, output| Block {
            weight: of(&format!("{name}.weight")),
            gain: of(&format!("{name}.gain")),
            bias: of(&format!("{name}.bias")),
            mean: statistics.of(&format!("{name}.mean")),
            variance: statistics.of(&format!("{name}.variance")),
            output,
        };
        let attention = |i: usize| {
            let name = format!("encoder.attention.{i}");
            Attention {
                key: of(&format!("{name}.key")),
                value: of(&format!("{name}.value")),
                place: of(&format!("{name}.place")),
                offset: block(&format!("{name}.offset"), WIDTH),
            }
        };
        Self {
            embed: [block("encoder.embed.0", EMBED), block("encoder.embed.1", WIDTH)],
            attention: (0..LAYERS).map(attention).collect(),
            fuse: block("encoder.fuse", FUSED),
            class_hidden: block("class.hidden", CLASS_HIDDEN),
            class_out: of("class.out.weight"),
            class_bias: of("class.out.bias"),
            segment_token: of("segment.token"),
            segment_cloud: of("segment.cloud"),
            segment_point: block("segment.point", SEGMENT_HIDDEN[0]),
            segment_hidden: block("segment.hidden", SEGMENT_HIDDEN[1]),
            segment_out: of("segment.out.weight"),
            segment_bias: of("segment.out.bias"),
            parameters: parameters.len(),
            statistics: statistics.len(),
        }
    }
}

#[derive(Debug, Default)]
struct Attended {
    /// Input with its place.
    placed: Vec<f32>,
    key: Vec<f32>,
    value: Vec<f32>,
    /// Softmax over the keys; cloud by cloud.
    softmax: Vec<f32>,
    /// Its sums over the queries, cloud by cloud.
    column: Vec<f32>,
    seen: Vec<f32>,
    /// Input less what it saw.
    offset: Vec<f32>,
    norm: Normalised,
    out: Vec<f32>,
}

/// Buffers of a shard, and what it found.
#[derive(Debug, Default)]
pub(crate) struct Pass {
    pub(crate) gradient: Vec<f32>,
    /// Batch mean and variance of each normalised channel.
    pub(crate) statistics: Vec<f32>,
    pub(crate) loss: f32,
    pub(crate) class_logits: Vec<f32>,
    pub(crate) segment_logits: Vec<f32>,
    members: Vec<f32>,
    places: Vec<f32>,
    points: Vec<f32>,
    homes: Vec<([u32; HOMES], [f32; HOMES])>,
    marks: Vec<f32>,
    embed: [Normalised; 2],
    tokens: Vec<f32>,
    winners: Vec<u8>,
    attention: Vec<Attended>,
    fuse: Normalised,
    cloud: Vec<f32>,
    cloud_winners: Vec<u8>,
    class_hidden: Normalised,
    dropped: Vec<f32>,
    context: Vec<f32>,
    cloud_context: Vec<f32>,
    segment_point: Normalised,
    segment_hidden: Normalised,
    panels: Panels,
    scratch: [Vec<f32>; 8],
}

fn zeroed(buffer: &mut Vec<f32>, len: usize) -> &mut [f32] {
    buffer.clear();
    buffer.resize(len, 0.0);
    buffer
}

fn sized(buffer: &mut Vec<f32>, len: usize) -> &mut [f32] {
    buffer.resize(len, 0.0);
    buffer
}

/// What is asked of a shard: where its losses and their gradients come from.
#[derive(Clone, Debug, Default)]
pub(crate) struct Demand<'a> {
    /// Class each look should be answered with; `None` is as well as any.
    pub(crate) classes: Vec<Option<usize>>,
    /// So many looks, the first ones, should be segmented as they are marked.
    pub(crate) segmented: usize,
    /// Gradient of another loss by the features of the clouds, looks × [`FEATURES`].
    pub(crate) features: Option<&'a [f32]>,
    /// Gradient of another loss by the hidden layer of the classification head, looks × [`CLASS_HIDDEN`].
    pub(crate) hidden: Option<&'a [f32]>,
}

/// Features of a cloud: largest and mean of each channel over its tokens.
pub(crate) const FEATURES: usize = 2 * FUSED;

impl Pass {
    /// Loss of a shard of labelled looks, its gradient, statistics and logits. `mask` multiplies the
    /// hidden layer of the classification head.
    pub(crate) fn run(&mut self, plan: &Plan, parameters: &[f32], looks: &[&Look], mask: &[f32], phase: usize) {
        let classes = looks.iter().map(|look| Some(look.class.code() as usize)).collect();
        self.see(plan, parameters, looks, mask, phase);
        self.backward(plan, parameters, mask, &Demand { classes, segmented: looks.len(), ..Demand::default() });
    }

    /// Features, statistics and logits of a shard.
    pub(crate) fn see(&mut self, plan: &Plan, parameters: &[f32], looks: &[&Look], mask: &[f32], phase: usize) {
        self.statistics.resize(plan.statistics, 0.0);
        self.read(looks, phase);
        self.forward(plan, parameters, mask, looks.len());
    }

    /// Features of the clouds seen last, looks × [`FEATURES`].
    pub(crate) fn features(&self) -> &[f32] {
        &self.cloud
    }

    /// Hidden layer of the classification head, looks × [`CLASS_HIDDEN`].
    pub(crate) fn hidden(&self) -> &[f32] {
        &self.class_hidden.out
    }

    fn read(&mut self, looks: &[&Look], phase: usize) {
        self.members.clear();
        self.places.clear();
        self.points.clear();
        self.homes.clear();
        self.marks.clear();
        for (b, look) in looks.iter().enumerate() {
            let sample = &look.sample;
            for (centre, group) in sample.centres.iter().zip(&sample.groups) {
                let c = &sample.points[usize::from(*centre)];
                self.places.extend_from_slice(&c[..3]);
                for &index in group {
                    self.members.extend_from_slice(&member(&sample.points[usize::from(index)], c));
                }
            }
            for i in (phase..sample.points.len()).step_by(SEGMENT_STRIDE) {
                let home = sample.home[i];
                let c = &sample.points[usize::from(sample.centres[usize::from(home[0])])];
                self.points.extend_from_slice(&member(&sample.points[i], c));
                self.homes.push((home.map(|h| (b * CENTRES) as u32 + u32::from(h)), sample.share[i]));
                self.marks.push(f32::from(u8::from(look.segment[i])));
            }
        }
    }
}

/// Scale of the attention's energies, 1/√(key width).
const ENERGY: f32 = 0.25;
const _: () = assert!(KEY_WIDTH == 16);
