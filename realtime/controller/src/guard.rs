//! What is checked before a set-point goes out.
//!
//! 1. *Clearance* at the set-point, to scene and self, at least its floor while moving.
//! 2. *Braking*: the stop that would follow ends where the path was swept and found
//!    clear with the present scene, part and permissions. A stop never leaves the path.
//! 3. *Separation*: no body part is owed more than there is, by any link, on all the way
//!    of that stop.
//!
//! The swept part of the path is kept and extended, so an undisturbed motion costs
//! one clearance query a cycle; a changed scene makes the sweep start again from
//! where the arm is.

use tandem_clearance::{Clearance, Monitor};
use tandem_kinematics::{Chain, LinkPoses};
use tandem_msg::{AttachedPart, HumanState, SceneObject, StopCause};

use crate::Joints;
use crate::path::Path;
use crate::people::{Ahead, People};
use crate::plan::{Leg, Touch};
use crate::sweep::Sweep;
use crate::workspace::Workspace;

/// Clearance samples a cycle when the sweep has fallen behind the stop: the arm's way in one stop
/// is rarely more than a few samples long, and where it is, the arm slows until the sweep is ahead.
const CATCH_UP_SAMPLES: u32 = 10;
/// Rounding between the floor that was planned with and the one that is guarded, metres.
const FLOOR_SLACK: f64 = 5e-4;

/// The monitor of the present motion, and what it last said.
pub(crate) struct Guard {
    monitor: Monitor,
    sweep: Sweep,
    rate: f64,
    margin: f64,
    floor: f64,
    clearance_min: f64,
    poses: LinkPoses,
    at: Joints,
    clearance: Clearance,
    people: People,
    stale: bool,
}

impl Guard {
    pub(crate) fn new(chain: &Chain, monitor: Monitor, clearance_min: f64) -> Self {
        let at = [f64::NAN; tandem_msg::JOINTS_MAX];
        let poses = chain.forward(&[0.0; tandem_msg::JOINTS_MAX]);
        let clearance = monitor.clearance(&poses);
        Self {
            monitor,
            sweep: Sweep::default(),
            rate: 1.0,
            margin: 0.0,
            floor: 0.0,
            clearance_min,
            poses,
            at,
            clearance,
            people: People::nobody(),
            stale: true,
        }
    }

    /// Takes the objects of a scene; says whether it is one.
    pub(crate) fn set_scene(&mut self, objects: &[SceneObject]) -> bool {
        self.changed();
        self.monitor.set_scene(objects).is_ok()
    }

    pub(crate) fn set_human(&mut self, human: &HumanState) {
        let count = (human.capsule_count as usize).min(human.capsules.len());
        self.monitor.set_human(&human.capsules[..count]);
    }

    /// Says what the tool carries and what it may touch.
    pub(crate) fn set_context(&mut self, attached: &AttachedPart, touch: &Touch) {
        self.monitor.set_attached((attached.present == 1).then_some(attached));
        self.monitor.set_touch(touch);
        self.changed();
    }

    /// Prepares for a stretch; `swept` when it was found clear with the scene in force.
    pub(crate) fn take(&mut self, leg: &Leg, attached: &AttachedPart, swept: bool) {
        self.set_context(attached, &leg.touch);
        self.rate = leg.rate;
        self.margin = leg.margin;
        self.floor = leg.margin.min(self.clearance_min) - FLOOR_SLACK;
        if swept {
            self.sweep = Sweep::done(leg.path.length());
        }
    }

    /// What was swept holds no more.
    fn changed(&mut self) {
        self.stale = true;
        self.sweep = Sweep::new(f64::NAN, self.rate, self.margin, self.clearance_min);
    }

    /// Extends the sweep: far enough for a stop that ends at `needed`, or a little.
    pub(crate) fn sweep(&mut self, chain: &Chain, path: &Path, from: f64, needed: f64) {
        if self.sweep.clear_to().is_nan() {
            // Guard by the floor, not by the margin that was planned with: the arm is on its way already.
            self.sweep = Sweep::new(from, self.rate, self.floor, self.floor.min(0.0));
        }
        for sample in 0..CATCH_UP_SAMPLES {
            let behind = self.sweep.clear_to() < needed;
            if self.sweep.finished(path) || (sample > 0 && !behind) {
                break;
            }
            self.sweep.step(chain, &self.monitor, path);
        }
    }

    /// Length up to which the path is known to be clear.
    pub(crate) fn clear_to(&self) -> f64 {
        self.sweep.clear_to()
    }

    /// Whether the sweep met something.
    pub(crate) fn blocked(&self) -> bool {
        self.sweep.blocked()
    }

    /// The cause of a stop for what is too near at the position measured last.
    pub(crate) fn cause_here(&self) -> StopCause {
        cause_of(self.clearance.object)
    }

    /// The cause of a stop for what the sweep met.
    pub(crate) fn cause_ahead(&self) -> StopCause {
        cause_of(self.sweep.blocked_by())
    }

    /// Clearance at another position.
    pub(crate) fn clearance_at(&self, chain: &Chain, position: &Joints) -> f64 {
        self.monitor.clearance(&chain.forward(position)).distance
    }

    /// Smallest clearance a moving arm may have here.
    pub(crate) fn floor(&self) -> f64 {
        self.floor
    }

    /// Measures the clearance at a position, where something has changed.
    pub(crate) fn measure(&mut self, chain: &Chain, position: &Joints) {
        if self.stale || *position != self.at {
            self.poses = chain.forward(position);
            self.clearance = self.monitor.track(&self.poses);
            self.at = *position;
            self.stale = false;
        }
    }

    /// Measures people up to `horizon` metres off from the position measured last, known with this age and deviation.
    pub(crate) fn look_around(&mut self, chain: &Chain, horizon: f64, known: (f64, f64)) {
        self.people.measure(&self.monitor, chain, &self.poses, None, horizon, known);
    }

    /// The same from the position measured last, which is `from` on a path, and along its next `way`, and
    /// `onward` beyond that.
    pub(crate) fn look_along(
        &mut self,
        chain: &Chain,
        path: &Path,
        (from, way, onward): (f64, f64, f64),
        horizon: impl FnOnce(f64) -> f64,
        known: (f64, f64),
    ) {
        let [way, onward] = [way, onward].map(|way| way.min(path.length() - from).max(0.0));
        let ahead = Ahead { path, from, way, onward, rate: self.rate };
        self.people.measure(&self.monitor, chain, &self.poses, Some(&ahead), horizon(self.rate), known);
    }

    pub(crate) fn clearance(&self) -> &Clearance {
        &self.clearance
    }

    pub(crate) fn people(&self) -> &People {
        &self.people
    }
}

fn cause_of(object: u32) -> StopCause {
    if Workspace::is_wall(object) { StopCause::Workspace } else { StopCause::Clearance }
}
