//! The encoder–decoder network (Section 2.1, Fig. 3 of the paper), a point-cloud transformer.
//!
//! ```text
//! 512 points × 10 ── groups 64 × 16 × 13 ── embed 32, 64 ── max over members ── 64 tokens × 64
//!   ── 4 × offset attention (q and k share weights, 16 wide) ── tokens and all four layers: 320
//!   ── fuse 256 ──┬─ max and mean over tokens: 512 ── 128 ── 8 class logits
//!                 └─ to each point from its nearest 3 centres + own 13 + cloud 512 ── 64 ── 32 ── 1 segment logit
//! ```
//!
//! Every weight is a plain matrix input × output, so that rows × channels flow through
//! without transposes. Normalisation is by batch statistics while training and by their
//! running means afterwards.

use std::cell::RefCell;
use std::sync::{Arc, Mutex, PoisonError};

use candle_core::{D, DType, Device, Result, Tensor};
use tandem_msg::FEATURE_CLASSES;

use super::ops::{AffineRelu, BatchNormRelu, BatchStatistics, MaxOverMembers, Softmax};
use super::sample::{CENTRES, CHANNELS, HOMES, NEIGHBOURS, POINTS, Sample};

/// Name of the architecture, in cards.
pub const ARCHITECTURE: &str = "pct-512x10-64x16-d64-4";
/// Width of a group member.
pub(crate) const EMBED: usize = 32;
/// Width of a token.
pub(crate) const WIDTH: usize = 64;
/// Width of queries and keys.
pub(crate) const KEY_WIDTH: usize = 16;
pub(crate) const LAYERS: usize = 4;
pub(crate) const FUSED: usize = 256;
pub(crate) const CLASS_HIDDEN: usize = 128;
pub(crate) const SEGMENT_HIDDEN: [usize; 2] = [64, 32];
/// Numbers a group member, and numbers a point brings to the segmentation head.
pub(crate) const MEMBER: usize = CHANNELS + 3;
/// Share of a batch in the running statistics.
pub(crate) const MOMENTUM: f32 = 0.1;
/// Brings places inside a group, and the local shape, to the size of the other inputs.
const ZOOM: f32 = 5.0;
const SHAPE_ZOOM: f32 = 4.0;

/// What the network reads of a point `p` seen from a centre `c`: place from the centre, place,
/// normal, local shape.
#[inline(always)]
pub(crate) fn member(p: &[f32; CHANNELS], c: &[f32; CHANNELS]) -> [f32; MEMBER] {
    let [x, y, z, nx, ny, nz, fine, coarse, bulge, alignment] = *p;
    let [u, v, w] = [x - c[0], y - c[1], z - c[2]].map(|d| d * ZOOM);
    let shape = [fine, coarse, bulge, 1.0 - alignment].map(|s| s * SHAPE_ZOOM);
    [u, v, w, x, y, z, nx, ny, nz, shape[0], shape[1], shape[2], shape[3]]
}

/// Where the network's numbers come from.
pub trait Source {
    /// A trainable tensor of this shape.
    ///
    /// # Errors
    /// When there is none of that name and shape.
    fn weight(&mut self, name: &str, shape: &[usize], kind: Kind) -> Result<Tensor>;
    /// Running statistics, `width` numbers.
    ///
    /// # Errors
    /// When there are none of that name and width.
    fn statistics(&mut self, name: &str, width: usize, kind: Kind) -> Result<Vec<f32>>;
}

/// What a tensor is for, and so how it starts out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Matrix input × output.
    Matrix,
    /// Starts at one.
    Gain,
    /// Starts at zero.
    Bias,
}

/// A linear layer, normalisation and ReLU.
#[derive(Debug)]
struct Block {
    name: String,
    weight: Tensor,
    gain: Tensor,
    bias: Tensor,
    running: RefCell<BatchStatistics>,
}

