//! A curve drawn anew at its own tempo: slow where it bends, fast between.
//!
//! A law follows a path at one speed of its length, and the sharpest bend decides which. So the length itself is laid
//! out in time: control points stand at places between which the arm takes equal times. Each turn measures how fast
//! every piece may be followed, moves the places half of the way towards that, and smooths them, since a change of speed
//! takes acceleration and jerk as well; the fastest of all turns is taken. Of random bends that takes a sixth to a third
//! of the time away.

use tandem_trajectory::State;

use super::Tools;
use super::way::round_off;
use crate::law::Law;
use crate::path::{CONTROLS, NODES_MAX, Path, PathPoint};

/// Times that it is drawn anew.
const TURNS: u32 = 6;
/// Times that durations of pieces, and then their control points, are drawn between their neighbours.
const SMOOTHED: u32 = 12;
const ROUNDED: u32 = 3;
/// A piece that takes longer than so many others counts as that long.
const LONGEST: f64 = 10.0;

const PIECES: usize = NODES_MAX - 1;

/// The curve at its tempo, from rest, or as a path at `start` goes on that is followed at `speed`, length per second.
pub(super) fn at_its_tempo(tools: &Tools<'_>, curve: &Path, start: Option<&PathPoint>, speed: f64, share: f64) -> Path {
    let spacing = curve.length() / PIECES as f64;
    let mut travel = [0.0; NODES_MAX];
    for (index, travel) in travel.iter_mut().enumerate() {
        *travel = curve.tcp_travel(tools.chain, spacing * index as f64);
    }
    let mut places: [f64; NODES_MAX] = core::array::from_fn(|index| spacing * index as f64);
    let duration = |path: &Path| {
        let limits = path.limits(tools.chain, share, tools.params.tcp_speed_max);
        let from = State { position: 0.0, velocity: speed, acceleration: 0.0 };
        let law = limits.are_usable().then(|| Law::to(path.length(), from, &limits).ok()).flatten();
        law.map_or(f64::INFINITY, |law| law.duration())
    };
    let (mut path, mut fastest) = (*curve, (duration(curve), *curve));
    for _ in 0..TURNS {
        let mut times = [0.0; PIECES];
        for (piece, time) in times.iter_mut().enumerate() {
            let step = (places[piece + 1] - places[piece]) / (path.length() / PIECES as f64);
            let tcp = step * travel[piece].max(travel[piece + 1]) / tools.params.tcp_speed_max;
            *time = tcp.max(path.slowness(tools.chain, piece));
        }
        let mean = times.iter().sum::<f64>() / PIECES as f64;
        for time in &mut times {
            *time = (*time / mean).min(LONGEST).sqrt();
        }
        for _ in 0..SMOOTHED {
            let before = times;
            for (piece, time) in times.iter_mut().enumerate() {
                let [left, right] = [piece.saturating_sub(1), (piece + 1).min(PIECES - 1)];
                *time = 0.25 * before[left] + 0.5 * before[piece] + 0.25 * before[right];
            }
        }
        places = evenly(&places, &times);
        let mut controls = [[0.0; tandem_msg::JOINTS_MAX]; CONTROLS];
        for (control, place) in controls[1..].iter_mut().zip(&places) {
            *control = curve.at(*place).position;
        }
        // Where it goes on from another path, its length is that of the curve there.
        let length = if start.is_some() { places[1] * PIECES as f64 } else { curve.length() };
        path = round_off(&mut controls, start, length, ROUNDED);
        let duration = duration(&path);
        if duration < fastest.0 {
            fastest = (duration, path);
        }
    }
    fastest.1
}

/// The places between which equal times pass, when these pass between the present ones.
fn evenly(places: &[f64; NODES_MAX], times: &[f64; PIECES]) -> [f64; NODES_MAX] {
    let total: f64 = times.iter().sum();
    let (mut piece, mut passed) = (0, 0.0);
    let mut even = *places;
    for (index, place) in even.iter_mut().enumerate().take(PIECES).skip(1) {
        let time = total * index as f64 / PIECES as f64;
        while piece + 1 < PIECES && passed + times[piece] < time {
            passed += times[piece];
            piece += 1;
        }
        let share = ((time - passed) / times[piece]).clamp(0.0, 1.0);
        *place = places[piece] + share * (places[piece + 1] - places[piece]);
    }
    even
}
