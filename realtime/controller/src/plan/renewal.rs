//! A way that is renewed while the arm follows it.
//!
//! ```text
//!            branch  corner
//! ───●─────────┬──────●─ ─ ─ ─ ─ ─ ─ ●  present way: blocked, or longer
//!   now         ╲____                │
//!   at speed         ╲_______________●  new way, to the same end
//! ```
//!
//! The rest of the present way is swept with the scene and the people as they are now. Then the planners are asked in
//! their order for a way from a corner a little beyond the branch, where the arm will be by the time they are done: the
//! policy, where the way is blocked the hand-made routes, and the sampling planner. A new way goes on from the present
//! one where it leaves it, with the same position, direction and bend, so what the law says of the length there holds
//! for both, and velocity and acceleration of every joint have no step. It is swept from the branch to its end before
//! it may be followed.
//!
//! Nothing is changed here but by [`Search::change_over`], which the arm calls when it comes to the branch.

use tandem_msg::{ChangeReason, MotionPhase, Planner};
use tandem_planner::Progress as Sampling;
use tandem_trajectory::State;

use super::preview::{Previewed, policy_for};
use super::route::{ROUTES, via_points};
use super::search::{LEGS_MAX, Search};
use super::way::LEAD;
use super::{LOOKS_PER_STEP, Leg, Tools};
use crate::Joints;
use crate::law::Law;
use crate::path::{Path, PathPoint};
use crate::sweep::{Sweep, Swept};

/// From the branch to the first corner, s: time for rounding the corner off; and how short and how long that may be,
/// length.
const LEAD_TIME: f64 = 0.15;
const LEAD_LENGTH: [f64; 2] = [0.05, 0.5];
/// What is left of the present way beyond that must be worth the effort, length.
const LEFT_MIN: f64 = 0.2;
/// A new way round something that blocks may take so much longer than the present one, s: for less it is waited.
const DETOUR_MAX: f64 = 2.0;
/// A new way is shorter when it saves this share of the time that is left, and no less than this, s.
const GAIN: f64 = 0.1;
const GAIN_MIN: f64 = 0.15;
/// Looks that the sampling planner may take, for the arm does not wait for it.
const LOOKS_MAX: u32 = 20_000;

/// Where the present way may be left.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Chance {
    /// Stretch in hand.
    pub(crate) leg: usize,
    /// State of the law there; its position is the length on that stretch.
    pub(crate) state: State,
}

impl Chance {
    /// Length at which planners begin: beyond the branch, but for an arm that stands there.
    pub(crate) fn corner(&self) -> f64 {
        let lead = (LEAD_TIME * self.state.velocity).clamp(LEAD_LENGTH[0], LEAD_LENGTH[1]);
        self.state.position + if self.at_rest() { 0.0 } else { lead }
    }

    /// Whether the arm stands there. Then the new way may begin in any direction.
    pub(crate) fn at_rest(&self) -> bool {
        self.state.velocity == 0.0 && self.state.acceleration == 0.0
    }
}

/// How a renewal stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Renewed {
    /// There is none under way.
    Idle,
    /// It is known whether the present way is blocked; now it is asked where it may be left.
    Judged {
        /// Something has come into it.
        blocked: bool,
    },
    /// There is more to do.
    Working,
    /// There is a better way.
    Ready,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    Idle,
    /// The rest of the present way, stretch by stretch.
    Rest(usize),
    Judged,
    Begin,
    Preview,
    Route,
    Sample,
    Path,
    PathSweep,
    Ready,
}

/// A renewal and its result.
#[derive(Clone, Copy)]
pub(super) struct Renewal {
    step: Step,
    chance: Chance,
    /// The present way at the branch.
    start: PathPoint,
    /// Where planners begin.
    corner: Joints,
    /// Where the way across ends, and its last stretch.
    end: Joints,
    last: usize,
    /// Seconds that the rest of the present way takes from the branch on.
    left: f64,
    blocked: bool,
    sweep: Sweep,
    planner: Planner,
    route: usize,
    found: Option<Leg>,
    /// Seconds it takes.
    duration: f64,
}

impl Renewal {
    pub(super) fn new() -> Self {
        let nowhere = [0.0; tandem_msg::JOINTS_MAX];
        Self {
            step: Step::Idle,
            chance: Chance { leg: 0, state: State::at_rest(f64::INFINITY) },
            start: PathPoint::default(),
            corner: nowhere,
            end: nowhere,
            last: 0,
            left: 0.0,
            blocked: false,
            sweep: Sweep::default(),
            planner: Planner::None,
            route: 0,
            found: None,
            duration: 0.0,
        }
    }

    pub(super) fn drop(&mut self) {
        (self.step, self.found) = (Step::Idle, None);
    }
}

impl Search {
    /// Gives a renewal up.
    pub(crate) fn drop_renewal(&mut self) {
        self.renewal.drop();
    }

    /// Whether no renewal is under way.
    pub(crate) fn is_settled(&self) -> bool {
        self.renewal.step == Step::Idle
    }

