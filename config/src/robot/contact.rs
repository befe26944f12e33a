//! Which links of an arm must not meet: what an SRDF would list, worked out.

use tandem_clearance::{Meeting, Monitor};
use tandem_kinematics::{Chain, JOINTS_MAX};

/// Positions looked at to find pairs that always touch.
const SAMPLES: u32 = 128;

/// Pairs of links to check against each other.
///
/// Left out are neighbours, which share a joint; pairs that touch at home, where
/// the arm is known to be well; and pairs that touch wherever the joints stand.
/// A pair that merely was never seen to touch is kept.
pub(super) fn pairs_to_check(arm: &Monitor, chain: &Chain, home: &[f64; JOINTS_MAX]) -> Vec<[usize; 2]> {
    let at_home = chain.forward(home);
    let pairs = arm.link_pairs(chain, SAMPLES).into_iter();
    pairs
        .filter(|pair| matches!(pair.meeting, Meeting::Never | Meeting::AtTimes))
        .map(|pair| pair.links)
        .filter(|links| arm.link_distance(&at_home, *links) > 0.0)
        .collect()
}
