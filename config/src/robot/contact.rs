//! Which links of an arm must not meet: what an SRDF would list, worked out.

use tandem_clearance::{ArmBody, BodyError, LinkCapsule, Monitor};
use tandem_kinematics::{Chain, JOINTS_MAX};

/// Positions looked at to find pairs that always touch.
const SAMPLES: u32 = 128;

/// Pairs of links to check against each other.
///
/// Left out are neighbours, which share a joint; pairs that touch at home, where
/// the arm is known to be well; and pairs that touch wherever the joints stand.
/// A pair that merely was never seen to touch is kept.
pub(super) fn pairs_to_check(
    chain: &Chain,
    capsules: &[LinkCapsule],
    home: &[f64; JOINTS_MAX],
) -> Result<Vec<[usize; 2]>, BodyError> {
    let mut pairs = Vec::new();
    for a in 0..=chain.joint_count() {
        for b in a + 2..=chain.joint_count() {
            let monitor = Monitor::new(ArmBody::new(capsules, &[[a, b]])?);
            let touch = |position: &[f64; JOINTS_MAX]| monitor.clearance(&chain.forward(position)).distance <= 0.0;
            let has = |link: usize| capsules.iter().any(|capsule| capsule.link == link);
            if has(a) && has(b) && !touch(home) && !(1..=SAMPLES).all(|sample| touch(&scattered(chain, sample))) {
                pairs.push([a, b]);
            }
        }
    }
    Ok(pairs)
}

/// A position within the limits, and within a turn of 0; the same for the same number.
fn scattered(chain: &Chain, sample: u32) -> [f64; JOINTS_MAX] {
    /// Fractions of a turn whose multiples spread evenly (powers of the inverse of the root of x⁹ = x + 1).
    const STEP: f64 = 0.926_939_7;
    let mut position = [0.0; JOINTS_MAX];
    let mut step = 1.0;
    for (q, joint) in position.iter_mut().zip(chain.joints()) {
        step *= STEP;
        let (low, high) = (joint.position_min.max(-std::f64::consts::PI), joint.position_max.min(std::f64::consts::PI));
        *q = if low < high { low + (high - low) * (f64::from(sample) * step).fract() } else { joint.position_min };
    }
    position
}