    /// Length on the stretch in hand at which it would be left; infinite as long as that is not known.
    pub(crate) fn branch(&self) -> f64 {
        self.renewal.chance.state.position
    }

    /// Begins to renew the way in hand, of which `from` on a stretch of it is still ahead; says whether there is enough.
    /// The monitor must see people where they keep the arm from going on.
    pub(crate) fn begin_renewal(&mut self, tools: &mut Tools<'_>, leg: usize, from: f64) -> bool {
        let rest = self.legs[..self.count.min(LEGS_MAX)].get(leg..).unwrap_or_default();
        let count = rest.iter().take_while(|leg| leg.phase == MotionPhase::Transfer).count();
        let (Some(present), Some(end)) = (rest.first(), rest[..count].last()) else { return false };
        if rest[..count].iter().map(|leg| leg.path.length()).sum::<f64>() - from < LEFT_MIN {
            return false;
        }
        self.renewal = Renewal {
            step: Step::Rest(leg),
            end: *end.path.end(),
            last: leg + count - 1,
            sweep: Sweep::new(from, present.rate, tools.params.clearance_min, 0.0),
            ..Renewal::new()
        };
        tools.monitor.set_attached(self.goal.attached.present.eq(&1).then_some(&self.goal.attached));
        tools.monitor.set_touch(&[0; 16]);
        true
    }

    /// The present way may be left there; says whether that is worth it. The monitor must see people where a new way
    /// keeps away from them.
    pub(crate) fn leave_at(&mut self, chance: &Chance) -> bool {
        let across = &self.legs[chance.leg..=self.renewal.last];
        let Some(leg) = across.first() else { return false };
        let branch = chance.state.position;
        let lead = chance.corner() - branch;
        let length: f64 = across.iter().map(|leg| leg.path.length()).sum();
        let Some(left) = time_left(across, chance.state) else { return false };
        if leg.path.length() - branch < lead || length - branch < lead + LEFT_MIN {
            return false;
        }
        self.way.clear();
        for k in 0..LEAD {
            if k == 0 || lead > 0.0 {
                self.way.turn_at(&leg.path.at(branch + lead * k as f64 / (LEAD - 1) as f64).position);
            }
        }
        self.way.branch_off();
        self.renewal = Renewal {
            step: Step::Begin,
            chance: *chance,
            start: leg.path.at(branch),
            corner: leg.path.at(chance.corner()).position,
            left,
            ..self.renewal
        };
        true
    }

    /// Goes on with a renewal, up to `params.planning_work` steps of it.
    pub(crate) fn renew(&mut self, tools: &mut Tools<'_>) -> Renewed {
        let mut budget = 4 * tools.params.planning_work;
        while budget > 0 {
            let step = self.renewal.step;
            match step {
                Step::Idle => return Renewed::Idle,
                Step::Ready => return Renewed::Ready,
                _ => {}
            }
            let cost = match step {
                Step::Preview if self.preview.rolls() => 8,
                Step::Preview | Step::Begin => 1,
                Step::Route => 8,
                Step::Path => 16,
                _ => 4,
            };
            budget = budget.saturating_sub(cost);
            self.renewal.step = self.advance_renewal(step, tools);
            if self.renewal.step == Step::Judged {
                return Renewed::Judged { blocked: self.renewal.blocked };
            }
        }
        Renewed::Working
    }

    fn advance_renewal(&mut self, step: Step, tools: &mut Tools<'_>) -> Step {
        match step {
            Step::Rest(index) => self.sweep_rest(tools, index),
            Step::Begin => {
                if policy_for(tools.policies, self.goal.subtask).is_none() {
                    return Step::Route;
                }
                self.renewal.planner = Planner::Policy;
                self.way.restart();
                self.preview.begin(tools, &self.goal, &self.renewal.corner, &self.renewal.end);
                Step::Preview
            }
            Step::Preview => match self.preview.step(tools, &self.goal, &mut self.way) {
                Previewed::More => step,
                Previewed::Ready => Step::Path,
                Previewed::Failed => Step::Route,
            },
            Step::Route => self.renew_by_route(tools),
            Step::Sample => match self.sampled.work(tools.chain, tools.monitor, LOOKS_PER_STEP) {
                Sampling::Searching => step,
                Sampling::Failed(_) => Step::Idle,
                Sampling::Found => {
                    self.renewal.planner = Planner::RrtConnect;
                    self.way.restart();
                    let fits = self.sampled.path().iter().skip(1).all(|corner| self.way.turn_at(corner));
                    if fits { Step::Path } else { Step::Idle }
                }
            },
            Step::Path => self.renewed_path(tools),
            Step::PathSweep => match &self.renewal.found {
                Some(leg) => match self.renewal.sweep.step(tools.chain, tools.monitor, &leg.path) {
                    Swept::More => step,
                    Swept::Clear => Step::Ready,
                    Swept::Blocked => Step::Path,
                },
                None => Step::Idle,
            },
            Step::Idle | Step::Judged | Step::Ready => step,
        }
    }

