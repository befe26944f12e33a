//! Closed form for arms of the UR kind, from the geometry of their axes.
//!
//! Let the arm stand at position 0 with joint axes of direction `w1..w6`. The
//! form applies when axes 2, 3 and 4 are parallel (direction `w`), `w ⟂ w1`,
//! `w5 ⟂ w`, `w6 ⟂ w5`, and axes 5 and 6 meet, in the wrist point. No
//! Denavit–Hartenberg frames are needed, so any URDF of such an arm qualifies.
//! With `E_i` the motion of joint i, `H = goal · tcp(0)⁻¹ = E1 E2 E3 E4 E5 E6`:
//!
//! - the wrist point stays where E5 and E6 leave it, and E2 E3 E4 do not move it
//!   along `w`: one equation for q1, two solutions;
//! - the component of axis 6 along `w` depends on q5 alone: two solutions;
//! - `w` seen from the far side fixes q6 (free when axis 6 is parallel to `w`: taken from the seed);
//! - what remains is a planar arm of two links with the sum of angles given: two solutions.

use core::f64::consts::PI;

use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};

use super::{Branches, IkFailure, TOLERANCE, numeric};
use crate::{Chain, JOINTS_MAX, JointKind};

/// Directions and distances count as exact within this: URDF files round to eight digits or so.
const GEOMETRY_TOLERANCE: f64 = 1e-6;

/// An arm whose joints 2, 3 and 4 are parallel, at position 0, in the base frame, metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ParallelShoulder {
    /// Directions of the axes.
    directions: [Vector3<f64>; 6],
    /// A point on each axis; for axes 5 and 6 the wrist point.
    points: [Vector3<f64>; 6],
    /// +1 or −1: whether joints 2, 3, 4 turn about `w` or against it.
    senses: [f64; 3],
    /// TCP at position 0.
    base_from_tcp: Isometry3<f64>,
}

impl ParallelShoulder {
    /// The closed form of a chain, if it has one.
    pub(crate) fn of(chain: &Chain) -> Option<Self> {
        if chain.joint_count() != 6 || chain.joints().iter().any(|joint| joint.kind != JointKind::Revolute) {
            return None;
        }
        let poses = chain.forward(&[0.0; JOINTS_MAX]);
        let mut directions = [Vector3::zeros(); 6];
        let mut points = [Vector3::zeros(); 6];
        for (index, joint) in chain.joints().iter().enumerate() {
            let pose = &poses.base_from_link[index + 1];
            directions[index] = pose.rotation * joint.axis.into_inner();
            points[index] = pose.translation.vector;
        }
        let w = directions[1];
        let parallel = |d: &Vector3<f64>| d.cross(&w).norm() < GEOMETRY_TOLERANCE;
        let square = |a: &Vector3<f64>, b: &Vector3<f64>| a.dot(b).abs() < GEOMETRY_TOLERANCE;
        let fits = parallel(&directions[2])
            && parallel(&directions[3])
            && square(&directions[0], &w)
            && square(&directions[4], &w)
            && square(&directions[5], &directions[4]);
        if !fits {
            return None;
        }
        // Axes 5 and 6 are square to each other: they meet when nothing separates them along their common normal.
        let between = points[5] - points[4];
        if directions[4].cross(&directions[5]).dot(&between).abs() > GEOMETRY_TOLERANCE {
            return None;
        }
        let wrist = points[4] + directions[4] * directions[4].dot(&between);
        points[4] = wrist;
        points[5] = wrist;
        let senses = [1, 2, 3].map(|index: usize| directions[index].dot(&w).signum());
        // Links of the planar arm must have length, or the elbow has no triangle.
        let form = Self { directions, points, senses, base_from_tcp: poses.base_from_tcp };
        let lengths = [form.across(&(points[2] - points[1])), form.across(&(points[3] - points[2]))];
        lengths.iter().all(|length| length.norm() > 1e-3).then_some(form)
    }

    /// All branches within limits, nearest to `near` first.
    pub(crate) fn solve(
        &self,
        chain: &Chain,
        goal: &Isometry3<f64>,
        near: &[f64; JOINTS_MAX],
    ) -> Result<Branches, IkFailure> {
        let motion = goal * self.base_from_tcp.inverse();
        let mut branches = Branches::NONE;
        let mut beyond_limits = false;
        for mut solution in self.candidates(&motion, near).into_iter().flatten() {
            if !numeric::polish(chain, goal, &mut solution, TOLERANCE) {
                continue;
            }
            match chain.within_limits(&solution, near) {
                Some(solution) => branches.insert(&solution, near),
                None => beyond_limits = true,
            }
        }
        match (branches.count, beyond_limits) {
            (0, true) => Err(IkFailure::JointLimit),
            (0, false) => Err(IkFailure::Unreachable),
            _ => Ok(branches),
        }
    }

