//! How long a motion takes at the joints' limits.

use tandem_kinematics::Chain;
use tandem_policy::DOF;
use tandem_trajectory::{Input, Limits, Route, State, Trajectory, Waypoints};

use crate::world::Joints;

/// Waypoints of a timed route.
const WAYPOINTS: usize = 24;
/// Trajectories that may be calculated for one.
const BUDGET: u32 = 400;

/// Seconds along joint positions: stopping at each, as hand-made paths do, or passing them.
///
/// Velocity, acceleration and jerk of every joint are at most the cell's; the speed of the TCP is not capped.
pub fn duration(chain: &Chain, path: &[Joints], stopping: bool) -> Option<f64> {
    let limits: [Limits; DOF] = std::array::from_fn(|k| {
        let joint = &chain.joints()[k];
        Limits::symmetric(joint.velocity_max, joint.acceleration_max, joint.jerk_max)
    });
    let at = |q: &Joints| -> [f64; DOF] { std::array::from_fn(|k| q[k]) };
    let between = |from: &Joints, to: &Joints| Input::<DOF> {
        start: at(from).map(State::at_rest),
        target: at(to).map(State::at_rest),
        limits,
        ..Input::default()
    };
    let (first, last) = (path.first()?, path.last()?);
    if stopping || path.len() == 2 {
        let legs = path.windows(2).map(|leg| Trajectory::calculate(&between(&leg[0], &leg[1])).ok());
        return legs.map(|leg| leg.map(|leg| leg.duration())).sum();
    }
    let inner = path.get(1..path.len() - 1).unwrap_or(&[]);
    // Of more than there is room for, evenly spaced ones.
    let every = inner.len().div_ceil(WAYPOINTS).max(1);
    let positions: Vec<[f64; DOF]> = inner.iter().step_by(every).map(at).collect();
    let mut waypoints = Waypoints::<DOF, WAYPOINTS>::new(&positions);
    let route = Route::calculate(&between(first, last), &mut waypoints, BUDGET).ok()?;
    Some(route.duration())
}
