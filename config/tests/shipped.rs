//! The files that are shipped load, and describe a box that can be built.

use nalgebra::{Isometry3, Translation3, Vector3};
use std::path::Path;
use tandem_config::{Cell, Part};
use tandem_msg::{Coded, FeatureClass};

/// The shipped cell, set up for each product.
fn shipped() -> [Cell; 2] {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("cells/s471.toml");
    ["s471", "s472"].map(|product| Cell::load(&file, Some(product)).unwrap_or_else(|faults| panic!("{faults}")))
}

#[test]
fn the_shipped_cell_loads() {
    let cells = shipped();
    for (cell, parts) in cells.iter().zip([10, 11]) {
        assert_eq!(cell.product.parts.len(), parts);
        assert_eq!(cell.product.part("battery_module"), Some(2));
        assert_ne!(cell.hash, 0);
        assert_eq!(cell.controller.config_hash, cell.hash);
        assert_eq!(cell.controller.home, cell.robot.home);
    }
    assert_ne!(cells[0].hash, cells[1].hash, "a product is part of a configuration");
}

#[test]
fn all_eight_feature_classes_occur() {
    for cell in shipped() {
        for &class in FeatureClass::ALL {
            let name = &cell.product.name;
            assert!(cell.product.parts.iter().any(|part| part.feature.class == class), "{name}: {class}");
        }
    }
}

/// Cuboids of a part where it belongs: lowest and highest corner in the fixture frame.
fn placed(part: &Part) -> Vec<[Vector3<f64>; 2]> {
    part.body
        .cuboids()
        .iter()
        .map(|cuboid| {
            let half = Vector3::from(cuboid.half_extents);
            let centre = part.fixture_from_part * nalgebra::Point3::from(cuboid.centre);
            [centre.coords - half, centre.coords + half]
        })
        .collect()
}

/// No two parts fill the same space, each rests on another or on the fixture, and the
/// whole is no larger than the box.
#[test]
fn the_box_stacks_up() {
    for cell in shipped() {
        let parts = &cell.product.parts;
        for (index, part) in parts.iter().enumerate() {
            let mut rests = false;
            for [low, high] in placed(part) {
                rests |= low.z.abs() < 1e-9;
                assert!(low.x >= -0.15 - 1e-9 && high.x <= 0.15 + 1e-9, "{}", part.name);
                assert!(low.y >= -0.20 - 1e-9 && high.y <= 0.20 + 1e-9, "{}", part.name);
                assert!(low.z >= -1e-9 && high.z <= 0.14 + 1e-9, "{}", part.name);
                for other in &parts[..index] {
                    for [other_low, other_high] in placed(other) {
                        let overlap = (0..3).map(|k| high[k].min(other_high[k]) - low[k].max(other_low[k]));
                        let overlap: Vec<f64> = overlap.collect();
                        assert!(
                            overlap.iter().any(|along| *along < 1e-6),
                            "{} in {}: {overlap:?}",
                            part.name,
                            other.name
                        );
                        rests |= overlap[0] > 0.0 && overlap[1] > 0.0 && (low.z - other_high.z).abs() < 1e-9;
                    }
                }
            }
            assert!(rests, "{} rests on nothing", part.name);
        }
    }
}

/// Whatever comes later goes straight down onto its place: nothing placed earlier stands above it.
#[test]
fn every_place_is_free_from_above() {
    for cell in shipped() {
        let parts = &cell.product.parts;
        for (index, part) in parts.iter().enumerate() {
            for [low, high] in placed(part) {
                for other in &parts[..index] {
                    for [other_low, other_high] in placed(other) {
                        let beside = (0..2).any(|k| high[k] <= other_low[k] + 1e-9 || low[k] >= other_high[k] - 1e-9);
                        assert!(beside || other_high.z <= low.z + 1e-9, "{} stands over {}", other.name, part.name);
                    }
                }
            }
        }
    }
}

/// Every pose the arm is sent to, and the straight way to it, has a joint position.
#[test]
fn every_pose_is_within_reach() {
    for cell in shipped() {
        let reach = |what: &str, base_from_tcp: Isometry3<f64>, back: f64| {
            for share in [0.0, 0.5, 1.0] {
                let goal = base_from_tcp * Translation3::new(0.0, 0.0, -back * share);
                let found = cell.robot.chain.inverse(&goal, &cell.robot.home);
                assert!(found.is_ok(), "{what}: {found:?}");
            }
            let down = base_from_tcp.rotation * Vector3::z();
            assert!((down + Vector3::z()).norm() < 1e-9, "{what} is not from above");
        };
        let layout = &cell.layout;
        for slot in &layout.rack_slots {
            reach(slot.tool.name(), slot.base_from_tcp, layout.rack_approach);
        }
        reach("handover", layout.base_from_handover, cell.supervisor.retract);
        reach("hold", layout.base_from_hold, cell.supervisor.retract);
        for part in &cell.product.parts {
            let lies = layout.stations[part.station].base_from_station * part.station_from_part;
            reach(&part.name, lies * part.part_from_grasp, cell.supervisor.retract);
            reach(
                &part.name,
                layout.base_from_fixture * part.fixture_from_part * part.part_from_grasp,
                cell.supervisor.hover,
            );
        }
    }
}

/// At its station a part lies on the carrier and within it; one whose feature is thicker than its body lies on that.
#[test]
fn parts_lie_on_their_carriers() {
    for cell in shipped() {
        use FeatureClass as C;
        for part in &cell.product.parts {
            let at = part.station_from_part.translation.vector;
            let carrier = &cell.layout.stations[part.station].carrier;
            let lift = at.z - part.half_extents[2];
            let stands_out = matches!(part.feature.class, C::Cone | C::SmoothAxis | C::ThreadedAxis);
            let radius = if stands_out { part.feature.diameter / 2.0 } else { 0.0 };
            let thicker = (radius - part.half_extents[2]).max(0.0);
            assert!((lift - thicker).abs() < 1e-3, "{}: {lift} m above its body's rest, allowed {thicker}", part.name);
            for axis in 0..2 {
                let room = carrier.half_extents[axis] - at[axis].abs() - part.half_extents[axis];
                assert!(room > 0.01, "{} has {room} m of room", part.name);
            }
        }
    }
}
