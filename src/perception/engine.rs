//! Inference: the network's forward pass without tensors.
//!
//! Normalisation is folded into the weights when they are read; every product adds its bias,
//! cuts at zero and pools on its way out of the registers; all that lies between is in
//! buffers made once. [`super::network`] is what it must agree with, and a test says it does.

use candle_core::Result;
use tandem_msg::FEATURE_CLASSES;

use super::kernel::{Add, Finish, LANES, Panels, Store, accumulate_transposed, exp, product, widest};
use super::network::{
    CLASS_HIDDEN, EMBED, FUSED, KEY_WIDTH, Kind, LAYERS, MEMBER, SEGMENT_HIDDEN, Source, WIDTH, member,
};
use super::sample::{CENTRES, NEIGHBOURS, POINTS, Sample};

/// Keeps a channel without variance finite; as in training.
pub(crate) const EPSILON: f32 = 1e-5;

/// A linear layer ready to be multiplied with, and what is added to it.
#[derive(Debug)]
struct Layer {
    panels: Panels,
    bias: Vec<f32>,
}

fn numbers(source: &mut dyn Source, name: &str, shape: &[usize], kind: Kind) -> Result<Vec<f32>> {
    source.weight(name, shape, kind)?.flatten_all()?.to_vec1()
}

/// Factor and term of each channel that stand for its normalisation.
fn normalisation(source: &mut dyn Source, name: &str, width: usize) -> Result<(Vec<f32>, Vec<f32>)> {
    let gain = numbers(source, &format!("{name}.gain"), &[width], Kind::Gain)?;
    let bias = numbers(source, &format!("{name}.bias"), &[width], Kind::Bias)?;
    let mean = source.statistics(&format!("{name}.mean"), width, Kind::Bias)?;
    let variance = source.statistics(&format!("{name}.variance"), width, Kind::Gain)?;
    let scale: Vec<f32> = gain.iter().zip(&variance).map(|(g, v)| g / (v + EPSILON).sqrt()).collect();
    let shift = bias.iter().zip(&mean).zip(&scale).map(|((b, m), s)| b - m * s).collect();
    Ok((scale, shift))
}

fn scaled(mut matrix: Vec<f32>, scale: &[f32]) -> Vec<f32> {
    for row in matrix.chunks_exact_mut(scale.len()) {
        row.iter_mut().zip(scale).for_each(|(w, s)| *w *= s);
    }
    matrix
}

impl Layer {
    fn normalised(source: &mut dyn Source, name: &str, input: usize, output: usize) -> Result<Self> {
        let weight = numbers(source, &format!("{name}.weight"), &[input, output], Kind::Matrix)?;
        let (scale, bias) = normalisation(source, name, output)?;
        Ok(Self { panels: Panels::new(&scaled(weight, &scale), input, output), bias })
    }

    /// The layer and its ReLU.
    fn rectified(&self, x: &[f32], out: &mut [f32]) {
        product(x, &self.panels, &mut Rectified { out, bias: &self.bias });
    }
}

#[derive(Debug)]
struct Attention {
    place: Panels,
    key: Panels,
    value: Panels,
    offset: Layer,
}

/// The network and room for one cloud.
#[derive(Debug)]
pub struct Engine {
    embed: [Layer; 2],
    attention: Vec<Attention>,
    fuse: Layer,
    class_hidden: Layer,
    class_out: Layer,
    segment_token: Panels,
    segment_cloud: Panels,
    segment_point: Layer,
    segment_hidden: Layer,
    segment_out: Vec<f32>,
    segment_bias: f32,
    room: Room,
}

#[derive(Debug)]
struct Room {
    members: Vec<f32>,
    embedded: Vec<f32>,
    places: Vec<f32>,
    tokens: Vec<f32>,
    placed: Vec<f32>,
    keys: Vec<f32>,
    key_panels: Panels,
    values: Vec<f32>,
    softmax: Vec<f32>,
    column: Vec<f32>,
    seen: Vec<f32>,
    layers: Vec<f32>,
    fused: Vec<f32>,
    cloud: Vec<f32>,
    hidden: Vec<f32>,
    context: Vec<f32>,
    level: Vec<f32>,
    points: Vec<f32>,
    point_hidden: Vec<f32>,
    logits: [f32; FEATURE_CLASSES],
    segment: Vec<f32>,
}

