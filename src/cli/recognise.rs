//! `tandem recognise`: what perception makes of clouds and meshes in files.

use std::path::{Path, PathBuf};

use clap::{Args, ValueEnum};
use serde_json::json;
use tandem_msg::{Coded, FeatureClass, FeatureDimensions};

use super::exit;
use crate::perception::{Perception, Recognised};
use crate::recognise::{self, View};

#[derive(Args)]
pub(super) struct RecogniseArgs {
    /// Clouds (PLY, PCD, NPY) or meshes (STL, OBJ), which are scanned
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
    if args.axis.is_some_and(|axis| axis == [0.0; 3]) || args.width.is_some_and(|w| !w.is_finite() || w <= 0.0) {
        anstream::eprintln!("error: --axis must have a length and --width must be above 0");
        return exit::USAGE;
    }
    let mut perception = match Perception::load(&args.model) {
        Ok(perception) => perception,
        Err(error) => {
            anstream::eprintln!("{error}");
            return exit::CONFIG;
        }
    };
    let asked = args.at.is_some() || args.axis.is_some() || args.width.is_some();
    let view = asked.then(|| View {
        at: args.at.map(|at| at.map(|v| v * unit)),
        axis: args.axis.unwrap_or([0.0, 0.0, 1.0]),
        half_width: args.width.map(|width| 0.5 * width * unit),
    });
    let mut code = exit::OK;
    for file in &args.files {
        match look(&mut perception, file, unit, view.as_ref()) {
            Ok(seen) => show(&perception, file, &seen, args.json),
            Err(message) => {
                code = exit::FAILED;
                if args.json {
                    anstream::println!("{}", json!({"event": "refused", "file": file, "error": message}));
                } else {
                    anstream::eprintln!("{message}");
                }
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

/// Name, value and deviation in millimetres of what was measured.
fn dimensions(d: &FeatureDimensions) -> impl Iterator<Item = (&'static str, f64, f64)> {
    let all =
        [("diameter", d.diameter), ("depth", d.depth), ("length", d.length), ("width", d.width), ("pitch", d.pitch)];
    all.into_iter().filter(|(_, m)| m.value > 0.0).map(|(name, m)| (name, m.value * 1e3, m.sigma * 1e3))
}

fn show(perception: &Perception, file: &Path, seen: &Recognised, json: bool) {
    let probability = |class: FeatureClass| f64::from(seen.probabilities[class.code() as usize]);
    let sure = probability(seen.class) >= perception.card().threshold && seen.fit.is_some();
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
