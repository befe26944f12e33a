//! The search for the nearest pair: boxes rule out most, capsules nearly all others, and of the pairs that are
//! left the one that could be nearest is looked at first.
//!
//! What rules a pair out is a bound on its distance, so the order changes no answer, but where a depth was left open:
//! that of a pair that is ruled out is not as deep as the answer.

use crate::kernel::{Near, Wanted};
use crate::obstacle::Obstacle;
use crate::placed::{Placed, PlacedArm};
use crate::targets::{CHUNK, Targets};
use crate::{ArmBody, Clearance, LINK_CAPSULES_MAX};

/// Pairs that can wait for their turn; more are looked at as they come.
const WAITING_MAX: usize = 48;
/// Rounding that no bound on a depth may rest on, metres.
const ROUNDING: f64 = 1e-5;

/// Pairs that only their capsules are known of yet, each with the distance of those: it is no larger.
struct Waiting {
    pairs: [(f64, u8, u8); WAITING_MAX],
    count: usize,
}

impl Waiting {
    const NONE: Self = Self { pairs: [(0.0, 0, 0); WAITING_MAX], count: 0 };

    /// Whether there was room for it.
    fn add(&mut self, bound: f64, first: usize, second: usize) -> bool {
        let room = self.count < WAITING_MAX;
        if room {
            // Bodies and targets are fewer than a byte can count.
            self.pairs[self.count] = (bound, first as u8, second as u8);
            self.count += 1;
        }
        room
    }

    /// Takes out the pair with the least bound, if that is at most `limit`.
    fn next(&mut self, limit: f64) -> Option<(usize, usize)> {
        let waiting = &self.pairs[..self.count];
        let least = (0..waiting.len()).min_by(|a, b| waiting[*a].0.total_cmp(&waiting[*b].0))?;
        let (bound, first, second) = waiting[least];
        self.count -= 1;
        self.pairs[least] = self.pairs[self.count];
        (bound <= limit).then_some((usize::from(first), usize::from(second)))
    }
}

/// The arm against all targets. Tool and part may touch those that `touch` names.
#[inline]
pub(crate) fn against<const N: usize>(
    arm: &PlacedArm,
    targets: &Targets<N>,
    touch: &[u32],
    enough: f64,
    best: &mut Clearance,
) {
    const { assert!(N <= u8::MAX as usize) };
    let may_touch = |body: &Placed, obstacle: &Obstacle| body.tool && touch.contains(&obstacle.id);
    let bodies = arm.bodies();
    if targets.all().is_empty() {
        return;
    }
    // Boxes tell which pair is likely to be the nearest; once it is known, they spare nearly all others.
    let mut least = [0.0; LINK_CAPSULES_MAX + 1];
    if enough == f64::NEG_INFINITY {
        let mut first = (f64::INFINITY, 0);
        for (index, body) in bodies.iter().enumerate().filter(|(_, body)| body.link != 0) {
            least[index] = targets.squared_gap_min(&body.centre, &body.half);
            if least[index] < first.0 {
                first = (least[index], index);
            }
        }
        let body = &bodies[first.1];
        let gaps = targets.squared_gaps(&body.centre, &body.half);
        let nearest = gaps.iter().zip(targets.all()).find(|(gap, _)| **gap == first.0);
        if let Some((_, obstacle)) = nearest.filter(|(_, obstacle)| !may_touch(body, obstacle)) {
            check(arm, body, obstacle, enough, best);
        }
    }
    let mut waiting = Waiting::NONE;
    // From the tool inwards: what is nearest is mostly out there.
    for (at, body) in bodies.iter().enumerate().rev().filter(|(_, body)| body.link != 0) {
        if !may_be_nearer(least[at], best.distance + body.radius + targets.around_max()) {
            continue;
        }
        let gaps = targets.squared_gaps(&body.centre, &body.half);
        for (chunk, gaps) in gaps.chunks(CHUNK).enumerate() {
            let reach = best.distance + body.radius + targets.around_max();
            let squared = reach.max(0.0).powi(2);
            if !gaps.iter().fold(false, |any, gap| any | (*gap <= squared)) {
                continue;
            }
            for (lane, gap) in gaps.iter().enumerate() {
                let index = chunk * CHUNK + lane;
                let Some(obstacle) = targets.all().get(index) else { break };
                let reach = best.distance + body.radius + targets.around(index);
                if !may_be_nearer(*gap, reach)
                    || reach < -ROUNDING && -targets.depth_max(index, &body.centre, &body.half) > reach + ROUNDING
                    || may_touch(body, obstacle)
                {
                    continue;
                }
                // Where any contact will do, the first that comes along does.
                if enough == f64::NEG_INFINITY
                    && let Some(bound) = arm.apart_at_least(body, obstacle)
                    && (bound > best.distance || waiting.add(bound, at, index))
                {
                    continue;
                }
                check(arm, body, obstacle, enough, best);
                if best.distance <= enough {
                    return;
                }
            }
        }
    }
    while let Some((body, obstacle)) = waiting.next(best.distance) {
        check(arm, &bodies[body], &targets.all()[obstacle], enough, best);
        if best.distance <= enough {
            return;
        }
    }
}

