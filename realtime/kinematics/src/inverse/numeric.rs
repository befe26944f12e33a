//! Damped least squares for chains without a closed form, and the polish for those with one.
//!
//! Each step solves `(J·Jᵀ + λ²·I) x = e`, `Δq = Jᵀ·x`, where `e` is what is left
//! to do and `λ²` shrinks with it (Levenberg–Marquardt), so steps are bold far
//! off, exact near the goal and bounded at a singularity. A joint that stands on
//! its limit and is pushed outwards is left out of the step; one that can turn
//! all the way round has no limits that matter.

use core::f64::consts::{PI, TAU};

use nalgebra::{Isometry3, Rotation3, SVector, UnitQuaternion};

use super::{IkFailure, TOLERANCE};
use crate::{Chain, JOINTS_MAX, Jacobian, Joint, JointKind, manipulability};

/// Descents after the one from the seed.
const RESTARTS: u32 = 48;
/// Steps of one descent.
const STEPS: u32 = 40;
/// Steps a descent may go without getting nearer by a tenth.
const IDLE_MAX: u32 = 4;
/// Longest step of a joint, rad or m.
const STEP_MAX: f64 = 1.2;
/// Damping λ² per squared residual, and what is left of it at the goal.
const DAMPING: f64 = 3e-2;
const DAMPING_MIN: f64 = 1e-12;
/// Residual below which a failure near a singular position is called one, m and rad.
const NEAR: f64 = 2e-2;
/// Manipulability below which a position counts as singular.
const SINGULAR: f64 = 1e-4;

/// How a descent ended.
#[derive(Clone, Copy)]
struct Descent {
    position: [f64; JOINTS_MAX],
    residual: f64,
}

/// One solution within limits.
pub(super) fn solve(
    chain: &Chain,
    goal: &Isometry3<f64>,
    near: &[f64; JOINTS_MAX],
) -> Result<[f64; JOINTS_MAX], IkFailure> {
    let mut start = *near;
    for (q, joint) in start.iter_mut().zip(chain.joints()) {
        *q = q.max(joint.position_min).min(joint.position_max);
    }
    let mut best = Descent { position: start, residual: f64::INFINITY };
    for attempt in 0..=RESTARTS {
        let from = if attempt == 0 { start } else { scattered(chain, attempt, &start, true) };
        let descent = descend(chain, goal, &from, true);
        if descent.residual < TOLERANCE
            && let Some(solution) = chain.within_limits(&descent.position, near)
        {
            return Ok(solution);
        }
        if descent.residual < best.residual {
            best = descent;
        }
    }
    // Would it be there without limits? Then they are the reason.
    for attempt in 0..4 {
        let from = if attempt == 0 { *near } else { scattered(chain, attempt, near, false) };
        if descend(chain, goal, &from, false).residual < TOLERANCE {
            return Err(IkFailure::JointLimit);
        }
    }
    if best.residual < NEAR && manipulability(&chain.tcp_jacobian(&best.position).1) < SINGULAR {
        return Err(IkFailure::Singular);
    }
    Err(IkFailure::Unreachable)
}

/// Brings a near-solution below `tolerance`; answers whether it is there.
pub(super) fn polish(chain: &Chain, goal: &Isometry3<f64>, position: &mut [f64; JOINTS_MAX], tolerance: f64) -> bool {
    /// Below this there is nothing to gain.
    const EXACT: f64 = 1e-11;
    const POLISH_STEPS: u32 = 4;
    let mut residual = f64::INFINITY;
    for _ in 0..=POLISH_STEPS {
        let (left, jacobian) = residual_at(chain, goal, position);
        let norm = left.norm();
        if norm < EXACT || norm >= residual || norm.is_nan() {
            residual = residual.min(norm);
            break;
        }
        residual = norm;
        if norm > 1e-3 {
            break;
        }
        let Some(step) = step(&jacobian, chain.joint_count(), &left, DAMPING_MIN) else {
            break;
        };
        for (q, dq) in position.iter_mut().zip(step) {
            *q += dq;
        }
    }
    residual < tolerance
}

fn descend(chain: &Chain, goal: &Isometry3<f64>, from: &[f64; JOINTS_MAX], limited: bool) -> Descent {
    let mut position = *from;
    let mut best = Descent { position, residual: f64::INFINITY };
    let mut idle = 0;
    for _ in 0..STEPS {
        let (left, mut jacobian) = residual_at(chain, goal, &position);
        let norm = left.norm();
        idle = if norm < 0.9 * best.residual { 0 } else { idle + 1 };
        if norm < best.residual {
            best = Descent { position, residual: norm };
        }
        if norm < 0.1 * TOLERANCE || idle > IDLE_MAX {
            break;
        }
        let damping = (DAMPING * norm * norm).max(DAMPING_MIN);
        let Some(mut step_taken) = step(&jacobian, chain.joint_count(), &left, damping) else {
            break;
        };
        if limited && leave_out_blocked(chain, &position, &step_taken, &mut jacobian) {
            let Some(again) = step(&jacobian, chain.joint_count(), &left, damping) else {
                break;
            };
            step_taken = again;
        }
        let longest = step_taken.iter().fold(0.0, |longest: f64, dq| longest.max(dq.abs()));
        let scale = if longest > STEP_MAX { STEP_MAX / longest } else { 1.0 };
        for ((q, dq), joint) in position.iter_mut().zip(step_taken).zip(chain.joints()) {
            *q += scale * dq;
            if limited && !is_free(joint) {
                *q = q.max(joint.position_min).min(joint.position_max);
            }
        }
    }
    best
}

