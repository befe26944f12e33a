//! The TCP and its Jacobian, by the shortest way.
//!
//! Every joint gets a frame of its own choosing: its z axis is the joint's, and it is turned about
//! that axis so that the way to the next one is a turn about x alone, by the twist `alpha`, as in
//! Denavit and Hartenberg's frames. Unlike theirs the origin may lie anywhere on the axis, so that
//! parallel and nearly parallel axes are nothing special; it is chosen so that the next one lies in
//! the x–y plane. A joint then costs two turns of two columns and one shift, and its axis is a column:
//!
//! `S ← S·Rx(alpha)·Rz(q + phase)`, `p ← p + S·(x, y, 0)`

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

use crate::sin_cos::sin_cos;
use crate::{Chain, JOINTS_MAX, Jacobian, Joint, JointKind};

/// One joint's constants.
#[derive(Clone, Copy, Debug, Default)]
struct Step {
    /// From the frame before to this one, in the frame before, metres.
    shift: [f64; 2],
    /// Cosine and sine of the twist between the axes.
    twist: [f64; 2],
}

/// Constants of all joints.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Recursion {
    /// The frame the first step starts from.
    base: [Vector3<f64>; 3],
    origin: Vector3<f64>,
    /// Angles about z at position 0.
    phases: [f64; JOINTS_MAX],
    /// 1 for a joint that turns, 0 for one that slides.
    turns: [f64; JOINTS_MAX],
    steps: [Step; JOINTS_MAX],
    /// The TCP in the last frame, metres.
    tool_shift: [f64; 2],
    tool: Matrix3<f64>,
}

impl Recursion {
    pub(crate) fn of(joints: &[Joint], tool: &Isometry3<f64>) -> Self {
        let mut steps = [Step::default(); JOINTS_MAX];
        let (mut phases, mut turns) = ([0.0; JOINTS_MAX], [0.0; JOINTS_MAX]);
        // Frame before, as turned from what the last joint moves; its turn about z is still free.
        let mut before = UnitQuaternion::identity();
        let mut base = UnitQuaternion::identity();
        let mut origin = Vector3::zeros();
        // How far along its z axis the frame before was moved.
        let mut shifts = [Vector3::zeros(); JOINTS_MAX];
        for (index, joint) in joints.iter().enumerate().take(JOINTS_MAX) {
            let axis = aligned(&joint.axis);
            let between = before.inverse() * joint.parent_from_joint.rotation * axis;
            let [first, twist, second] = euler_zxz(&between);
            let turned = before * about_z(first);
            match index.checked_sub(1) {
                None => base = about_z(first),
                Some(last) => phases[last] += first,
            }
            shifts[index] = turned.inverse() * joint.parent_from_joint.translation.vector;
            steps[index].twist = [twist.cos(), twist.sin()];
            phases[index] = second;
            turns[index] = if joint.kind == JointKind::Revolute { 1.0 } else { 0.0 };
            before = axis;
        }
        let last = joints.len().min(JOINTS_MAX).saturating_sub(1);
        let tool_at = before.inverse() * tool.translation.vector;
        let tool_shift = [tool_at.x, tool_at.y];
        let tool = before.inverse() * tool.rotation;
        let [cos, sin] = steps[last].twist;
        shifts[last] += Vector3::new(0.0, -sin, cos) * tool_at.z;
        // From the far end: what a shift has along its z axis the origin before takes over.
        for index in (0..joints.len().min(JOINTS_MAX)).rev() {
            steps[index].shift = [shifts[index].x, shifts[index].y];
            let along = shifts[index].z;
            match index.checked_sub(1) {
                None => origin = base * Vector3::new(0.0, 0.0, along),
                Some(last) => {
                    let [cos, sin] = steps[last].twist;
                    shifts[last] += Vector3::new(0.0, -sin, cos) * along;
                }
            }
        }
        let base = [Vector3::x(), Vector3::y(), Vector3::z()].map(|column| base * column);
        let tool = *tool.to_rotation_matrix().matrix();
        Self { base, origin, phases, turns, steps, tool_shift, tool }
    }
}

