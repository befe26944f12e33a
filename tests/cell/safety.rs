//! The safety campaign in brief: the whole one is `tandem eval safety`.

use tandem::evaluation::safety::{Arm, Behind, Terms, campaign, crossing, passers_by, withdrawal};

use crate::rig::shipped;

fn arm() -> Arm {
    let cell = shipped("s471");
    Arm { chain: cell.robot.chain, body: cell.robot.body, params: cell.controller }
}

const WATCHED: Terms = Terms { cycles: 700, blind: false };

/// People from any side, with a tracker that is late, frozen or wrong: nobody is touched by a moving arm, nobody has
/// less than they are owed, every stop is as short as announced. With the monitor off the same people are touched.
#[test]
fn nobody_is_touched_and_the_referee_can_see() {
    let arm = arm();
    let watched = campaign(&arm, 1, 150, WATCHED, &|_| {});
    assert_eq!((watched.contacts, watched.below), (0, 0), "{watched:#?}");
    assert!(watched.overrun <= 5e-3, "{watched:#?}");
    assert!(watched.moving > 10_000 && watched.stops > 0 && watched.faults.len() == 7, "{watched:#?}");
    let unwatched = campaign(&arm, 1, 60, Terms { blind: true, ..WATCHED }, &|_| {});
    assert!(unwatched.contacts > 0 && unwatched.below > 0, "{unwatched:#?}");
}

/// The same where the person stays for ten seconds, so that the arm stops, waits and starts again beside them.
#[test]
fn nobody_is_touched_by_an_arm_that_starts_again() {
    let tally = campaign(&arm(), 1, 40, Terms { cycles: 10_000, ..WATCHED }, &|_| {});
    assert_eq!((tally.contacts, tally.below), (0, 0), "{tally:#?}");
    assert!(tally.waiting > 50_000 && tally.moving > 50_000 && tally.stops > 20, "{tally:#?}");
}

/// The same seeds give the same run, on however many threads.
#[test]
fn a_campaign_is_its_seeds() {
    let arm = arm();
    let tell = || format!("{:?}", campaign(&arm, 7, 6, WATCHED, &|_| {}));
    assert_eq!(tell(), tell());
}

/// The arm makes up its mind once at a crossing, mostly stands only for who is near, and withdraws at full speed from
/// what is five centimetres behind it.
#[test]
fn the_monitor_is_no_nuisance() {
    let arm = arm();
    for (seed, speed) in [(1, 0.5), (166, 0.5), (206, 0.5), (2, 1.0), (3, 1.6), (7, 1.6)] {
        assert!(crossing(&arm, seed, speed) <= 1, "seed {seed} at {speed} m/s");
    }
    let [cycles, _, needless, _] = passers_by(&arm, 1, 20_000);
    assert!(needless * 20 <= cycles, "{needless} of {cycles}");
    let free = withdrawal(&arm, Behind::Nothing);
    for behind in [Behind::Obstacle, Behind::Hand] {
        let with = withdrawal(&arm, behind);
        // Another way may be taken, none that is slower.
        assert!(
            with.iter().zip(free).all(|(with, free)| (with - free).abs() < 1e-3 * free),
            "{behind:?}: {with:?}, {free:?}"
        );
    }
}
