//! Speed and separation: how fast the arm may go with people where they are.
//!
//! Two answers from one formula, ISO/TS 15066 5.5.4, for each pair of a link and a body part:
//! - *margin*: what there is beyond the separation owed in the state about to be
//!   commanded, with the stop that would follow it known exactly. Less than
//!   nothing while moving is a protective stop.
//! - *level*: the largest share of the path's speed at which the separation owed
//!   would still leave a reserve. The arm slows, and waits, before it must be
//!   stopped; to speed up again takes some distance more than to slow down, for
//!   some time.
//!
//! A law that slows for a person brakes as hard as a stop does. The separation
//! owed then shrinks as fast as a person of the credited speed can come nearer,
//! so a protective stop for separation means somebody appeared or was faster.
//!
//! **Moving away.** The speeds of the formula are those towards each other. Where
//! the policy says so, a link owes nothing to a body part it moves away from and
//! which does not follow it: to slow it down would only keep it there longer. An arm that
//! waits does not start on these terms unless everybody near it stands, at a
//! hand-over for a while: whoever moves is let pass first, and takes the part away first.

use core::time::Duration;

use tandem_clearance::ssm::{self, Gait};
use tandem_msg::Stamp;
use tandem_trajectory::State;

use crate::SeparationParams;
use crate::law::{Law, LawLimits, Refused, Stop};
use crate::people::{Pair, People};

/// Shares of the path's speed. Level 0 is to wait, level k is entry k - 1.
pub(crate) const LEVELS: [f64; 8] = [0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0];
/// Stopping time that is assumed before there is a path, s.
const REST_STOP: f64 = 0.12;
/// Nobody farther off than this has ever mattered to an arm at rest, metres.
pub(crate) const FAR: f64 = 2.0;
/// A level this much below the present speed is a slower one.
const SLOWER: f64 = 0.999;
/// Somebody slower than this stands, m/s.
const STANDING: f64 = 0.1;
/// Hands at the tool are about to take the part away; those that have stood so long are not.
const HAND_OVER_PATIENCE: Duration = Duration::from_secs(1);

/// What a stop takes that does not begin at once.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Halt {
    /// Speed it begins with, length per second.
    pub(crate) velocity: f64,
    /// Length up to standstill, what is done before it begins included.
    pub(crate) way: f64,
    /// Seconds of braking.
    pub(crate) duration: f64,
}

/// Who is owed nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Credit {
    /// A body part that a stop from here leads away from.
    Left,
    /// One that the arm would leave further when it goes on.
    LeftForGood,
    /// Nobody.
    None,
}

/// What there is beyond what is owed, and to whom.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Margin {
    /// Metres; infinite when nobody is in view.
    pub(crate) spare: f64,
    /// Separation owed to that pair, metres.
    pub(crate) owed: f64,
    /// The pair that has least to spare.
    pub(crate) pair: Pair,
}

impl Margin {
    pub(crate) const NOBODY: Self = Self { spare: f64::INFINITY, owed: 0.0, pair: Pair::NONE };
}

/// Chooses the level and knows what is owed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Governor {
    params: SeparationParams,
    /// Stops from each level's speed on the present path.
    stops: [Stop; LEVELS.len()],
    speeds: [f64; LEVELS.len()],
    acceleration: f64,
    jerk: f64,
    level: usize,
    /// Since when there is room to speed up to each level.
    room_since: [Option<Stamp>; LEVELS.len()],
    /// Since when everybody near has stood, on the present path, and how long they must have for the arm to start.
    stood_since: Option<Stamp>,
    patience: Duration,
}

impl Governor {
    pub(crate) fn new(params: &SeparationParams) -> Self {
        Self {
            params: *params,
            stops: [Stop { duration: REST_STOP, end: 0.0 }; LEVELS.len()],
            speeds: [0.0; LEVELS.len()],
            acceleration: 1.0,
            jerk: 1.0,
            level: 0,
            room_since: [None; LEVELS.len()],
            stood_since: None,
            patience: Duration::ZERO,
        }
    }

    /// Prepares for a path; `with_person` when somebody takes from the tool, or holds, what it lets go of.
    pub(crate) fn take(&mut self, limits: &LawLimits, with_person: bool) -> Result<(), Refused> {
        self.level = 0;
        self.stood_since = None;
        self.patience = if with_person { HAND_OVER_PATIENCE } else { Duration::ZERO };
        self.change_over(limits)
    }

    /// Goes over to another path in motion, at the level in force.
    pub(crate) fn change_over(&mut self, limits: &LawLimits) -> Result<(), Refused> {
        self.acceleration = limits.acceleration;
        self.jerk = limits.jerk;
        for ((stop, speed), share) in self.stops.iter_mut().zip(&mut self.speeds).zip(LEVELS) {
            *speed = limits.velocity * share;
            let cruising = State { position: 0.0, velocity: *speed, acceleration: 0.0 };
            *stop = Law::stop_from(cruising, limits)?;
        }
        Ok(())
    }

