//! Waypoints on the way, and targets that move.

use crate::{
    check::check,
    inputs::{Kind, Source},
};
use tandem_trajectory::{Input, Limits, Route, State, Tracker, Trajectory, Waypoints};

fn input(source: &mut Source) -> (Input<3>, [[f64; 3]; 4]) {
    let mut place = || [0; 3].map(|_| source.uniform(-2.0, 2.0));
    let input = Input {
        start: place().map(State::at_rest),
        target: place().map(State::at_rest),
        limits: [Limits::symmetric(1.0, 2.0, 10.0); 3],
        ..Input::default()
    };
    (input, [(); 4].map(|()| place()))
}

/// Every waypoint is passed, by all joints at once, in a motion that is valid and never slower than one
/// that rests at each; more work never gives a slower one, and a warm start is as good for less.
#[test]
fn waypoints_are_passed_without_resting() {
    let mut source = Source::new(Kind::Benchmark, 19);
    let mut shares = 0.0;
    for index in 0..40 {
        let (input, positions) = input(&mut source);
        let mut waypoints = Waypoints::<3, 6>::new(&positions);
        let resting = Route::calculate(&input, &mut waypoints, 0).expect("from rest to rest").duration();
        let some = Route::calculate(&input, &mut Waypoints::<3, 6>::new(&positions), 100).expect("valid");
        let route = Route::calculate(&input, &mut waypoints, 2000).expect("valid");
        assert!(route.duration() <= some.duration() && some.duration() <= resting, "{index}");
        assert!(route.calculations() <= 2000 + 14 && some.calculations() <= 100 + 14, "{}", route.calculations());
        shares += route.duration() / resting / 40.0;
        let mut begin = 0.0;
        for (place, section) in route.sections().enumerate() {
            let (from, to) = (section.at(0.0), section.at(section.duration()));
            for joint in 0..3 {
                let profile = &section.profiles()[joint];
                let faults = check(profile, &from[joint], &to[joint], true, &input.limits[joint]);
                assert!(faults.position < 1e-11 && faults.velocity < 1e-11 && faults.excess < 1e-11, "{faults:?}");
            }
            begin += section.duration();
            let there = route.at(begin - 1e-9);
            for joint in 0..3 {
                let wanted = positions.get(place).map_or(input.target[joint].position, |point| point[joint]);
                assert!((to[joint].position - wanted).abs() < 1e-12 && (there[joint].position - wanted).abs() < 1e-8);
            }
        }
        let again = Route::calculate(&input, &mut waypoints, 200).expect("valid");
        assert!(again.duration() <= route.duration() * (1.0 + 1e-12), "{index}: warm");
        waypoints.pass();
        assert_eq!(waypoints.positions(), &positions[1..]);
    }
    println!("share of the time that resting takes: {shares:.3}");
    // Most random waypoints are turning points of some joint.
    assert!(shares < 0.92, "{shares}");
    let mut none = Waypoints::<3, 6>::default();
    let (input, _) = input(&mut source);
    let direct = Trajectory::calculate(&input).expect("valid").duration();
    assert_eq!(Route::calculate(&input, &mut none, 100).expect("valid").duration(), direct);
}

/// Waypoints on the straight way cost little more than they make the acceleration vanish there.
#[test]
fn waypoints_on_the_way_cost_little() {
    let mut source = Source::new(Kind::Benchmark, 21);
    let mut worst = 0.0_f64;
    for _ in 0..40 {
        let (mut input, _) = input(&mut source);
        input.target = [0, 1, 2].map(|joint| State::at_rest(input.start[joint].position + source.uniform(2.0, 4.0)));
        let at = |share: f64| {
            [0, 1, 2].map(|joint| {
                let (from, to) = (input.start[joint].position, input.target[joint].position);
                from + share * (to - from)
            })
        };
        let mut waypoints = Waypoints::<3, 3>::new(&[at(0.25), at(0.5), at(0.75)]);
        let direct = Trajectory::calculate(&input).expect("valid").duration();
        let route = Route::calculate(&input, &mut waypoints, 1000).expect("valid").duration();
        worst = worst.max(route / direct);
    }
    println!("at most {worst:.3} of the time without waypoints");
    assert!(worst < 1.1, "{worst}");
}

/// A signal within the limits is met, and then followed one cycle behind: what is commanded for the end of a
/// cycle is the sample taken at its beginning.
#[test]
fn a_feasible_signal_is_followed_one_cycle_behind() {
    let (cycle, limits) = (1e-3, Limits::symmetric(2.0, 8.0, 80.0));
    let mut source = Source::new(Kind::Benchmark, 20);
    for _ in 0..20 {
        // Two tones that use at most 0.6 of each limit: what is left is to catch up with.
        let mut tone = |share: f64| {
            let rate: f64 = source.uniform(0.5, 9.0);
            let size = share * (2.0 / rate).min(8.0 / rate.powi(2)).min(80.0 / rate.powi(3));
            (rate, size, source.uniform(0.0, 6.0))
        };
        let tones = [tone(0.3), tone(0.3)];
        let signal = |time: f64| {
            tones.iter().fold(State::default(), |sum, (rate, size, phase)| {
                let (sin, cos) = (rate * time + phase).sin_cos();
                State {
                    position: sum.position + size * sin,
                    velocity: sum.velocity + size * rate * cos,
                    acceleration: sum.acceleration - size * rate * rate * sin,
                }
            })
        };
        let start = State { position: 1.5, velocity: -0.5, acceleration: 0.0 };
        let mut tracker = Tracker::new([start], [limits], cycle);
        let mut met = None;
        let mut before = start;
        for step in 0..6000 {
            let target = signal(f64::from(step) * cycle);
            let [state] = tracker.follow(&[target]).expect("valid");
            assert!((state.acceleration - before.acceleration).abs() <= 80.0 * cycle * (1.0 + 1e-9));
            assert!(state.velocity.abs() <= 2.0 * (1.0 + 1e-9) && state.acceleration.abs() <= 8.0 * (1.0 + 1e-9));
            before = state;
            let off = (state.position - target.position).abs();
            if met.is_none() && off < 1e-9 && (state.velocity - target.velocity).abs() < 1e-6 {
                met = Some(step);
            }
            if met.is_some_and(|met| step > met + 2) {
                assert!(off < 1e-7, "step {step}: off by {off:e}");
            }
        }
        assert!(met.is_some_and(|met| met < 5000), "{met:?} {tones:?}");
    }
}

/// A target that moves faster than the joint can is followed as well as the limits allow, without an error;
/// one that stands still is reached and kept.
#[test]
fn a_target_that_cannot_be_followed_is_no_error() {
    let limits = Limits::symmetric(1.0, 4.0, 40.0);
    let mut tracker = Tracker::new([State::default()], [limits], 1e-3);
    for step in 0..2000 {
        let time = f64::from(step) * 1e-3;
        let target = State { position: 3.0 * time, velocity: 3.0, acceleration: 0.0 };
        let [state] = tracker.follow(&[target]).expect("no error");
        assert!(state.velocity <= 1.0 + 1e-9);
    }
    assert!((tracker.states()[0].velocity - 1.0).abs() < 1e-9);
    for _ in 0..3000 {
        tracker.follow(&[State::at_rest(0.5)]).expect("no error");
    }
    let [state] = *tracker.states();
    assert!((state.position - 0.5).abs() < 1e-9 && state.velocity.abs() < 1e-9, "{state:?}");
    let wrong = [State { position: f64::NAN, ..State::default() }];
    assert!(tracker.follow(&wrong).is_err() && *tracker.states() == [state]);
}
