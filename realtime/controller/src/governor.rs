//! Speed and separation: how fast the arm may go with a person where they are.
//!
//! Two answers from one formula, ISO/TS 15066 5.5.4:
//! - *required*: the separation owed in the state about to be commanded, with
//!   the stop that would follow it known exactly. Less than that while moving is
//!   a protective stop.
//! - *level*: the largest share of the path's speed at which the separation owed
//!   would still leave a reserve. The arm slows, and waits, before it must be
//!   stopped; to speed up again takes some distance more than to slow down.
//!
//! A law that slows for a person brakes as hard as a stop does. The separation
//! owed then shrinks as fast as a person of the credited speed can come nearer,
//! so a protective stop for separation means somebody appeared or was faster.

use tandem_clearance::{Separation, ssm};
use tandem_msg::Stamp;
use tandem_trajectory::State;

use crate::SeparationParams;
use crate::law::{Law, LawLimits, Refused, Stop};

/// Shares of the path's speed. Level 0 is to wait, level k is entry k - 1.
pub(crate) const LEVELS: [f64; 8] = [0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0];
/// Stopping time that is assumed before there is a path, s.
const REST_STOP: f64 = 0.12;

/// Where a person is with respect to the arm, in one cycle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Person {
    /// Distance at the set-point, metres.
    pub(crate) distance: f64,
    /// Speed towards the arm that is reckoned with, m/s.
    pub(crate) speed: f64,
    /// Age of what is known, s.
    pub(crate) age: f64,
    /// Standard deviation of their position, metres.
    pub(crate) sigma: f64,
}

impl Person {
    pub(crate) fn new(separation: &Separation, age: f64, sigma: f64, params: &SeparationParams) -> Self {
        let closing: f64 =
            -separation.human_velocity.iter().zip(&separation.direction).map(|(v, d)| v * d).sum::<f64>();
        // Written so that a speed that is no number stays one: it will stop the arm.
        let speed = if closing <= params.human_speed_min { params.human_speed_min } else { closing };
        Self { distance: separation.distance, speed, age, sigma }
    }

    fn nobody(&self) -> bool {
        self.distance == f64::INFINITY
    }
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
    enough_since: Option<Stamp>,
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
            enough_since: None,
        }
    }

    /// Prepares for a path.
    pub(crate) fn take(&mut self, limits: &LawLimits) -> Result<(), Refused> {
        self.level = 0;
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

    /// Length ahead at which the second separation is to be measured, from a state and its stop.
    pub(crate) fn look_ahead(&self, state: &State, stop: &Stop) -> f64 {
        let moving = stop.end + state.velocity * self.params.reaction_time.as_secs_f64();
        moving.max(state.position + self.stops[0].end)
    }

    /// Separation owed to a person by an arm that comes nearer by `gradient` metres per length.
    pub(crate) fn required(&self, person: &Person, velocity: f64, way: f64, duration: f64, gradient: f64) -> f64 {
        ssm::protective_separation(&ssm::Approach {
            human_speed: person.speed,
            robot_speed: velocity * gradient,
            reaction_time: self.params.reaction_time.as_secs_f64() + person.age,
            stopping_time: duration,
            stopping_distance: way * gradient,
            intrusion: self.params.intrusion,
            human_uncertainty: self.params.sigma_factor * person.sigma,
            robot_uncertainty: self.params.arm_uncertainty,
        })
    }

    /// Separation owed by an arm at rest before it may start.
    pub(crate) fn required_at_rest(&self, person: &Person) -> f64 {
        self.required(person, 0.0, 0.0, REST_STOP, 0.0)
    }

    /// Keeps the record of whether an arm off any path might start.
    pub(crate) fn watch_at_rest(&mut self, now: Stamp, person: &Person) {
        let enough = person.nobody()
            || person.distance >= self.required_at_rest(person) + self.params.reserve + self.params.hysteresis;
        self.record(now, enough);
    }

    /// Whether there was room for an arm at rest to start, when last asked.
    pub(crate) fn enough(&self) -> bool {
        self.enough_since.is_some()
    }

    fn record(&mut self, now: Stamp, enough: bool) {
        self.enough_since = if enough { self.enough_since.or(Some(now)) } else { None };
    }

    /// Chooses the level for the next cycle. `velocity` is the law's; `required` is what is owed
    /// now: with less than the reserve above it the law goes over into its stop, which takes the
    /// separation owed down as fast as a person of the credited speed can come nearer.
    pub(crate) fn choose(&mut self, now: Stamp, person: &Person, gradient: f64, velocity: f64, required: f64) -> usize {
        let standing = velocity <= 0.0;
        let mut best = 0;
        if person.nobody() {
            best = LEVELS.len();
        } else {
            let room = standing || person.distance >= required + self.params.reserve;
            for (index, (stop, speed)) in self.stops.iter().zip(&self.speeds).enumerate() {
                // While it speeds up, the arm has to take its acceleration back before it can brake.
                let ramp = self.acceleration.min((self.jerk * (speed - velocity).max(0.0)).sqrt()) / self.jerk;
                let owed = self.required(person, *speed, stop.end + speed * ramp, stop.duration + ramp, gradient);
                let extra = if index + 1 > self.level { self.params.hysteresis } else { 0.0 };
                if room && person.distance >= owed + self.params.reserve + extra {
                    best = index + 1;
                }
            }
        }
        self.record(now, best > 0);
        if standing && self.level == 0 {
            let delay = self.params.resume_delay;
            let waited = self.enough_since.is_some_and(|since| since.age_at(now) >= delay);
            if !waited {
                best = 0;
            }
        }
        self.level = best;
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn governor() -> Governor {
        let mut governor = Governor::new(&SeparationParams::default());
        let limits = LawLimits { velocity: 1.0, acceleration: 5.0, jerk: 50.0 };
        governor.take(&limits).expect("limits are usable");
        governor
    }

    fn person(distance: f64) -> Person {
        Person { distance, speed: 1.6, age: 0.001, sigma: 0.01 }
    }

    fn level_at(governor: &mut Governor, distance: f64) -> usize {
        governor.choose(Stamp(0), &person(distance), 1.0, 0.5, 0.0)
    }

    /// Nearer is never faster, nobody is full speed, touching is no speed.
    #[test]
    fn the_level_falls_with_the_distance() {
        let mut governor = governor();
        assert_eq!(level_at(&mut governor, f64::INFINITY), LEVELS.len());
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
}
