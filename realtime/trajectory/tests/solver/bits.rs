//! The same bits in every build: debug or release, whatever the processor, whatever was calculated before.

use crate::inputs::{Kind, Source};
use tandem_trajectory::{Input, Interface, Limits, State, Synchronization, Trajectory};

/// What the trajectories below hash to, in every build and on every machine: change it with the solver.
const DIGEST: u64 = 0x7a05_1dcd_9b5b_ac43;

/// A problem of four joints from nothing but uniform numbers, so that the inputs are the same everywhere, too.
fn input(source: &mut Source) -> Input<4> {
    let mut input = Input::<4>::default();
    for joint in 0..4 {
        let mut limit = || source.uniform(0.5, 9.0);
        let limits = [limit(), limit(), limit(), limit(), limit(), limit()];
        let [v, w, a, b, j, k] = limits;
        input.limits[joint] = Limits {
            velocity_min: -w,
            velocity_max: v,
            acceleration_min: -b,
            acceleration_max: a,
            jerk_min: -k,
            jerk_max: j,
        };
        let mut state = |share: f64| State {
            position: source.uniform(-4.0, 4.0),
            velocity: share * source.uniform(-w, v),
            acceleration: share * source.uniform(-b, a),
        };
        // Some starts lie outside the limits; targets well inside.
        (input.start[joint], input.target[joint]) = (state(1.3), state(0.3));
        let bits = source.bits();
        input.interface[joint] = if bits & 3 == 0 { Interface::Velocity } else { Interface::Position };
        let kinds = [Synchronization::Time, Synchronization::TimeIfNecessary, Synchronization::None];
        input.synchronization[joint] = kinds[(bits >> 8) as usize % 3];
        input.soft_limits[joint] = bits & 4 != 0;
    }
    input
}

fn digest(count: usize) -> u64 {
    let mut source = Source::new(Kind::Benchmark, 23);
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut add = |value: f64| hash = (hash ^ value.to_bits()).wrapping_mul(0x100_0000_01b3).rotate_left(23);
    let mut solved = 0;
    for _ in 0..count {
        let Ok(trajectory) = Trajectory::calculate(&input(&mut source)) else { continue };
        solved += 1;
        add(trajectory.duration());
        for share in 0..8 {
            for state in trajectory.at(trajectory.duration() * f64::from(share) / 8.0) {
                add(state.position);
                add(state.velocity);
                add(state.acceleration);
            }
        }
    }
    assert!(solved * 2 > count, "{solved}");
    hash
}

#[test]
fn every_build_calculates_the_same_bits() {
    let first = digest(3000);
    assert_eq!(first, digest(3000), "an earlier calculation changes a later one");
    assert_eq!(first, DIGEST, "{first:#x}");
}
