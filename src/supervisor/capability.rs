//! Who can do a step: the capability check of Section 2.1(2).
//!
//! The paper measures "the distance between assembly part and objects", where the objects
//! are the two subjects ("the spatial distance between assembly part and operators is input
//! by visual computing", Section 2.2). Here `d_po` is therefore taken once for each subject,
//! from the part's *perceived* position: for the robot to its base, for the person to the
//! shoulder they have when they stand at the bench to work, for that is where they will do it
//! from, wherever they walk now.
//!
//! What the paper leaves open: a value exactly at its limit is infeasible (strict `<`); a
//! value that is not finite is never compared and makes the step unassignable; a harmful part
//! is not given to a person unless the cell file says so; when nobody can do it, nobody is
//! assigned. None of these has a default: a person is asked.

use tandem_config::{Capability, Focus};

/// What is compared: one part, both subjects.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Demand {
    /// Distance from the part to the person's working shoulder, metres (d_po for Eq. 1).
    pub human_distance: f64,
    /// Distance from the part to the robot's base, metres (d_po for Eq. 2).
    pub robot_distance: f64,
    /// Mass of the part, kg (W_p).
    pub mass: f64,
    /// Whether the part bends (F_p = 1).
    pub flexible: bool,
    /// Whether the part can hurt a person who handles it.
    pub harmful: bool,
}

/// How far a subject is from its limits: range minus distance (m), load minus mass (kg).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Margins {
    /// R − d_po, metres.
    pub reach: f64,
    /// L − W_p, kg.
    pub load: f64,
}

/// Why a step is assigned as it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reason {
    /// Both can: the robot has priority.
    RobotFirst,
    /// Only the robot can.
    RobotOnly,
    /// Only the person can.
    HumanOnly,
    /// A distance or the mass is not a finite number.
    NotFinite,
    /// Only the person could, but the part is harmful.
    Harmful,
    /// Nobody can: too far, too heavy, or too flexible for the robot.
    Nobody,
}

impl Reason {
    /// The reason in words.
    pub fn text(self) -> &'static str {
        match self {
            Self::RobotFirst => "both can, robot first",
            Self::RobotOnly => "only the robot can",
            Self::HumanOnly => "only the person can",
            Self::NotFinite => "a distance or the mass is not known",
            Self::Harmful => "only the person could, but the part is harmful",
            Self::Nobody => "neither can",
        }
    }
}

/// The verdict, with everything it was made from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Verdict {
    /// Eq. (1), and the part may be given to a person.
    pub human: bool,
    /// Eq. (2).
    pub robot: bool,
    /// Margins of the person.
    pub human_margins: Margins,
    /// Margins of the robot.
    pub robot_margins: Margins,
    /// Who does the final assembly; `None` when the step is unassignable.
    pub assigned: Option<Focus>,
    /// Why.
    pub reason: Reason,
}

