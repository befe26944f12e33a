//! Any bit pattern is an input: the answer is an error or a finite trajectory, never a panic.

use crate::inputs::{Kind, Source, campaign};
use tandem_trajectory::{Input, Interface, Limits, State, Synchronization, Trajectory};

/// A double from bits, biased towards the troublemakers.
fn number(source: &mut Source) -> f64 {
    let bits = source.bits();
    match bits % 8 {
        0 => f64::from_bits(source.bits()),
        1 => f64::from_bits(source.bits() >> 12),
        2 => [0.0, -0.0, f64::INFINITY, f64::NEG_INFINITY, f64::NAN, f64::MAX, f64::MIN_POSITIVE, 5e-324]
            [(bits >> 8) as usize % 8],
        3 => source.uniform(-1.0, 1.0) * 10_f64.powf(source.uniform(-300.0, 300.0)),
        4 => source.uniform(-1.0, 1.0) * 10_f64.powf(source.uniform(-20.0, 20.0)),
        _ => source.uniform(-4.0, 4.0),
    }
}

#[test]
fn any_bit_pattern_gives_an_error_or_a_finite_trajectory() {
    let mut source = Source::new(Kind::Benchmark, 7);
    let (mut solved, mut refused) = (0, 0);
    for index in 0..campaign(100_000) {
        let mut input = Input::<2>::default();
        for joint in 0..2 {
            let mut state = || State {
                position: number(&mut source),
                velocity: number(&mut source),
                acceleration: number(&mut source),
            };
            (input.start[joint], input.target[joint]) = (state(), state());
            let limit = |x: f64| if index % 16 == 0 { x } else { x.abs() };
            let [v, a, j, w, b, k] = [0; 6].map(|_| limit(number(&mut source)));
            input.limits[joint] = Limits {
                velocity_min: -w,
                velocity_max: v,
                acceleration_min: -b,
                acceleration_max: a,
                jerk_min: -k,
                jerk_max: j,
            };
            let bits = source.bits();
            input.interface[joint] = if bits & 1 == 0 { Interface::Position } else { Interface::Velocity };
            let all = [
                Synchronization::Time,
                Synchronization::TimeIfNecessary,
                Synchronization::Phase,
                Synchronization::StrictPhase,
                Synchronization::None,
            ];
            input.synchronization[joint] = all[(bits >> 8) as usize % 5];
            if bits & 0x100_0000 != 0 {
                input.minimum_duration = number(&mut source);
                input.duration_step = number(&mut source);
            }
        }
        match Trajectory::calculate(&input) {
            Err(_) => refused += 1,
            Ok(trajectory) => {
                solved += 1;
                assert!(trajectory.duration().is_finite() && trajectory.duration() >= 0.0, "{index}: {input:?}");
                for profile in trajectory.profiles() {
                    for segment in profile.segments() {
                        let State { position, velocity, acceleration } = segment.start;
                        let numbers = [segment.start_time, position, velocity, acceleration, segment.jerk];
                        assert!(numbers.iter().all(|x| x.is_finite()), "{index}: {segment:?} {input:?}");
                    }
                }
            }
        }
    }
    println!("{solved} solved, {refused} refused");
}
