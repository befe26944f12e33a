//! The arm that is shipped, and what is said of URDFs that make no arm.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use std::f64::consts::{FRAC_PI_2, PI};
use std::path::Path;
use tandem_clearance::Monitor;
use tandem_config::{Cell, Robot, RobotOptions};
use tandem_kinematics::{JOINTS_MAX, manipulability};

fn shipped() -> Cell {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("cells/s471.toml");
    Cell::load(&file, None).unwrap_or_else(|faults| panic!("{faults}"))
}

fn parse(text: &str) -> Result<Robot, String> {
    Robot::parse(Path::new("arm.urdf"), text, &RobotOptions::default())
        .map_err(|faults| faults.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))
}

/// What a text is refused with; every fault on a line of its own.
fn refusal(text: &str) -> String {
    match parse(text) {
        Ok(robot) => panic!("{} was accepted", robot.name),
        Err(message) => message,
    }
}

/// Stretched along x, the arm is as long as the published figures say.
#[test]
fn the_shipped_arm_has_its_published_figures() {
    let robot = shipped().robot;
    assert_eq!(robot.name, "ur10");
    let names = ["shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3"];
    assert_eq!(robot.joint_names, names.map(|name| format!("{name}_joint")));
    let stretched = robot.chain.forward(&[0.0; JOINTS_MAX]).base_from_tcp;
    let expected = Vector3::new(0.612 + 0.5723, 0.163941 + 0.0922 + 0.20, 0.1273 - 0.1157);
    assert!((stretched.translation.vector - expected).norm() < 1e-12, "{stretched}");
    let z = stretched.rotation * Vector3::z();
    assert!((z - Vector3::y()).norm() < 1e-12, "the tool points along y: {z}");

    let masses: Vec<f64> = robot.links.iter().map(|link| link.mass).collect();
    assert_eq!(masses, [4.0, 7.778, 12.93, 3.87, 1.96, 1.96, 0.35 + 1.2]);
    // 0.35 kg at -0.02 m and 1.2 kg at 0.07 m along the flange's axis.
    let wrist = &robot.links[6];
    assert!((wrist.centre[2] - (0.35 * -0.02 + 1.2 * 0.07) / 1.55).abs() < 1e-12, "{wrist:?}");
    let apart = 0.35 * 1.2 / 1.55 * 0.09 * 0.09;
    assert!((wrist.inertia[0][0] - (0.00025 + 0.00244 + apart)).abs() < 1e-12, "{wrist:?}");
    assert!((wrist.inertia[2][2] - (0.00035 + 0.00096)).abs() < 1e-12, "{wrist:?}");

    let tools = robot.body.capsules().iter().filter(|capsule| capsule.tool).count();
    assert_eq!((robot.body.capsules().len(), tools), (12, 2));
    let mut pairs: Vec<[usize; 2]> =
        robot.body.self_pairs().map(|pair| pair.map(|index| robot.body.capsules()[index].link)).collect();
    pairs.sort_unstable();
    pairs.dedup();
    let without = [[0, 1], [1, 2], [2, 3], [3, 4], [4, 5], [5, 6], [0, 2], [1, 3]];
    assert!(pairs.iter().all(|pair| !without[..6].contains(pair)), "{pairs:?}");
    assert!(pairs.contains(&[0, 6]) && pairs.contains(&[1, 5]) && pairs.contains(&[4, 6]), "{pairs:?}");
}

