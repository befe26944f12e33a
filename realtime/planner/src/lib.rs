//! Ways through joint space that nobody thought of beforehand: RRT-Connect, then shortening.
//!
//! Two trees of joint positions grow towards each other, one from where the arm is, one from where it
//! shall be, until a straight motion joins them (Kuffner and LaValle, *RRT-Connect: An Efficient Approach
//! to Single-Query Path Planning*, ICRA 2000). Every branch is a motion swept clear of scene and arm,
//! not sampled. What is found is then shortened by straight motions between two places on it.
//!
//! A [`Planner`] works a little at a time: [`Planner::work`] does as many looks at the scene as it is
//! told, so it runs in a control cycle while the arm stands; [`Planner::solve`] runs to the end.
//! The same request gives the same path, bit for bit, however the work is cut into slices.
//!
//! **Invariant:** only [`Planner::new`] allocates; nothing blocks, reads a clock or panics; every slice and
//! every search has a bound.
//! **Invariant:** a path keeps more than the margin asked for all the way, people left aside: see
//! [`tandem_clearance::MotionSweep`].
//! **Invariant:** randomness comes from the request's seed alone.

mod draws;
mod planner;
mod shorten;
mod tree;

pub use planner::{Effort, Failure, Planner, Progress, ROOTS_MAX, Request};

/// One number per joint, rad or m; entries past the joints in use are 0.
type Joints = [f64; tandem_kinematics::JOINTS_MAX];