impl Block {
    fn new(source: &mut dyn Source, name: &str, input: usize, output: usize) -> Result<Self> {
        Ok(Self {
            name: name.to_owned(),
            weight: source.weight(&format!("{name}.weight"), &[input, output], Kind::Matrix)?,
            gain: source.weight(&format!("{name}.gain"), &[output], Kind::Gain)?,
            bias: source.weight(&format!("{name}.bias"), &[output], Kind::Bias)?,
            running: RefCell::new(BatchStatistics {
                mean: source.statistics(&format!("{name}.mean"), output, Kind::Bias)?,
                variance: source.statistics(&format!("{name}.variance"), output, Kind::Gain)?,
            }),
        })
    }

    fn forward(&self, x: &Tensor, training: bool) -> Result<Tensor> {
        self.normalise(&x.matmul(&self.weight)?, training)
    }

    /// Normalisation and ReLU of what the linear layer gave.
    fn normalise(&self, x: &Tensor, training: bool) -> Result<Tensor> {
        if !training {
            let (gain, bias) = (self.gain.to_vec1::<f32>()?, self.bias.to_vec1::<f32>()?);
            return x.apply_op1_no_bwd(&AffineRelu::new(&gain, &bias, &self.running.borrow()));
        }
        let statistics = Arc::new(Mutex::new(BatchStatistics::default()));
        let y = x.apply_op3(&self.gain, &self.bias, BatchNormRelu { statistics: statistics.clone() })?;
        let batch = statistics.lock().unwrap_or_else(PoisonError::into_inner);
        let mut running = self.running.borrow_mut();
        let BatchStatistics { mean, variance } = &mut *running;
        for (old, new) in mean.iter_mut().zip(&batch.mean).chain(variance.iter_mut().zip(&batch.variance)) {
            *old += MOMENTUM * (new - *old);
        }
        drop(running);
        drop(batch);
        Ok(y)
    }
}

/// Offset attention: the layer works on the difference of its input and the attended values.
#[derive(Debug)]
struct Attention {
    key: Tensor,
    value: Tensor,
    place: Tensor,
    offset: Block,
}

impl Attention {
    fn new(source: &mut dyn Source, name: &str) -> Result<Self> {
        Ok(Self {
            key: source.weight(&format!("{name}.key"), &[WIDTH, KEY_WIDTH], Kind::Matrix)?,
            value: source.weight(&format!("{name}.value"), &[WIDTH, WIDTH], Kind::Matrix)?,
            place: source.weight(&format!("{name}.place"), &[3, WIDTH], Kind::Matrix)?,
            offset: Block::new(source, &format!("{name}.offset"), WIDTH, WIDTH)?,
        })
    }

    /// `x`: batch·tokens × width; `places`: batch·tokens × 3.
    fn forward(&self, x: &Tensor, places: &Tensor, batch: usize, training: bool) -> Result<Tensor> {
        let x = (x + places.matmul(&self.place)?)?;
        let key = x.matmul(&self.key)?.reshape((batch, CENTRES, KEY_WIDTH))?;
        let energy = (key.matmul(&key.transpose(1, 2)?.contiguous()?)? * (KEY_WIDTH as f64).powf(-0.5))?;
        let attention = energy.apply_op1(Softmax)?;
        // Softmax over the keys, then L1 over the queries, as in PCT: damps tokens all look at.
        let attention = attention.broadcast_div(&(attention.sum_keepdim(1)? + 1e-9)?)?;
        let value = x.matmul(&self.value)?.reshape((batch, CENTRES, WIDTH))?;
        let seen = attention.transpose(1, 2)?.contiguous()?.matmul(&value)?.reshape((batch * CENTRES, WIDTH))?;
        &x + self.offset.forward(&(&x - seen)?, training)?
    }
}

/// A batch as the network reads it.
#[derive(Clone, Debug)]
pub struct Input {
    batch: usize,
    /// batch·centres·neighbours × 13.
    members: Tensor,
    /// batch·centres × 3.
    places: Tensor,
    /// batch·points/stride × 13.
    points: Tensor,
    /// Row of each of these points' centres, and their shares in it.
    homes: [(Tensor, Tensor); HOMES],
}