    fn candidates(&self, motion: &Isometry3<f64>, near: &[f64; JOINTS_MAX]) -> [Option<[f64; JOINTS_MAX]>; 8] {
        let mut found = [None; 8];
        let w = self.directions[1];
        let Some(shoulders) = self.shoulder(motion) else {
            return found;
        };
        for (s, q1) in shoulders.into_iter().enumerate() {
            let rest = self.turn(0, q1).inverse() * motion;
            let Some(wrists) = self.wrist(&rest) else {
                continue;
            };
            for (k, q5) in wrists.into_iter().enumerate() {
                let q6 = self.flange(&rest, q5).unwrap_or(near[5]);
                let planar = rest * self.turn(5, q6).inverse() * self.turn(4, q5).inverse();
                let sum = angle_about(&w, &self.across(&any_across(&w)), &(planar.rotation * any_across(&w)));
                let Some(elbows) = self.elbow(&planar) else {
                    continue;
                };
                for (e, [q2, q3]) in elbows.into_iter().enumerate() {
                    let [s2, s3, s4] = self.senses;
                    let q4 = s4 * (sum - s2 * q2 - s3 * q3);
                    found[4 * s + 2 * k + e] = Some([q1, q2, q3, q4, q5, q6, 0.0, 0.0]);
                }
            }
        }
        found
    }

    /// Both q1: the wrist point, turned back, lies as far along `w` as at position 0.
    fn shoulder(&self, motion: &Isometry3<f64>) -> Option<[f64; 2]> {
        let (w1, u) = (self.directions[0], self.directions[1]);
        let v = w1.cross(&u);
        let wrist = motion.rotation * self.points[5] + motion.translation.vector - self.points[0];
        let (x, y) = (wrist.dot(&u), wrist.dot(&v));
        let along = (self.points[5] - self.points[0]).dot(&u);
        let spread = acos(along / x.hypot(y))?;
        let middle = y.atan2(x);
        Some([middle - spread, middle + spread])
    }

    /// Both q5: the component of axis 6 along `w`.
    fn wrist(&self, rest: &Isometry3<f64>) -> Option<[f64; 2]> {
        let [_, w, _, _, w5, w6] = self.directions;
        let spread = acos(w.dot(&(rest.rotation * w6)))?;
        let middle = w.dot(&w5.cross(&w6)).atan2(w.dot(&w6));
        Some([middle - spread, middle + spread])
    }

    /// q6, or nothing where axis 6 is parallel to `w`.
    fn flange(&self, rest: &Isometry3<f64>, q5: f64) -> Option<f64> {
        let [_, w, _, _, _, w6] = self.directions;
        let from = rest.rotation.inverse() * w;
        let to = self.turn(4, q5).rotation.inverse() * w;
        // Turning by −q6 about axis 6 takes `to` to `from`.
        let lever = to - w6 * w6.dot(&to);
        (lever.norm() > 1e-7).then(|| angle_about(&w6, &from, &to))
    }

    /// Both pairs (q2, q3) of the planar arm.
    fn elbow(&self, planar: &Isometry3<f64>) -> Option<[[f64; 2]; 2]> {
        let w = self.directions[1];
        let upper = self.across(&(self.points[2] - self.points[1]));
        let fore = self.across(&(self.points[3] - self.points[2]));
        let end = planar.rotation * self.points[3] + planar.translation.vector;
        let reach = self.across(&(end - self.points[1]));
        let (a, b) = (upper.norm(), fore.norm());
        let bend = acos((reach.norm_squared() - a * a - b * b) / (2.0 * a * b))?;
        let straight = angle_about(&w, &upper, &fore);
        Some([bend, -bend].map(|bend| {
            let turn3 = bend - straight;
            let folded = upper + rotation(&w, turn3) * fore;
            let turn2 = angle_about(&w, &folded, &reach);
            [self.senses[0] * turn2, self.senses[1] * turn3]
        }))
    }

    /// Motion of joint `index` (from 0) by `angle`, at position 0 of the others.
    fn turn(&self, index: usize, angle: f64) -> Isometry3<f64> {
        let rotation = rotation(&self.directions[index], angle);
        let point = self.points[index];
        Isometry3::from_parts(Translation3::from(point - rotation * point), rotation)
    }

    /// The part of a vector across `w`.
    fn across(&self, vector: &Vector3<f64>) -> Vector3<f64> {
        vector - self.directions[1] * self.directions[1].dot(vector)
    }
}

fn rotation(axis: &Vector3<f64>, angle: f64) -> UnitQuaternion<f64> {
    UnitQuaternion::from_axis_angle(&Unit::new_unchecked(*axis), angle)
}

/// A unit vector square to `w`.
fn any_across(w: &Vector3<f64>) -> Vector3<f64> {
    let other = if w.x.abs() < 0.7 { Vector3::x() } else { Vector3::y() };
    w.cross(&other).normalize()
}

/// The angle about `axis` that turns the shadow of `from` onto the shadow of `to`.
fn angle_about(axis: &Vector3<f64>, from: &Vector3<f64>, to: &Vector3<f64>) -> f64 {
    let (from, to) = (from - axis * axis.dot(from), to - axis * axis.dot(to));
    axis.dot(&from.cross(&to)).atan2(from.dot(&to))
}

/// acos that forgives rounding at its ends and answers `None` past them.
fn acos(cosine: f64) -> Option<f64> {
    const FORGIVEN: f64 = 1e-9;
    (cosine.abs() <= 1.0 + FORGIVEN).then(|| if cosine <= -1.0 { PI } else { cosine.min(1.0).acos() })
}
