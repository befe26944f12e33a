//! Prints what the bits of trajectories hash to, twice: the second time with a used solver. Compiled by the test
//! beside it in several ways, not by cargo.

use tandem_trajectory::{Input, Interface, Limits, State, Synchronization, Trajectory};

/// Uniform numbers from a counter (splitmix64), the same everywhere.
struct Source(u64);

impl Source {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ mixed >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ mixed >> 31
    }

    fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

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

/// What the trajectories of `count` problems hash to; each is calculated into what the one before has left.
fn digest(count: usize) -> u64 {
    let mut source = Source(23);
    let mut trajectory = Trajectory::default();
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut add = |value: f64| hash = (hash ^ value.to_bits()).wrapping_mul(0x100_0000_01b3).rotate_left(23);
    let mut solved = 0;
    for _ in 0..count {
        if trajectory.recalculate(&input(&mut source)).is_err() {
            continue;
        }
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

fn main() {
    println!("{:#x} {:#x}", digest(3000), digest(3000));
}