/// What is left to do at a position, metres and radians in base axes, and the Jacobian there.
fn residual_at(chain: &Chain, goal: &Isometry3<f64>, position: &[f64; JOINTS_MAX]) -> (SVector<f64, 6>, Jacobian) {
    let mut jacobian = Jacobian::zeros();
    let (rotation, origin) = chain.tcp_columns(position, &mut jacobian);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
    let shift = goal.translation.vector - origin;
    let turn = (goal.rotation * rotation.inverse()).scaled_axis();
    (SVector::<f64, 6>::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z), jacobian)
}

/// Whether a joint has every direction within its limits: then the search needs none, the right turn is chosen at the end.
fn is_free(joint: &Joint) -> bool {
    joint.kind == JointKind::Revolute && joint.position_max - joint.position_min >= TAU
}

/// Clears the columns of joints that stand on a limit and would be pushed past it.
fn leave_out_blocked(
    chain: &Chain,
    position: &[f64; JOINTS_MAX],
    step: &[f64; JOINTS_MAX],
    jacobian: &mut Jacobian,
) -> bool {
    let mut any = false;
    for (index, joint) in chain.joints().iter().enumerate().filter(|(_, joint)| !is_free(joint)) {
        let (q, dq) = (position[index], step[index]);
        if (q <= joint.position_min && dq < 0.0) || (q >= joint.position_max && dq > 0.0) {
            jacobian.column_mut(index).fill(0.0);
            any = true;
        }
    }
    any
}

/// `Jᵀ (J·Jᵀ + λ²·I)⁻¹ e` over the first `count` columns, by Cholesky's decomposition; `None` when the
/// numbers have gone astray.
#[inline]
fn step(jacobian: &Jacobian, count: usize, left: &SVector<f64, 6>, damping: f64) -> Option<[f64; JOINTS_MAX]> {
    let columns = &jacobian.data.0[..count.min(JOINTS_MAX)];
    // Lower triangle of the normal matrix, which becomes its factor, with the inverse of the diagonal.
    let mut factor = [[0.0; 6]; 6];
    for column in columns {
        for row in 0..6 {
            for other in 0..=row {
                factor[row][other] += column[row] * column[other];
            }
        }
    }
    for row in 0..6 {
        factor[row][row] += damping;
        for other in 0..=row {
            let known = factor[row].iter().zip(&factor[other]).take(other);
            let sum = factor[row][other] - known.map(|(a, b)| a * b).sum::<f64>();
            if other < row {
                factor[row][other] = sum * factor[other][other];
            } else if sum > 0.0 {
                factor[row][row] = 1.0 / sum.sqrt();
            } else {
                return None;
            }
        }
    }
    let mut x = [0.0; 6];
    for row in 0..6 {
        let known: f64 = factor[row].iter().zip(&x).take(row).map(|(a, b)| a * b).sum();
        x[row] = (left[row] - known) * factor[row][row];
    }
    for row in (0..6).rev() {
        let known: f64 = factor.iter().zip(&x).skip(row + 1).map(|(factor, x)| factor[row] * x).sum();
        x[row] = (x[row] - known) * factor[row][row];
    }
    let mut step = [0.0; JOINTS_MAX];
    for (dq, column) in step.iter_mut().zip(columns) {
        *dq = column.iter().zip(&x).map(|(a, b)| a * b).sum();
    }
    step.iter().all(|dq: &f64| dq.is_finite()).then_some(step)
}

/// Start number `attempt`: a Halton point at most half a turn from `near`, within the limits if asked.
fn scattered(chain: &Chain, attempt: u32, near: &[f64; JOINTS_MAX], limited: bool) -> [f64; JOINTS_MAX] {
    const PRIMES: [u32; JOINTS_MAX] = [2, 3, 5, 7, 11, 13, 17, 19];
    let mut start = [0.0; JOINTS_MAX];
    for (index, joint) in chain.joints().iter().enumerate() {
        let (mut low, mut high) = (near[index] - PI, near[index] + PI);
        if limited || joint.kind == JointKind::Prismatic {
            low = low.max(joint.position_min);
            high = high.min(joint.position_max);
        }
        // The first few points of a Halton sequence lie on a line in its high dimensions.
        start[index] = low + (high - low) * radical_inverse(attempt + 20, PRIMES[index]);
    }
    start
}

/// The digits of `number` in base `base`, mirrored behind the point.
fn radical_inverse(number: u32, base: u32) -> f64 {
    let (mut rest, mut place, mut sum) = (number, 1.0, 0.0);
    while rest > 0 {
        place /= f64::from(base);
        sum += place * f64::from(rest % base);
        rest /= base;
    }
    sum
}