impl Room {
    fn new() -> Self {
        let of = |len| vec![0.0; len];
        Self {
            members: Vec::with_capacity(CENTRES * NEIGHBOURS * MEMBER),
            embedded: of(CENTRES * NEIGHBOURS * EMBED),
            places: Vec::with_capacity(CENTRES * 3),
            tokens: of(CENTRES * WIDTH),
            placed: of(CENTRES * WIDTH),
            keys: of(CENTRES * KEY_WIDTH),
            key_panels: Panels::new(&of(CENTRES * KEY_WIDTH), KEY_WIDTH, CENTRES),
            values: of(CENTRES * WIDTH),
            softmax: of(CENTRES * CENTRES),
            column: of(CENTRES),
            seen: of(CENTRES * WIDTH),
            layers: of(CENTRES * WIDTH * (LAYERS + 1)),
            fused: of(CENTRES * FUSED),
            cloud: of(2 * FUSED),
            hidden: of(CLASS_HIDDEN),
            context: of(CENTRES * SEGMENT_HIDDEN[0]),
            level: of(SEGMENT_HIDDEN[0]),
            points: Vec::with_capacity(POINTS * MEMBER),
            point_hidden: of(POINTS * SEGMENT_HIDDEN[0]),
            logits: [0.0; FEATURE_CLASSES],
            segment: of(POINTS),
        }
    }
}

impl Engine {
    /// Builds the engine on numbers from `source`.
    ///
    /// # Errors
    /// Those of the source.
    pub fn new(source: &mut dyn Source) -> Result<Self> {
        let attention = |source: &mut dyn Source, i: usize| {
            let name = format!("encoder.attention.{i}");
            // Queries and keys share weights: each takes half of the scale 1/√width.
            let half = (KEY_WIDTH as f32).powf(-0.25);
            let key = numbers(source, &format!("{name}.key"), &[WIDTH, KEY_WIDTH], Kind::Matrix)?;
            let value = numbers(source, &format!("{name}.value"), &[WIDTH, WIDTH], Kind::Matrix)?;
            let place = numbers(source, &format!("{name}.place"), &[3, WIDTH], Kind::Matrix)?;
            Ok(Attention {
                key: Panels::new(&scaled(key, &[half; KEY_WIDTH]), WIDTH, KEY_WIDTH),
                value: Panels::new(&value, WIDTH, WIDTH),
                place: Panels::new(&place, 3, WIDTH),
                offset: Layer::normalised(source, &format!("{name}.offset"), WIDTH, WIDTH)?,
            })
        };
        let segment_width = SEGMENT_HIDDEN[0];
        let (scale, bias) = normalisation(source, "segment.point", segment_width)?;
        let mut segment_panels = |name: &str, input: usize| -> Result<Panels> {
            let weight = numbers(source, name, &[input, segment_width], Kind::Matrix)?;
            Ok(Panels::new(&scaled(weight, &scale), input, segment_width))
        };
        let segment_token = segment_panels("segment.token", FUSED)?;
        let segment_cloud = segment_panels("segment.cloud", 2 * FUSED)?;
        let segment_point = Layer { panels: segment_panels("segment.point.weight", MEMBER)?, bias };
        let class_out = numbers(source, "class.out.weight", &[CLASS_HIDDEN, FEATURE_CLASSES], Kind::Matrix)?;
        Ok(Self {
            embed: [
                Layer::normalised(source, "encoder.embed.0", MEMBER, EMBED)?,
                Layer::normalised(source, "encoder.embed.1", EMBED, WIDTH)?,
            ],
            attention: (0..LAYERS).map(|i| attention(source, i)).collect::<Result<_>>()?,
            fuse: Layer::normalised(source, "encoder.fuse", WIDTH * (LAYERS + 1), FUSED)?,
            class_hidden: Layer::normalised(source, "class.hidden", 2 * FUSED, CLASS_HIDDEN)?,
            class_out: Layer {
                panels: Panels::new(&class_out, CLASS_HIDDEN, FEATURE_CLASSES),
                bias: numbers(source, "class.out.bias", &[FEATURE_CLASSES], Kind::Bias)?,
            },
            segment_token,
            segment_cloud,
            segment_point,
            segment_hidden: Layer::normalised(source, "segment.hidden", SEGMENT_HIDDEN[0], SEGMENT_HIDDEN[1])?,
            segment_out: numbers(source, "segment.out.weight", &[SEGMENT_HIDDEN[1], 1], Kind::Matrix)?,
            segment_bias: numbers(source, "segment.out.bias", &[1], Kind::Bias)?[0],
            room: Room::new(),
        })
    }

