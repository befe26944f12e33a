//! Joints on a straight line through joint space.
//!
//! If the displacement, the velocities and the accelerations at both ends are all multiples of one
//! vector `d`, the joints can move as `p_i(t) = p_i(0) + d_i q(t)`. The line coordinate `q` is that
//! of the leading joint, the one with the largest component, for which `d = 1`; its limits are the
//! tightest of all joints, each divided by its `d_i`. So a straight motion is one problem of one
//! joint, and slower than arriving together only where another joint's limit is the tighter one.

use crate::{
    error::Error,
    input::{self, Input, Interface, JointInput},
    profile::Profile,
    state::{Limits, State},
    task::Task,
};

/// Relative distance from the line that counts as being on it: some roundings of the inputs.
const TIE: f64 = 64.0 * f64::EPSILON;

/// A group of joints moving on a line.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line<const N: usize> {
    pub(crate) task: Task,
    /// The problem of the line coordinate.
    coordinate: JointInput,
    /// The joint whose coordinate is that of the line.
    pub(crate) leader: usize,
    /// Share of each joint in the line coordinate; 0 for a joint that does not move.
    direction: [f64; N],
}

impl<const N: usize> Line<N> {
    /// The line of the joints marked in `members`.
    ///
    /// # Errors
    /// [`Error::NotStraight`] if there is none, or what [`input::check`] finds wrong.
    pub(crate) fn new(input: &Input<N>, members: &[bool; N]) -> Result<Self, Error> {
        let quantities: [[f64; N]; 5] = [
            core::array::from_fn(|i| match input.interface[i] {
                Interface::Position => input.target[i].position - input.start[i].position,
                Interface::Velocity => 0.0,
            }),
            core::array::from_fn(|i| input.start[i].velocity),
            core::array::from_fn(|i| input.target[i].velocity),
            core::array::from_fn(|i| input.start[i].acceleration),
            core::array::from_fn(|i| input.target[i].acceleration),
        ];
        // The leading joint has the largest component of the first quantity that is not zero.
        let (mut leader, mut base) = (0, &quantities[0]);
        for quantity in &quantities {
            for (i, value) in quantity.iter().enumerate() {
                if members[i] && (!members[leader] || value.abs() > base[leader].abs()) {
                    (leader, base) = (i, quantity);
                }
            }
            if members[leader] && base[leader] != 0.0 {
                break;
            }
        }
        let lead = base[leader];
        let direction = core::array::from_fn(|i| match (members[i], lead == 0.0) {
            (true, false) => base[i] / lead,
            (true, true) if i == leader => 1.0,
            _ => 0.0,
        });
        for quantity in &quantities {
            let reach = quantity
                .iter()
                .enumerate()
                .filter(|(i, _)| members[*i])
                .fold(0.0_f64, |most, (_, value)| most.max(value.abs()));
            for (i, value) in quantity.iter().enumerate() {
                if members[i] && (value - direction[i] * quantity[leader]).abs() > TIE * reach {
                    return Err(Error::NotStraight { joint: i });
                }
            }
        }
        if (0..N).any(|i| members[i] && input.interface[i] != input.interface[leader]) {
            return Err(Error::NotStraight { joint: leader });
        }
        let mut limits = input.limits[leader];
        for (i, own) in input.limits.iter().enumerate() {
            if direction[i] != 0.0 {
                tighten(&mut limits, own, direction[i]);
            }
        }
        let own = input.joint(leader);
        let start = State { position: 0.0, ..own.start };
        let target = State { position: quantities[0][leader], ..own.target };
        let coordinate = JointInput { start, target, limits, ..own };
        let joint = input::check(leader, &coordinate)?;
        Ok(Line { task: *Task::begin(&mut None, joint, &coordinate), coordinate, leader, direction })
    }

    /// The motion of the line coordinate, unless it leaves the range of doubles.
    pub(crate) fn along(&mut self, duration: f64) -> Option<Profile> {
        let mut profile = Profile::EMPTY;
        self.task.write(&self.coordinate, duration, &mut profile).then_some(profile)
    }

    /// The motion of joint `index`, given that of the line coordinate.
    pub(crate) fn profile(&self, index: usize, along: &Profile, input: &Input<N>) -> Profile {
        let held = input.interface[index] == Interface::Position;
        along.scaled(self.direction[index], input.start[index].position, &input.target[index], held)
    }
}

/// Narrows the limits of the line coordinate to what a joint with the share `direction` can do.
fn tighten(limits: &mut Limits, own: &Limits, direction: f64) {
    let both = |low: f64, high: f64| {
        if direction > 0.0 { (low / direction, high / direction) } else { (high / direction, low / direction) }
    };
    let narrow = |low: &mut f64, high: &mut f64, own: (f64, f64)| {
        *low = low.max(own.0);
        *high = high.min(own.1);
    };
    narrow(&mut limits.velocity_min, &mut limits.velocity_max, both(own.velocity_min, own.velocity_max));
    narrow(
        &mut limits.acceleration_min,
        &mut limits.acceleration_max,
        both(own.acceleration_min, own.acceleration_max),
    );
    narrow(&mut limits.jerk_min, &mut limits.jerk_max, both(own.jerk_min, own.jerk_max));
}
