//! Forward.

use std::ops::Range;

use tandem_msg::FEATURE_CLASSES;

use super::{Attended, ENERGY, Pass, Plan, sized, zeroed};
use crate::perception::engine::soften;
use crate::perception::kernel::{Add, Panels, Store, accumulate_transposed, product, widest};
use crate::perception::network::{CLASS_HIDDEN, EMBED, FUSED, KEY_WIDTH, LAYERS, MEMBER, SEGMENT_HIDDEN, WIDTH};
use crate::perception::sample::{CENTRES, NEIGHBOURS};

widest! {
    /// Largest over the members of each group, and which it was.
    fn pool(rows: &[f32], members: usize, channels: usize, top: &mut [f32], winner: &mut [u8]) {
        for ((group, top), winner) in rows.chunks_exact(members * channels).zip(top.chunks_exact_mut(channels)).zip(winner.chunks_exact_mut(channels)) {
            top.copy_from_slice(&group[..channels]);
            winner.fill(0);
            for (m, row) in group.chunks_exact(channels).enumerate().skip(1) {
                for ((x, top), winner) in row.iter().zip(&mut *top).zip(&mut *winner) {
                    let beats = *x > *top;
                    *top = if beats { *x } else { *top };
                    *winner = if beats { m as u8 } else { *winner };
                }
            }
        }
    }
}

/// rows × depth times a weight depth × width.
fn linear(panels: &mut Panels, x: &[f32], weight: &[f32], depth: usize, width: usize, out: &mut Vec<f32>) {
    panels.fill(weight, depth, width);
    product(x, panels, &mut Store(sized(out, x.len() / depth * width), width));
}

