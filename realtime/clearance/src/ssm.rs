//! Speed and separation monitoring: the arithmetic of ISO/TS 15066:2016, 5.5.4.
//!
//! The protective separation at an instant is
//! `S_p = S_h + S_r + S_s + C + Z_d + Z_r`, where over the reaction time and the
//! stopping time the person covers `S_h`, the arm covers `S_r` before it begins to brake and
//! `S_s` while it brakes, `C` is how far a person intrudes before being seen,
//! and `Z_d`, `Z_r` are the uncertainties of the person's and the arm's position.
//! Speeds are those towards each other at the pair of nearest points.

/// What is known about the pair of nearest points, and what the cell's sensors are worth. SI units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    /// Speed of the person towards the arm, m/s; the bound of 1.6 m/s when it is not measured.
    pub human_speed: f64,
    /// Speed of the arm towards the person, m/s; below 0 when it moves away.
    pub robot_speed: f64,
    /// From the person moving to the arm beginning to brake, s: ages of all that is in between.
    pub reaction_time: f64,
    /// From beginning to brake to standstill, s.
    pub stopping_time: f64,
    /// Way of the arm towards the person while it brakes, metres.
    pub stopping_distance: f64,
    /// Intrusion distance `C`, metres.
    pub intrusion: f64,
    /// Uncertainty of the person's position `Z_d`, metres.
    pub human_uncertainty: f64,
    /// Uncertainty of the arm's position `Z_r`, metres.
    pub robot_uncertainty: f64,
}

/// How fast people are reckoned to come, as in ISO 13855: a speed, and a higher one within arm's reach of the
/// danger, where a step becomes a grasp.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gait {
    /// Speed farther off than `near`, m/s.
    pub speed: f64,
    /// Speed over the last `near` metres, m/s; not below `speed`.
    pub speed_near: f64,
    /// Metres.
    pub near: f64,
}

impl Gait {
    /// The longest way, metres, at the end of which a person can arrive within `time` seconds: its last
    /// `near` metres are made at `speed_near`, what comes before at `speed`.
    pub fn reach(&self, time: f64) -> f64 {
        let hurried = self.near / self.speed_near;
        if time <= hurried { self.speed_near * time } else { self.near + self.speed * (time - hurried) }
    }

    /// The gait of somebody who is measured to be this fast.
    #[must_use]
    pub fn at_least(&self, measured: f64) -> Self {
        // Written so that a speed that is no number stays one.
        let over = |speed: f64| if measured <= speed { speed } else { measured };
        Self { speed: over(self.speed), speed_near: over(self.speed_near), near: self.near }
    }
}

/// The protective separation `S_p`, metres. A speed away counts as 0, so nobody is owed less than
/// standing still would give. Infinite when a number is not finite.
pub fn protective_separation(approach: &Approach) -> f64 {
    let human = approach.human_speed.max(0.0) * (approach.reaction_time + approach.stopping_time);
    let reaction = approach.robot_speed.max(0.0) * approach.reaction_time;
    let stopping = approach.stopping_distance.max(0.0);
    let sum =
        human + reaction + stopping + approach.intrusion + approach.human_uncertainty + approach.robot_uncertainty;
    // `max` drops what is not a number, so the sum alone would hide it.
    let given = approach.human_speed + approach.robot_speed + approach.stopping_distance;
    if (sum + given).is_finite() { sum } else { f64::INFINITY }
}

