//! `tandem recognise`: what perception makes of clouds and meshes in files, and how often it is right
//! about a folder of parts whose classes are known.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use comfy_table::{CellAlignment, Table, presets};
use serde_json::json;
use tandem_config::{LabelledPart, PartSet};
use tandem_msg::{Coded, FeatureClass, FeatureDimensions};

use super::exit;
use crate::perception::{Perception, Recognised};
use crate::recognise::{self, Score, View};

#[derive(Args)]
pub(super) struct RecogniseArgs {
    /// Clouds (PLY, PCD, NPY) or meshes (STL, OBJ), which are scanned; or folders with a parts.toml,
    /// which says what is true of their files
    #[arg(required = true)]
    files: Vec<PathBuf>,
    /// What a number in the files means
    #[arg(long, value_enum, default_value = "mm")]
    unit: Unit,
    /// Where the feature is in the file's frame, in its unit [default: the middle]
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, allow_hyphen_values = true)]
    at: Option<[f64; 3]>,
    /// Direction the feature looks in: where the camera stands
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, allow_hyphen_values = true)]
    axis: Option<[f64; 3]>,
    /// Width of the view, in the files' unit [default: the whole]
    #[arg(long)]
    width: Option<f64>,
    /// Direction that is up while a mesh lies on its carrier [default: the axis]
    #[arg(long, value_name = "X,Y,Z", value_parser = triple, allow_hyphen_values = true)]
    up: Option<[f64; 3]>,
    /// Looks at each mesh of a folder, each from another side
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=1000))]
    looks: u32,
    /// Folder of the model
    #[arg(long, default_value = "config/models/s471")]
    model: PathBuf,
    /// Print one JSON object a file
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum Unit {
    Mm,
    Cm,
    M,
    Inch,
}

impl Unit {
    fn metres(self) -> f64 {
        match self {
            Self::Mm => 1e-3,
            Self::Cm => 1e-2,
            Self::M => 1.0,
            Self::Inch => 25.4e-3,
        }
    }
}

fn triple(text: &str) -> Result<[f64; 3], String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|word| word.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some([x, y, z]) if [x, y, z].iter().all(|v| v.is_finite()) => Ok([*x, *y, *z]),
        _ => Err("three numbers with commas between them".to_owned()),
    }
}

pub(super) fn recognise(args: &RecogniseArgs) -> u8 {
    let unit = args.unit.metres();
    if [args.axis, args.up].contains(&Some([0.0; 3])) || args.width.is_some_and(|w| !w.is_finite() || w <= 0.0) {
        anstream::eprintln!("error: --axis and --up must have a length and --width must be above 0");
        return exit::USAGE;
    }
    let mut perception = match Perception::load(&args.model) {
        Ok(perception) => perception,
        Err(error) => {
            anstream::eprintln!("{error}");
            return exit::CONFIG;
        }
    };
    let asked = args.at.is_some() || args.axis.is_some() || args.up.is_some() || args.width.is_some();
    let axis = args.axis.unwrap_or([0.0, 0.0, 1.0]);
    let view = asked.then(|| View {
        at: args.at.map(|at| at.map(|v| v * unit)),
        axis,
        up: args.up.unwrap_or(axis),
        half_width: args.width.map(|width| 0.5 * width * unit),
        look: 0,
    });
    let mut code = exit::OK;
    for file in &args.files {
        let seen = if file.is_dir() {
            look_through(&mut perception, file, args.looks, args.json)
        } else {
            look(&mut perception, file, unit, view.as_ref()).map(|seen| show(&perception, file, &seen, args.json))
        };
        if let Err(message) = seen {
            code = exit::FAILED;
            if args.json {
                anstream::println!("{}", json!({"event": "refused", "file": file, "error": message}));
            } else {
                anstream::eprintln!("{message}");
            }
        }
    }
    code
}

fn look(perception: &mut Perception, file: &Path, unit: f64, view: Option<&View>) -> Result<Recognised, String> {
    let shape = recognise::read(file, unit).map_err(|error| error.to_string())?;
    let cloud = recognise::in_camera(&shape, view).map_err(|error| format!("{}: {error}", file.display()))?;
    let too_little =
        || format!("{}: {} points in view, too few or without extent; widen --width", file.display(), cloud.len());
    perception.recognise(&cloud).ok_or_else(too_little)
}

/// Looks at all parts of a folder and says how often the answer was right.
fn look_through(perception: &mut Perception, folder: &Path, looks: u32, json: bool) -> Result<(), String> {
    let set = PartSet::load(folder).map_err(|faults| faults.to_string())?;
    let threshold = perception.card().threshold;
    let told = |part: &LabelledPart, answers: &[Option<Recognised>]| {
        if json {
            for (look, seen) in answers.iter().enumerate() {
                anstream::println!("{}", look_json(part, look, seen.as_ref(), threshold));
            }
        } else {
            anstream::println!("{}", told_of(part, answers));
        }
    };
    let score = recognise::score(perception, &set, looks, told)?;
    if json {
        anstream::println!("{}", score_json(folder, &set, &score));
        return Ok(());
    }
    anstream::println!("\n{}", confusion(&score));
    anstream::println!(
        "{} parts, {} looks: {:.1} % right; {} sure, {:.1} % of them right",
        set.parts.len(),
        score.looks,
        100.0 * score.accuracy(),
        score.sure,
        100.0 * score.accuracy_when_sure(),
    );
    Ok(())
}

