//! A product: its parts, how each is shaped, held, placed and in which order.

use crate::body::{Body, FeatureGeometry};
use crate::fault::Fault;
use crate::layout::Layout;
use crate::read::{Bound, Document, Reading, Table, bound};
use nalgebra::Isometry3;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const MASS: Bound = bound("mass_kg", "kg", 0.001, 100.0);
const GRASP_WIDTH: Bound = bound("grasp_width_m", "m", 0.0, 0.2);
const CAPTURE: Bound = bound("position_m", "m", 0.0005, 0.05);
const CAPTURE_TURN: Bound = bound("angle_rad", "rad", 0.005, 0.5);
const TILT: Bound = bound("view_tilt_rad", "rad", 0.0, 1.2);
const TURN: Bound = bound("view_turn_rad", "rad", -3.2, 3.2);

/// Parts a product may have: as many as a scene has room for beside the cell itself.
const PARTS_MAX: usize = 24;

/// How far from its place a part still slips into it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capture {
    /// Metres.
    pub position: f64,
    /// Radians.
    pub angle: f64,
}

/// One part type of a product.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Part {
    /// Name in files, lower case.
    pub name: String,
    /// Name on the screen.
    pub label: String,
    /// Its shape.
    pub body: Body,
    /// Half extents of the box around it, metres.
    pub half_extents: [f64; 3],
    /// The feature it is assembled by.
    pub feature: FeatureGeometry,
    /// Mass, kg (W_p).
    pub mass: f64,
    /// Whether it bends (F_p).
    pub flexible: bool,
    /// Whether it is oily: suction does not hold it.
    pub oily: bool,
    /// Whether it can hurt a person who handles it.
    pub harmful: bool,
    /// Index of its station in the layout.
    pub station: usize,
    /// Where it nominally lies on the carrier.
    pub station_from_part: Isometry3<f64>,
    /// TCP pose at which it is held; z into the part.
    pub part_from_grasp: Isometry3<f64>,
    /// Frame of its feature; z along the axis, out of the part.
    pub part_from_feature: Isometry3<f64>,
    /// Where it belongs in the box.
    pub fixture_from_part: Isometry3<f64>,
    /// Width at which a gripper holds it, metres; 0 when the grip is not checked.
    pub grasp_width: f64,
    /// How far from its place it still slips into it.
    pub capture: Capture,
    /// Tilt of the inspection view from the feature's axis, radians.
    pub view_tilt: f64,
    /// Direction of that tilt about the feature's axis, radians.
    pub view_turn: f64,
    /// Indices of the parts that must sit before it.
    pub after: Vec<usize>,
}

/// A product: part types in the order in which a box is assembled.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Product {
    /// Name in files, lower case.
    pub name: String,
    /// Name on the screen.
    pub label: String,
    /// Folder of the model that recognises its parts, where it is not the cell's.
    pub model: Option<PathBuf>,
    /// Part types; every part's `after` lies before it.
    pub parts: Vec<Part>,
}

impl Product {
    /// Index of the part of that name.
    pub fn part(&self, name: &str) -> Option<usize> {
        self.parts.iter().position(|part| part.name == name)
    }
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields)]
struct Properties {
    oily: bool,
    harmful: bool,
}

/// Reads the properties file; its own faults are noted.
fn read_properties(document: &Document, reading: &Reading) -> BTreeMap<String, Properties> {
    serde_json::from_str(&document.text).unwrap_or_else(|error| {
        let text = error.to_string();
        reading.note(Fault {
            file: document.file.clone(),
            line: error.line(),
            column: error.column(),
            field: String::new(),
            found: text.split(" at line ").next().unwrap_or(&text).to_owned(),
            allowed: "{ \"part\": { \"oily\": bool, \"harmful\": bool }, … }".into(),
            advice: "mend the entry".into(),
        });
        BTreeMap::new()
    })
}

/// Reads `root`, of a file in `folder`, as a product made in `layout`, with the properties beside it.
pub(crate) fn read(
    root: &Table<'_>,
    folder: &Path,
    properties: Option<&Document>,
    layout: &Layout,
    reading: &Reading,
) -> Product {
    let known = properties.map(|document| (document, read_properties(document, reading)));
    let mut product = Product {
        name: root.text("name").unwrap_or_default(),
        label: root.text("label").unwrap_or_default(),
        model: root.text_if("model").map(|model| crate::cell::beside(folder, &model)),
        parts: Vec::new(),
    };
    let tables = root.tables("part");
    if tables.is_empty() || tables.len() > PARTS_MAX {
        let found = format!("{} parts", tables.len());
        root.refuse("part", &found, &format!("1..={PARTS_MAX} parts"), "write one [[part]] a part type");
    }
    let mut afters = Vec::new();
    for table in &tables {
        let mut part = read_part(table, layout);
        if product.part(&part.name).is_some() {
            table.refuse("name", &format!("\"{}\"", part.name), "a name used once", "give each part its own name");
        }
        if let Some((document, entries)) = &known {
            match entries.get(&part.name) {
                Some(entry) => (part.oily, part.harmful) = (entry.oily, entry.harmful),
                None if entries.is_empty() => {}
                None => reading.note(whole_file(document, &part.name, "missing", "say whether it is oily and harmful")),
            }
        }
        afters.push(table.texts("after"));
        product.parts.push(part);
    }
    if let Some((document, entries)) = &known {
        for name in entries.keys().filter(|name| product.part(name).is_none()) {
            reading.note(whole_file(document, name, "unknown", "remove it, or add the part to the product"));
        }
    }
    order(&mut product, &tables, &afters);
    product
}