/// The pairs of the arm's own bodies that are to be checked.
pub(crate) fn against_itself(arm: &PlacedArm, body: &ArmBody, enough: f64, best: &mut Clearance) {
    let bodies = arm.bodies();
    let mut waiting = Waiting::NONE;
    for [a, b] in body.self_pairs() {
        let (first, second) = (&bodies[a], &bodies[b]);
        if !may_be_nearer(first.squared_gap(second), best.distance + first.radius + second.radius) {
            continue;
        }
        if enough == f64::NEG_INFINITY
            && let Some(bound) = arm.apart_at_least_each_other(first, second)
            && (bound > best.distance || waiting.add(bound, a, b))
        {
            continue;
        }
        check_own(arm, first, second, enough, best);
        if best.distance <= enough {
            return;
        }
    }
    while let Some((first, second)) = waiting.next(best.distance) {
        check_own(arm, &bodies[first], &bodies[second], enough, best);
        if best.distance <= enough {
            return;
        }
    }
    part_to_arm(arm, enough, best);
}

/// The part against the links it does not hang on.
pub(crate) fn part_to_arm(arm: &PlacedArm, enough: f64, best: &mut Clearance) {
    if let Some(part) = arm.part() {
        for body in arm.bodies().iter().filter(|body| body.link < part.link) {
            check_own(arm, part, body, enough, best);
        }
    }
}

/// Whether what lies in two boxes with this squared gap may be within `reach`. Where the boxes overlap
/// the gap does not tell how deep.
#[inline]
pub(crate) fn may_be_nearer(squared_gap: f64, reach: f64) -> bool {
    let reach = reach.max(0.0);
    squared_gap <= reach * reach
}

#[inline]
pub(crate) fn check(arm: &PlacedArm, body: &Placed, obstacle: &Obstacle, enough: f64, best: &mut Clearance) {
    let wanted = Wanted { limit: best.distance, enough };
    if let Some(near) = arm.near(body, obstacle, wanted) {
        keep(best, &near, body.link, obstacle.id);
    }
}

/// Two bodies of the arm; the one farther out is the first of the answer.
#[inline]
pub(crate) fn check_own(arm: &PlacedArm, first: &Placed, second: &Placed, enough: f64, best: &mut Clearance) {
    if !may_be_nearer(first.squared_gap(second), best.distance + first.radius + second.radius) {
        return;
    }
    let wanted = Wanted { limit: best.distance, enough };
    if let Some(near) = arm.near_each_other(first, second, wanted) {
        keep_own(best, &near, first, second);
    }
}

pub(crate) fn keep_own(best: &mut Clearance, near: &Near, first: &Placed, second: &Placed) {
    if second.link >= first.link {
        keep(best, &near.swapped(), second.link, 0);
    } else {
        keep(best, near, first.link, 0);
    }
}

#[inline]
pub(crate) fn keep(best: &mut Clearance, near: &Near, link: usize, object: u32) {
    // Whatever the order they are looked at in, of pairs equally near the same is named.
    let nearer =
        near.distance < best.distance || near.distance == best.distance && (link, object) < (best.link, best.object);
    // A kernel that came to no number counts as a contact.
    if nearer || near.distance.is_nan() {
        *best = Clearance {
            distance: if near.distance.is_nan() { f64::NEG_INFINITY } else { near.distance },
            link,
            object,
            point_on_arm: near.on_first.into(),
            point_on_other: near.on_second.into(),
        };
    }
}