/// The shortest turn that takes z to the axis.
fn aligned(axis: &Vector3<f64>) -> UnitQuaternion<f64> {
    // Two opposite directions have no shortest turn.
    let half = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), core::f64::consts::PI);
    UnitQuaternion::rotation_between(&Vector3::z(), axis).unwrap_or(half)
}

fn about_z(angle: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Vector3::z_axis(), angle)
}

/// Angles a, b, c with `rotation = Rz(a)·Rx(b)·Rz(c)`, also where only a + c is determined.
fn euler_zxz(rotation: &UnitQuaternion<f64>) -> [f64; 3] {
    let axis = rotation * Vector3::z();
    let across = axis.x.hypot(axis.y);
    let first = if across > 0.0 { axis.x.atan2(-axis.y) } else { 0.0 };
    let twist = across.atan2(axis.z);
    let tilted = about_z(first) * UnitQuaternion::from_axis_angle(&Vector3::x_axis(), twist);
    let rest = tilted.inverse() * rotation * Vector3::x();
    [first, twist, rest.y.atan2(rest.x)]
}

impl Chain {
    /// Pose of the TCP and its Jacobian; `position` in rad or m, entries past the joints in use are
    /// ignored. Where the links are is not asked: that makes it faster than [`Chain::jacobian`].
    ///
    /// # Realtime
    /// Bounded by [`JOINTS_MAX`]; no allocation. Positions that are not finite give poses that are not.
    pub fn tcp_jacobian(&self, position: &[f64; JOINTS_MAX]) -> (Isometry3<f64>, Jacobian) {
        let mut answer = (Isometry3::identity(), Jacobian::zeros());
        let (rotation, origin) = self.tcp_columns(position, &mut answer.1);
        let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rotation));
        answer.0 = Isometry3::from_parts(Translation3::from(origin), rotation);
        answer
    }

    /// As [`Chain::tcp_jacobian`], the rotation as a matrix; columns past the joints in use stay as they are.
    #[inline(always)]
    pub(crate) fn tcp_columns(
        &self,
        position: &[f64; JOINTS_MAX],
        jacobian: &mut Jacobian,
    ) -> (Matrix3<f64>, Vector3<f64>) {
        let recursion = &self.recursion;
        let angles = core::array::from_fn(|k| recursion.turns[k] * position[k] + recursion.phases[k]);
        let (sines, cosines) = sin_cos(&angles);
        let [mut x, mut y, mut z] = recursion.base;
        let mut origin = recursion.origin;
        // At first a column holds a point of the joint's axis, then what that means for the TCP.
        let columns = &mut jacobian.data.0[..self.joint_count().min(JOINTS_MAX)];
        for (index, column) in columns.iter_mut().enumerate() {
            let Step { shift, twist: [cos, sin] } = recursion.steps[index];
            origin += x * shift[0] + y * shift[1];
            (y, z) = (y * cos + z * sin, z * cos - y * sin);
            let (sin, cos) = (sines[index], cosines[index]);
            (x, y) = (x * cos + y * sin, y * cos - x * sin);
            if recursion.turns[index] == 0.0 {
                origin += z * position[index];
            }
            *column = [origin.x, origin.y, origin.z, z.x, z.y, z.z];
        }
        let tcp = origin + x * recursion.tool_shift[0] + y * recursion.tool_shift[1];
        for (column, turns) in columns.iter_mut().zip(&recursion.turns) {
            let [ox, oy, oz, ax, ay, az] = *column;
            let [rx, ry, rz] = [tcp.x - ox, tcp.y - oy, tcp.z - oz];
            *column = if *turns == 0.0 {
                [ax, ay, az, 0.0, 0.0, 0.0]
            } else {
                [ay * rz - az * ry, az * rx - ax * rz, ax * ry - ay * rx, ax, ay, az]
            };
        }
        (Matrix3::from_columns(&[x, y, z]) * recursion.tool, tcp)
    }
}