fn whole_file(document: &Document, field: &str, found: &str, advice: &str) -> Fault {
    Fault {
        file: document.file.clone(),
        line: 0,
        column: 0,
        field: field.to_owned(),
        found: found.to_owned(),
        allowed: String::new(),
        advice: advice.to_owned(),
    }
}

fn read_part(table: &Table<'_>, layout: &Layout) -> Part {
    let station_name = table.text("station").unwrap_or_default();
    let station = layout.station(&station_name).unwrap_or_else(|| {
        if !station_name.is_empty() {
            let names: Vec<_> = layout.stations.iter().map(|station| station.name.as_str()).collect();
            let found = format!("\"{station_name}\"");
            table.refuse("station", &found, &names.join(", "), "name a station of the cell");
        }
        0
    });
    let body_table = table.table("body");
    let body = body_table.as_ref().map_or(Body::Box { size: [0.01; 3] }, Body::read);
    let feature_table = table.table("feature");
    let feature = feature_table.as_ref().map_or_else(placeholder_feature, FeatureGeometry::read);
    let (view_tilt, view_turn) =
        feature_table.as_ref().map_or((0.0, 0.0), |table| (table.number_or(&TILT, 0.0), table.number_or(&TURN, 0.0)));
    let part_from_feature = feature_table.as_ref().map_or_else(Isometry3::identity, |table| table.pose("pose"));
    let name = table.text("name").unwrap_or_default();
    if name.chars().any(|c| !c.is_ascii_lowercase() && !c.is_ascii_digit() && c != '_') || name.len() > 48 {
        let allowed = "at most 48 of a-z, 0-9, _";
        table.refuse("name", &format!("\"{name}\""), allowed, "names are database keys: keep them plain");
    }
    let capture = table.table("capture");
    Part {
        label: table.text("label").unwrap_or_default(),
        name,
        half_extents: body.half_extents(),
        body,
        feature,
        mass: table.number(&MASS),
        flexible: table.flag("flexible"),
        oily: false,
        harmful: false,
        station,
        station_from_part: table.pose("station_from_part"),
        part_from_grasp: table.pose("part_from_grasp"),
        part_from_feature,
        fixture_from_part: table.pose("fixture_from_part"),
        grasp_width: table.number(&GRASP_WIDTH),
        capture: Capture {
            position: capture.as_ref().map_or(0.005, |table| table.number(&CAPTURE)),
            angle: capture.as_ref().map_or(0.07, |table| table.number(&CAPTURE_TURN)),
        },
        view_tilt,
        view_turn,
        after: Vec::new(),
    }
}

fn placeholder_feature() -> FeatureGeometry {
    FeatureGeometry {
        class: tandem_msg::FeatureClass::Other,
        diameter: 0.0,
        depth: 0.0,
        length: 0.0,
        width: 0.0,
        pitch: 0.0,
        angle: 0.0,
        chamfer: 0.0,
    }
}

/// Resolves `after` and brings the parts into an order that keeps it: the file's own
/// order wherever that is possible, else the earliest part whose predecessors all sit.
fn order(product: &mut Product, tables: &[Table<'_>], afters: &[Vec<String>]) {
    let count = product.parts.len();
    let mut edges: Vec<Vec<usize>> = Vec::new();
    for (index, names) in afters.iter().enumerate() {
        let mut resolved = Vec::new();
        for name in names {
            match product.part(name) {
                Some(before) => resolved.push(before),
                None => {
                    let known: Vec<_> = product.parts.iter().map(|part| part.name.as_str()).collect();
                    tables[index].refuse(
                        "after",
                        &format!("\"{name}\""),
                        &known.join(", "),
                        "name a part of this product",
                    );
                }
            }
        }
        edges.push(resolved);
    }
    let mut sequence: Vec<usize> = Vec::new();
    while sequence.len() < count {
        let ready = |index: &usize| !sequence.contains(index) && edges[*index].iter().all(|b| sequence.contains(b));
        let Some(next) = (0..count).find(ready) else {
            let left: Vec<usize> = (0..count).filter(|index| !sequence.contains(index)).collect();
            let names: Vec<_> = left.iter().map(|index| product.parts[*index].name.as_str()).collect();
            let found = format!("a circle among {}", names.join(", "));
            tables[left[0]].refuse("after", &found, "an order without circles", "remove one `after` of the circle");
            return;
        };
        sequence.push(next);
    }
    let rank = |index: usize| sequence.iter().position(|at| *at == index).unwrap_or(index);
    for (part, edges) in product.parts.iter_mut().zip(&edges) {
        part.after = edges.iter().map(|before| rank(*before)).collect();
    }
    let mut ordered: Vec<(usize, Part)> =
        product.parts.drain(..).enumerate().map(|(i, part)| (rank(i), part)).collect();
    ordered.sort_by_key(|(rank, _)| *rank);
    product.parts = ordered.into_iter().map(|(_, part)| part).collect();
}
