//! Everything a control cycle calls, for seven joints. Compiled by the test beside it, not by cargo.
#![no_std]
#![forbid(unsafe_code)]

use tandem_trajectory::{
    Cursor, Error, Extrema, Generator, Input, Limits, Profile, Route, Segment, State, Step, Stopping, Tracker,
    Trajectory, Waypoints,
};

const JOINTS: usize = 7;
const WAYPOINTS: usize = 8;

#[inline(never)]
pub fn calculate(input: &Input<JOINTS>) -> Result<Trajectory<JOINTS>, Error> {
    Trajectory::calculate(input)
}

#[inline(never)]
pub fn recalculate(trajectory: &mut Trajectory<JOINTS>, input: &Input<JOINTS>) -> Result<(), Error> {
    trajectory.recalculate(input)
}

#[inline(never)]
pub fn stop(start: &[State; JOINTS], limits: &[Limits; JOINTS]) -> Result<Trajectory<JOINTS>, Error> {
    Trajectory::stop(start, limits)
}

#[inline(never)]
pub fn stopping(start: &State, limits: &Limits) -> Result<Stopping, Error> {
    Stopping::of(start, limits)
}

#[inline(never)]
pub fn minimum_durations(input: &Input<JOINTS>) -> Result<[f64; JOINTS], Error> {
    input.minimum_durations()
}

#[inline(never)]
pub fn at(trajectory: &Trajectory<JOINTS>, time: f64) -> [State; JOINTS] {
    trajectory.at(time)
}

#[inline(never)]
pub fn cursor(cursor: &mut Cursor<JOINTS>, trajectory: &Trajectory<JOINTS>, time: f64) -> [State; JOINTS] {
    cursor.at(trajectory, time)
}

#[inline(never)]
pub fn extrema(profile: &Profile) -> Extrema {
    profile.extrema()
}

#[inline(never)]
pub fn first_time_at(profile: &Profile, position: f64) -> Option<f64> {
    profile.first_time_at(position)
}

#[inline(never)]
pub fn segment(profile: &Profile, index: usize) -> Option<Segment> {
    profile.segments().nth(index).or(profile.segment(index))
}

#[inline(never)]
pub fn begin(input: &Input<JOINTS>) -> Result<Generator<JOINTS>, Error> {
    Generator::new(input)
}

#[inline(never)]
pub fn update(generator: &mut Generator<JOINTS>, input: &Input<JOINTS>, period: f64) -> Result<Step<JOINTS>, Error> {
    generator.update(input, period)
}

#[inline(never)]
pub fn route(
    input: &Input<JOINTS>,
    waypoints: &mut Waypoints<JOINTS, WAYPOINTS>,
    budget: u32,
) -> Result<Route<JOINTS, WAYPOINTS>, Error> {
    Route::calculate(input, waypoints, budget)
}

#[inline(never)]
pub fn route_at(route: &Route<JOINTS, WAYPOINTS>, time: f64) -> ([State; JOINTS], f64) {
    (route.at(time), route.duration())
}

#[inline(never)]
pub fn waypoints(waypoints: &mut Waypoints<JOINTS, WAYPOINTS>, positions: &[[f64; JOINTS]]) -> bool {
    *waypoints = Waypoints::new(positions);
    waypoints.pass();
    waypoints.positions().len() == waypoints.velocities().len()
}

#[inline(never)]
pub fn track(tracker: &mut Tracker<JOINTS>, target: &[State; JOINTS]) -> Result<[State; JOINTS], Error> {
    tracker.follow(target)
}
