//! A folder of parts with their true classes: what recognition is measured on.

use crate::fault::Faults;
use crate::read::{Bound, Reading, Table, bound};
use std::path::{Path, PathBuf};
use tandem_msg::FeatureClass;

const AT: Bound = bound("at_mm", "mm", -10_000.0, 10_000.0);
const AXIS: Bound = bound("axis", "", -1.0, 1.0);
const UP: Bound = bound("up", "", -1.0, 1.0);
const WIDTH: Bound = bound("width_mm", "mm", 0.1, 20_000.0);

/// Units a file's numbers may be in, and what each is in metres.
const UNITS: [(&str, f64); 4] = [("mm", 1e-3), ("cm", 1e-2), ("m", 1.0), ("inch", 25.4e-3)];

/// The parts of a folder.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct PartSet {
    /// What a number in the part files means, metres.
    pub unit: f64,
    /// The parts, in the order of the file.
    pub parts: Vec<LabelledPart>,
}

/// A feature of a part in a file, and how it is to be looked at.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct LabelledPart {
    /// The cloud or mesh.
    pub file: PathBuf,
    /// What is true of the feature.
    pub class: FeatureClass,
    /// What kind of part it is, for reports; may be empty.
    pub family: String,
    /// Mouth or foot of the feature in the file's frame, metres; the middle of the part when `None`.
    pub at: Option<[f64; 3]>,
    /// Direction the feature looks in.
    pub axis: [f64; 3],
    /// Direction that is up while the part lies on its carrier.
    pub up: [f64; 3],
    /// Width of the view, metres; the whole part when `None`.
    pub width: Option<f64>,
}

impl PartSet {
    /// Name of the file that lists a folder's parts.
    pub const FILE: &str = "parts.toml";

    /// Reads the list of a folder.
    ///
    /// # Errors
    /// Every fault of the list at once; the part files themselves are not opened.
    pub fn load(folder: &Path) -> Result<Self, Faults> {
        let reading = Reading::new();
        let set = read(folder, &reading);
        let (_, faults) = reading.finish();
        match set {
            Some(set) if faults.is_empty() => Ok(set),
            _ => Err(Faults::new(faults)),
        }
    }
}

fn read(folder: &Path, reading: &Reading) -> Option<PartSet> {
    let document = reading.open(&folder.join(PartSet::FILE), None)?;
    let parsed = document.parse(reading);
    let root = document.root(reading, &parsed);
    let unit = root.text_if("unit").unwrap_or_else(|| UNITS[0].0.to_owned());
    let metres = UNITS.iter().find(|(name, _)| *name == unit).map(|(_, metres)| *metres);
    if metres.is_none() {
        let names = UNITS.map(|(name, _)| name).join(", ");
        root.refuse("unit", &format!("\"{unit}\""), &names, "choose one of these names");
    }
    let tables = root.tables("part");
    if tables.is_empty() {
        root.refuse("part", "no part", "at least one [[part]]", "list the files of this folder");
    }
    let parts = tables.iter().filter_map(|table| LabelledPart::read(table, folder)).collect();
    Some(PartSet { unit: metres?, parts })
}

impl LabelledPart {
    fn read(table: &Table<'_>, folder: &Path) -> Option<Self> {
        let file = table.text("file").map(|name| folder.join(name));
        if let Some(file) = file.as_ref().filter(|file| !file.is_file()) {
            let found = format!("\"{}\"", file.display());
            table.refuse("file", &found, "a file of this folder", "there is none; name one, or remove this part");
        }
        let class = table.named("class");
        let axis = direction(table, &AXIS, [0.0, 0.0, 1.0]);
        Some(Self {
            family: table.text_if("family").unwrap_or_default(),
            at: table.has(AT.key).then(|| table.numbers(&AT).map(|v: f64| v * 1e-3)),
            axis,
            up: direction(table, &UP, axis),
            width: table.has(WIDTH.key).then(|| table.number(&WIDTH) * 1e-3),
            file: file?,
            class: class?,
        })
    }
}

/// A direction of any length but none; `absent` when it does not stand there.
fn direction(table: &Table<'_>, bound: &Bound, absent: [f64; 3]) -> [f64; 3] {
    if !table.has(bound.key) {
        return absent;
    }
    let direction: [f64; 3] = table.numbers(bound);
    if direction == [0.0; 3] {
        table.refuse(bound.key, "no direction", "a vector that is not 0", "point it out of the part");
        return absent;
    }
    direction
}
