//! A walk-in, as the cell at work has it: the person leans in unasked, the arm slows, waits and goes on.

use std::path::PathBuf;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use tandem_config::Cell;
use tandem_msg::StopState;

use crate::lockstep::{SimCell, SimError};
use crate::plot::{Band, Figure, Line, Panel};
use crate::strategy::Library;
use crate::strategy::store::Store;
use crate::supervisor::RunOptions;

/// Shown before the arm begins to wait, and after it goes on, s.
const BEFORE: f64 = 3.0;
const AFTER: f64 = 1.5;
/// An arm this fast is on its way, m/s.
const UNDER_WAY: f64 = 0.25;
/// An arm this slow stands: what is measured of one at rest stays below, m/s.
const STANDS: f64 = 0.01;
/// It was on its way this long before it waited, at most, s.
const SHORTLY: f64 = 1.0;

/// One instant of the cell.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Cell time, s.
    pub time: f64,
    /// Speed of the TCP, m/s.
    pub tcp_speed: f64,
    /// Share of the speed in use.
    pub speed: f64,
    /// Distance to the person, metres.
    pub separation: f64,
    /// Distance owed to them.
    pub required: f64,
    /// Distance to scene and arm itself, metres.
    pub clearance: f64,
    /// The arm may move.
    pub running: bool,
}

/// The arm slowed, waited, went on.
#[derive(Clone, Debug)]
pub struct WalkIn {
    /// From a little before to a little after.
    pub samples: Vec<Sample>,
    /// When the arm stood, and when it moved again, s.
    pub stood: [f64; 2],
    /// Fastest before and after, m/s.
    pub speeds: [f64; 2],
    /// Least distance to the person while the arm moved, metres.
    pub distance: f64,
}

/// Runs the cell with a person who leans in again and again, until once the moving arm had to wait for them and
/// went on; `None` when that never happened while a box was made.
///
/// # Errors
/// What the lockstep cell says.
pub fn walk_in(cell: &Cell, seed: u64) -> Result<Option<WalkIn>, SimError> {
    let mut cell = cell.clone();
    cell.human.intrusion_probability = 1.0;
    let folder = Scratch::new().map_err(|error| SimError::of("a folder for the store", &error))?;
    let url = format!("sqlite://{}", folder.0.join("cell.db").display());
    let store = Store::open(&url).map_err(|error| SimError::of("store", &error))?;
    store.seed(&cell.strategies).map_err(|error| SimError::of("store", &error))?;
    let library: Library = store.library().map_err(|error| SimError::of("store", &error))?;
    let options = RunOptions { boxes: 1, seed, run_id: "walk-in".into() };
    let mut sim = SimCell::new(&cell, library, options)?;
    let mut samples: Vec<Sample> = Vec::new();
    let mut found = None;
    sim.run(&store, &mut |_| {}, |sim| {
        let now = sim.now().as_secs_f64();
        if samples.last().is_some_and(|last| now - last.time < Duration::from_millis(5).as_secs_f64()) {
            return false;
        }
        let motion = sim.motion();
        samples.push(Sample {
            time: now,
            tcp_speed: motion.tcp_speed,
            speed: motion.speed,
            separation: motion.separation,
            required: motion.separation_required,
            clearance: motion.clearance,
            running: motion.stop.is(StopState::Running),
        });
        found = complete(&samples);
        found.is_some()
    })?;
    Ok(found)
}

/// A folder for a database nobody will read; gone when dropped.
struct Scratch(PathBuf);

impl Scratch {
    fn new() -> std::io::Result<Self> {
        let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let name = format!("tandem-walk-in-{}-{:x}", std::process::id(), since.as_nanos());
        let path = std::env::temp_dir().join(name);
        std::fs::create_dir(&path)?;
        Ok(Self(path))
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        // What is left of it is the temporary folder's to clear.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// The last samples as a walk-in, once the arm is well under way again.
fn complete(samples: &[Sample]) -> Option<WalkIn> {
    let last = samples.last()?;
    let since = samples.partition_point(|sample| sample.time < last.time - 30.0);
    let recent = &samples[since..];
    // Backwards: on the way again for AFTER, before that standing next to somebody, before that on the way.
    let again = recent.iter().rposition(|sample| sample.tcp_speed < STANDS)?;
    let resumed = recent[again].time;
    let after = recent[again..].iter().fold(0.0_f64, |fastest, sample| fastest.max(sample.tcp_speed));
    if last.time - resumed < AFTER || after < UNDER_WAY {
        return None;
    }
    let standing = recent[..=again].iter().rposition(|sample| sample.tcp_speed >= STANDS)? + 1;
    let stood = recent[standing].time;
    let waited = recent[standing..=again].iter().any(|sample| sample.separation < sample.required + 0.1);
    let shortly = recent[..standing].iter().filter(|sample| sample.time > stood - SHORTLY);
    let before = shortly.fold(0.0_f64, |fastest, sample| fastest.max(sample.tcp_speed));
    if !waited || before < UNDER_WAY {
        return None;
    }
    let from = recent.partition_point(|sample| sample.time < stood - BEFORE);
    let moving = recent[from..].iter().filter(|sample| sample.tcp_speed >= STANDS);
    let distance = moving.fold(f64::INFINITY, |least, sample| least.min(sample.separation));
    Some(WalkIn { samples: recent[from..].to_vec(), stood: [stood, resumed], speeds: [before, after], distance })
}

impl WalkIn {
    /// Clearance, separation and speed over time.
    pub fn figure(&self) -> Figure {
        let start = self.samples.first().map_or(0.0, |sample| sample.time);
        let line = |name: &str, of: fn(&Sample) -> f64| Line {
            name: name.into(),
            points: self.samples.iter().map(|sample| [sample.time - start, of(sample)]).collect(),
        };
        let stopped = self.samples.iter().any(|sample| !sample.running);
        let name = if stopped { "protective stop" } else { "arm waits" };
        Figure {
            title: "A person walks in: the arm slows, waits and goes on".into(),
            x_label: "time (s)".into(),
            panels: vec![
                Panel {
                    y_label: "person (m)".into(),
                    y_max: Some(1.5),
                    lines: vec![line("separation", |s| s.separation), line("owed", |s| s.required)],
                },
                Panel {
                    y_label: "TCP speed (m/s)".into(),
                    y_max: None,
                    lines: vec![line("measured", |s| s.tcp_speed)],
                },
                Panel { y_label: "share of speed".into(), y_max: Some(1.0), lines: vec![line("allowed", |s| s.speed)] },
                Panel {
                    y_label: "clearance (m)".into(),
                    y_max: Some(0.3),
                    lines: vec![line("scene and self", |s| s.clearance)],
                },
            ],
            bands: vec![Band { from_to: self.stood.map(|time| time - start), name: name.into() }],
        }
    }
}
