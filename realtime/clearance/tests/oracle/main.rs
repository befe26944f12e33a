//! Clearance against outside references.
//!
//! `data/*_distance.csv`: coal 3.0.3 at a tolerance of 1e-10, on the links of the reference robots as
//! capsules and as convex hulls. `data/*_edges.csv`: straight motions whose both ends are free, with
//! the smallest distance over 401 samples; `through` rows touch on the way.
#![allow(clippy::disallowed_types, clippy::disallowed_macros, reason = "a test may allocate")]

mod contacts;
#[path = "../reference/mod.rs"]
mod reference;
mod single;

use nalgebra::Vector3;
use tandem_kinematics::JOINTS_MAX;
use tandem_msg::{AttachedPart, Pose};

use reference::{Links, Robot, robots, rows};

/// How far an answer may lie from the reference, metres: of capsules and of hulls.
const OFF: f64 = 1e-6;
const HULL_OFF: f64 = 1e-5;

/// One row of a reference file.
struct Case {
    name: String,
    scene: String,
    position: [f64; JOINTS_MAX],
    /// Distance to the scene, link, obstacle; distance to itself, two links.
    expected: Vec<String>,
}

fn cases(robot: &Robot, links: Links) -> Vec<Case> {
    let columns = if links == Links::Capsules { 0..6 } else { 6..12 };
    let case = |row: Vec<String>| Case {
        name: format!("{} case {}, {links:?}", robot.name, row[0]),
        scene: row[1].clone(),
        position: robot.position(&row[3..]),
        expected: row[3 + robot.joints..][columns.clone()].to_vec(),
    };
    rows(&format!("{}_distance.csv", robot.name)).into_iter().map(case).collect()
}

/// A distance against the reference, whose depths bind by their sign alone: they are what its penetration
/// search came to.
fn agrees(distance: f64, expected: f64, off: f64) -> bool {
    if expected <= 0.0 { distance <= 0.0 } else { distance <= expected + 1e-9 && distance >= expected - off }
}

/// No contact missed, nothing over-estimated; positive distances within the tolerance of the reference; names agree
/// with it; the boolean query, the one for both and the one by body part agree with the others.
#[test]
fn distances_agree_with_the_reference() {
    for robot in robots() {
        for (links, off) in [(Links::Capsules, OFF), (Links::Hulls, HULL_OFF)] {
            let alone = robot.monitor(links, true);
            let (mut compared, mut touching) = (0, 0);
            for Case { name: case, scene, position, expected: reference } in cases(&robot, links) {
                let monitor = robot.monitor_in(&scene, links, false);
                let poses = robot.chain.forward(&position);

                let clearance = monitor.clearance(&poses);
                let separation = monitor.separation(&poses);
                assert_eq!(monitor.measure(&poses), (clearance, separation), "{case}");
                let expected: f64 = reference[0].parse().expect("a distance");
                let nearest_is_person = separation.distance < clearance.distance;
                let distance = clearance.distance.min(separation.distance);
                assert!(agrees(distance, expected, off), "{case}: {distance} m, reference {expected} m");
                if expected <= 0.0 {
                    touching += 1;
                } else {
                    let person = robot.is_person(&scene, &reference[2]);
                    assert_eq!(nearest_is_person, person, "{case}: {clearance:?} {separation:?}");
                    let link = if person { separation.link } else { clearance.link };
                    let named = robot.names.iter().position(|other| *other == reference[1]).expect("a link");
                    assert_eq!(link, robot.capsules[named].link, "{case}");
                    if !person {
                        let object = reference[2].parse::<u32>().expect("an id") + 1;
                        assert_eq!(clearance.object, object, "{case}");
                        let [a, b] = [clearance.point_on_arm, clearance.point_on_other].map(Vector3::from);
                        assert!(((a - b).norm() - distance).abs() < 1e-8, "{case}: {clearance:?}");
                    }
                }

                let own = alone.clearance(&poses);
                let expected: f64 = reference[3].parse().expect("a distance");
                assert!(agrees(own.distance, expected, off), "{case}: self {own:?}, reference {expected} m");
                assert_eq!(own.object, 0, "{case}");

                let both = robot.monitor_in(&scene, links, true);
                let all = both.clearance(&poses);
                assert_eq!(all.distance, clearance.distance.min(own.distance), "{case}: {all:?}");
                for margin in [0.0, 0.01, 0.05] {
                    let clear = both.is_clear(&poses, margin);
                    assert_eq!(clear, all.distance > margin, "{case}: {all:?}, margin {margin}");
                }
                let parts = monitor.separations(&poses);
                let least = parts.iter().map(|part| part.distance).fold(f64::INFINITY, f64::min);
                assert_eq!(least, separation.distance, "{case}");
                compared += 1;
            }
            assert!(compared > 300 && touching > 50, "{}: {compared} cases, {touching} in contact", robot.name);
        }
    }
}

