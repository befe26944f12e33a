//! Which joint positions bring the TCP to a pose.

mod axes;
mod numeric;
mod parallel_shoulder;
mod spherical_wrist;

use core::fmt;

use nalgebra::Isometry3;

use crate::chain::is_finite;
use crate::{Chain, JOINTS_MAX};

use axes::Axes;
use parallel_shoulder::ParallelShoulder;
use spherical_wrist::SphericalWrist;

/// Solutions one question may have: 2 shoulders × 2 elbows × 2 wrists.
const BRANCHES_MAX: usize = 8;
/// A solution is one whose TCP is off by no more than this, metres and radians.
const TOLERANCE: f64 = 1e-8;

/// What a closed form proposes, limits aside.
type Candidates = [Option<[f64; JOINTS_MAX]>; BRANCHES_MAX];

/// The geometry of a chain that can be solved without a search.
#[derive(Clone, Copy, Debug)]
pub(crate) enum ClosedForm {
    /// Joints 2, 3 and 4 are parallel, as of the UR series.
    ParallelShoulder(ParallelShoulder),
    /// The last three axes meet.
    SphericalWrist(SphericalWrist),
}

impl ClosedForm {
    /// The closed form of a chain, if it has one.
    pub(crate) fn of(chain: &Chain) -> Option<Self> {
        let axes = Axes::of(chain)?;
        let parallel = ParallelShoulder::of(axes).map(Self::ParallelShoulder);
        parallel.or_else(|| SphericalWrist::of(axes).map(Self::SphericalWrist))
    }

    /// All branches within limits, nearest to `near` first.
    fn solve(&self, chain: &Chain, goal: &Isometry3<f64>, near: &[f64; JOINTS_MAX]) -> Result<Branches, IkFailure> {
        let candidates = match self {
            Self::ParallelShoulder(form) => form.candidates(goal, near),
            Self::SphericalWrist(form) => form.candidates(goal, near),
        };
        let mut branches = Branches::NONE;
        let mut beyond_limits = false;
        for mut solution in candidates.into_iter().flatten() {
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
}

/// Why no joint position was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IkFailure {
    /// No joint position puts the TCP there; or, solved numerically, none was found.
    Unreachable,
    /// The search came near the goal and stalled where the arm has lost a direction of motion.
    Singular,
    /// Positions that put the TCP there exist, all of them outside the joint limits.
    JointLimit,
    /// The goal or the seed holds a number that is not finite.
    NotFinite,
}

impl fmt::Display for IkFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Unreachable => "no joint position reaches the pose",
            Self::Singular => "the pose lies at a singularity of the arm",
            Self::JointLimit => "the pose needs a joint beyond its limits",
            Self::NotFinite => "the pose or the seed holds a number that is not finite",
        })
    }
}

impl core::error::Error for IkFailure {}

/// Solutions of one inverse problem, within limits, nearest to the seed first.
#[derive(Clone, Copy, Debug)]
pub struct Branches {
    solutions: [[f64; JOINTS_MAX]; BRANCHES_MAX],
    distances: [f64; BRANCHES_MAX],
    count: usize,
}

impl Branches {
    const NONE: Self =
        Self { solutions: [[0.0; JOINTS_MAX]; BRANCHES_MAX], distances: [f64::INFINITY; BRANCHES_MAX], count: 0 };

    fn one(solution: &[f64; JOINTS_MAX]) -> Self {
        let mut one = Self { count: 1, ..Self::NONE };
        one.solutions[0] = *solution;
        one
    }

    /// The solutions, rad or m, nearest to the seed first (Euclidean distance of joint positions).
    pub fn as_slice(&self) -> &[[f64; JOINTS_MAX]] {
        &self.solutions[..self.count.min(BRANCHES_MAX)]
    }

    fn insert(&mut self, solution: &[f64; JOINTS_MAX], seed: &[f64; JOINTS_MAX]) {
        const SAME: f64 = 1e-6;
        let apart = |a: &[f64; JOINTS_MAX], b: &[f64; JOINTS_MAX]| -> f64 {
            a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
        };
        let known = self.as_slice().iter().any(|other| apart(other, solution) < SAME);
        if known || self.count >= BRANCHES_MAX {
            return;
        }
        let distance = apart(solution, seed);
        let mut at = self.count;
        while at > 0 && self.distances[at - 1] > distance {
            self.solutions[at] = self.solutions[at - 1];
            self.distances[at] = self.distances[at - 1];
            at -= 1;
        }
        self.solutions[at] = *solution;
        self.distances[at] = distance;
        self.count += 1;
    }
}

impl Chain {
    /// Joint positions that put the TCP at `goal` (in the base frame), within limits, the nearest
    /// to `seed`. In closed form that is the nearest of all; numerically it is what descends from
    /// the seed, or else from the first restart that succeeds. Entries past the joints in use are 0.
    ///
    /// # Errors
    /// What [`IkFailure`] names.
    ///
    /// # Realtime
    /// No allocation. Closed form: 8 branches. Numeric: at most 33 descents of 60 steps each
    /// (about 2 ms), so plan with it, do not servo with it.
    pub fn inverse(&self, goal: &Isometry3<f64>, seed: &[f64; JOINTS_MAX]) -> Result<[f64; JOINTS_MAX], IkFailure> {
        self.branches(goal, seed).map(|branches| branches.solutions[0])
    }

    /// As [`Chain::inverse`], with all branches where the closed form applies. At least one comes back.
    ///
    /// # Errors
    /// What [`IkFailure`] names.
    pub fn branches(&self, goal: &Isometry3<f64>, seed: &[f64; JOINTS_MAX]) -> Result<Branches, IkFailure> {
        let near = self.checked_question(goal, seed)?;
        match &self.closed_form {
            Some(form) => form.solve(self, goal, &near),
            None => numeric::solve(self, goal, &near).map(|solution| Branches::one(&solution)),
        }
    }

    /// As [`Chain::inverse`], by the numeric search alone, whether there is a closed form or not.
    ///
    /// # Errors
    /// What [`IkFailure`] names.
    pub fn search(&self, goal: &Isometry3<f64>, seed: &[f64; JOINTS_MAX]) -> Result<[f64; JOINTS_MAX], IkFailure> {
        numeric::solve(self, goal, &self.checked_question(goal, seed)?)
    }

    /// The seed with 0 past the joints in use.
    fn checked_question(
        &self,
        goal: &Isometry3<f64>,
        seed: &[f64; JOINTS_MAX],
    ) -> Result<[f64; JOINTS_MAX], IkFailure> {
        let count = self.joint_count();
        let seed_is_finite = seed[..count].iter().all(|q| q.is_finite());
        let rotation_is_unit = (goal.rotation.norm() - 1.0).abs() < 1e-5;
        if !is_finite(goal) || !seed_is_finite || !rotation_is_unit {
            return Err(IkFailure::NotFinite);
        }
        let mut near = [0.0; JOINTS_MAX];
        near[..count].copy_from_slice(&seed[..count]);
        Ok(near)
    }

    /// The solution with every turn chosen within limits and near the seed.
    fn within_limits(&self, solution: &[f64; JOINTS_MAX], near: &[f64; JOINTS_MAX]) -> Option<[f64; JOINTS_MAX]> {
        let mut chosen = [0.0; JOINTS_MAX];
        for (index, joint) in self.joints().iter().enumerate() {
            chosen[index] = joint.equivalent(solution[index], near[index])?;
        }
        Some(chosen)
    }
}