/// Home and every place of the cell are reached by one family of joint positions, so the arm never has
/// to turn over: elbow up, wrist 2 at −90°, far from singular, nothing but the tool near anything.
#[test]
fn the_cell_is_within_reach() {
    let cell = shipped();
    let robot = &cell.robot;
    let mut monitor = Monitor::new(robot.body);
    monitor.set_scene(&cell.layout.scene_objects()).expect("the layout is a scene");

    let down = |base: &Isometry3<f64>, z: f64, yaw: f64| {
        let turned = UnitQuaternion::from_euler_angles(0.0, 0.0, yaw) * UnitQuaternion::from_euler_angles(PI, 0.0, 0.0);
        base * Isometry3::from_parts(Translation3::new(0.0, 0.0, z), turned)
    };
    let layout = &cell.layout;
    let mut goals = vec![
        ("home".to_owned(), robot.chain.forward(&robot.home).base_from_tcp),
        ("hand-over".to_owned(), layout.base_from_handover),
        ("hold".to_owned(), layout.base_from_hold),
    ];
    for yaw in [0.0, FRAC_PI_2, -FRAC_PI_2] {
        for z in [0.03, 0.12, 0.25] {
            goals.push((format!("fixture {z} {yaw}"), down(&layout.base_from_fixture, z, yaw)));
            for station in &layout.stations {
                let name = format!("station {} {z} {yaw}", station.name);
                goals.push((name, down(&station.base_from_station, z, yaw)));
            }
        }
    }
    for slot in &layout.rack_slots {
        let above = slot.base_from_tcp * Translation3::new(0.0, 0.0, -layout.rack_approach);
        goals.push((format!("rack {}", slot.tool), slot.base_from_tcp));
        goals.push((format!("above rack {}", slot.tool), above));
    }
    for (name, goal) in &goals {
        let branches = robot.chain.branches(goal, &robot.home).unwrap_or_else(|failure| panic!("{name}: {failure}"));
        let is_clear = |position: &&[f64; JOINTS_MAX]| {
            let clearance = monitor.clearance(&robot.chain.forward(position));
            // Near the rack is the tool alone, which couples there.
            let least = if clearance.link == 6 && clearance.object != 0 { 0.005 } else { 0.03 };
            clearance.distance > least
        };
        let clear = branches.as_slice().iter().find(is_clear);
        let near = clear.unwrap_or_else(|| panic!("{name}: none is clear of {branches:?}"));
        let poses = robot.chain.forward(near);
        assert!(poses.base_from_link[3].translation.z > 0.4, "{name}: elbow down, {near:?}");
        assert!((near[4] + FRAC_PI_2).abs() < 0.01, "{name}: wrist 2 in {near:?}");
        assert!(robot.chain.is_within_limits(near, 0.5), "{name}: {near:?}");
        assert!(manipulability(&robot.chain.jacobian(near).1) > 0.1, "{name}: {near:?}");
    }
    let home = robot.chain.forward(&robot.home).base_from_tcp;
    assert!((home.rotation * Vector3::z() + Vector3::z()).norm() < 1e-3, "home points down: {home}");
}

/// Two sliding joints and one turning, with links fixed in between and beyond.
const GANTRY: &str = r#"<robot name="gantry">
  <link name="world"/>
  <link name="rail"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    <collision><geometry><box size="1 0.1 0.1"/></geometry></collision></link>
  <link name="bracket"><inertial><mass value="3"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
  <link name="slider"><inertial><mass value="2"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    <collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <link name="head"><inertial><mass value="2"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    <collision><geometry><sphere radius="0.1"/></geometry></collision></link>
  <link name="nozzle"/>
  <joint name="head_turn" type="continuous"><parent link="slider"/><child link="head"/>
    <axis xyz="0 0 2"/><limit effort="5" velocity="1"/></joint>
  <joint name="rail_slide" type="prismatic"><parent link="world"/><child link="rail"/><origin xyz="0 0 1"/>
    <axis xyz="1 0 0"/><limit lower="-0.5" upper="0.5" effort="10" velocity="2"/></joint>
  <joint name="clamp" type="fixed"><parent link="rail"/><child link="bracket"/><origin xyz="0 0.4 0" rpy="0 0 1.5707963267948966"/></joint>
  <joint name="reach" type="prismatic"><parent link="bracket"/><child link="slider"/>
    <axis xyz="1 0 0"/><limit lower="0" upper="1" effort="10" velocity="2"/></joint>
  <joint name="tip" type="fixed"><parent link="head"/><child link="nozzle"/><origin xyz="0 0 -0.3"/></joint>
</robot>"#;

/// Joints in any order, fixed ones folded, masses gathered: the chain moves as the file says.
#[test]
fn any_serial_chain_loads() {
    let robot = parse(GANTRY).unwrap_or_else(|message| panic!("{message}"));
    assert_eq!(robot.joint_names, ["rail_slide", "reach", "head_turn"]);
    let tip = robot.chain.forward(&[0.2, 0.3, FRAC_PI_2, 0.0, 0.0, 0.0, 0.0, 0.0]).base_from_tcp;
    assert!((tip.translation.vector - Vector3::new(0.2, 0.4 + 0.3, 0.7)).norm() < 1e-12, "{tip}");
    assert!((tip.rotation * Vector3::x() + Vector3::x()).norm() < 1e-12, "two quarter turns: {tip}");
    let rail = &robot.links[1];
    assert_eq!((rail.name.as_str(), rail.mass), ("rail", 4.0));
    assert!((rail.centre[1] - 0.3).abs() < 1e-12, "{rail:?}");
    let limits: Vec<(f64, f64)> =
        robot.chain.joints().iter().map(|joint| (joint.acceleration_max, joint.jerk_max)).collect();
    assert_eq!(limits, [(4.0, 40.0), (4.0, 40.0), (2.0, 20.0)]);
}