    /// Share of the path's speed at a level.
    pub(crate) fn share(level: usize) -> f64 {
        if level == 0 { 0.0 } else { LEVELS[(level - 1).min(LEVELS.len() - 1)] }
    }

    /// The stop from a state, as late as it may begin.
    pub(crate) fn halt(&self, state: &State, stop: &Stop) -> Halt {
        let before = state.velocity.max(0.0) * self.params.reaction_time.as_secs_f64();
        let way = (stop.end - state.position).max(0.0) + before;
        Halt { velocity: state.velocity, way, duration: stop.duration }
    }

    /// Lengths ahead that people are measured along: the way of a stop, at rest that of the slowest one;
    /// and how the arm would go on.
    pub(crate) fn look_ahead(&self, halt: &Halt) -> (f64, f64) {
        let way = halt.way.max(self.stops[0].end);
        (way, self.halt_from(LEVELS.len() - 1, halt.velocity).way.max(2.0 * way))
    }

    /// The stop of an arm that is speeding up from a velocity to that of a level.
    fn halt_from(&self, index: usize, velocity: f64) -> Halt {
        let (stop, speed) = (&self.stops[index], self.speeds[index]);
        // While it speeds up, the arm has to take its acceleration back before it can brake.
        let ramp = self.acceleration.min((self.jerk * (speed - velocity).max(0.0)).sqrt()) / self.jerk;
        let before = ramp + self.params.reaction_time.as_secs_f64();
        Halt { velocity: speed, way: stop.end + speed * before, duration: stop.duration + ramp }
    }

    /// Distance beyond which nobody changes anything, when the arm travels up to `rate` metres per length.
    pub(crate) fn horizon(&self, rate: f64, (age, sigma): (f64, f64)) -> f64 {
        let top = LEVELS.len() - 1;
        let halt = self.halt_from(top, 0.0);
        let kept = self.params.reserve + self.params.hysteresis;
        let horizon = self.owed_standing(&halt, age, sigma, f64::NEG_INFINITY) + rate * halt.way + kept;
        if horizon.is_finite() { horizon } else { FAR }
    }

    /// Separation at which an arm on the present path passes somebody at the speed of a level, and does not wait for
    /// them, metres.
    pub(crate) fn passes_at(&self, level: usize, (age, sigma): (f64, f64)) -> f64 {
        let halt = self.halt_from(level.clamp(1, LEVELS.len()) - 1, 0.0);
        self.owed_standing(&halt, age, sigma, f64::NEG_INFINITY) + self.params.reserve
    }

    /// The reserve kept beyond what is owed, metres.
    pub(crate) fn reserve(&self) -> f64 {
        self.params.reserve
    }

    /// Separation owed, beyond what the arm comes nearer, to a body part measured to close in at a speed.
    fn owed_standing(&self, halt: &Halt, age: f64, sigma: f64, closing: f64) -> f64 {
        let reaction_time = self.params.reaction_time.as_secs_f64() + age;
        let time = reaction_time + halt.duration;
        let gait = Gait {
            speed: self.params.human_speed_min,
            speed_near: self.params.human_speed_near,
            near: self.params.near_distance,
        };
        let reach = gait.at_least(closing).reach(time);
        ssm::protective_separation(&ssm::Approach {
            human_speed: if time > 0.0 { reach / time } else { 0.0 },
            robot_speed: 0.0,
            reaction_time,
            stopping_time: halt.duration,
            stopping_distance: 0.0,
            intrusion: self.params.intrusion,
            human_uncertainty: self.params.sigma_factor * sigma,
            robot_uncertainty: self.params.arm_uncertainty,
        })
    }

    /// The pair that has least to spare if the arm were stopped so.
    fn margin_of(&self, people: &People, halt: &Halt, credit: Credit) -> Margin {
        let standing = self.owed_standing(halt, people.age, people.sigma, f64::NEG_INFINITY);
        // Length to metres, by what was measured ahead. What the arm does before it brakes is part of that way.
        let scale = if people.way > 0.0 { halt.way / people.way } else { 0.0 };
        let away = if people.way > 0.0 { halt.velocity / people.way } else { 0.0 };
        let mut least = Margin { spare: f64::INFINITY, owed: 0.0, pair: people.nearest };
        for pair in people.pairs() {
            let credited = match credit {
                Credit::Left => true,
                Credit::LeftForGood => pair.leaves,
                Credit::None => false,
            };
            let left = self.params.recede
                && credited
                && pair.retreat > 0.0
                && pair.distance > 0.0
                && pair.closing <= (away * pair.retreat).max(STANDING);
            if left {
                continue;
            }
            let owed = if pair.closing <= self.params.human_speed_min {
                standing + pair.approach * scale
            } else {
                self.owed_standing(halt, people.age, people.sigma, pair.closing) + pair.approach * scale
            };
            let spare = pair.distance - owed;
            // Written so that what is no number is least.
            if !(spare >= least.spare) {
                least = Margin { spare: if spare.is_nan() { f64::NEG_INFINITY } else { spare }, owed, pair: *pair };
            }
        }
        least
    }