fn look_json(part: &LabelledPart, look: usize, seen: Option<&Recognised>, threshold: f64) -> serde_json::Value {
    json!({
        "event": "look", "file": part.file, "family": part.family, "look": look,
        "class": part.class.to_string(),
        "answer": seen.map(|seen| seen.class.to_string()),
        "probability": seen.map(|seen| seen.probabilities[seen.class.code() as usize]),
        "right": seen.is_some_and(|seen| seen.class == part.class),
        "sure": seen.is_some_and(|seen| seen.is_sure(threshold)),
    })
}

/// A line a part: how many looks were answered rightly, and what else was answered.
fn told_of(part: &LabelledPart, answers: &[Option<Recognised>]) -> String {
    let right = answers.iter().flatten().filter(|seen| seen.class == part.class).count();
    let mut wrong: BTreeMap<String, u32> = BTreeMap::new();
    for answer in answers {
        let answer = answer.as_ref().map(|seen| seen.class);
        if answer != Some(part.class) {
            *wrong.entry(answer.map_or("nothing to see".into(), |class| class.to_string())).or_default() += 1;
        }
    }
    let wrong: Vec<String> = wrong.iter().map(|(answer, times)| format!("{times} × {answer}")).collect();
    let but = if wrong.is_empty() { String::new() } else { format!(", but {}", wrong.join(", ")) };
    let name = part.file.file_name().unwrap_or_default().to_string_lossy();
    format!("{right} of {} {name}: {}{but}", answers.len(), part.class)
}

fn score_json(folder: &Path, set: &PartSet, score: &Score) -> serde_json::Value {
    let (classes, confusion): (Vec<_>, Vec<_>) = confusions(score).unzip();
    json!({
        "event": "score", "folder": folder, "parts": set.parts.len(), "looks": score.looks,
        "accuracy": score.accuracy(), "sure": score.sure, "accuracy_when_sure": score.accuracy_when_sure(),
        "classes": classes, "confusion": confusion,
    })
}

/// A true class and how often each class was answered, in the order of [`FeatureClass::ALL`].
fn confusions(score: &Score) -> impl Iterator<Item = (&'static str, Vec<u32>)> {
    FeatureClass::ALL.iter().map(|class| {
        let row = score.confusion[class.code() as usize];
        (class.name(), FeatureClass::ALL.iter().map(|answer| row[answer.code() as usize]).collect())
    })
}

/// True classes down, answers across.
fn confusion(score: &Score) -> Table {
    let mut table = Table::new();
    let names = FeatureClass::ALL.iter().map(|class| class.name());
    table.load_style(presets::NOTHING).set_header(["is, said"].into_iter().chain(names));
    for (class, row) in confusions(score) {
        table.add_row([class.to_owned()].into_iter().chain(row.iter().map(u32::to_string)));
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

/// Name, value and deviation in millimetres of what was measured.
fn dimensions(d: &FeatureDimensions) -> impl Iterator<Item = (&'static str, f64, f64)> {
    let all =
        [("diameter", d.diameter), ("depth", d.depth), ("length", d.length), ("width", d.width), ("pitch", d.pitch)];
    all.into_iter().filter(|(_, m)| m.value > 0.0).map(|(name, m)| (name, m.value * 1e3, m.sigma * 1e3))
}

fn show(perception: &Perception, file: &Path, seen: &Recognised, json: bool) {
    let probability = |class: FeatureClass| f64::from(seen.probabilities[class.code() as usize]);
    let sure = seen.is_sure(perception.card().threshold);
    if json {
        let probabilities: serde_json::Map<String, serde_json::Value> =
            FeatureClass::ALL.iter().map(|&class| (class.to_string(), json!(probability(class)))).collect();
        let mut object = json!({
            "event": "recognised", "file": file, "class": seen.class.to_string(), "sure": sure,
            "probability": probability(seen.class), "probabilities": probabilities,
            "segment_points": seen.segment_count, "dimensions_mm": {}, "camera_from_feature": null,
        });
        if let Some(fit) = &seen.fit {
            for (name, value, sigma) in dimensions(&fit.dimensions) {
                object["dimensions_mm"][name] = json!({"value": value, "sigma": sigma});
            }
            let pose = &fit.camera_from_feature;
            let q = pose.rotation.coords;
            object["camera_from_feature"] = json!({
                "position_m": [pose.translation.x, pose.translation.y, pose.translation.z],
                "rotation_xyzw": [q.x, q.y, q.z, q.w],
            });
        }
        anstream::println!("{object}");
        return;
    }
    let word = if sure { "sure" } else { "unsure" };
    anstream::println!("{}: {} ({:.1} %, {word})", file.display(), seen.class, 100.0 * probability(seen.class));
    let mut others: Vec<FeatureClass> = FeatureClass::ALL.iter().copied().filter(|c| *c != seen.class).collect();
    others.sort_by(|a, b| probability(*b).total_cmp(&probability(*a)));
    let likely: Vec<String> = others
        .iter()
        .filter(|class| probability(**class) >= 0.005)
        .map(|class| format!("{class} {:.1} %", 100.0 * probability(*class)))
        .collect();
    if !likely.is_empty() {
        anstream::println!("  else      {}", likely.join(", "));
    }
    if let Some(fit) = &seen.fit {
        for (name, value, sigma) in dimensions(&fit.dimensions) {
            anstream::println!("  {name:<9} {value:8.3} mm ± {sigma:.3}");
        }
        let [x, y, z] = fit.camera_from_feature.translation.vector.map(|v| v * 1e3).into();
        let axis = fit.camera_from_feature * nalgebra::Vector3::z();
        anstream::println!("  position  {x:.2}, {y:.2}, {z:.2} mm in the camera's frame");
        anstream::println!("  axis      {:.3}, {:.3}, {:.3}", axis.x, axis.y, axis.z);
    }
}
