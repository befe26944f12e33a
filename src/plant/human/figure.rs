//! The shape of a person: where they stand and where their hands are, as capsules.
//!
//! Proportions are those of a 1.75 m adult. The trunk leans forward from the hips
//! when a hand has to reach farther than the arm is long; shoulders, elbows and
//! hands follow from there, the elbow hanging below the line from shoulder to hand.

use nalgebra::{UnitQuaternion, Vector3};
use tandem_msg::BodyPart;

/// Height of the hips above the floor, metres.
const HIP: f64 = 0.95;
/// From the hips to the line of the shoulders.
const TRUNK: f64 = 0.47;
/// From the spine to a shoulder.
const SHOULDER: f64 = 0.19;
/// From the shoulders to the middle of the head.
const HEAD: f64 = 0.24;
/// From shoulder to elbow.
const UPPER_ARM: f64 = 0.30;
/// From elbow to wrist.
const FOREARM: f64 = 0.27;
/// From the wrist to the middle of the fingers.
const HAND: f64 = 0.12;
/// Farthest a hand gets from its shoulder.
const REACH: f64 = UPPER_ARM + FOREARM + HAND - 0.02;
/// Deepest lean of the trunk, rad.
const LEAN_MAX: f64 = 0.75;

/// Capsules of a figure.
pub(in crate::plant) const CAPSULES: usize = 10;
/// What each capsule covers: trunk, head, then left and right arm, then the legs.
pub(super) const BODY: [BodyPart; CAPSULES] = [
    BodyPart::Torso,
    BodyPart::Head,
    BodyPart::UpperArm,
    BodyPart::Forearm,
    BodyPart::Hand,
    BodyPart::UpperArm,
    BodyPart::Forearm,
    BodyPart::Hand,
    BodyPart::Leg,
    BodyPart::Leg,
];
const RADIUS: [f64; CAPSULES] = [0.16, 0.12, 0.06, 0.05, 0.045, 0.06, 0.05, 0.045, 0.09, 0.09];
/// Radius of a hand, metres.
pub(super) const HAND_RADIUS: f64 = RADIUS[4];

/// A capsule of the body, in the base frame, metres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(in crate::plant) struct Limb {
    pub(in crate::plant) ends: [Vector3<f64>; 2],
    pub(in crate::plant) radius: f64,
}

/// Where a person's hands rest, in the frame of their stand (x ahead, z up), left then right.
pub(super) fn hands_at_rest() -> [Vector3<f64>; 2] {
    [Vector3::new(0.18, 0.26, 0.88), Vector3::new(0.18, -0.26, 0.88)]
}

/// The body of a person who stands on the ground point `stand`, looks along
/// `heading` (rad about z) and has their hands at `hands`, in the frame of the
/// stand. The hands come as near to there as the body allows.
pub(super) fn figure(stand: &Vector3<f64>, heading: f64, hands: &[Vector3<f64>; 2]) -> [Limb; CAPSULES] {
    let lean = hands.iter().map(lean_for).fold(0.0, f64::max);
    let hip = Vector3::new(0.0, 0.0, HIP);
    let along = Vector3::new(lean.sin(), 0.0, lean.cos());
    let neck = hip + along * TRUNK;
    let mut local = [[Vector3::zeros(); 2]; CAPSULES];
    local[0] = [hip + along * 0.02, neck - along * 0.06];
    local[1] = [neck + along * (HEAD - 0.05), neck + along * (HEAD + 0.04)];
    for (side, hand) in hands.iter().enumerate() {
        let sign = if side == 0 { 1.0 } else { -1.0 };
        let shoulder = neck + Vector3::new(0.0, sign * SHOULDER, -0.03);
        let (elbow, wrist, fingers) = arm(&shoulder, hand, sign);
        let first = 2 + 3 * side;
        local[first] = [shoulder, elbow];
        local[first + 1] = [elbow, wrist];
        local[first + 2] = [wrist, fingers];
        local[8 + side] = [Vector3::new(0.0, sign * 0.11, 0.10), Vector3::new(0.0, sign * 0.10, HIP - 0.06)];
    }
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), heading);
    let mut body = [Limb::default(); CAPSULES];
    for (limb, (ends, radius)) in body.iter_mut().zip(local.iter().zip(RADIUS)) {
        *limb = Limb { ends: ends.map(|end| stand + turn * end), radius };
    }
    body
}

/// Smallest lean that brings a shoulder within reach of the hand's goal, rad.
fn lean_for(hand: &Vector3<f64>) -> f64 {
    let reaches = |lean: f64| {
        let neck = Vector3::new(TRUNK * lean.sin(), 0.0, HIP + TRUNK * lean.cos() - 0.03);
        let sideways = (hand.y.abs() - SHOULDER).abs();
        Vector3::new(hand.x - neck.x, sideways, hand.z - neck.z).norm() <= REACH
    };
    if reaches(0.0) {
        return 0.0;
    }
    // Bisection in a fixed number of steps: 0.75 rad / 2^12 is far below what anyone could see.
    let (mut low, mut high) = (0.0, LEAN_MAX);
    for _ in 0..12 {
        let middle = (low + high) / 2.0;
        if reaches(middle) {
            high = middle;
        } else {
            low = middle;
        }
    }
    high
}

/// Elbow, wrist and fingertip middle of an arm whose hand is to be at `goal`.
fn arm(shoulder: &Vector3<f64>, goal: &Vector3<f64>, sign: f64) -> (Vector3<f64>, Vector3<f64>, Vector3<f64>) {
    let way = goal - shoulder;
    let distance = way.norm().max(1e-6);
    let ahead = way / distance;
    // Forearm and hand are one straight piece, the upper arm the other.
    let (upper, lower) = (UPPER_ARM, FOREARM + HAND);
    let span = distance.clamp(lower - upper + 0.02, REACH);
    let along = (upper * upper - lower * lower + span * span) / (2.0 * span);
    let aside = (upper * upper - along * along).max(0.0).sqrt();
    let down = Vector3::new(-0.2, 0.3 * sign, -1.0);
    let hang = (down - ahead * down.dot(&ahead)).try_normalize(1e-6).unwrap_or_else(|| Vector3::y() * sign);
    let elbow = shoulder + ahead * along + hang * aside;
    let fingers = shoulder + ahead * span;
    let wrist = elbow + (fingers - elbow) * (FOREARM / lower);
    (elbow, wrist, fingers)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bones keep their length wherever the hands go, and a hand within reach is where it was sent.
    #[test]
    fn bones_keep_their_length() {
        for x in [0.1, 0.4, 0.7, 0.9] {
            for z in [0.9, 1.1, 1.4] {
                let goal = Vector3::new(x, 0.2, z);
                let body = figure(&Vector3::zeros(), 0.0, &[goal, hands_at_rest()[1]]);
                let length = |limb: &Limb| (limb.ends[1] - limb.ends[0]).norm();
                assert!((length(&body[2]) - UPPER_ARM).abs() < 1e-9, "{x} {z}: {:?}", body[2]);
                assert!((length(&body[3]) + length(&body[4]) - FOREARM - HAND).abs() < 1e-9, "{x} {z}");
                let miss = (body[4].ends[1] - goal).norm();
                assert!(miss < 0.02 || x > 0.8, "hand misses {goal:?} by {miss}");
            }
        }
    }
}