    /// The pair that has least to spare if the arm were stopped so.
    pub(crate) fn margin(&self, people: &People, halt: &Halt) -> Margin {
        self.margin_of(people, halt, Credit::Left)
    }

    /// The margin of an arm at rest before it may start.
    pub(crate) fn margin_at_rest(&self, people: &People) -> Margin {
        self.margin(people, &Halt { velocity: 0.0, way: 0.0, duration: REST_STOP })
    }

    /// Keeps the record of whether an arm off any path might start.
    pub(crate) fn watch_at_rest(&mut self, now: Stamp, people: &People) {
        let enough = self.margin_at_rest(people).spare >= self.params.reserve + self.params.hysteresis;
        for since in &mut self.room_since {
            *since = if enough { since.or(Some(now)) } else { None };
        }
    }

    /// Whether there was room for an arm at rest to start, when last asked.
    pub(crate) fn enough(&self) -> bool {
        self.room_since[0].is_some()
    }

    /// Chooses the level for the next cycle. With less than the reserve beyond what is owed by the stop from
    /// here, the law goes over to a slower level or to rest, and both begin as that stop does, which takes the
    /// separation owed down as fast as a person of the credited speed can come nearer.
    pub(crate) fn choose(&mut self, now: Stamp, people: &People, halt: &Halt) -> usize {
        let velocity = halt.velocity;
        let standing = velocity <= 0.0;
        if people.nobody_in_view() {
            self.room_since = self.room_since.map(|since| since.or(Some(now)));
            self.level = LEVELS.len();
            return self.level;
        }
        if people.pairs().iter().all(|pair| pair.speed <= STANDING) {
            self.stood_since.get_or_insert(now);
        } else {
            self.stood_since = None;
        }
        let waits = standing && self.level == 0;
        let delay = if waits { self.params.resume_delay } else { self.params.speed_up_delay };
        let stood = self.stood_since.is_some_and(|since| since.age_at(now) >= self.patience);
        let credit = if waits && !stood { Credit::None } else { Credit::LeftForGood };
        let braking = !standing && !(self.margin_of(people, halt, Credit::LeftForGood).spare >= self.params.reserve);
        let mut best = 0;
        for index in 0..LEVELS.len() {
            let spare = self.margin_of(people, &self.halt_from(index, velocity), credit).spare;
            let room = spare >= self.params.reserve + self.params.hysteresis;
            let since = &mut self.room_since[index];
            *since = if room { since.or(Some(now)) } else { None };
            let up = since.is_some_and(|since| since.age_at(now) >= delay);
            let slower = !braking || self.speeds[index] < SLOWER * velocity;
            if slower && (up || index < self.level && spare >= self.params.reserve) {
                best = index + 1;
            }
        }
        self.level = best;
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Slower than the slowest level.
    const SLOW: Halt = Halt { velocity: 0.01, way: 0.001, duration: 0.02 };

    fn governor() -> Governor {
        let params =
            SeparationParams { resume_delay: Duration::ZERO, speed_up_delay: Duration::ZERO, ..Default::default() };
        governor_of(&params)
    }

    fn governor_of(params: &SeparationParams) -> Governor {
        let mut governor = Governor::new(params);
        let limits = LawLimits { velocity: 1.0, acceleration: 5.0, jerk: 50.0 };
        governor.take(&limits, false).expect("limits are usable");
        governor
    }

    fn level_at(governor: &mut Governor, distance: f64) -> usize {
        governor.choose(Stamp(0), &People::at(distance), &SLOW)
    }

    /// Nearer is never faster, nobody is full speed, touching is no speed.
    #[test]
    fn the_level_falls_with_the_distance() {
        let mut governor = governor();
        assert_eq!(governor.choose(Stamp(0), &People::nobody(), &SLOW), LEVELS.len());
        let mut last = LEVELS.len();
        for millimetres in (0..2_000).rev() {
            let level = level_at(&mut governor, f64::from(millimetres) * 1e-3);
            assert!(level <= last, "{millimetres} mm");
            last = level;
        }
        assert_eq!(last, 0);
        assert_eq!(level_at(&mut governor, f64::NAN), 0);
    }

    /// A distance that wavers by less than the hysteresis changes the level at most once.
    #[test]
    fn noise_does_not_make_it_flicker() {
        let mut governor = governor();
        for centre in 10..150 {
            level_at(&mut governor, f64::from(centre) * 0.01);
            let mut changes = 0;
            let mut last = level_at(&mut governor, f64::from(centre) * 0.01);
            for k in 0..100 {
                let noise = if k % 2 == 0 { 0.01 } else { -0.01 };
                let level = level_at(&mut governor, f64::from(centre) * 0.01 + noise);
                changes += u32::from(level != last);
                last = level;
            }
            assert!(changes <= 1, "{centre} cm: {changes} changes");
        }
    }

    /// To speed up takes room for a while; to slow down takes one look.
    #[test]
    fn it_speeds_up_late_and_slows_at_once() {
        let mut governor = governor_of(&SeparationParams::default());
        let delay = SeparationParams::default().speed_up_delay;
        let mut at = |ms: u64, distance: f64| governor.choose(Stamp(ms * 1_000_000), &People::at(distance), &SLOW);
        at(0, 1.9);
        assert_eq!(at(500, 1.9), LEVELS.len());
        let near = at(501, 0.5);
        assert!(near < LEVELS.len());
        let soon = 502 + u64::try_from(delay.as_millis()).expect("short") - 1;
        for ms in 502..=soon {
            assert_eq!(at(ms, 1.9), near, "after {ms} ms");
        }
        assert_eq!(at(soon + 1, 1.9), LEVELS.len());
        assert_eq!(at(soon + 2, 0.5), near);
    }

    /// A link owes its full separation to a part it nears or passes, nothing to one it leaves, unless that one follows.
    #[test]
    fn only_what_is_left_behind_is_owed_nothing() {
        let halt = Halt { velocity: 0.5, way: 0.1, duration: 0.2 };
        let owed = |approach: f64, retreat: f64, closing: f64, recede: bool| {
            let governor = governor_of(&SeparationParams { recede, ..SeparationParams::default() });
            let mut people = People::at(0.05);
            *people.first() = Pair { approach, retreat, closing, ..*people.first() };
            let margin = governor.margin(&people, &halt);
            assert_eq!(margin.spare == f64::INFINITY, margin.owed == 0.0);
            margin.owed
        };
        let standing = owed(0.0, 0.0, 0.0, true);
        assert!(standing > 0.4, "{standing}");
        assert!((owed(0.05, 0.0, 0.0, true) - standing - 0.05).abs() < 1e-12);
        assert_eq!(owed(0.0, 0.1, 0.0, true), 0.0);
        assert_eq!(owed(0.0, 0.1, 0.4, true), 0.0, "slower than the arm");
        assert_eq!(owed(0.0, 0.1, 0.6, true), standing, "faster than the arm");
        assert_eq!(owed(0.0, 0.1, f64::NAN, true), f64::INFINITY);
        assert_eq!(owed(0.0, 0.1, 0.0, false), standing, "the policy says no");

        let mut people = People::at(0.05);
        *people.first() = Pair { retreat: 0.1, ..*people.first() };
        let mut governor = governor_of(&SeparationParams::default());
        assert_eq!(governor.choose(Stamp(0), &people, &halt), 0, "it would turn back");
        people.first().leaves = true;
        let levels = [0, 100_000_000].map(|at| governor.choose(Stamp(at), &people, &halt));
        assert_eq!(levels[1], LEVELS.len());
    }

    /// An arm that waits starts past a hand that stands where it leaves it, at a hand-over only after a while; not past
    /// one that moves, whichever way.
    #[test]
    fn an_arm_that_waits_lets_others_go_first() {
        let rest = Halt { velocity: 0.0, way: 0.0, duration: 0.0 };
        for (with_person, starts_ms) in [(false, 200), (true, 1_200)] {
            let mut governor = governor_of(&SeparationParams::default());
            let limits = LawLimits { velocity: 1.0, acceleration: 5.0, jerk: 50.0 };
            governor.take(&limits, with_person).expect("limits are usable");
            let mut people = People::at(0.05);
            *people.first() = Pair { retreat: 0.1, leaves: true, closing: -0.3, speed: 0.3, ..*people.first() };
            for ms in 0..3_000 {
                assert_eq!(governor.choose(Stamp(ms * 1_000_000), &people, &rest), 0, "{ms} ms: it moves");
            }
            (people.first().closing, people.first().speed) = (0.0, 0.0);
            let started = (3_000..6_000).find(|ms| governor.choose(Stamp(ms * 1_000_000), &people, &rest) > 0);
            assert_eq!(started, Some(3_000 + starts_ms));
        }
    }
}
