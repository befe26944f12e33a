//! The axes of a six-joint arm at position 0, and the parts its closed forms share.
//!
//! Nothing here needs Denavit–Hartenberg frames, so any URDF of a fitting arm qualifies. With `E_i`
//! the motion of joint i, a goal is reached when `E1 E2 E3 E4 E5 E6 = goal · tcp(0)⁻¹`.

use core::f64::consts::PI;

use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};

use crate::{Chain, JOINTS_MAX, JointKind};

/// Directions and distances count as exact within this: URDF files round to eight digits or so.
pub(super) const GEOMETRY_TOLERANCE: f64 = 1e-6;
/// Below this a lever is too short to tell an angle.
const LEVER_MIN: f64 = 1e-7;

/// Axes in the base frame, metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axes {
    /// Directions.
    pub(super) directions: [Vector3<f64>; 6],
    /// A point on each.
    pub(super) points: [Vector3<f64>; 6],
    /// TCP at position 0.
    pub(super) base_from_tcp: Isometry3<f64>,
}

impl Axes {
    /// The axes of a chain of six turning joints whose second and third are parallel and square to
    /// the first, with links long enough to have a triangle; `None` for others.
    pub(super) fn of(chain: &Chain) -> Option<Self> {
        if chain.joint_count() != 6 || chain.joints().iter().any(|joint| joint.kind != JointKind::Revolute) {
            return None;
        }
        let poses = chain.forward(&[0.0; JOINTS_MAX]);
        let mut axes = Self {
            directions: [Vector3::zeros(); 6],
            points: [Vector3::zeros(); 6],
            base_from_tcp: poses.base_from_tcp,
        };
        for (index, joint) in chain.joints().iter().enumerate() {
            let pose = &poses.base_from_link[index + 1];
            axes.directions[index] = pose.rotation * joint.axis.into_inner();
            axes.points[index] = pose.translation.vector;
        }
        let fits = axes.are_parallel(1, 2)
            && axes.are_square(0, 1)
            && axes.across(&(axes.points[2] - axes.points[1])).norm() > 1e-3;
        fits.then_some(axes)
    }

    pub(super) fn are_parallel(&self, a: usize, b: usize) -> bool {
        self.directions[a].cross(&self.directions[b]).norm() < GEOMETRY_TOLERANCE
    }

    pub(super) fn are_square(&self, a: usize, b: usize) -> bool {
        self.directions[a].dot(&self.directions[b]).abs() < GEOMETRY_TOLERANCE
    }

    /// Where two axes meet that are not parallel; `None` where they pass each other.
    pub(super) fn meeting(&self, a: usize, b: usize) -> Option<Vector3<f64>> {
        let [u, v] = [self.directions[a], self.directions[b]];
        let between = self.points[b] - self.points[a];
        let normal = u.cross(&v);
        let spread = normal.norm_squared();
        if spread < GEOMETRY_TOLERANCE || normal.dot(&between).abs() > GEOMETRY_TOLERANCE * spread.sqrt() {
            return None;
        }
        Some(self.points[a] + u * (between.cross(&v).dot(&normal) / spread))
    }

    /// +1 or −1: whether a joint turns about axis 2 or against it.
    pub(super) fn sense(&self, index: usize) -> f64 {
        self.directions[index].dot(&self.directions[1]).signum()
    }

    /// Both q1 that bring `carried` (a point at position 0 that joints 2 and 3 move across axis 2
    /// only) to `end`; any, here `near`, when both lie on axis 1.
    pub(super) fn shoulder(&self, carried: &Vector3<f64>, end: &Vector3<f64>, near: f64) -> Option<[f64; 2]> {
        let (w1, u) = (self.directions[0], self.directions[1]);
        let v = w1.cross(&u);
        let end = end - self.points[0];
        let (x, y) = (end.dot(&u), end.dot(&v));
        let along = (carried - self.points[0]).dot(&u);
        let reach = x.hypot(y);
        if reach < LEVER_MIN && along.abs() < LEVER_MIN {
            return Some([near, near]);
        }
        let spread = acos(along / reach)?;
        let middle = y.atan2(x);
        Some([middle - spread, middle + spread])
    }