impl Input {
    /// The batch of these samples; every `stride`-th point is segmented.
    ///
    /// # Errors
    /// As candle reports them; none for well-formed samples.
    pub fn of(samples: &[&Sample], stride: usize, device: &Device) -> Result<Self> {
        let batch = samples.len();
        let mut members = Vec::with_capacity(batch * CENTRES * NEIGHBOURS * MEMBER);
        let mut places = Vec::with_capacity(batch * CENTRES * 3);
        let mut points = Vec::with_capacity(batch * POINTS.div_ceil(stride) * MEMBER);
        let mut homes: [(Vec<u32>, Vec<f32>); HOMES] = Default::default();
        for (b, sample) in samples.iter().enumerate() {
            for (centre, group) in sample.centres.iter().zip(&sample.groups) {
                let c = &sample.points[usize::from(*centre)];
                places.extend_from_slice(&c[..3]);
                for &index in group {
                    members.extend_from_slice(&member(&sample.points[usize::from(index)], c));
                }
            }
            for (i, p) in sample.points.iter().enumerate().step_by(stride) {
                let c = &sample.points[usize::from(sample.centres[usize::from(sample.home[i][0])])];
                points.extend_from_slice(&member(p, c));
                for (k, (rows, shares)) in homes.iter_mut().enumerate() {
                    rows.push((b * CENTRES) as u32 + u32::from(sample.home[i][k]));
                    shares.push(sample.share[i][k]);
                }
            }
        }
        let count = points.len() / MEMBER;
        let [a, b, c]: [Result<_>; HOMES] =
            homes.map(|(rows, shares)| Ok((Tensor::new(rows, device)?, Tensor::from_vec(shares, (count, 1), device)?)));
        Ok(Self {
            batch,
            members: Tensor::from_vec(members, (batch * CENTRES * NEIGHBOURS, MEMBER), device)?,
            places: Tensor::from_vec(places, (batch * CENTRES, 3), device)?,
            points: Tensor::from_vec(points, (count, MEMBER), device)?,
            homes: [a?, b?, c?],
        })
    }
}

/// What the network says of a batch.
#[derive(Clone, Debug)]
pub struct Output {
    /// Batch × classes.
    pub class_logits: Tensor,
    /// Batch·points/stride: above 0 for points of the feature.
    pub segment_logits: Tensor,
}

/// The network.
#[derive(Debug)]
pub struct Network {
    embed: [Block; 2],
    attention: Vec<Attention>,
    fuse: Block,
    class_hidden: Block,
    class_out: Tensor,
    class_bias: Tensor,
    segment_token: Tensor,
    segment_cloud: Tensor,
    segment_point: Block,
    segment_hidden: Block,
    segment_out: Tensor,
    segment_bias: Tensor,
}

impl Network {
    /// Builds the network on numbers from `source`, asked for in a fixed order.
    ///
    /// # Errors
    /// Those of the source.
    pub fn new(source: &mut dyn Source) -> Result<Self> {
        Ok(Self {
            embed: [
                Block::new(source, "encoder.embed.0", MEMBER, EMBED)?,
                Block::new(source, "encoder.embed.1", EMBED, WIDTH)?,
            ],
            attention: (0..LAYERS)
                .map(|i| Attention::new(source, &format!("encoder.attention.{i}")))
                .collect::<Result<_>>()?,
            fuse: Block::new(source, "encoder.fuse", WIDTH * (LAYERS + 1), FUSED)?,
            class_hidden: Block::new(source, "class.hidden", 2 * FUSED, CLASS_HIDDEN)?,
            class_out: source.weight("class.out.weight", &[CLASS_HIDDEN, FEATURE_CLASSES], Kind::Matrix)?,
            class_bias: source.weight("class.out.bias", &[FEATURE_CLASSES], Kind::Bias)?,
            segment_token: source.weight("segment.token", &[FUSED, SEGMENT_HIDDEN[0]], Kind::Matrix)?,
            segment_cloud: source.weight("segment.cloud", &[2 * FUSED, SEGMENT_HIDDEN[0]], Kind::Matrix)?,
            segment_point: Block::new(source, "segment.point", MEMBER, SEGMENT_HIDDEN[0])?,
            segment_hidden: Block::new(source, "segment.hidden", SEGMENT_HIDDEN[0], SEGMENT_HIDDEN[1])?,
            segment_out: source.weight("segment.out.weight", &[SEGMENT_HIDDEN[1], 1], Kind::Matrix)?,
            segment_bias: source.weight("segment.out.bias", &[1], Kind::Bias)?,
        })
    }

