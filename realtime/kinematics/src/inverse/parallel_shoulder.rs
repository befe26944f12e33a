//! Closed form for arms of the UR kind, from the geometry of their axes.
//!
//! Let the arm stand at position 0 with joint axes of direction `w1..w6`. The
//! form applies when axes 2, 3 and 4 are parallel (direction `w`), `w ⟂ w1`,
//! `w5 ⟂ w`, `w6 ⟂ w5`, and axes 5 and 6 meet, in the wrist point.
//!
//! - the wrist point stays where E5 and E6 leave it, and E2 E3 E4 do not move it
//!   along `w`: one equation for q1, two solutions;
//! - the component of axis 6 along `w` depends on q5 alone: two solutions;
//! - `w` seen from the far side fixes q6 (free when axis 6 is parallel to `w`: taken from the seed);
//! - what remains is a planar arm of two links with the sum of angles given: two solutions.

use nalgebra::Isometry3;

use super::Candidates;
use super::axes::{Axes, angle_about, any_across, component_about, lever_about};
use crate::JOINTS_MAX;

/// An arm whose joints 2, 3 and 4 are parallel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ParallelShoulder {
    /// Points of axes 5 and 6 are the wrist point.
    axes: Axes,
}

impl ParallelShoulder {
    /// The closed form of an arm, if it is of this kind.
    pub(super) fn of(mut axes: Axes) -> Option<Self> {
        let fits = axes.are_parallel(1, 3) && axes.are_square(1, 4) && axes.are_square(4, 5);
        let wrist = axes.meeting(4, 5).filter(|_| fits)?;
        axes.points[4] = wrist;
        axes.points[5] = wrist;
        (axes.across(&(axes.points[3] - axes.points[2])).norm() > 1e-3).then_some(Self { axes })
    }

    /// All branches, limits aside.
    pub(super) fn candidates(&self, goal: &Isometry3<f64>, near: &[f64; JOINTS_MAX]) -> Candidates {
        let axes = &self.axes;
        let motion = goal * axes.base_from_tcp.inverse();
        let mut found = [None; 8];
        let [_, w, _, _, w5, w6] = axes.directions;
        let wrist = motion.rotation * axes.points[5] + motion.translation.vector;
        let Some(shoulders) = axes.shoulder(&axes.points[5], &wrist, near[0]) else {
            return found;
        };
        for (s, q1) in shoulders.into_iter().enumerate() {
            let rest = axes.turn(0, q1).inverse() * motion;
            let Some(wrists) = component_about(&w5, &w6, &w, w.dot(&(rest.rotation * w6))) else {
                continue;
            };
            for (k, q5) in wrists.into_iter().enumerate() {
                // Turning by −q6 about axis 6 takes `w` as joint 5 leaves it to `w` seen from the far side.
                let [from, to] = [axes.turn(4, q5).rotation.inverse() * w, rest.rotation.inverse() * w];
                let q6 = lever_about(&w6, &from, &to).map_or(near[5], |turn| -turn);
                let planar = rest * axes.turn(5, q6).inverse() * axes.turn(4, q5).inverse();
                let sum = angle_about(&w, &any_across(&w), &(planar.rotation * any_across(&w)));
                let end = planar.rotation * axes.points[3] + planar.translation.vector;
                let Some(elbows) = axes.elbow(&axes.points[3], &end) else {
                    continue;
                };
                for (e, [q2, q3]) in elbows.into_iter().enumerate() {
                    let q4 = axes.sense(3) * (sum - q2 - axes.sense(2) * q3);
                    found[4 * s + 2 * k + e] = Some([q1, q2, q3, q4, q5, q6, 0.0, 0.0]);
                }
            }
        }
        found
    }
}
