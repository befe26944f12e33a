//! Whatever is wrong with a cell's files is told at once, each fault with its place, the value,
//! what is allowed and what to do.

use std::path::{Path, PathBuf};
use tandem_config::Cell;

/// A copy of the shipped files that may be spoilt.
struct Files {
    folder: tempfile::TempDir,
}

impl Files {
    fn new() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let shipped = Path::new(env!("CARGO_MANIFEST_DIR"));
        for part in ["cells", "products", "strategies", "robots"] {
            std::fs::create_dir(folder.path().join(part)).expect("a folder");
            for entry in std::fs::read_dir(shipped.join(part)).expect("shipped files") {
                let from = entry.expect("an entry").path();
                let name = from.file_name().expect("a name");
                std::fs::copy(&from, folder.path().join(part).join(name)).expect("copies");
            }
        }
        Self { folder }
    }

    fn path(&self, file: &str) -> PathBuf {
        self.folder.path().join(file)
    }

    /// Replaces `old`, which stands there exactly once, by `new`.
    fn spoil(&self, file: &str, old: &str, new: &str) -> &Self {
        let text = std::fs::read_to_string(self.path(file)).expect("reads");
        assert_eq!(text.matches(old).count(), 1, "{old} in {file}");
        std::fs::write(self.path(file), text.replace(old, new)).expect("writes");
        self
    }

    /// The faults, one a line, with the folder cut from their paths.
    fn faults(&self) -> Vec<String> {
        let folder = format!("{}/", self.folder.path().display());
        match Cell::load(&self.path("cells/s471.toml"), None) {
            Ok(_) => Vec::new(),
            Err(faults) => faults.to_string().lines().map(|line| line.replace(&folder, "")).collect(),
        }
    }

    /// `line:column` of `text` in `file`.
    fn at(&self, file: &str, text: &str) -> String {
        let content = std::fs::read_to_string(self.path(file)).expect("reads");
        let offset = content.find(text).unwrap_or_else(|| panic!("{text} in {file}"));
        let line = content[..offset].matches('\n').count() + 1;
        let column = offset - content[..offset].rfind('\n').map_or(0, |at| at + 1) + 1;
        format!("{line}:{column}")
    }
}

const CELL: &str = "cells/s471.toml";
const PRODUCT: &str = "products/s471.toml";

#[test]
fn the_copy_is_sound() {
    assert_eq!(Files::new().faults(), [""; 0]);
}

#[test]
fn a_value_out_of_range_is_told_with_its_place_and_bounds() {
    let files = Files::new();
    files.spoil(CELL, "plant = { period_us = 1000", "plant = { period_us = 50");
    let at = files.at(CELL, "50, phase_us");
    assert_eq!(
        files.faults(),
        [format!(
            "{CELL}:{at}: timing.plant.period_us = 50 us, allowed 250..=1000000 us; choose a value within these bounds"
        )]
    );
}

#[test]
fn a_key_in_another_unit_is_recognised() {
    let files = Files::new();
    files.spoil(CELL, "plant = { period_us = 1000", "plant = { period_ms = 1");
    let (table, key) = (files.at(CELL, "{ period_ms"), files.at(CELL, "period_ms"));
    assert_eq!(
        files.faults(),
        [
            format!("{CELL}:{table}: timing.plant.period_us is missing, allowed 250..=1000000 us; add it"),
            format!("{CELL}:{key}: unknown key `timing.plant.period_ms`; did you mean `period_us`?"),
        ]
    );
}

#[test]
fn a_slip_of_the_pen_is_recognised() {
    let files = Files::new();
    files.spoil(CELL, "walk_speed_m_s = 1.4", "walk_sped_m_s = 1.4");
    let (table, key) = (files.at(CELL, "[human]"), files.at(CELL, "walk_sped_m_s"));
    assert_eq!(
        files.faults(),
        [
            format!("{CELL}:{table}: human.walk_speed_m_s is missing, allowed 0.1..=2 m/s; add it"),
            format!("{CELL}:{key}: unknown key `human.walk_sped_m_s`; did you mean `walk_speed_m_s`?"),
        ]
    );
}

#[test]
fn values_of_another_kind_are_told() {
    let files = Files::new();
    files.spoil(CELL, "shoulder_height_m = 1.4", "shoulder_height_m = \"1.4\"");
    files.spoil(CELL, "harmful_by_hand = false", "harmful_by_hand = 0");
    files.spoil(CELL, "work_m = [1.42, 0.15, -0.9]", "work_m = [1.42, 0.15]");
    files.spoil(CELL, "policy = \"best_effort\"", "policy = \"hard\"");
    files.spoil(CELL, "looks_max = 3", "looks_max = 2.5");
    let at = |text: &str| files.at(CELL, text);
    let mut expected = vec![
        format!("{CELL}:{}: human.shoulder_height_m = a string, allowed 0.8..=2 m; write a number", at("\"1.4\"")),
        format!(
            "{CELL}:{}: supervisor.capability.harmful_by_hand = an integer, allowed true or false; write it as that",
            at("0\n\n[supervisor.timeout]")
        ),
        format!(
            "{CELL}:{}: human.work_m = 2 numbers, allowed 3 numbers, each -5..=5 m; write as many numbers as that",
            at("[1.42, 0.15]")
        ),
        format!(
            "{CELL}:{}: realtime.policy = \"hard\", allowed best_effort, enforce; choose one of these names",
            at("\"hard\"")
        ),
        format!(
            "{CELL}:{}: perception.looks_max = 2.5, allowed whole numbers; drop the fraction",
            at("2.5\noffset_max_m")
        ),
    ];
    let mut found = files.faults();
    expected.sort();
    found.sort();
    assert_eq!(found, expected);
}

