//! Closed form for arms with a spherical wrist (Pieper), from the geometry of their axes.
//!
//! The form applies when axes 4, 5 and 6 meet in the wrist point, 5 parallel to neither of the
//! others, and axes 2 and 3 are parallel (direction `w`) with `w ⟂ w1`: the usual six-joint industrial
//! arm, with or without offsets at shoulder and elbow.
//!
//! - joints 4, 5 and 6 do not move the wrist point, and joints 2 and 3 do not move it along `w`: one
//!   equation for q1, two solutions;
//! - joints 2 and 3 are a planar arm of two links that brings it there: two solutions;
//! - the rotation that is left is that of joints 4, 5 and 6: the component of axis 6 along axis 4
//!   depends on q5 alone, two solutions; then axis 6 fixes q4 and axis 4 fixes q6. Where the two are
//!   parallel only their sum counts and q4 is taken from the seed.

use nalgebra::{Isometry3, Vector3};

use super::Candidates;
use super::axes::{Axes, angle_about, any_across, component_about, lever_about};
use crate::JOINTS_MAX;

/// An arm whose last three axes meet.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SphericalWrist {
    axes: Axes,
    wrist: Vector3<f64>,
}

impl SphericalWrist {
    /// The closed form of an arm, if it is of this kind.
    pub(super) fn of(axes: Axes) -> Option<Self> {
        let wrist = axes.meeting(3, 4)?;
        let also = axes.meeting(4, 5)?;
        let meet = (wrist - also).norm() < super::axes::GEOMETRY_TOLERANCE;
        (meet && axes.across(&(wrist - axes.points[2])).norm() > 1e-3).then_some(Self { axes, wrist })
    }

    /// All branches, limits aside.
    pub(super) fn candidates(&self, goal: &Isometry3<f64>, near: &[f64; JOINTS_MAX]) -> Candidates {
        let axes = &self.axes;
        let motion = goal * axes.base_from_tcp.inverse();
        let end = motion.rotation * self.wrist + motion.translation.vector;
        let mut found = [None; 8];
        let Some(shoulders) = axes.shoulder(&self.wrist, &end, near[0]) else {
            return found;
        };
        for (s, q1) in shoulders.into_iter().enumerate() {
            let back = axes.turn(0, q1).inverse();
            let Some(elbows) = axes.elbow(&self.wrist, &(back.rotation * end + back.translation.vector)) else {
                continue;
            };
            for (e, [q2, q3]) in elbows.into_iter().enumerate() {
                let arm = axes.turn(0, q1).rotation * axes.turn(1, q2).rotation * axes.turn(2, q3).rotation;
                let left = arm.inverse() * motion.rotation;
                let [_, _, _, w4, w5, w6] = axes.directions;
                let pointing = left * w6;
                let Some(wrists) = component_about(&w5, &w6, &w4, w4.dot(&pointing)) else {
                    continue;
                };
                for (k, q5) in wrists.into_iter().enumerate() {
                    let bend = axes.turn(4, q5).rotation;
                    let q4 = lever_about(&w4, &(bend * w6), &pointing).unwrap_or(near[3]);
                    let last = (axes.turn(3, q4).rotation * bend).inverse() * left;
                    let mark = any_across(&w6);
                    let q6 = angle_about(&w6, &mark, &(last * mark));
                    found[4 * s + 2 * e + k] = Some([q1, q2, q3, q4, q5, q6, 0.0, 0.0]);
                }
            }
        }
        found
    }
}