impl Pass {
    pub(super) fn forward(&mut self, plan: &Plan, parameters: &[f32], mask: &[f32], batch: usize) {
        let p = |span: &Range<usize>| &parameters[span.clone()];
        let (panels, statistics) = (&mut self.panels, &mut self.statistics);
        let rows = batch * CENTRES;
        let [e0, e1] = &mut self.embed;
        linear(panels, &self.members, p(&plan.embed[0].weight), MEMBER, EMBED, &mut e0.raw);
        e0.forward(&plan.embed[0], parameters, statistics);
        linear(panels, &e0.out, p(&plan.embed[1].weight), EMBED, WIDTH, &mut e1.raw);
        e1.forward(&plan.embed[1], parameters, statistics);
        self.winners.resize(rows * WIDTH, 0);
        pool(&e1.out, NEIGHBOURS, WIDTH, sized(&mut self.tokens, rows * WIDTH), &mut self.winners);

        self.attention.resize_with(LAYERS, Attended::default);
        for layer in 0..LAYERS {
            let (before, rest) = self.attention.split_at_mut(layer);
            let (x, a, at) = (before.last().map_or(&self.tokens, |a| &a.out), &mut rest[0], &plan.attention[layer]);
            linear(panels, &self.places, p(&at.place), 3, WIDTH, &mut a.placed);
            a.placed.iter_mut().zip(x).for_each(|(u, x)| *u += x);
            linear(panels, &a.placed, p(&at.key), WIDTH, KEY_WIDTH, &mut a.key);
            linear(panels, &a.placed, p(&at.value), WIDTH, WIDTH, &mut a.value);
            let softmax = sized(&mut a.softmax, rows * CENTRES);
            for (key, energy) in
                a.key.chunks_exact(CENTRES * KEY_WIDTH).zip(softmax.chunks_exact_mut(CENTRES * CENTRES))
            {
                panels.fill_transposed(key, KEY_WIDTH, CENTRES);
                product(key, panels, &mut Store(energy, CENTRES));
                energy.iter_mut().for_each(|e| *e *= ENERGY);
            }
            soften(softmax, sized(&mut a.column, rows));
            let seen = zeroed(&mut a.seen, rows * WIDTH);
            for (b, seen) in seen.chunks_exact_mut(CENTRES * WIDTH).enumerate() {
                let softmax = &a.softmax[b * CENTRES * CENTRES..][..CENTRES * CENTRES];
                let value = &a.value[b * CENTRES * WIDTH..][..CENTRES * WIDTH];
                accumulate_transposed(softmax, CENTRES, value, WIDTH, seen);
                for (seen, column) in seen.chunks_exact_mut(WIDTH).zip(&a.column[b * CENTRES..]) {
                    let inverse = 1.0 / column;
                    seen.iter_mut().for_each(|s| *s *= inverse);
                }
            }
            let offset = sized(&mut a.offset, rows * WIDTH);
            for ((o, u), s) in offset.iter_mut().zip(&a.placed).zip(&*seen) {
                *o = u - s;
            }
            linear(panels, &a.offset, p(&at.offset.weight), WIDTH, WIDTH, &mut a.norm.raw);
            a.norm.forward(&at.offset, parameters, statistics);
            let out = sized(&mut a.out, rows * WIDTH);
            for ((o, u), y) in out.iter_mut().zip(&a.placed).zip(&a.norm.out) {
                *o = u + y;
            }
        }

        let raw = zeroed(&mut self.fuse.raw, rows * FUSED);
        let layers = std::iter::once(&self.tokens).chain(self.attention.iter().map(|a| &a.out));
        for (x, weight) in layers.zip(p(&plan.fuse.weight).chunks_exact(WIDTH * FUSED)) {
            panels.fill(weight, WIDTH, FUSED);
            product(x, panels, &mut Add(raw, FUSED));
        }
        self.fuse.forward(&plan.fuse, parameters, statistics);

        let cloud = sized(&mut self.cloud, batch * 2 * FUSED);
        self.cloud_winners.resize(batch * FUSED, 0);
        for (b, (tokens, cloud)) in
            self.fuse.out.chunks_exact(CENTRES * FUSED).zip(cloud.chunks_exact_mut(2 * FUSED)).enumerate()
        {
            let (top, mean) = cloud.split_at_mut(FUSED);
            pool(tokens, CENTRES, FUSED, top, &mut self.cloud_winners[b * FUSED..][..FUSED]);
            mean.fill(0.0);
            for row in tokens.chunks_exact(FUSED) {
                mean.iter_mut().zip(row).for_each(|(m, v)| *m += v);
            }
            mean.iter_mut().for_each(|m| *m *= 1.0 / CENTRES as f32);
        }
        let hidden = &mut self.class_hidden;
        linear(panels, &self.cloud, p(&plan.class_hidden.weight), 2 * FUSED, CLASS_HIDDEN, &mut hidden.raw);
        hidden.forward(&plan.class_hidden, parameters, statistics);
        let dropped = sized(&mut self.dropped, hidden.out.len());
        for ((d, h), m) in dropped.iter_mut().zip(&hidden.out).zip(mask) {
            *d = h * m;
        }
        linear(panels, &self.dropped, p(&plan.class_out), CLASS_HIDDEN, FEATURE_CLASSES, &mut self.class_logits);
        for row in self.class_logits.chunks_exact_mut(FEATURE_CLASSES) {
            row.iter_mut().zip(p(&plan.class_bias)).for_each(|(l, b)| *l += b);
        }

        const S: usize = SEGMENT_HIDDEN[0];
        linear(panels, &self.fuse.out, p(&plan.segment_token), FUSED, S, &mut self.context);
        linear(panels, &self.cloud, p(&plan.segment_cloud), 2 * FUSED, S, &mut self.cloud_context);
        for (tokens, cloud) in self.context.chunks_exact_mut(CENTRES * S).zip(self.cloud_context.chunks_exact(S)) {
            for row in tokens.chunks_exact_mut(S) {
                row.iter_mut().zip(cloud).for_each(|(r, c)| *r += c);
            }
        }
        linear(panels, &self.points, p(&plan.segment_point.weight), MEMBER, S, &mut self.segment_point.raw);
        for (row, (homes, shares)) in self.segment_point.raw.chunks_exact_mut(S).zip(&self.homes) {
            for (&home, &share) in homes.iter().zip(shares) {
                let from = &self.context[home as usize * S..][..S];
                row.iter_mut().zip(from).for_each(|(r, c)| *r += share * c);
            }
        }
        self.segment_point.forward(&plan.segment_point, parameters, statistics);
        let hidden = &mut self.segment_hidden;
        linear(panels, &self.segment_point.out, p(&plan.segment_hidden.weight), S, SEGMENT_HIDDEN[1], &mut hidden.raw);
        hidden.forward(&plan.segment_hidden, parameters, statistics);
        linear(panels, &hidden.out, p(&plan.segment_out), SEGMENT_HIDDEN[1], 1, &mut self.segment_logits);
        let bias = p(&plan.segment_bias)[0];
        self.segment_logits.iter_mut().for_each(|l| *l += bias);
    }
}