    /// Class logits of a sample, and the segment logit of each of its points.
    ///
    /// Allocates nothing.
    pub fn run(&mut self, sample: &Sample) -> (&[f32; FEATURE_CLASSES], &[f32]) {
        let room = &mut self.room;
        room.members.clear();
        room.places.clear();
        for (&centre, group) in sample.centres.iter().zip(&sample.groups) {
            let c = &sample.points[usize::from(centre)];
            room.places.extend_from_slice(&c[..3]);
            for &index in group {
                room.members.extend_from_slice(&member(&sample.points[usize::from(index)], c));
            }
        }
        self.embed[0].rectified(&room.members, &mut room.embedded);
        room.tokens.fill(f32::NEG_INFINITY);
        // The largest of what the ReLU would be taken of: the bias is common to a group.
        product(&room.embedded, &self.embed[1].panels, &mut Pooled { out: &mut room.tokens });
        rectify(&mut room.tokens, &self.embed[1].bias);

        let stride = WIDTH * (LAYERS + 1);
        for (layer, attention) in self.attention.iter().enumerate() {
            spread(&room.tokens, &mut room.layers, layer * WIDTH, stride);
            room.placed.copy_from_slice(&room.tokens);
            product(&room.places, &attention.place, &mut Add(&mut room.placed, WIDTH));
            product(&room.placed, &attention.key, &mut Store(&mut room.keys, KEY_WIDTH));
            product(&room.placed, &attention.value, &mut Store(&mut room.values, WIDTH));
            room.key_panels.fill_transposed(&room.keys, KEY_WIDTH, CENTRES);
            product(&room.keys, &room.key_panels, &mut Store(&mut room.softmax, CENTRES));
            soften(&mut room.softmax, &mut room.column);
            room.seen.fill(0.0);
            accumulate_transposed(&room.softmax, CENTRES, &room.values, WIDTH, &mut room.seen);
            for ((seen, placed), column) in
                room.seen.chunks_exact_mut(WIDTH).zip(room.placed.chunks_exact(WIDTH)).zip(&room.column)
            {
                let inverse = 1.0 / column;
                seen.iter_mut().zip(placed).for_each(|(s, u)| *s = u - *s * inverse);
            }
            attention.offset.rectified(&room.seen, &mut room.tokens);
            room.tokens.iter_mut().zip(&room.placed).for_each(|(x, u)| *x += u);
        }
        spread(&room.tokens, &mut room.layers, LAYERS * WIDTH, stride);
        self.fuse.rectified(&room.layers, &mut room.fused);

        let (top, mean) = room.cloud.split_at_mut(FUSED);
        summarise(&room.fused, top, mean);
        self.class_hidden.rectified(&room.cloud, &mut room.hidden);
        room.logits.copy_from_slice(&self.class_out.bias);
        product(&room.hidden, &self.class_out.panels, &mut Add(&mut room.logits, FEATURE_CLASSES));

        const S: usize = SEGMENT_HIDDEN[0];
        product(&room.fused, &self.segment_token, &mut Store(&mut room.context, S));
        room.level.copy_from_slice(&self.segment_point.bias);
        product(&room.cloud, &self.segment_cloud, &mut Add(&mut room.level, S));
        room.points.clear();
        for (p, home) in sample.points.iter().zip(&sample.home) {
            let c = &sample.points[usize::from(sample.centres[usize::from(home[0])])];
            room.points.extend_from_slice(&member(p, c));
        }
        let mut informed = Informed { out: &mut room.point_hidden, context: &room.context, level: &room.level, sample };
        product(&room.points, &self.segment_point.panels, &mut informed);
        room.segment.fill(self.segment_bias);
        let mut answer =
            Answered { out: &mut room.segment, bias: &self.segment_hidden.bias, weight: &self.segment_out };
        product(&room.point_hidden, &self.segment_hidden.panels, &mut answer);
        (&room.logits, &room.segment)
    }
}

impl Engine {
    /// Features of the cloud seen last: largest and mean of each channel over its tokens.
    pub(crate) fn features(&self) -> &[f32] {
        &self.room.cloud
    }
}

/// Adds the bias and cuts at zero.
struct Rectified<'a> {
    out: &'a mut [f32],
    bias: &'a [f32],
}

impl Finish for Rectified<'_> {
    #[inline(always)]
    fn row(&mut self, row: usize, column: usize, sums: &[f32; LANES]) {
        let width = self.bias.len();
        let to = &mut self.out[row * width + column..][..LANES];
        let bias = &self.bias[column..][..LANES];
        for l in 0..LANES {
            to[l] = (sums[l] + bias[l]).max(0.0);
        }
    }
}

