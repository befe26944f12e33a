//! Loss, and backward from it to the gradient of every weight.

use std::ops::Range;

use tandem_msg::FEATURE_CLASSES;

use super::{Demand, ENERGY, Pass, Plan, SEGMENT, SMOOTHING, sized, zeroed};
use crate::perception::kernel::{Add, Store, accumulate_transposed, product};
use crate::perception::network::{CLASS_HIDDEN, EMBED, FUSED, KEY_WIDTH, LAYERS, MEMBER, SEGMENT_HIDDEN, WIDTH};
use crate::perception::sample::{CENTRES, NEIGHBOURS};

impl Pass {
    /// Loss and gradient of what was seen last.
    pub(crate) fn backward(&mut self, plan: &Plan, parameters: &[f32], mask: &[f32], demand: &Demand<'_>) {
        let p = |span: &Range<usize>| &parameters[span.clone()];
        let (batch, panels) = (demand.classes.len(), &mut self.panels);
        let rows = batch * CENTRES;
        let gradient = zeroed(&mut self.gradient, plan.parameters);
        const S: usize = SEGMENT_HIDDEN[0];
        const T: usize = SEGMENT_HIDDEN[1];
        let [da, db, dcloud, dcontext, dfused, dlayers, dkeys, dplaces] = &mut self.scratch;

        // Cross-entropy of smoothed labels, over those that have one.
        let labelled = demand.classes.iter().flatten().count().max(1) as f32;
        let mut loss = 0.0;
        let dlogits = sized(da, batch * FEATURE_CLASSES);
        for ((logits, d), class) in self
            .class_logits
            .chunks_exact(FEATURE_CLASSES)
            .zip(dlogits.chunks_exact_mut(FEATURE_CLASSES))
            .zip(&demand.classes)
        {
            let Some(class) = class else {
                d.fill(0.0);
                continue;
            };
            let top = logits.iter().fold(f32::NEG_INFINITY, |m, v| m.max(*v));
            let sum: f32 = logits.iter().map(|l| (l - top).exp()).sum();
            for (c, (l, d)) in logits.iter().zip(d).enumerate() {
                let share = SMOOTHING / FEATURE_CLASSES as f32;
                let label = share + if c == *class { 1.0 - SMOOTHING } else { 0.0 };
                loss -= label * (l - top - sum.ln()) / labelled;
                *d = ((l - top).exp() / sum - label) / labelled;
            }
        }
        accumulate_transposed(
            &self.dropped,
            CLASS_HIDDEN,
            dlogits,
            FEATURE_CLASSES,
            &mut gradient[plan.class_out.clone()],
        );
        for row in dlogits.chunks_exact(FEATURE_CLASSES) {
            gradient[plan.class_bias.clone()].iter_mut().zip(row).for_each(|(g, d)| *g += d);
        }
        panels.fill_transposed(p(&plan.class_out), FEATURE_CLASSES, CLASS_HIDDEN);
        let dhidden = sized(db, batch * CLASS_HIDDEN);
        product(dlogits, panels, &mut Store(dhidden, CLASS_HIDDEN));
        dhidden.iter_mut().zip(mask).for_each(|(d, m)| *d *= m);
        if let Some(other) = demand.hidden {
            dhidden.iter_mut().zip(other).for_each(|(d, o)| *d += o);
        }
        self.class_hidden.backward(&plan.class_hidden, parameters, gradient, dhidden);
        let weight = &mut gradient[plan.class_hidden.weight.clone()];
        accumulate_transposed(&self.cloud, 2 * FUSED, dhidden, CLASS_HIDDEN, weight);
        panels.fill_transposed(p(&plan.class_hidden.weight), CLASS_HIDDEN, 2 * FUSED);
        let dcloud = sized(dcloud, batch * 2 * FUSED);
        product(dhidden, panels, &mut Store(dcloud, 2 * FUSED));

        if let Some(other) = demand.features {
            dcloud.iter_mut().zip(other).for_each(|(d, o)| *d += o);
        }
        let dfused = zeroed(dfused, rows * FUSED);
        let count = self.marks.len();
        let marked = count / batch * demand.segmented;
        if marked > 0 {
            // Cross-entropy of the points, over all that count.
            let dsegment = sized(da, count);
            let mut sum = 0.0_f32;
            for ((d, x), mark) in dsegment[..marked].iter_mut().zip(&self.segment_logits).zip(&self.marks) {
                sum += x.max(0.0) + (-x.abs()).exp().ln_1p() - x * mark;
                *d = SEGMENT * (1.0 / (1.0 + (-x).exp()) - mark) / marked as f32;
            }
            dsegment[marked..].fill(0.0);
            loss += SEGMENT * sum / marked as f32;
            accumulate_transposed(&self.segment_hidden.out, T, dsegment, 1, &mut gradient[plan.segment_out.clone()]);
            gradient[plan.segment_bias.start] += dsegment.iter().sum::<f32>();
            let dhidden = sized(db, count * T);
            for (row, d) in dhidden.chunks_exact_mut(T).zip(&*dsegment) {
                row.iter_mut().zip(p(&plan.segment_out)).for_each(|(r, w)| *r = d * w);
            }
            self.segment_hidden.backward(&plan.segment_hidden, parameters, gradient, dhidden);
            let weight = &mut gradient[plan.segment_hidden.weight.clone()];
            accumulate_transposed(&self.segment_point.out, S, dhidden, T, weight);
            panels.fill_transposed(p(&plan.segment_hidden.weight), T, S);
            let dpoint = sized(da, count * S);
            product(dhidden, panels, &mut Store(dpoint, S));
            self.segment_point.backward(&plan.segment_point, parameters, gradient, dpoint);
            let weight = &mut gradient[plan.segment_point.weight.clone()];
            accumulate_transposed(&self.points, MEMBER, dpoint, S, weight);
            let dcontext = zeroed(dcontext, rows * S);
            for (d, (homes, shares)) in dpoint.chunks_exact(S).zip(&self.homes) {
                for (&home, &share) in homes.iter().zip(shares) {
                    let to = &mut dcontext[home as usize * S..][..S];
                    to.iter_mut().zip(d).for_each(|(t, d)| *t += share * d);
                }
            }
            let dcloud_context = zeroed(db, batch * S);
            for (tokens, cloud) in dcontext.chunks_exact(CENTRES * S).zip(dcloud_context.chunks_exact_mut(S)) {
                for row in tokens.chunks_exact(S) {
                    cloud.iter_mut().zip(row).for_each(|(c, r)| *c += r);
                }
            }
            let weight = &mut gradient[plan.segment_cloud.clone()];
            accumulate_transposed(&self.cloud, 2 * FUSED, dcloud_context, S, weight);
            panels.fill_transposed(p(&plan.segment_cloud), S, 2 * FUSED);
            product(dcloud_context, panels, &mut Add(dcloud, 2 * FUSED));
            accumulate_transposed(&self.fuse.out, FUSED, dcontext, S, &mut gradient[plan.segment_token.clone()]);
            panels.fill_transposed(p(&plan.segment_token), S, FUSED);
            product(dcontext, panels, &mut Store(dfused, FUSED));
        }
        self.loss = loss;

        // Pooling over the tokens.
        for (b, (tokens, cloud)) in
            dfused.chunks_exact_mut(CENTRES * FUSED).zip(dcloud.chunks_exact(2 * FUSED)).enumerate()
        {
            let (top, mean) = cloud.split_at(FUSED);
            for row in tokens.chunks_exact_mut(FUSED) {
                row.iter_mut().zip(mean).for_each(|(r, m)| *r += m * (1.0 / CENTRES as f32));
            }
            for (c, (d, winner)) in top.iter().zip(&self.cloud_winners[b * FUSED..]).enumerate() {
                tokens[usize::from(*winner) * FUSED + c] += d;
            }
        }
        self.fuse.backward(&plan.fuse, parameters, gradient, dfused);
        let len = rows * WIDTH;
        let dlayers = sized(dlayers, (LAYERS + 1) * len);
        let layers = std::iter::once(&self.tokens).chain(self.attention.iter().map(|a| &a.out));
        for (i, (x, d)) in layers.zip(dlayers.chunks_exact_mut(len)).enumerate() {
            let span = plan.fuse.weight.start + i * WIDTH * FUSED..plan.fuse.weight.start + (i + 1) * WIDTH * FUSED;
            accumulate_transposed(x, WIDTH, dfused, FUSED, &mut gradient[span.clone()]);
            panels.fill_transposed(&parameters[span], FUSED, WIDTH);
            product(dfused, panels, &mut Store(d, WIDTH));
        }

        for layer in (0..LAYERS).rev() {
            let (a, at) = (&self.attention[layer], &plan.attention[layer]);
            let (before, after) = dlayers.split_at_mut((layer + 1) * len);
            // Of the layer's input, to which that of its output is added.
            let (dx, dout) = (&mut before[layer * len..], &after[..len]);
            let dnorm = sized(da, len);
            dnorm.copy_from_slice(dout);
            a.norm.backward(&at.offset, parameters, gradient, dnorm);
            accumulate_transposed(&a.offset, WIDTH, dnorm, WIDTH, &mut gradient[at.offset.weight.clone()]);
            panels.fill_transposed(p(&at.offset.weight), WIDTH, WIDTH);
            let doffset = sized(db, len);
            product(dnorm, panels, &mut Store(doffset, WIDTH));
            // Of the placed input: directly, through the offset, and below through key and value.
            let dplaced = sized(dplaces, len);
            for ((d, o), out) in dplaced.iter_mut().zip(&*doffset).zip(dout) {
                *d = o + out;
            }
            let dvalue = zeroed(da, len);
            let dkey = zeroed(dkeys, rows * KEY_WIDTH);
            for b in 0..batch {
                let softmax = &a.softmax[b * CENTRES * CENTRES..][..CENTRES * CENTRES];
                let column = &a.column[b * CENTRES..][..CENTRES];
                let at_width = b * CENTRES * WIDTH..(b + 1) * CENTRES * WIDTH;
                let value = &a.value[at_width.clone()];
                // seen = softmaxᵀ·value / column, and its gradient is −doffset.
                let mut dseen = [0.0_f32; CENTRES * WIDTH];
                let mut dcolumn = [0.0_f32; CENTRES];
                let seen = &a.seen[at_width.clone()];
                for (k, row) in dseen.chunks_exact_mut(WIDTH).enumerate() {
                    let inverse = 1.0 / column[k];
                    let d = &doffset[at_width.start + k * WIDTH..][..WIDTH];
                    let mut along = 0.0;
                    for ((r, d), s) in row.iter_mut().zip(d).zip(&seen[k * WIDTH..]) {
                        *r = -d * inverse;
                        along += *r * s;
                    }
                    dcolumn[k] = -along;
                }
                panels.fill(&dseen, CENTRES, WIDTH);
                product(softmax, panels, &mut Store(&mut dvalue[at_width.clone()], WIDTH));
                let mut denergy = [0.0_f32; CENTRES * CENTRES];
                panels.fill_transposed(&dseen, WIDTH, CENTRES);
                product(value, panels, &mut Store(&mut denergy, CENTRES));
                for (row, y) in denergy.chunks_exact_mut(CENTRES).zip(softmax.chunks_exact(CENTRES)) {
                    let mut along = 0.0;
                    for ((r, c), y) in row.iter_mut().zip(&dcolumn).zip(y) {
                        *r += c;
                        along += *r * y;
                    }
                    row.iter_mut().zip(y).for_each(|(r, y)| *r = ENERGY * y * (*r - along));
                }
                let at_key = b * CENTRES * KEY_WIDTH..(b + 1) * CENTRES * KEY_WIDTH;
                let key = &a.key[at_key.clone()];
                // energy = key·keyᵀ: through the queries and through the keys.
                panels.fill(key, CENTRES, KEY_WIDTH);
                product(&denergy, panels, &mut Store(&mut dkey[at_key.clone()], KEY_WIDTH));
                accumulate_transposed(&denergy, CENTRES, key, KEY_WIDTH, &mut dkey[at_key]);
            }
            accumulate_transposed(&a.placed, WIDTH, dvalue, WIDTH, &mut gradient[at.value.clone()]);
            panels.fill_transposed(p(&at.value), WIDTH, WIDTH);
            product(dvalue, panels, &mut Add(dplaced, WIDTH));
            accumulate_transposed(&a.placed, WIDTH, dkey, KEY_WIDTH, &mut gradient[at.key.clone()]);
            panels.fill_transposed(p(&at.key), KEY_WIDTH, WIDTH);
            product(dkey, panels, &mut Add(dplaced, WIDTH));
            accumulate_transposed(&self.places, 3, dplaced, WIDTH, &mut gradient[at.place.clone()]);
            dx.iter_mut().zip(&*dplaced).for_each(|(x, d)| *x += d);
        }

        // Pooling over the members, and the embedding.
        let members = rows * NEIGHBOURS;
        let dembed = zeroed(da, members * WIDTH);
        for ((group, d), winner) in dembed
            .chunks_exact_mut(NEIGHBOURS * WIDTH)
            .zip(dlayers.chunks_exact(WIDTH))
            .zip(self.winners.chunks_exact(WIDTH))
        {
            for (c, (d, winner)) in d.iter().zip(winner).enumerate() {
                group[usize::from(*winner) * WIDTH + c] = *d;
            }
        }
        let [e0, e1] = &self.embed;
        e1.backward(&plan.embed[1], parameters, gradient, dembed);
        accumulate_transposed(&e0.out, EMBED, dembed, WIDTH, &mut gradient[plan.embed[1].weight.clone()]);
        panels.fill_transposed(p(&plan.embed[1].weight), WIDTH, EMBED);
        let dfirst = sized(db, members * EMBED);
        product(dembed, panels, &mut Store(dfirst, EMBED));
        e0.backward(&plan.embed[0], parameters, gradient, dfirst);
        accumulate_transposed(&self.members, MEMBER, dfirst, EMBED, &mut gradient[plan.embed[0].weight.clone()]);
    }
}