#[test]
fn faults_of_all_files_are_told_together() {
    let files = Files::new();
    files.spoil(CELL, "present_s = 10.0", "present_s = 0.0");
    files.spoil(PRODUCT, "mass_kg = 6.5", "mass_kg = -6.5");
    files.spoil("products/s471-properties.json", "\"fuse\"", "\"fuze\"");
    files.spoil("strategies/human.toml", "form = \"hold\"", "form = \"hug\"");
    let at = |file, text: &str| files.at(file, text);
    let human = "strategies/human.toml";
    let hold = "[change_tool, grasp, hold, assemble_held, release]";
    let robot = "[change_tool, grasp, transfer, place] or [change_tool, grasp, transfer, place, assemble]";
    assert_eq!(
        files.faults(),
        [
            format!(
                "{CELL}:{}: supervisor.timeout.present_s = 0.0 s, allowed 0.1..=600 s; choose a value within these bounds",
                at(CELL, "0.0\nrecognise_s")
            ),
            "products/s471-properties.json: fuse is missing; say whether it is oily and harmful".to_owned(),
            "products/s471-properties.json: unknown key `fuze`; remove it, or add the part to the product".to_owned(),
            format!(
                "{PRODUCT}:{}: part[0].mass_kg = -6.5 kg, allowed 0.001..=100 kg; choose a value within these bounds",
                at(PRODUCT, "-6.5")
            ),
            format!(
                "{human}:{}: strategy[2].form = \"hug\", allowed robot, alone, hand_over, hold; choose one of these names",
                at(human, "\"hug\"")
            ),
            format!(
                "{human}:{}: strategy[2].actions = {hold}, allowed {robot}; write a sequence of form robot",
                at(human, "[\"change_tool\", \"grasp\", \"hold\"")
            ),
        ]
    );
}

#[test]
fn files_that_are_not_there_are_told_where_they_are_asked_for() {
    let files = Files::new();
    files.spoil(CELL, "product = \"s471\"", "product = \"s999\"");
    files.spoil(CELL, "\"../strategies/robot.toml\"", "\"../strategies/robots.toml\"");
    files.spoil(CELL, "../robots/ur10.urdf", "../robots/ur11.urdf");
    let folder = files.folder.path().display();
    let told = |field: &str, found: &str, allowed: &str, file: &str, at: &str| {
        let at = files.at(CELL, at);
        format!("{CELL}:{at}: {field} = {found}, allowed {allowed}; {file}: no such file; name a file that can be read")
    };
    let found: Vec<String> = files.faults().into_iter().map(|line| line.replace(&format!("{folder}/"), "")).collect();
    assert_eq!(
        found,
        [
            told("product", "\"s999\"", "a product of the products folder", "products/s999.toml", "\"s999\""),
            told(
                "strategies",
                "\"strategies/robots.toml\"",
                "a strategy file",
                "strategies/robots.toml",
                "[\"../strategies/reference.toml\""
            ),
            told("robot.urdf", "\"robots/ur11.urdf\"", "a URDF file", "robots/ur11.urdf", "\"../robots/ur11.urdf\""),
        ]
    );
    let missing = Cell::load(Path::new("no/such/cell.toml"), None).err().map(|faults| faults.to_string());
    assert_eq!(missing.as_deref(), Some("no/such/cell.toml: no such file; name a file that can be read"));
}

#[test]
fn an_order_that_goes_round_in_a_circle_is_refused() {
    let files = Files::new();
    files.spoil(PRODUCT, "after = [\"bottom_shell\"]", "after = [\"battery_module\"]");
    let at = files.at(PRODUCT, "[\"battery_module\"]");
    let circle = "sealing_ring, battery_module, heat_guard_plate, fireproof_guard_plate, metal_partition_plate, \
                  main_cable, top_cover, fuse, protective_film";
    assert_eq!(
        files.faults(),
        [format!(
            "{PRODUCT}:{at}: part[1].after = a circle among {circle}, allowed an order without circles; \
             remove one `after` of the circle"
        )]
    );
}