/// Keeps the largest over the members of a group.
struct Pooled<'a> {
    out: &'a mut [f32],
}

impl Finish for Pooled<'_> {
    #[inline(always)]
    fn row(&mut self, row: usize, column: usize, sums: &[f32; LANES]) {
        let to = &mut self.out[row / NEIGHBOURS * WIDTH + column..][..LANES];
        for l in 0..LANES {
            to[l] = if sums[l] > to[l] { sums[l] } else { to[l] };
        }
    }
}

/// Adds what a point hears from its centres and of the cloud, and cuts at zero.
struct Informed<'a> {
    out: &'a mut [f32],
    context: &'a [f32],
    level: &'a [f32],
    sample: &'a Sample,
}

impl Finish for Informed<'_> {
    #[inline(always)]
    fn row(&mut self, row: usize, column: usize, sums: &[f32; LANES]) {
        const S: usize = SEGMENT_HIDDEN[0];
        let (home, share) = (&self.sample.home[row], &self.sample.share[row]);
        let mut sums = *sums;
        let level = &self.level[column..][..LANES];
        for l in 0..LANES {
            sums[l] += level[l];
        }
        for (&home, share) in home.iter().zip(share) {
            let context = &self.context[usize::from(home) * S + column..][..LANES];
            for l in 0..LANES {
                sums[l] = share.mul_add(context[l], sums[l]);
            }
        }
        let to = &mut self.out[row * S + column..][..LANES];
        for l in 0..LANES {
            to[l] = sums[l].max(0.0);
        }
    }
}

/// The last two layers at once: cuts at zero and adds the weighted rest to the point's logit.
struct Answered<'a> {
    out: &'a mut [f32],
    bias: &'a [f32],
    weight: &'a [f32],
}

impl Finish for Answered<'_> {
    #[inline(always)]
    fn row(&mut self, row: usize, column: usize, sums: &[f32; LANES]) {
        let (bias, weight) = (&self.bias[column..][..LANES], &self.weight[column..][..LANES]);
        let mut parts = [0.0_f32; LANES];
        for l in 0..LANES {
            parts[l] = (sums[l] + bias[l]).max(0.0) * weight[l];
        }
        let mut half = LANES / 2;
        while half > 0 {
            for l in 0..half {
                parts[l] += parts[l + half];
            }
            half /= 2;
        }
        self.out[row] += parts[0];
    }
}

widest! {
    fn rectify(rows: &mut [f32], bias: &[f32]) {
        for row in rows.chunks_exact_mut(bias.len()) {
            row.iter_mut().zip(bias).for_each(|(v, b)| *v = (*v + b).max(0.0));
        }
    }
}

widest! {
    /// Largest and mean of each channel over the tokens.
    fn summarise(rows: &[f32], top: &mut [f32], mean: &mut [f32]) {
        top.fill(f32::NEG_INFINITY);
        mean.fill(0.0);
        for row in rows.chunks_exact(FUSED) {
            for ((v, top), mean) in row.iter().zip(&mut *top).zip(&mut *mean) {
                *top = if *v > *top { *v } else { *top };
                *mean += v;
            }
        }
        mean.iter_mut().for_each(|m| *m *= 1.0 / CENTRES as f32);
    }
}

widest! {
    /// Softmax of each row of square matrices, in place, and the column sums of each matrix.
    fn soften(energy: &mut [f32], column: &mut [f32]) {
        for (matrix, column) in energy.chunks_exact_mut(CENTRES * CENTRES).zip(column.chunks_exact_mut(CENTRES)) {
            column.fill(1e-9);
            for row in matrix.chunks_exact_mut(CENTRES) {
                let top = row.iter().fold(f32::NEG_INFINITY, |m, v| m.max(*v));
                row.iter_mut().for_each(|v| *v = exp(*v - top));
                let inverse = 1.0 / row.iter().sum::<f32>();
                for (v, c) in row.iter_mut().zip(&mut *column) {
                    *v *= inverse;
                    *c += *v;
                }
            }
        }
    }
}

/// Rows of [`WIDTH`] to their columns among those of all layers.
fn spread(rows: &[f32], to: &mut [f32], column: usize, stride: usize) {
    for (row, to) in rows.chunks_exact(WIDTH).zip(to.chunks_exact_mut(stride)) {
        to[column..column + WIDTH].copy_from_slice(row);
    }
}
