//! Damped least squares for chains without a closed form, and the polish for those with one.
//!
//! Each step solves `(J·Jᵀ + λ²·I) x = e`, `Δq = Jᵀ·x`, where `e` is what is left
//! to do and `λ²` shrinks with it (Levenberg–Marquardt), so steps are bold far
//! off, exact near the goal and bounded at a singularity. A joint that stands on
//! its limit and is pushed outwards is left out of the step.

use core::f64::consts::PI;

use nalgebra::{Isometry3, SMatrix, SVector};

use super::{Branches, IkFailure, TOLERANCE};
use crate::{Chain, JOINTS_MAX, JointKind, manipulability};

/// Descents after the one from the seed.
const RESTARTS: u32 = 32;
/// Steps of one descent.
const STEPS: u32 = 60;
/// Longest step of a joint, rad or m.
const STEP_MAX: f64 = 0.7;
/// Damping that is left at the goal.
const DAMPING_MIN: f64 = 1e-12;
/// Residual below which a failure near a singular position is called one, m and rad.
const NEAR: f64 = 2e-2;
/// Manipulability below which a position counts as singular.
const SINGULAR: f64 = 1e-4;

/// How a descent ended.
struct Descent {
    position: [f64; JOINTS_MAX],
    residual: f64,
    manipulability: f64,
}

/// One solution within limits.
pub(super) fn solve(chain: &Chain, goal: &Isometry3<f64>, near: &[f64; JOINTS_MAX]) -> Result<Branches, IkFailure> {
    let mut start = *near;
    for (q, joint) in start.iter_mut().zip(chain.joints()) {
        *q = q.max(joint.position_min).min(joint.position_max);
    }
    let mut best = f64::INFINITY;
    let mut best_manipulability = f64::INFINITY;
    for attempt in 0..=RESTARTS {
        let from = if attempt == 0 { start } else { scattered(chain, attempt, &start, true) };
        let descent = descend(chain, goal, &from, true);
        if descent.residual < TOLERANCE
            && let Some(solution) = chain.within_limits(&descent.position, near)
        {
            let mut branches = Branches::NONE;
            branches.insert(&solution, near);
            return Ok(branches);
        }
        if descent.residual < best {
            best = descent.residual;
            best_manipulability = descent.manipulability;
        }
    }
    // Would it be there without limits? Then they are the reason.
    for attempt in 0..4 {
        let from = if attempt == 0 { *near } else { scattered(chain, attempt, near, false) };
        if descend(chain, goal, &from, false).residual < TOLERANCE {
            return Err(IkFailure::JointLimit);
        }
    }
    if best < NEAR && best_manipulability < SINGULAR {
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
        let (poses, jacobian) = chain.jacobian(position);
        let left = Chain::residual(&poses.base_from_tcp, goal);
        let norm = left.norm();
        if norm < EXACT || norm >= residual || norm.is_nan() {
            residual = residual.min(norm);
            break;
        }
        residual = norm;
        if norm > 1e-3 {
            break;
        }
        let Some(step) = step(&jacobian, &left, DAMPING_MIN) else {
            break;
        };
        for (q, dq) in position.iter_mut().zip(step.iter()) {
            *q += dq;
        }
    }
    residual < tolerance
}

fn descend(chain: &Chain, goal: &Isometry3<f64>, from: &[f64; JOINTS_MAX], limited: bool) -> Descent {
    let mut position = *from;
    let mut best = Descent { position, residual: f64::INFINITY, manipulability: 0.0 };
    let mut idle = 0;
    for _ in 0..STEPS {
        let (poses, mut jacobian) = chain.jacobian(&position);
        let left = Chain::residual(&poses.base_from_tcp, goal);
        let norm = left.norm();
        idle = if norm < 0.9 * best.residual { 0 } else { idle + 1 };
        if norm < best.residual {
            best = Descent { position, residual: norm, manipulability: 0.0 };
        }
        if norm < 0.1 * TOLERANCE || idle > 8 {
            break;
        }
        let damping = (1e-2 * norm * norm).max(DAMPING_MIN);
        let Some(mut step_taken) = step(&jacobian, &left, damping) else {
            break;
        };
        if limited && leave_out_blocked(chain, &position, &step_taken, &mut jacobian) {
            let Some(again) = step(&jacobian, &left, damping) else {
                break;
            };
            step_taken = again;
        }
        let longest = step_taken.amax();
        let scale = if longest > STEP_MAX { STEP_MAX / longest } else { 1.0 };
        for ((q, dq), joint) in position.iter_mut().zip(step_taken.iter()).zip(chain.joints()) {
            *q += scale * dq;
            if limited {
                *q = q.max(joint.position_min).min(joint.position_max);
            }
        }
    }
    best.manipulability = manipulability(&chain.jacobian(&best.position).1);
    best
}

/// Clears the columns of joints that stand on a limit and would be pushed past it.
fn leave_out_blocked(
    chain: &Chain,
    position: &[f64; JOINTS_MAX],
    step: &SVector<f64, JOINTS_MAX>,
    jacobian: &mut SMatrix<f64, 6, JOINTS_MAX>,
) -> bool {
    let mut any = false;
    for (index, joint) in chain.joints().iter().enumerate() {
        let (q, dq) = (position[index], step[index]);
        if (q <= joint.position_min && dq < 0.0) || (q >= joint.position_max && dq > 0.0) {
            jacobian.column_mut(index).fill(0.0);
            any = true;
        }
    }
    any
}

/// `Jᵀ (J·Jᵀ + λ²·I)⁻¹ e`; `None` when the numbers have gone astray.
fn step(
    jacobian: &SMatrix<f64, 6, JOINTS_MAX>,
    left: &SVector<f64, 6>,
    damping: f64,
) -> Option<SVector<f64, JOINTS_MAX>> {
    let mut normal = jacobian * jacobian.transpose();
    for index in 0..6 {
        normal[(index, index)] += damping;
    }
    let step = jacobian.transpose() * normal.cholesky()?.solve(left);
    step.iter().all(|x| x.is_finite()).then_some(step)
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
