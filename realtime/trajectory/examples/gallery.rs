//! Draws what the crate can do, one SVG a feature: position, velocity and acceleration over time.
//!
//! `cargo run --release -p tandem-trajectory --example gallery [FOLDER]`
#![allow(clippy::disallowed_types, clippy::disallowed_macros, clippy::disallowed_methods, reason = "an example may")]

use std::fmt::Write as _;
use tandem_trajectory::{Input, Interface, Limits, Route, State, Synchronization, Tracker, Trajectory, Waypoints};

const COLOURS: [&str; 4] = ["#1b6ca8", "#d1495b", "#66a182", "#8a6fb0"];
const SAMPLES: u32 = 600;

/// A name, how it is read from a state, and its limits.
type Quantity = (&'static str, fn(&State) -> f64, Option<[f64; 2]>);

/// Three panels, one curve a joint: states over time, and a dashed line for each of `limits`.
fn draw(title: &str, duration: f64, limits: Option<&Limits>, states: impl FnMut(f64) -> Vec<State>) -> String {
    let times: Vec<f64> = (0..=SAMPLES).map(|step| duration * f64::from(step) / f64::from(SAMPLES)).collect();
    let samples: Vec<Vec<State>> = times.iter().copied().map(states).collect();
    let quantities: [Quantity; 3] = [
        ("position", |state| state.position, None),
        ("velocity", |state| state.velocity, limits.map(|limits| [limits.velocity_min, limits.velocity_max])),
        (
            "acceleration",
            |state| state.acceleration,
            limits.map(|limits| [limits.acceleration_min, limits.acceleration_max]),
        ),
    ];
    let mut svg = format!(
        r#"<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 760 560" font-family="sans-serif" font-size="13"><rect width="760" height="560" fill="white"/><text x="70" y="24" font-size="16">{title}</text>"#
    );
    for (panel, (name, value, bounds)) in quantities.iter().enumerate() {
        let top = 40.0 + 170.0 * panel as f64;
        let values = samples.iter().flatten().map(value).chain(bounds.iter().flatten().copied());
        let (low, high) = values.fold((f64::MAX, f64::MIN), |(low, high), value| (low.min(value), high.max(value)));
        let margin = 0.06 * (high - low).max(1e-9);
        let y = |value: f64| top + 150.0 * (high + margin - value) / (high - low + 2.0 * margin);
        let x = |time: f64| 70.0 + 670.0 * time / duration;
        let _ = write!(svg, r##"<rect x="70" y="{top}" width="670" height="150" fill="none" stroke="#bbb"/>"##);
        let middle = top + 75.0;
        let _ = write!(
            svg,
            r#"<text x="16" y="{middle}" transform="rotate(-90 16 {middle})" text-anchor="middle">{name}</text>"#
        );
        for at in [low, high] {
            let _ = write!(svg, r#"<text x="64" y="{:.1}" text-anchor="end">{at:.2}</text>"#, y(at) + 4.0);
        }
        for bound in bounds.iter().flatten() {
            let at = y(*bound);
            let _ = write!(
                svg,
                r##"<line x1="70" x2="740" y1="{at:.1}" y2="{at:.1}" stroke="#999" stroke-dasharray="5 4"/>"##
            );
        }
        for joint in 0..samples[0].len() {
            let points = times
                .iter()
                .zip(&samples)
                .map(|(time, states)| format!("{:.1},{:.1} ", x(*time), y(value(&states[joint]))));
            let colour = COLOURS[joint % COLOURS.len()];
            let _ = write!(
                svg,
                r#"<polyline fill="none" stroke="{colour}" stroke-width="1.6" points="{}"/>"#,
                points.collect::<String>()
            );
        }
    }
    let _ = write!(svg, r#"<text x="740" y="552" text-anchor="end">{duration:.2} s</text></svg>"#);
    svg
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args().nth(1).unwrap_or_else(|| "target/gallery".into());
    std::fs::create_dir_all(&folder)?;
    let save = |name: &str, svg: String| std::fs::write(format!("{folder}/{name}.svg"), svg);
    let limits = Limits::symmetric(1.0, 2.0, 10.0);
    let of = |name: &str, title: &str, input: &Input<2>| -> Result<(), Box<dyn std::error::Error>> {
        let trajectory = Trajectory::calculate(input)?;
        let states = |time| trajectory.at(time).to_vec();
        Ok(save(name, draw(title, trajectory.duration(), Some(&input.limits[0]), states))?)
    };
    let mut input = Input::<2> { limits: [limits; 2], ..Input::default() };
    input.start[0] = State { position: 0.0, velocity: 0.4, acceleration: 0.0 };
    input.target = [State::at_rest(1.2), State::at_rest(-0.3)];
    of("together", "Two joints that arrive together", &input)?;
    of("apart", "As early as each can", &Input { synchronization: [Synchronization::None; 2], ..input })?;
    let line = Input { start: [State::default(); 2], synchronization: [Synchronization::StrictPhase; 2], ..input };
    of("straight", "On a straight line", &line)?;
    of("longer", "In no less than 3 s", &Input { minimum_duration: 3.0, ..input })?;
    let mut full = input;
    full.target = [
        State { position: 1.2, velocity: 0.6, acceleration: -0.5 },
        State { position: -0.3, velocity: -0.2, acceleration: 1.0 },
    ];
    of("moving-target", "To a full target state", &full)?;
    let uneven = Limits { velocity_min: -0.6, acceleration_min: -4.0, jerk_min: -40.0, ..limits };
    of("asymmetric", "Braking harder than accelerating", &Input { limits: [uneven; 2], ..input })?;
    of("velocity", "To a velocity", &Input { interface: [Interface::Velocity; 2], ..full })?;
    let mut fast = input;
    fast.start[0].velocity = 1.8;
    fast.start[1].velocity = 1.8;
    fast.target = [State::at_rest(4.0), State::at_rest(4.0)];
    fast.soft_limits = [true, false];
    fast.synchronization = [Synchronization::None; 2];
    of("brake", "A start above the limit: soft (blue) and fastest (red) return", &fast)?;
    let mut out = input;
    out.target[0] = State { position: 1.2, velocity: 1.5, acceleration: 0.0 };
    out.target_outside = [true; 2];
    of("target-outside", "A target above the limit", &out)?;
    let stop = Trajectory::stop(&full.target, &full.limits)?;
    save("stop", draw("The fastest stop", stop.duration(), Some(&limits), |time| stop.at(time).to_vec()))?;
    let mut route = Waypoints::<2, 4>::new(&[[0.5, 0.3], [1.0, 0.1], [1.4, -0.4]]);
    let mut through = input;
    (through.start, through.target) = ([State::default(); 2], [State::at_rest(2.0), State::at_rest(-0.5)]);
    let route = Route::calculate(&through, &mut route, 600)?;
    save(
        "waypoints",
        draw("Through three waypoints", route.duration(), Some(&limits), |time| route.at(time).to_vec()),
    )?;
    let mut tracker = Tracker::new([State::default()], [limits], 0.01);
    let signal = |time: f64| State {
        position: 0.8 + 0.4 * (1.6 * time).sin(),
        velocity: 0.64 * (1.6 * time).cos(),
        acceleration: -1.024 * (1.6 * time).sin(),
    };
    let tracked =
        |time: f64| vec![tracker.follow(&[signal(time)]).map_or(State::default(), |[state]| state), signal(time)];
    save("tracking", draw("Following (blue) a target that moves (red)", 6.0, Some(&limits), tracked))?;
    println!("drawn to {folder}");
    Ok(())
}