#[test]
fn names_that_lead_nowhere_and_names_used_twice_are_refused() {
    let files = Files::new();
    files.spoil(PRODUCT, "after = [\"bottom_shell\"]", "after = [\"bottom_shel\"]");
    files.spoil(PRODUCT, "name = \"fuse\"", "name = \"top_cover\"");
    files.spoil(
        PRODUCT,
        "mass_kg = 0.35\nflexible = true\nstation = \"B\"",
        "mass_kg = 0.35\nflexible = true\nstation = \"C\"",
    );
    files.spoil(CELL, "tool = \"press_tool\"", "tool = \"screwdriver\"");
    let found = files.faults();
    let told = |text: &str| assert!(found.iter().any(|line| line.contains(text)), "{text} in {found:#?}");
    told("part[1].after = \"bottom_shel\", allowed bottom_shell, sealing_ring,");
    told("part[8].name = \"top_cover\", allowed a name used once; give each part its own name");
    told("part[1].station = \"C\", allowed A, B; name a station of the cell");
    told("layout.rack.slot[3].tool = \"screwdriver\", allowed each of the four tools once; give each tool one place");
    told("layout.rack.slot = no place for press_tool, allowed each of the four tools once; add a [[layout.rack.slot]]");
}

#[test]
fn syntax_faults_have_their_place() {
    let files = Files::new();
    files.spoil(CELL, "reaction_s = 0.8", "reaction_s = = 0.8");
    let found = files.faults();
    let at = files.at(CELL, "= 0.8");
    let line = at.split(':').next().expect("a line").to_owned();
    assert!(
        found.iter().any(|fault| fault.starts_with(&format!("{CELL}:{line}:")) && fault.contains("not TOML")),
        "{found:#?}"
    );
    let files = Files::new();
    files.spoil("products/s471-properties.json", "\"fuse\": {", "\"fuse\" {");
    let found = files.faults();
    assert!(found[0].starts_with("products/s471-properties.json:10:10: expected `:`"), "{found:#?}");
}

#[test]
fn a_database_of_another_kind_is_refused_without_its_password() {
    let files = Files::new();
    files.spoil(CELL, "[supervisor]\n", "[store]\nurl = \"postgres://me:secret@host/db\"\n\n[supervisor]\n");
    let at = files.at(CELL, "\"postgres");
    assert_eq!(
        files.faults(),
        [format!(
            "{CELL}:{at}: store.url = \"postgres:…\", allowed sqlite:, mysql: or mariadb:; \
             write sqlite://FILE or mysql://USER@HOST/DATABASE"
        )]
    );
}

#[test]
fn faults_are_told_to_machines_too() {
    let files = Files::new();
    files.spoil(PRODUCT, "mass_kg = 9.2", "mass_kg = 920");
    let faults = Cell::load(&files.path(CELL), None).expect_err("too heavy");
    let value = serde_json::to_value(&faults).expect("serialises");
    assert_eq!(value[0]["field"], "part[2].mass_kg");
    assert_eq!((&value[0]["found"], &value[0]["allowed"]), (&"920 kg".into(), &"0.001..=100 kg".into()));
    assert!(value[0]["line"].as_u64() > Some(1) && value[0]["column"].as_u64() == Some(11), "{value}");
}

/// Any byte of any file changes the hash, so that peers of another configuration are known.
#[test]
fn the_hash_is_over_every_file() {
    let hash = |files: &Files| Cell::load(&files.path(CELL), None).unwrap_or_else(|faults| panic!("{faults}")).hash;
    let original = hash(&Files::new());
    assert_eq!(hash(&Files::new()), original);
    for (file, old, new) in [
        (CELL, "spread = 0.2", "spread = 0.3"),
        (PRODUCT, "mass_kg = 9.2", "mass_kg = 9.1"),
        ("products/s471-properties.json", "\"fuse\": { \"oily\": false", "\"fuse\": { \"oily\": true"),
        ("strategies/human.toml", "# light and near", "# near and light"),
        ("strategies/reference.toml", "effort = 150.0", "effort = 151.0"),
    ] {
        let files = Files::new();
        files.spoil(file, old, new);
        assert_ne!(hash(&files), original, "{file}");
    }
}

/// A wrong number of joints, or a rest outside their limits, never reaches a controller.
#[test]
fn the_resting_configuration_is_checked_against_the_arm() {
    let files = Files::new();
    files.spoil(CELL, "home_rad = [-0.61, -2.18, 1.98, -1.3708, -1.5708, -2.18]", "home_rad = [0.0, -1.57, 1.57]");
    let at = files.at(CELL, "[0.0, -1.57, 1.57]");
    assert_eq!(
        files.faults(),
        [format!(
            "{CELL}:{at}: robot.home_rad = 3 numbers, allowed 6 numbers; write one for each moving joint, base first"
        )]
    );
}

/// What stands for the arm's shape is one of two names; both make a cell.
#[test]
fn the_collision_geometry_is_capsules_or_hulls() {
    const URDF: &str = "urdf = \"../robots/ur10.urdf\"\n";
    for (named, fault) in [
        ("hulls", ""),
        ("capsules", ""),
        ("spheres", "robot.collision = \"spheres\", allowed capsules, hulls; choose one of these names"),
    ] {
        let files = Files::new();
        files.spoil(CELL, URDF, &format!("{URDF}collision = \"{named}\"\n"));
        let at = files.at(CELL, &format!("\"{named}\""));
        let expected: Vec<String> =
            [fault].iter().filter(|text| !text.is_empty()).map(|text| format!("{CELL}:{at}: {text}")).collect();
        assert_eq!(files.faults(), expected);
    }
}