/// A motion that touches anything on the way is never called clear, one that stays 3 cm off always is.
#[test]
fn nothing_thin_is_stepped_through() {
    for robot in robots() {
        let (mut through, mut free) = (0, 0);
        for row in rows(&format!("{}_edges.csv", robot.name)) {
            // Paths look at the scene only, so here the person stands in it; what does not fit makes a second one.
            let objects = robot.scene_of_objects(&row[1]);
            let from = robot.position(&row[3..]);
            let to = robot.position(&row[3 + robot.joints..]);
            for links in [Links::Capsules, Links::Hulls] {
                let mut monitor = robot.monitor(links, true);
                let clear = objects.chunks(tandem_msg::SCENE_OBJECTS_MAX).all(|objects| {
                    monitor.set_scene(objects).expect("a reference scene is sound");
                    monitor.path_is_clear(&robot.chain, &from, &to, 0.0, 2e-4)
                });
                match (row[2].as_str(), links) {
                    // The reference is of capsules, which hulls may pass where those do not.
                    ("through", Links::Capsules) => {
                        through += 1;
                        assert!(!clear, "{} edge {} goes through an obstacle", robot.name, row[0]);
                    }
                    ("free", _) => {
                        free += 1;
                        assert!(clear, "{} edge {} is free for {links:?}", robot.name, row[0]);
                    }
                    _ => {}
                }
            }
        }
        assert!(through > 20 && free > 20, "{}: {through} through, {free} free", robot.name);
    }
}

/// Motions between the reference positions, with a part and without: what is called clear keeps the
/// margin at each of 400 samples; what is not comes nearer than margin and resolution, or so near that a
/// sample may have missed it.
#[test]
fn a_sweep_says_what_samples_say() {
    const SAMPLES: u32 = 400;
    const RESOLUTION: f64 = 0.004;
    let part = AttachedPart {
        present: 1,
        half_extents: [0.08, 0.03, 0.05],
        tcp_from_part: Pose { position: [0.01, 0.0, 0.05], ..Pose::IDENTITY },
        ..AttachedPart::default()
    };
    for robot in robots() {
        let name = robot.name;
        let cases = rows(&format!("{name}_distance.csv"));
        let (mut clear, mut blocked) = (0, 0);
        for (index, pair) in cases.windows(2).enumerate() {
            let links = [Links::Capsules, Links::Hulls][index / 3 % 2];
            let mut monitor = robot.monitor_in(&pair[0][1], links, true);
            monitor.set_attached((index % 2 == 0).then_some(&part));
            let [from, far] = [0, 1].map(|k| robot.position(&pair[k][3..]));
            // Long motions are hardly ever clear.
            let share = [0.5, 0.1, 0.02][index % 3];
            let to: [f64; JOINTS_MAX] = std::array::from_fn(|k| from[k] + share * (far[k] - from[k]));
            let margin = [0.0, 0.02][index / 2 % 2];
            let said = monitor.path_is_clear(&robot.chain, &from, &to, margin, RESOLUTION);
            let mut least = f64::INFINITY;
            for k in 0..=SAMPLES {
                let at = f64::from(k) / f64::from(SAMPLES);
                let position = std::array::from_fn(|k| from[k] + at * (to[k] - from[k]));
                least = least.min(monitor.clearance(&robot.chain.forward(&position)).distance);
            }
            // No point of these arms is farther than 1.3 m from an axis.
            let turn: f64 = from.iter().zip(&to).map(|(a, b)| (a - b).abs()).sum();
            let missed = 1.3 * turn / f64::from(2 * SAMPLES);
            let case = format!("{name}, motion {index} of {links:?}: {said}, samples {least} m, margin {margin} m");
            if said {
                clear += 1;
                assert!(least > margin, "{case}");
            } else {
                blocked += 1;
                assert!(least <= margin + RESOLUTION + missed, "{case}");
            }
        }
        assert!(clear > 60 && blocked > 60, "{name}: {clear} clear, {blocked} not");
    }
}

/// Along motions between the reference positions, in steps from a cycle's to wild ones, with scenes, permissions and parts
/// changing on the way: the query that remembers says what the one that looks at everything says, to the last bit.
#[test]
fn what_is_remembered_changes_no_answer() {
    let part = AttachedPart { present: 1, half_extents: [0.08, 0.03, 0.05], ..AttachedPart::default() };
    for robot in robots() {
        for links in [Links::Capsules, Links::Hulls] {
            let cases = cases(&robot, links);
            let mut monitor = robot.monitor_in(&cases[0].scene, links, true);
            for (index, pair) in cases.windows(2).enumerate() {
                let [from, to] = [pair[0].position, pair[1].position];
                if index % 5 == 0 {
                    monitor.set_scene(&robot.scene(&pair[0].scene).0).expect("a reference scene is sound");
                }
                monitor.set_attached((index % 3 == 1).then_some(&part));
                for step in 0..40 {
                    if step == 20 && index % 2 == 0 {
                        monitor.set_touch(&[index as u32 % 7, 1]);
                    }
                    // Mostly a millimetre or so, now and then far.
                    let at = if step % 13 == 12 { 0.02 * f64::from(step) } else { 2e-4 * f64::from(step) };
                    let position: [f64; JOINTS_MAX] = std::array::from_fn(|k| from[k] + at * (to[k] - from[k]));
                    let poses = robot.chain.forward(&position);
                    let all = monitor.clearance(&poses);
                    assert_eq!(monitor.track(&poses), all, "{}, step {step}", pair[0].name);
                }
                let lost = robot.chain.forward(&[f64::NAN; JOINTS_MAX]);
                assert_eq!(monitor.track(&lost).distance, f64::NEG_INFINITY);
            }
        }
    }
}