/// The largest speed of the arm towards the person, m/s, that keeps `S_p` within `distance` metres when
/// the arm brakes at `deceleration` m/s² all the way. 0 when there is none, or a number is not finite.
///
/// Solves `v·T_r + v²/(2a) + v_h·(T_r + v/a) + C + Z_d + Z_r = distance` for v; `robot_speed`,
/// `stopping_time` and `stopping_distance` of `approach` are not read.
pub fn robot_speed_max(distance: f64, deceleration: f64, approach: &Approach) -> f64 {
    let human_speed = approach.human_speed.max(0.0);
    let room = distance
        - approach.intrusion
        - approach.human_uncertainty
        - approach.robot_uncertainty
        - human_speed * approach.reaction_time;
    let finite = (room + approach.human_speed + deceleration).is_finite();
    if !finite || room <= 0.0 || deceleration <= 0.0 {
        // An unbounded distance is the one infinity that means no limit.
        return if distance == f64::INFINITY && deceleration > 0.0 { f64::INFINITY } else { 0.0 };
    }
    let linear = approach.reaction_time + human_speed / deceleration;
    // v²/(2a) + linear·v − room = 0, in the form that does not cancel.
    2.0 * room / (linear + (linear * linear + 2.0 * room / deceleration).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    const BRISK: Approach = Approach {
        human_speed: 1.6,
        robot_speed: 0.5,
        reaction_time: 0.02,
        stopping_time: 0.1,
        stopping_distance: 0.025,
        intrusion: 0.0,
        human_uncertainty: 0.0,
        robot_uncertainty: 0.0,
    };

    /// 0.192 m of walking, 0.010 m of reaction and 0.025 m of braking; C and Z come on top.
    #[test]
    fn the_terms_add_up() {
        assert!((protective_separation(&BRISK) - 0.227).abs() < 1e-12);
        let sensed = Approach { intrusion: 0.1, human_uncertainty: 0.03, robot_uncertainty: 0.002, ..BRISK };
        assert!((protective_separation(&sensed) - 0.359).abs() < 1e-12);
    }

    /// Half a metre at 2.0 m/s, the rest at 1.6 m/s; whoever is faster than that is at least as fast as measured.
    #[test]
    fn people_hurry_when_near() {
        let gait = Gait { speed: 1.6, speed_near: 2.0, near: 0.5 };
        for (time, reach) in [(0.0, 0.0), (0.1, 0.2), (0.25, 0.5), (0.35, 0.66)] {
            assert!((gait.reach(time) - reach).abs() < 1e-12, "{time} s");
        }
        assert_eq!(gait.at_least(1.0), gait);
        assert_eq!(gait.at_least(1.8), Gait { speed: 1.8, ..gait });
        assert!((gait.at_least(3.0).reach(0.35) - 1.05).abs() < 1e-12);
        assert!(gait.at_least(f64::NAN).reach(0.1).is_nan());
        assert_eq!(Gait { speed_near: 0.0, speed: 0.0, near: 0.5 }.reach(1.0), 0.0);
    }

    /// Moving apart owes no less than standing still.
    #[test]
    fn speeds_away_count_as_none() {
        let apart = Approach { human_speed: -1.0, robot_speed: -1.0, stopping_distance: -0.1, ..BRISK };
        assert_eq!(protective_separation(&apart), 0.0);
    }

    /// The speed that is allowed at a distance needs just that distance.
    #[test]
    fn speed_and_distance_are_inverse() {
        let sensed = Approach { intrusion: 0.05, human_uncertainty: 0.03, ..BRISK };
        for centimetres in 12..300 {
            let distance = f64::from(centimetres) * 0.01;
            let speed = robot_speed_max(distance, 5.0, &sensed);
            assert!(speed > 0.0, "{distance} m");
            let stop = Approach {
                robot_speed: speed,
                stopping_time: speed / 5.0,
                stopping_distance: speed * speed / 10.0,
                ..sensed
            };
            let owed = protective_separation(&stop);
            assert!((owed - distance).abs() < 1e-9, "{distance} m allows {speed} m/s, which needs {owed} m");
        }
        assert_eq!(robot_speed_max(0.1, 5.0, &sensed), 0.0);
    }

    /// What is not a number stops the arm; no person does not.
    #[test]
    fn what_is_not_finite_stops() {
        let lost = Approach { human_speed: f64::NAN, ..BRISK };
        assert_eq!(protective_separation(&lost), f64::INFINITY);
        assert_eq!(robot_speed_max(1.0, 5.0, &lost), 0.0);
        assert_eq!(robot_speed_max(f64::NAN, 5.0, &BRISK), 0.0);
        assert_eq!(robot_speed_max(1.0, f64::NAN, &BRISK), 0.0);
        assert_eq!(robot_speed_max(f64::INFINITY, 5.0, &BRISK), f64::INFINITY);
    }
}
