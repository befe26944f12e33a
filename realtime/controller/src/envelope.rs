//! The last look at the stream of commands: is the next one what an arm may be sent after the last one?
//!
//! It knows nothing of paths and laws, only the limits of the arm and the two
//! set-points. What plans and follows keeps these limits by construction; what is
//! found here is a fault of theirs, and the command does not go out. A joint that
//! stands outside its range may come back in, and go no farther out.

use nalgebra::Vector3;
use tandem_kinematics::Chain;
use tandem_msg::StopCause;

use crate::motion::SetPoint;

/// Rounding, and what a clamped spline takes at its ends: shares of the limits.
const SPEED_SLACK: f64 = 1.01;
const ACCELERATION_SLACK: f64 = 1.05;
/// The jerk is a difference over one period, in which it may change.
const JERK_SLACK: f64 = 1.2;
/// Rounding of positions, rad or m.
const POSITION_SLACK: f64 = 1e-6;
/// The largest speed of the TCP is kept at sampled places of a path, with this share to spare.
const TCP_SLACK: f64 = 1.05;

/// What is wrong with sending `next` a period after `last`.
pub(crate) fn fault(
    chain: &Chain,
    last: &SetPoint,
    next: &SetPoint,
    period: f64,
    tcp_speed_max: f64,
) -> Option<StopCause> {
    let mut fault = None;
    for (index, joint) in chain.joints().iter().enumerate() {
        let (position, velocity) = (next.position[index], next.velocity[index]);
        let acceleration = next.acceleration[index];
        let jerk = (acceleration - last.acceleration[index]) / period;
        // Trapezoid of the two velocities: off by jerk · period³/12.
        let expected = last.position[index] + 0.5 * (last.velocity[index] + velocity) * period;
        let jump = JERK_SLACK * joint.jerk_max * period * period * period + POSITION_SLACK * 1e-3;
        let kept = position.is_finite()
            && velocity.abs() <= joint.velocity_max * SPEED_SLACK
            && acceleration.abs() <= joint.acceleration_max * ACCELERATION_SLACK
            && jerk.abs() <= joint.jerk_max * JERK_SLACK
            && (position - expected).abs() <= jump;
        if !kept {
            return Some(StopCause::Internal);
        }
        let above = position > joint.position_max + POSITION_SLACK && position > last.position[index];
        let below = position < joint.position_min - POSITION_SLACK && position < last.position[index];
        if above || below {
            fault = Some(StopCause::JointLimit);
        }
    }
    let poses = chain.forward(&next.position);
    let tcp: Vector3<f64> = poses.base_from_tcp.translation.vector;
    let speed = chain.point_velocity(&poses, poses.count, &tcp, &next.velocity).norm();
    if speed <= tcp_speed_max * TCP_SLACK { fault } else { Some(StopCause::Internal) }
}
