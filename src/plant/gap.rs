//! How drives join commands that come again after a pause.
//!
//! Meanwhile the set-point went on by itself, so it is neither where the commands are nor as fast. The difference,
//! position, velocity and acceleration of each joint, is led to zero as a critically damped system of third order
//! leads it: without a jump in any of them, and without overshoot of its own making.

use tandem_msg::{JOINTS_MAX, JointCommand};

use super::drive::SetPoint;

/// How fast a gap is closed, 1/s: after eight of its inverse, 0.14 s, a hundredth is left.
const RATE: f64 = 60.0;
/// A gap this small in position (rad), velocity and acceleration is none.
const NONE: f64 = 1e-9;

/// Set-point less command, joint by joint: rad, rad/s, rad/s².
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Gap([[f64; 3]; JOINTS_MAX]);

impl Gap {
    /// Between a command and a set-point that moves on by `dt` seconds to the command's instant.
    pub(super) fn between(
        set_point: &SetPoint,
        acceleration: &[f64; JOINTS_MAX],
        dt: f64,
        command: &JointCommand,
    ) -> Self {
        Self(core::array::from_fn(|joint| {
            let (position, velocity) = (set_point.position[joint], set_point.velocity[joint]);
            [
                position + velocity * dt - command.position[joint],
                velocity - command.velocity[joint],
                acceleration[joint] - command.acceleration[joint],
            ]
        }))
    }

    /// Closes it for `dt` seconds.
    pub(super) fn close(&mut self, dt: f64) {
        let fades = (-RATE * dt).exp();
        for gap in &mut self.0 {
            let [x, v, a] = *gap;
            // x(t) = p(t) exp(-RATE t), p a parabola.
            let (p1, p2) = (v + RATE * x, a + 2.0 * RATE * v + RATE * RATE * x);
            let (p, slope) = (x + (p1 + p2 * dt / 2.0) * dt, p1 + p2 * dt);
            let closed = [p, slope - RATE * p, p2 - 2.0 * RATE * slope + RATE * RATE * p].map(|value| value * fades);
            *gap = if closed.iter().all(|value| value.abs() < NONE) { [0.0; 3] } else { closed };
        }
    }

    /// Of one joint, rad.
    pub(super) fn position(&self, joint: usize) -> f64 {
        self.0[joint][0]
    }

    /// Of one joint, rad/s.
    pub(super) fn velocity(&self, joint: usize) -> f64 {
        self.0[joint][1]
    }
}
