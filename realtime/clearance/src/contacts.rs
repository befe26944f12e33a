//! Which links of an arm can meet: the allowed-collision matrix, worked out and checked.
//!
//! Positions of the joints that are spread evenly tell links that always touch from those that do so at
//! times. A pair that was never seen to touch is led on from where it was nearest, joint by joint, in steps that
//! shrink: a contact found is one that the arm can reach.
#![allow(clippy::disallowed_types, reason = "done while starting")]

use tandem_kinematics::{Chain, JOINTS_MAX};

use crate::Monitor;

/// Steps of the search for a contact, halved this often.
const HALVINGS: u32 = 8;

/// What two links do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Meeting {
    /// They share a joint, which is where they touch.
    Adjacent,
    /// They touched wherever the arm was looked at.
    Always,
    /// They did not touch anywhere, and no contact was found by search.
    Never,
    /// They touch at some positions and not at others: such a pair must be checked.
    AtTimes,
}

/// Two links of the arm that both have a shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkPair {
    /// The links, the lower one first.
    pub links: [usize; 2],
    /// What they do.
    pub meeting: Meeting,
    /// The smallest distance found, metres.
    pub distance: f64,
    /// Where it was found, rad or m.
    pub position: [f64; JOINTS_MAX],
    /// Whether the arm's body has the pair checked.
    pub checked: bool,
}

impl Monitor {
    /// All pairs of links and how they meet, over `samples` positions within the limits of the chain's joints.
    /// Neither scene, part nor people are looked at. Allocates: it is done while starting.
    pub fn link_pairs(&self, chain: &Chain, samples: u32) -> Vec<LinkPair> {
        let positions: Vec<_> = (1..=samples.max(1)).map(|sample| scattered(chain, sample)).collect();
        let has = |link: usize| self.body().capsules().iter().any(|capsule| capsule.link == link);
        let mut pairs = Vec::new();
        for a in 0..=chain.joint_count() {
            for b in a + 1..=chain.joint_count() {
                if has(a) && has(b) {
                    pairs.push(self.link_pair(chain, [a, b], &positions));
                }
            }
        }
        pairs
    }

    /// Pairs that the body leaves unchecked although they touch at some positions and not at others, each with a position
    /// where they do: what a wrong matrix hides.
    pub fn hidden_contacts(&self, chain: &Chain, samples: u32) -> Vec<LinkPair> {
        let mut pairs = self.link_pairs(chain, samples);
        pairs.retain(|pair| !pair.checked && pair.meeting == Meeting::AtTimes);
        pairs
    }

    fn link_pair(&self, chain: &Chain, links: [usize; 2], positions: &[[f64; JOINTS_MAX]]) -> LinkPair {
        let at = |position: &[f64; JOINTS_MAX]| self.link_distance(&chain.forward(position), links);
        let mut nearest = (f64::INFINITY, [0.0; JOINTS_MAX]);
        let mut touching = 0;
        for position in positions {
            let distance = at(position);
            touching += usize::from(distance <= 0.0);
            if distance < nearest.0 {
                nearest = (distance, *position);
            }
        }
        if touching == 0 {
            nearest = nearer(chain, links, nearest, at);
        }
        let meeting = match touching {
            _ if links[1] == links[0] + 1 => Meeting::Adjacent,
            all if all == positions.len() => Meeting::Always,
            _ if nearest.0 > 0.0 => Meeting::Never,
            _ => Meeting::AtTimes,
        };
        let capsules = self.body().capsules();
        let checked = self.body().self_pairs().any(|pair| {
            let [a, b] = pair.map(|index| capsules[index].link);
            [a.min(b), a.max(b)] == links
        });
        LinkPair { links, meeting, distance: nearest.0, position: nearest.1, checked }
    }
}

/// Leads two links towards each other by the joints between them.
fn nearer(
    chain: &Chain,
    links: [usize; 2],
    from: (f64, [f64; JOINTS_MAX]),
    at: impl Fn(&[f64; JOINTS_MAX]) -> f64,
) -> (f64, [f64; JOINTS_MAX]) {
    let mut nearest = from;
    let mut step = 0.25;
    for _ in 0..HALVINGS {
        let mut moved = true;
        while moved && nearest.0 > 0.0 {
            moved = false;
            for (index, joint) in chain.joints().iter().enumerate().take(links[1]).skip(links[0]) {
                for way in [-step, step] {
                    let mut position = nearest.1;
                    position[index] = (position[index] + way).clamp(joint.position_min, joint.position_max);
                    let distance = at(&position);
                    // Each step gains something that counts, so there is an end to them.
                    if distance < nearest.0 - 1e-4 {
                        nearest = (distance, position);
                        moved = true;
                    }
                }
            }
        }
        step *= 0.5;
    }
    nearest
}

/// A position within the limits, and within half a turn of 0; the same for the same number.
fn scattered(chain: &Chain, sample: u32) -> [f64; JOINTS_MAX] {
    /// Fractions of a turn whose multiples spread evenly: powers of the inverse of the root of x⁹ = x + 1.
    const STEP: f64 = 0.926_939_7;
    let mut position = [0.0; JOINTS_MAX];
    let mut step = 1.0;
    for (q, joint) in position.iter_mut().zip(chain.joints()) {
        step *= STEP;
        let (low, high) =
            (joint.position_min.max(-core::f64::consts::PI), joint.position_max.min(core::f64::consts::PI));
        *q = if low < high { low + (high - low) * (f64::from(sample) * step).fract() } else { joint.position_min };
    }
    position
}
