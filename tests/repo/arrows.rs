//! Dependencies point down only.

use crate::{root, text};

/// What each crate of ours may depend on, bottom first, and what it must never name.
const ALLOWED: &[(&str, &[&str])] = &[
    ("shm/msg", &[]),
    ("shm/bus", &["tandem-msg"]),
    ("realtime/trajectory", &[]),
    ("realtime/kinematics", &[]),
    ("realtime/cycle", &["tandem-msg"]),
    ("realtime/clearance", &["tandem-msg", "tandem-kinematics"]),
    ("realtime/planner", &["tandem-kinematics", "tandem-clearance"]),
    ("realtime/policy", &["tandem-msg", "tandem-kinematics", "tandem-clearance"]),
    (
        "realtime/controller",
        &[
            "tandem-msg",
            "tandem-trajectory",
            "tandem-kinematics",
            "tandem-clearance",
            "tandem-planner",
            "tandem-policy",
        ],
    ),
    ("config", &["tandem-msg", "tandem-kinematics", "tandem-clearance", "tandem-policy", "tandem-controller"]),
    (
        "src/learning/motion",
        &[
            "tandem-msg",
            "tandem-kinematics",
            "tandem-clearance",
            "tandem-planner",
            "tandem-policy",
            "tandem-trajectory",
            "tandem-config",
        ],
    ),
    ("benches/peers", &[]),
];

/// Crates that nothing realtime and no message may name.
const NEVER_REALTIME: &[&str] =
    &["candle-core", "candle-nn", "rapier3d-f64", "sqlx", "tokio", "serde", "serde_json", "toml", "clap", "iceoryx2"];

fn dependencies(folder: &str, section: &str) -> Vec<String> {
    let manifest: toml::Table = text(&root().join(folder).join("Cargo.toml")).parse().expect("a manifest is TOML");
    manifest.get(section).and_then(toml::Value::as_table).map(|t| t.keys().cloned().collect()).unwrap_or_default()
}

#[test]
fn no_crate_depends_on_one_above_it() {
    for (folder, allowed) in ALLOWED {
        for name in dependencies(folder, "dependencies").iter().filter(|name| name.starts_with("tandem")) {
            assert!(allowed.contains(&name.as_str()), "{folder} must not depend on {name}; allowed: {allowed:?}");
        }
    }
}

#[test]
fn nothing_realtime_names_a_database_a_runtime_or_a_learning_library() {
    for (folder, _) in ALLOWED.iter().filter(|(folder, _)| folder.starts_with("realtime/") || *folder == "shm/msg") {
        for name in dependencies(folder, "dependencies") {
            assert!(!NEVER_REALTIME.contains(&name.as_str()), "{folder} must not depend on {name}");
        }
    }
}

#[test]
fn only_the_bus_names_iceoryx2() {
    let members = ALLOWED.iter().map(|(folder, _)| *folder).chain(["."]);
    let naming: Vec<&str> =
        members.filter(|folder| dependencies(folder, "dependencies").iter().any(|d| d.contains("iceoryx2"))).collect();
    assert_eq!(naming, ["shm/bus"]);
}

#[test]
fn every_member_is_listed_here() {
    let manifest: toml::Table = text(&root().join("Cargo.toml")).parse().expect("the manifest is TOML");
    let mut members: Vec<&str> = manifest["workspace"]["members"]
        .as_array()
        .expect("members is a list")
        .iter()
        .map(|member| member.as_str().expect("a member is a path"))
        .collect();
    let mut listed: Vec<&str> = ALLOWED.iter().map(|(folder, _)| *folder).collect();
    members.sort_unstable();
    listed.sort_unstable();
    assert_eq!(members, listed);
}
