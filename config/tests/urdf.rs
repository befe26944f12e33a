//! URDFs as people have them: meshes in packages, grippers that are held still, an SRDF, wrong inertias.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use tandem_config::{Collision, Robot, RobotOptions};
use tandem_msg::{Pose, SceneObject, ShapeKind};

/// A slider with a turning head that carries a gripper of two fingers, the second a mimic.
const ARM: &str = r#"<robot name="arm">
  <link name="base"><collision><geometry><box size="0.2 0.2 0.1"/></geometry></collision></link>
  <link name="slider"><inertial><mass value="2"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>
    <collision><origin xyz="0 0 0.5"/><geometry><mesh filename="package://my-arm/meshes/slider.stl" scale="0.001 0.001 0.001"/></geometry></collision></link>
  <link name="head"><inertial><mass value="1"/><inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/></inertial>
    <collision><geometry><mesh filename="head.obj"/></geometry></collision></link>
  <link name="left"><collision><geometry><sphere radius="0.01"/></geometry></collision></link>
  <link name="right"><collision><geometry><sphere radius="0.01"/></geometry></collision></link>
  <link name="tcp"/>
  <joint name="slide" type="prismatic"><parent link="base"/><child link="slider"/><origin xyz="0 0 0.4"/>
    <axis xyz="1 0 0"/><limit lower="-0.5" upper="0.5" effort="10" velocity="2"/></joint>
  <joint name="turn" type="revolute"><parent link="slider"/><child link="head"/><origin xyz="0 0 0.9"/>
    <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="10" velocity="2"/></joint>
  <joint name="finger" type="prismatic"><parent link="head"/><child link="left"/>
    <axis xyz="0 1 0"/><limit lower="0.02" upper="0.05" effort="10" velocity="2"/></joint>
  <joint name="follower" type="prismatic"><parent link="head"/><child link="right"/>
    <axis xyz="0 1 0"/><limit lower="-0.05" upper="-0.02" effort="10" velocity="2"/><mimic joint="finger" multiplier="-1" offset="-0.001"/></joint>
  <joint name="end" type="fixed"><parent link="head"/><child link="tcp"/><origin xyz="0 0 0.1"/></joint>
</robot>"#;

/// A package folder with the arm's files.
fn package() -> (tempfile::TempDir, PathBuf, RobotOptions) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let own = folder.path().join("my-arm");
    std::fs::create_dir_all(own.join("meshes")).expect("a folder");
    // Two triangles 0.4 m apart along z, in millimetres.
    let mut stl = String::from("solid slider\n");
    for (x, y, z) in [(0, 0, 0), (50, 0, 0), (0, 50, 0), (0, 0, 400), (50, 0, 400), (0, 50, 400)] {
        writeln!(stl, "vertex {x} {y} {z}").expect("a text takes text");
    }
    std::fs::write(own.join("meshes/slider.stl"), stl).expect("written");
    std::fs::write(own.join("head.obj"), "v 0.05 0 0\nv -0.05 0 0\nv 0 0.05 0\nf 1 2 3\n").expect("written");
    let options = RobotOptions {
        locked: vec!["finger".into()],
        packages: vec![folder.path().to_owned()],
        ..RobotOptions::default()
    };
    let file = own.join("arm.urdf");
    (folder, file, options)
}

fn refusal(file: &Path, text: &str, options: &RobotOptions) -> String {
    let faults = Robot::parse(file, text, options).expect_err("it is no arm");
    let folder = file.parent().expect("a file has a folder").display().to_string();
    faults.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n").replace(&folder, "…")
}

/// Meshes of a package (its name may have a hyphen) and beside the file become capsules that hold
/// them; locked joints and their followers stand where they are held.
#[test]
fn meshes_and_locked_joints_load() {
    let (_folder, file, options) = package();
    let robot = Robot::parse(&file, ARM, &options).unwrap_or_else(|faults| panic!("{faults:?}"));
    assert_eq!(robot.joint_names, ["slide", "turn"]);
    assert_eq!(robot.meshes.len(), 2);
    assert!(robot.notes.is_empty(), "{:?}", robot.notes);
    let slider = robot.body.capsules().iter().find(|capsule| capsule.link == 1).expect("a capsule of the mesh");
    let length = (slider.ends[1][2] - slider.ends[0][2]).abs();
    assert!(slider.radius > 0.035 && slider.radius < 0.042 && (0.3..0.41).contains(&length), "{slider:?}");
    let fingers: Vec<f64> =
        robot.body.capsules().iter().filter(|c| c.radius == 0.01).map(|capsule| capsule.ends[0][1]).collect();
    assert_eq!(fingers, [0.02, -0.021]);
    // The same package named by its own folder, and found around the file.
    for packages in [vec![file.parent().expect("a folder").to_owned()], Vec::new()] {
        assert!(Robot::parse(&file, ARM, &RobotOptions { packages, ..options.clone() }).is_ok());
    }
}