    /// Whether the rest of the present way is clear.
    fn sweep_rest(&mut self, tools: &mut Tools<'_>, index: usize) -> Step {
        let path = &self.legs[index].path;
        match self.renewal.sweep.step(tools.chain, tools.monitor, path) {
            Swept::More => Step::Rest(index),
            Swept::Clear if index < self.renewal.last => {
                let next = index + 1;
                self.renewal.sweep = Sweep::new(0.0, self.legs[next].rate, tools.params.clearance_min, 0.0);
                Step::Rest(next)
            }
            swept => {
                self.renewal.blocked = swept == Swept::Blocked;
                Step::Judged
            }
        }
    }

    /// The next hand-made way. What is not blocked is only compared with the first of them, the direct one.
    fn renew_by_route(&mut self, tools: &mut Tools<'_>) -> Step {
        let Renewal { corner, end, route, blocked, .. } = self.renewal;
        if route >= ROUTES || (route > 0 && !blocked) {
            if !blocked || tools.params.sampling_looks_max == 0 {
                return Step::Idle;
            }
            self.sampled.clear();
            self.sampled.note_start(0, &corner);
            self.sampled.note_goal(0, &end);
            let looks_max = tools.params.sampling_looks_max.min(LOOKS_MAX);
            self.sampled.begin(tools.chain, tools.monitor, tools.params, looks_max, self.goal.seed);
            return Step::Sample;
        }
        self.renewal.route += 1;
        self.renewal.planner = Planner::Manual;
        let mut vias = [corner; 2];
        let Some(count) = via_points(route, &corner, &end, tools, &mut vias) else { return Step::Route };
        if !vias[..count].iter().all(|via| tools.chain.is_within_limits(via, 0.0)) {
            return Step::Route;
        }
        self.way.restart();
        let fits = vias[..count].iter().chain(core::iter::once(&end)).all(|corner| self.way.turn_at(corner));
        if fits { Step::Path } else { Step::Route }
    }

    /// The next path along the way in hand that takes no longer than it may, or the next planner.
    fn renewed_path(&mut self, tools: &mut Tools<'_>) -> Step {
        let start = (!self.renewal.chance.at_rest()).then_some(&self.renewal.start);
        let Some(path) = self.way.path(tools, start, self.renewal.chance.state.velocity, self.goal.speed) else {
            return match self.renewal.planner {
                Planner::RrtConnect => Step::Idle,
                _ => Step::Route,
            };
        };
        let leg = Leg::across(&self.goal, tools, &path);
        let from = State { position: 0.0, ..self.renewal.chance.state };
        let left = self.renewal.left;
        // An arm that had to slow down first would be longer on its way than the new one says.
        let too_fast = !self.renewal.blocked && from.velocity > leg.limits.velocity;
        let may_take = if self.renewal.blocked { left + DETOUR_MAX } else { left - GAIN_MIN.max(GAIN * left) };
        if !leg.limits.are_usable() || too_fast || !is_within(tools, &path) {
            return Step::Path;
        }
        match Law::to(path.length(), from, &leg.limits) {
            Ok(law) if law.duration() <= may_take => {
                self.renewal.duration = law.duration();
                self.renewal.sweep = Sweep::new(0.0, leg.rate, leg.margin, tools.params.clearance_min);
                self.renewal.found = Some(leg);
                Step::PathSweep
            }
            _ => Step::Path,
        }
    }

    /// The way to change over to, once there is one, and where.
    pub(crate) fn renewed(&self) -> Option<(&Leg, &Chance)> {
        let ready = self.renewal.step == Step::Ready;
        self.renewal.found.as_ref().filter(|_| ready).map(|leg| (leg, &self.renewal.chance))
    }

    /// Puts the new way in the place of the present one; says why, and how long it takes to its end, s.
    pub(crate) fn change_over(&mut self) -> Option<(ChangeReason, f64)> {
        let leg = self.renewal.found.take().filter(|_| self.renewal.step == Step::Ready)?;
        let Renewal { chance, last, blocked, planner, duration, .. } = self.renewal;
        self.legs[chance.leg] = leg;
        self.legs.copy_within(last + 1.., chance.leg + 1);
        self.count -= last - chance.leg;
        (self.planner, self.led_by) = (planner, self.preview.led_by());
        self.renewal.drop();
        let approach = time_left(self.legs().get(chance.leg + 1..).unwrap_or_default(), State::at_rest(0.0));
        Some((if blocked { ChangeReason::Blocked } else { ChangeReason::Shorter }, duration + approach.unwrap_or(0.0)))
    }
}

/// Whether every node of a path is within the joints' ranges.
fn is_within(tools: &Tools<'_>, path: &Path) -> bool {
    path.nodes().iter().all(|node| tools.chain.is_within_limits(node, 0.0))
}

/// Seconds that stretches one after another take from a state on the first of them.
fn time_left(legs: &[Leg], state: State) -> Option<f64> {
    let (mut from, mut time) = (state, 0.0);
    for leg in legs {
        time += Law::to(leg.path.length(), from, &leg.limits).ok()?.duration();
        from = State::at_rest(0.0);
    }
    Some(time)
}