/// One change to a good file, and what is said of it.
#[test]
fn what_makes_no_arm_is_refused_with_its_place() {
    let with = |from: &str, to: &str| {
        assert!(GANTRY.contains(from), "{from} stands in the file");
        refusal(&GANTRY.replacen(from, to, 1))
    };
    assert_eq!(
        with("<sphere radius=\"0.1\"/>", "<mesh filename=\"package://arm/slider.stl\"/>"),
        "arm.urdf:7:26: link \"slider\" collision mesh = \"package://arm/slider.stl\"; \
         list the folders of packages as robot.packages of the cell, or in ROS_PACKAGE_PATH"
    );
    assert_eq!(
        with("<sphere radius=\"0.1\"/>", "<sphere radius=\"-0.1\"/>"),
        "arm.urdf:7:16: link \"slider\" collision geometry = a size that is not finite and above 0 m; write the shape's size"
    );
    assert_eq!(
        with("<sphere radius=\"0.1\"/>", "<cone radius=\"0.1\"/>"),
        "arm.urdf:7:26: a <cone> shape, allowed box, cylinder, capsule, sphere, mesh; use one of these"
    );
    assert_eq!(
        with("<collision><geometry><sphere radius=\"0.1\"/></geometry></collision>", ""),
        "arm.urdf:6:3: link \"slider\" collision is missing, allowed at least one shape; \
         give the link a <collision>: a joint moves it"
    );
    assert_eq!(
        with("<mass value=\"2\"/>", "<mass value=\"0\"/>"),
        "arm.urdf:6:23: link \"slider\" inertial = mass 0 kg, with all that is fixed to it, allowed above 0 kg; \
         write what the link weighs: a joint moves it"
    );
    assert_eq!(
        with("<mass value=\"2\"/>", "<mass value=\"-2\"/>"),
        "arm.urdf:6:23: link \"slider\" inertial = mass = -2 kg with its inertia, \
         allowed a mass of at least 0 kg and finite numbers; write what the link weighs\n\
         arm.urdf:6:23: link \"slider\" inertial = mass 0 kg, with all that is fixed to it, allowed above 0 kg; \
         write what the link weighs: a joint moves it"
    );
    assert_eq!(
        with("lower=\"-0.5\" upper=\"0.5\"", "lower=\"0.5\" upper=\"-0.5\""),
        "arm.urdf:14:24: joint \"rail_slide\" limit lower = 0.5 m above upper = -0.5 m, allowed at most upper; swap the limits"
    );
    assert_eq!(
        with("upper=\"0.5\"", "upper=\"inf\""),
        "arm.urdf:14:24: joint \"rail_slide\" limit upper = inf m, allowed finite numbers; write how far the joint may go"
    );
    assert_eq!(
        with("effort=\"5\" velocity=\"1\"", "velocity=\"0\""),
        "arm.urdf:12:24: joint \"head_turn\" limit velocity = 0 rad/s, allowed above 0 rad/s; write what the joint's motor can do\n\
         arm.urdf:12:24: joint \"head_turn\" limit effort = 0 Nm, allowed above 0 Nm; write what the joint's motor can do"
    );
    assert_eq!(
        with("xyz=\"0 0 2\"", "xyz=\"0 0 0\""),
        "arm.urdf:12:5: joint \"head_turn\" axis xyz = \"0 0 0\", allowed a direction; write a vector that is not zero"
    );
    assert_eq!(
        with("type=\"continuous\"", "type=\"screw\""),
        "arm.urdf:11:3: joint \"head_turn\" type = \"screw\", allowed revolute, continuous, prismatic, fixed; use one of these"
    );
    assert_eq!(
        with("type=\"continuous\"", "type=\"floating\""),
        "arm.urdf:11:3: joint \"head_turn\" type = \"floating\", allowed revolute, continuous, prismatic, fixed; \
         an arm has joints of one axis"
    );
    assert_eq!(
        with("<axis xyz=\"0 0 2\"/>", "<mimic joint=\"reach\"/>"),
        "arm.urdf:12:5: joint \"head_turn\" mimic = of joint \"reach\", allowed joints that move by themselves; \
         name what it follows in robot.locked of the cell, or make it fixed"
    );
    assert_eq!(
        with("<parent link=\"slider\"/>", "<parent link=\"slidder\"/>"),
        "arm.urdf:11:45: joint \"head_turn\" parent = \"slidder\", allowed a link of the file; add the link"
    );
    assert_eq!(
        with("<child link=\"bracket\"/>", "<child link=\"rail\"/>"),
        "arm.urdf:15:57: joint \"clamp\" child = \"rail\", which joint \"rail_slide\" moves too, allowed one joint a link; \
         an arm is one chain"
    );
    assert_eq!(
        with("<link name=\"nozzle\"/>", "<link name=\"nozzle\"/><link name=\"rail\"/>"),
        "arm.urdf:10:24: link \"rail\" name = a second link of that name, allowed each name once; rename one of them"
    );
    assert_eq!(
        with("<link name=\"nozzle\"/>", "<link name=\"nozzle\"/><link name=\"stray\"/>"),
        "arm.urdf:1:1: 2 links that are no joint's child: world, stray, allowed one, the base; \
         join the others to it by fixed joints"
    );
    assert_eq!(
        with("<parent link=\"head\"/>", "<parent link=\"bracket\"/>"),
        "arm.urdf:1:1: 2 links at an end: head, nozzle, allowed one, or a link called tcp or tool0; \
         name the TCP's link as robot.tcp of the cell"
    );
    assert_eq!(
        with(
            "</robot>",
            "<link name=\"tcp\"/><joint name=\"j\" type=\"fixed\"><parent link=\"bracket\"/><child link=\"tcp\"/></joint></robot>"
        ),
        "arm.urdf:11:3: joint \"head_turn\" type = \"continuous\" beside the chain to \"tcp\", \
         allowed moving joints between base and TCP only; name it in robot.locked of the cell, or another link as robot.tcp\n\
         arm.urdf:16:3: joint \"reach\" type = \"prismatic\" beside the chain to \"tcp\", \
         allowed moving joints between base and TCP only; name it in robot.locked of the cell, or another link as robot.tcp"
    );
    assert_eq!(
        with("<parent link=\"world\"/>", "<parent link=\"nozzle\"/>"),
        "arm.urdf:3:3: link \"rail\" = on a loop of joints, allowed a chain; let the joints run outwards from one base"
    );
    assert_eq!(
        with("<link name=\"nozzle\"/>", "<link name=\"nozzle\">"),
        "arm.urdf: not a URDF: Elements not properly nested; mend the file"
    );
    assert_eq!(with("<link name=\"nozzle\"/>", "<link/>"), "arm.urdf:10:3: link name is missing; name it");
    assert_eq!(refusal(""), "arm.urdf: no XML element, allowed a <robot> element; name a URDF file");
    assert_eq!(
        refusal("<sdf version=\"1.7\"/>"),
        "arm.urdf:1:1: a <sdf> element, allowed a <robot> element; name a URDF file; expand xacro files first"
    );
    assert_eq!(
        refusal("<robot name=\"a\"><link name=\"base\"/></robot>"),
        "arm.urdf:1:1: 0 moving joints between base and \"base\", allowed 1..=8; \
         make some of them fixed, or name another file"
    );
    let tcp = RobotOptions { tcp: Some("nose".into()), ..RobotOptions::default() };
    let faults = Robot::parse(Path::new("arm.urdf"), GANTRY, &tcp).expect_err("there is no such link");
    assert_eq!(
        faults[0].to_string(),
        "arm.urdf:1:1: no link \"nose\", which the cell names as the TCP; add the link, or mend robot.tcp of the cell"
    );
}

/// A file that is not there is named with the reason.
#[test]
fn a_missing_file_is_named() {
    let faults = Robot::load(Path::new("nowhere/arm.urdf"), &RobotOptions::default()).expect_err("there is none");
    assert_eq!(
        faults.to_string(),
        "nowhere/arm.urdf: No such file or directory (os error 2); name a file that can be read"
    );
}