    /// Both pairs (q2, q3) that bring `carried` to `end`, seen along axis 2.
    pub(super) fn elbow(&self, carried: &Vector3<f64>, end: &Vector3<f64>) -> Option<[[f64; 2]; 2]> {
        let w = self.directions[1];
        let upper = self.across(&(self.points[2] - self.points[1]));
        let fore = self.across(&(carried - self.points[2]));
        let reach = self.across(&(end - self.points[1]));
        let (a, b) = (upper.norm(), fore.norm());
        let bend = acos((reach.norm_squared() - a * a - b * b) / (2.0 * a * b))?;
        let straight = angle_about(&w, &upper, &fore);
        Some([bend, -bend].map(|bend| {
            let turn3 = bend - straight;
            let folded = upper + rotation(&w, turn3) * fore;
            let turn2 = angle_about(&w, &folded, &reach);
            [turn2, self.sense(2) * turn3]
        }))
    }

    /// Motion of joint `index` (from 0) by `angle`, at position 0 of the others.
    pub(super) fn turn(&self, index: usize, angle: f64) -> Isometry3<f64> {
        let rotation = rotation(&self.directions[index], angle);
        let point = self.points[index];
        Isometry3::from_parts(Translation3::from(point - rotation * point), rotation)
    }

    /// The part of a vector across axis 2.
    pub(super) fn across(&self, vector: &Vector3<f64>) -> Vector3<f64> {
        vector - self.directions[1] * self.directions[1].dot(vector)
    }
}

pub(super) fn rotation(axis: &Vector3<f64>, angle: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Unit::new_unchecked(*axis), angle)
}

/// A unit vector square to `w`.
pub(super) fn any_across(w: &Vector3<f64>) -> Vector3<f64> {
    let other = if w.x.abs() < 0.7 { Vector3::x() } else { Vector3::y() };
    w.cross(&other).normalize()
}

/// The angle about `axis` that turns the shadow of `from` onto the shadow of `to`.
pub(super) fn angle_about(axis: &Vector3<f64>, from: &Vector3<f64>, to: &Vector3<f64>) -> f64 {
    let (from, to) = (from - axis * axis.dot(from), to - axis * axis.dot(to));
    axis.dot(&from.cross(&to)).atan2(from.dot(&to))
}

/// As [`angle_about`], or nothing where `from` is parallel to the axis and casts no shadow.
pub(super) fn lever_about(axis: &Vector3<f64>, from: &Vector3<f64>, to: &Vector3<f64>) -> Option<f64> {
    let lever = from - axis * axis.dot(from);
    (lever.norm() > LEVER_MIN).then(|| angle_about(axis, from, to))
}

/// Both angles about `axis` that turn `from` so that its component along `along` is `component`.
pub(super) fn component_about(
    axis: &Vector3<f64>,
    from: &Vector3<f64>,
    along: &Vector3<f64>,
    component: f64,
) -> Option<[f64; 2]> {
    // along · R(axis, q) from = still + cosine·cos q + sine·sin q
    let still = along.dot(axis) * axis.dot(from);
    let cosine = along.dot(from) - still;
    let sine = along.dot(&axis.cross(from));
    let spread = acos((component - still) / cosine.hypot(sine))?;
    let middle = sine.atan2(cosine);
    Some([middle - spread, middle + spread])
}

/// acos that forgives rounding at its ends and answers `None` past them.
fn acos(cosine: f64) -> Option<f64> {
    const FORGIVEN: f64 = 1e-9;
    (cosine.abs() <= 1.0 + FORGIVEN).then(|| if cosine <= -1.0 { PI } else { cosine.min(1.0).acos() })
}