/// A small ball beside the slider's prism: the hull is as far off as the mesh, the capsule nearer. What is flat
/// stays a capsule, and said so.
#[test]
fn hulls_stand_for_meshes_when_asked_for() {
    let (_folder, file, options) = package();
    let ball = SceneObject {
        id: 1,
        shape: ShapeKind::Sphere.into(),
        size: [0.01, 0.0, 0.0],
        base_from_object: Pose { position: [-0.1, 0.02, 1.1], ..Pose::IDENTITY },
    };
    let clearance = |collision: Collision| {
        let options = RobotOptions { collision, ..options.clone() };
        let robot = Robot::parse(&file, ARM, &options).unwrap_or_else(|faults| panic!("{faults:?}"));
        let mut monitor = robot.monitor();
        monitor.set_scene(&[ball]).expect("a ball is a scene");
        (monitor.clearance(&robot.chain.forward(&robot.home)), robot.notes)
    };
    let (by_capsules, notes) = clearance(Collision::Capsules);
    assert!((by_capsules.distance - 0.0797).abs() < 1e-3 && by_capsules.link == 1, "{by_capsules:?}");
    assert!(notes.is_empty(), "{notes:?}");
    let (by_hulls, notes) = clearance(Collision::Hulls);
    assert!(by_hulls.distance <= 0.09 && by_hulls.distance > 0.09 - 1e-6 && by_hulls.link == 1, "{by_hulls:?}");
    assert_eq!(notes, ["link \"head\": its mesh is flat, so a capsule stands for it"]);
}

/// What is missing, broken or of another format is told with its place.
#[test]
fn bad_meshes_are_refused_with_their_place() {
    let (folder, file, options) = package();
    let nowhere = RobotOptions { packages: Vec::new(), ..options.clone() };
    assert_eq!(
        refusal(&file, &ARM.replacen("my-arm", "your-arm", 1), &nowhere),
        "…/arm.urdf:4:49: link \"slider\" collision mesh = \"package://your-arm/meshes/slider.stl\"; \
         list the folders of packages as robot.packages of the cell, or in ROS_PACKAGE_PATH"
    );
    let with = |from: &str, to: &str| refusal(&file, &ARM.replacen(from, to, 1), &options);
    let place = folder.path().display();
    assert_eq!(
        with("meshes/slider.stl", "meshes/sledge.stl"),
        format!(
            "…/arm.urdf:4:49: link \"slider\" collision mesh = \"package://my-arm/meshes/sledge.stl\", \
             no file at …/meshes/sledge.stl; add the file, or list its package's folder as robot.packages of the cell"
        )
    );
    assert!(file.starts_with(place.to_string()));
    std::fs::write(file.with_file_name("head.dae"), "<COLLADA/>").expect("written");
    let dae = "…/arm.urdf:6:26: link \"head\" collision mesh = …/head.dae; save the mesh as STL or OBJ";
    assert_eq!(with("head.obj", "head.dae"), dae);
    std::fs::write(file.with_file_name("cut.stl"), [0_u8; 90]).expect("written");
    let cut = "…/arm.urdf:6:26: link \"head\" collision mesh = …/cut.stl, no triangles; write the mesh anew";
    assert_eq!(with("head.obj", "cut.stl"), cut);
    let model = "…/arm.urdf:6:26: link \"head\" collision mesh = \"model://head.obj\"; \
                 name it as package://, file:// or a path beside the URDF";
    assert_eq!(with("head.obj", "model://head.obj"), model);
    let locked = RobotOptions { locked: vec!["thumb".into()], ..options.clone() };
    let thumb = "…/arm.urdf:1:1: no moving joint \"thumb\", which the cell locks; mend robot.locked of the cell";
    assert_eq!(refusal(&file, ARM, &locked), thumb);
}

/// Pairs the SRDF allows are not checked; a name it does not share with the URDF is a fault.
#[test]
fn an_srdf_allows_collisions() {
    let (_folder, file, options) = package();
    let pairs = |srdf: Option<&str>| {
        let srdf = srdf.map(|text| (PathBuf::from("arm.srdf"), text.to_owned()));
        Robot::parse(&file, ARM, &RobotOptions { srdf, ..options.clone() }).map(|robot| robot.body.self_pairs().count())
    };
    // The two capsules of the base against what moves with the head: its mesh and both fingers.
    assert_eq!(pairs(None).expect("it loads"), 6);
    let some = r#"<robot name="arm"><disable_collisions link1="base" link2="head" reason="Never"/></robot>"#;
    assert_eq!(pairs(Some(some)).expect("it loads"), 6, "the fingers may still meet the base");
    let all = r#"<robot name="arm"><disable_collisions link1="base" link2="head"/>
        <disable_collisions link1="left" link2="base"/><disable_collisions link1="right" link2="base"/></robot>"#;
    assert_eq!(pairs(Some(all)).expect("it loads"), 0);
    let wrong = "<robot name=\"arm\">\n <disable_collisions link1=\"base\" link2=\"hat\"/>\n</robot>";
    assert_eq!(
        pairs(Some(wrong)).expect_err("there is no hat")[0].to_string(),
        "arm.srdf:2:2: disable_collisions link2 = \"hat\", allowed a link of the URDF; mend the name, or take the line out"
    );
}

/// An inertia no body of that shape can have is replaced, and said so.
#[test]
fn an_impossible_inertia_is_put_right() {
    let (_folder, file, options) = package();
    let text = ARM.replacen("izz=\"0.001\"", "izz=\"0.2\"", 1);
    let robot = Robot::parse(&file, &text, &options).unwrap_or_else(|faults| panic!("{faults:?}"));
    let note = "link \"head\": its inertia has a gyration radius of 0.45 m, past its farthest point at 0.08 m; \
                taken as that of its collision shape";
    assert_eq!(robot.notes, [note]);
    assert!(robot.links[2].inertia[2][2] < 0.0025, "{:?}", robot.links[2]);
}