    /// Runs the network. While training, `dropout` multiplies the hidden layer of the
    /// classification head (batch × 128) and running statistics follow the batch.
    ///
    /// # Errors
    /// As candle reports them; none for a well-formed input.
    pub fn forward(&self, input: &Input, dropout: Option<&Tensor>) -> Result<Output> {
        let (training, batch) = (dropout.is_some(), input.batch);
        let embedded = self.embed[0].forward(&input.members, training)?;
        let embedded = self.embed[1].forward(&embedded, training)?;
        let mut x = embedded.reshape((batch * CENTRES, NEIGHBOURS, WIDTH))?.apply_op1(MaxOverMembers)?;
        let mut layers = vec![x.clone()];
        for attention in &self.attention {
            x = attention.forward(&x, &input.places, batch, training)?;
            layers.push(x.clone());
        }
        let fused = self.fuse.forward(&Tensor::cat(&layers, D::Minus1)?, training)?;

        let tokens = fused.reshape((batch, CENTRES, FUSED))?;
        let cloud = Tensor::cat(&[tokens.apply_op1(MaxOverMembers)?, tokens.mean(1)?], D::Minus1)?;
        let mut hidden = self.class_hidden.forward(&cloud, training)?;
        if let Some(mask) = dropout {
            hidden = (hidden * mask)?;
        }
        let class_logits = hidden.matmul(&self.class_out)?.broadcast_add(&self.class_bias)?;

        // Linear layers commute with the spreading of tokens and cloud to points: they run before it.
        let context = fused.matmul(&self.segment_token)?.reshape((batch, CENTRES, SEGMENT_HIDDEN[0]))?;
        let context = context.broadcast_add(&cloud.matmul(&self.segment_cloud)?.unsqueeze(1)?)?;
        let context = context.reshape((batch * CENTRES, SEGMENT_HIDDEN[0]))?;
        let mut own = input.points.matmul(&self.segment_point.weight)?;
        for (rows, shares) in &input.homes {
            own = (own + context.index_select(rows, 0)?.broadcast_mul(shares)?)?;
        }
        let hidden = self.segment_point.normalise(&own, training)?;
        let hidden = self.segment_hidden.forward(&hidden, training)?;
        let segment_logits = hidden.matmul(&self.segment_out)?.broadcast_add(&self.segment_bias)?.flatten_all()?;
        Ok(Output { class_logits, segment_logits })
    }

    /// Running statistics by name, in a fixed order, as they are stored beside the weights.
    ///
    /// # Errors
    /// As candle reports them; none in practice.
    pub fn statistics(&self) -> Result<Vec<(String, Tensor)>> {
        let mut blocks: Vec<&Block> = self.embed.iter().collect();
        blocks.extend(self.attention.iter().map(|a| &a.offset));
        blocks.extend([&self.fuse, &self.class_hidden, &self.segment_point, &self.segment_hidden]);
        let mut out = Vec::with_capacity(2 * blocks.len());
        for block in blocks {
            let running = block.running.borrow();
            for (what, numbers) in [("mean", &running.mean), ("variance", &running.variance)] {
                let tensor = Tensor::from_slice(numbers, numbers.len(), &Device::Cpu)?.to_dtype(DType::F32)?;
                out.push((format!("{}.{what}", block.name), tensor));
            }
        }
        Ok(out)
    }
}
