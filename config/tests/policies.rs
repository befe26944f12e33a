//! Policies are read with their cards, and refused when the two do not belong together.

use std::path::Path;

use tandem_config::{Cell, PolicyCard, PolicyModel};
use tandem_policy::{DOF, Lateral, OBSERVATION, Shape};

fn model(method: &str, columns: usize) -> PolicyModel {
    let shape = Shape { inputs: OBSERVATION, outputs: DOF, columns, lateral: Lateral::Adapter };
    let count = shape.numbers().expect("a shape");
    PolicyModel {
        card: PolicyCard {
            format: PolicyCard::FORMAT,
            product: "s471".into(),
            subtask: "grasp".into(),
            method: method.into(),
            columns,
            weights_blake3: String::new(),
            source_blake3: None,
            seed: 1,
            scenes: 10,
            demonstrated: 100,
            episodes: 20,
            corrections: 3,
            updates: 40,
            validation_success: 0.5,
        },
        shape,
        numbers: (0..count).map(|k| (k % 13) as f32 * 0.01).collect(),
    }
}

/// What was saved is what is loaded, to the bit; a cell that names the folder has it, and its hash tells.
#[test]
fn policies_come_back_as_they_were() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let shipped = Path::new(env!("CARGO_MANIFEST_DIR"));
    let products = folder.path().join("models/s471");
    for columns in [1, 2] {
        let mut saved = model("pnn", columns);
        saved.save(&products).expect("writable");
        assert_eq!(PolicyModel::load(&products, "grasp").expect("readable"), saved);
    }
    let text = std::fs::read_to_string(shipped.join("cells/s471.toml")).expect("the shipped cell");
    let text = text.replace("\"../", &format!("\"{}/", shipped.display()));
    let cell = |text: &str| {
        let file = folder.path().join("cell.toml");
        std::fs::write(&file, text).expect("writable");
        Cell::load(&file, None)
    };
    let models = |folder: &Path| {
        let line = text.lines().find(|line| line.starts_with("policies")).expect("the cell names its policies");
        text.replace(line, &format!("policies = \"{}\"", folder.display()))
    };
    let with = cell(&models(&folder.path().join("models"))).expect("sound files");
    assert!(with.policies.grasp.is_some() && with.policies.transfer.is_none());
    let without = cell(&models(&folder.path().join("nowhere"))).expect("sound files");
    assert!(without.policies.grasp.is_none());
    assert_ne!(with.hash, without.hash);

    let weights = products.join("grasp.safetensors");
    let mut bytes = std::fs::read(&weights).expect("readable");
    *bytes.last_mut().expect("not empty") ^= 1;
    std::fs::write(&weights, bytes).expect("writable");
    let faults = cell(&models(&folder.path().join("models"))).expect_err("spoilt weights").to_string();
    assert!(faults.contains("grasp.safetensors: its hash is not the card's"), "{faults}");
}
