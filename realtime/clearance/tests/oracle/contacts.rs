//! Allowed-collision matrices against those of the reference robots' SRDF.

use tandem_clearance::{ArmBody, Meeting, Monitor};

use crate::reference::{Links, robots};

const SAMPLES: u32 = 400;

/// What the SRDF leaves to be checked can meet or is at least not adjacent, and every pair that is said to meet at
/// times does so at the position given with it.
#[test]
fn pairs_agree_with_the_robots_own_matrix() {
    for robot in robots() {
        let monitor = robot.monitor(Links::Capsules, true);
        let pairs = monitor.link_pairs(&robot.chain, SAMPLES);
        for pair in &pairs {
            let [a, b] = pair.links;
            let listed = robot.self_pairs.iter().any(|p| *p == [a, b] || *p == [b, a]);
            assert_eq!(pair.checked, listed, "{}: {pair:?}", robot.name);
            assert!(
                !listed || !matches!(pair.meeting, Meeting::Adjacent | Meeting::Always),
                "{}: {pair:?}",
                robot.name
            );
            assert_eq!(pair.meeting == Meeting::Adjacent, b == a + 1, "{}: {pair:?}", robot.name);
            if pair.meeting == Meeting::AtTimes {
                assert!(robot.chain.is_within_limits(&pair.position, 0.0), "{}: {pair:?}", robot.name);
                let body = ArmBody::new(&robot.capsules, &[[a, b]]).expect("a reference robot fits");
                let at = Monitor::new(body).clearance(&robot.chain.forward(&pair.position)).distance;
                assert!(at <= 0.0 && at == pair.distance, "{}: {pair:?}, clearance {at} m", robot.name);
            }
        }
        let meet = pairs.iter().filter(|pair| pair.checked && pair.meeting == Meeting::AtTimes).count();
        assert!(meet >= 4, "{}: {meet} checked pairs can meet: {pairs:?}", robot.name);
    }
}

/// A pair that can meet and is struck from the matrix is reported, and nothing else is.
#[test]
fn what_a_matrix_hides_is_reported() {
    for robot in robots() {
        let all = robot.monitor(Links::Capsules, true).link_pairs(&robot.chain, SAMPLES);
        let needed: Vec<[usize; 2]> =
            all.iter().filter(|pair| pair.meeting == Meeting::AtTimes).map(|pair| pair.links).collect();
        let hidden = |pairs: &[[usize; 2]]| -> Vec<[usize; 2]> {
            let body = ArmBody::new(&robot.capsules, pairs).expect("a reference robot fits");
            Monitor::new(body).hidden_contacts(&robot.chain, SAMPLES).iter().map(|pair| pair.links).collect()
        };
        assert_eq!(hidden(&needed), <[[usize; 2]; 0]>::default(), "{}", robot.name);
        for struck in &needed {
            let rest: Vec<[usize; 2]> = needed.iter().filter(|pair| *pair != struck).copied().collect();
            assert_eq!(hidden(&rest), [*struck], "{}", robot.name);
        }
    }
}