/// Judges one part.
pub fn judge(capability: &Capability, demand: &Demand) -> Verdict {
    let Demand { human_distance, robot_distance, mass, flexible, harmful } = *demand;
    let human_margins = Margins { reach: capability.human_reach - human_distance, load: capability.human_load - mass };
    let robot_margins = Margins { reach: capability.robot_reach - robot_distance, load: capability.robot_load - mass };
    let verdict =
        |human, robot, assigned, reason| Verdict { human, robot, human_margins, robot_margins, assigned, reason };
    if ![human_distance, robot_distance, mass].iter().all(|value| value.is_finite()) {
        return verdict(false, false, None, Reason::NotFinite);
    }
    // Eq. (1)
    let human = human_distance < capability.human_reach && mass < capability.human_load;
    // Eq. (2); the robot's own flexibility F_r is 0, so a part that bends is not for it.
    let robot = robot_distance < capability.robot_reach && mass < capability.robot_load && !flexible;
    let permitted = human && (!harmful || capability.harmful_by_hand);
    match (permitted, robot) {
        (true, true) => verdict(true, true, Some(Focus::Robot), Reason::RobotFirst),
        (false, true) => verdict(false, true, Some(Focus::Robot), Reason::RobotOnly),
        (true, false) => verdict(true, false, Some(Focus::Human), Reason::HumanOnly),
        (false, false) if human => verdict(false, false, None, Reason::Harmful),
        (false, false) => verdict(false, false, None, Reason::Nobody),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const CAPABILITY: Capability =
        Capability { human_reach: 1.45, human_load: 8.0, robot_reach: 1.3, robot_load: 10.0, harmful_by_hand: false };
    const DEMAND: Demand =
        Demand { human_distance: 1.0, robot_distance: 1.0, mass: 1.0, flexible: false, harmful: false };

    /// Below, at and above each limit, for every combination.
    #[test]
    fn the_whole_grid_of_the_limits() {
        let around = |limit: f64| [limit.next_down(), limit, limit.next_up()];
        for human_distance in around(1.45) {
            for robot_distance in around(1.3) {
                for mass in [0.1, 8f64.next_down(), 8.0, 8f64.next_up(), 10f64.next_down(), 10.0, 10f64.next_up()] {
                    for flexible in [false, true] {
                        for harmful in [false, true] {
                            let demand = Demand { human_distance, robot_distance, mass, flexible, harmful };
                            let able = human_distance < 1.45 && mass < 8.0;
                            let robot = robot_distance < 1.3 && mass < 10.0 && !flexible;
                            let expected = match (able && !harmful, robot) {
                                (true, true) => (Some(Focus::Robot), Reason::RobotFirst),
                                (false, true) => (Some(Focus::Robot), Reason::RobotOnly),
                                (true, false) => (Some(Focus::Human), Reason::HumanOnly),
                                (false, false) if able => (None, Reason::Harmful),
                                (false, false) => (None, Reason::Nobody),
                            };
                            let verdict = judge(&CAPABILITY, &demand);
                            assert_eq!((verdict.assigned, verdict.reason), expected, "{demand:?}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn a_value_at_its_limit_is_infeasible() {
        let at = |demand| judge(&CAPABILITY, &demand);
        assert!(!at(Demand { human_distance: 1.45, ..DEMAND }).human);
        assert!(!at(Demand { mass: 8.0, ..DEMAND }).human);
        assert!(!at(Demand { robot_distance: 1.3, ..DEMAND }).robot);
        assert!(!at(Demand { mass: 10.0, ..DEMAND }).robot);
        assert!(!at(Demand { flexible: true, ..DEMAND }).robot);
    }

    #[test]
    fn a_harmful_part_goes_to_a_person_only_where_the_cell_says_so() {
        let demand = Demand { harmful: true, flexible: true, ..DEMAND };
        assert_eq!(judge(&CAPABILITY, &demand).reason, Reason::Harmful);
        let allowed = Capability { harmful_by_hand: true, ..CAPABILITY };
        assert_eq!(judge(&allowed, &demand).assigned, Some(Focus::Human));
    }

    fn number() -> impl Strategy<Value = f64> {
        prop_oneof![0.0..20.0f64, Just(f64::NAN), Just(f64::INFINITY), Just(f64::NEG_INFINITY), -1.0..0.0f64]
    }

    proptest! {
        /// Nobody is assigned on numbers that are not finite; whoever is assigned is able by
        /// the equations; the robot has every step it is able to do.
        #[test]
        fn an_assignment_is_always_feasible(
            (human_distance, robot_distance, mass) in (number(), number(), number()),
            flexible: bool, harmful: bool, harmful_by_hand: bool,
        ) {
            let capability = Capability { harmful_by_hand, ..CAPABILITY };
            let verdict = judge(&capability, &Demand { human_distance, robot_distance, mass, flexible, harmful });
            let known = human_distance.is_finite() && robot_distance.is_finite() && mass.is_finite();
            let human = known && human_distance < 1.45 && mass < 8.0;
            let robot = known && robot_distance < 1.3 && mass < 10.0 && !flexible;
            prop_assert_eq!(verdict.robot, robot);
            match verdict.assigned {
                Some(Focus::Robot) => prop_assert!(robot),
                Some(Focus::Human) => prop_assert!(human && !robot && (!harmful || harmful_by_hand)),
                None => prop_assert!(!robot && (!human || (harmful && !harmful_by_hand))),
            }
        }
    }
}
