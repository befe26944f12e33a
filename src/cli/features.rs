//! `tandem eval features`: how well features are recognised and measured, on generated parts
//! nothing was fitted on.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use serde_json::json;
use tandem_msg::{Coded, FEATURE_CLASSES, FeatureClass};

use super::exit;
use crate::learning::encoder;
use crate::perception::Card;
use crate::perception::card::Metrics;

#[derive(Args)]
pub(super) struct FeaturesArgs {
    /// Folder of the model
    #[arg(long, default_value = "config/models/s471")]
    model: PathBuf,
    /// Test examples [default: as many as its card speaks of]
    #[arg(long)]
    count: Option<usize>,
    /// 160 examples only
    #[arg(long)]
    quick: bool,
    /// Folder for the report: metrics.json and confusion.svg
    #[arg(long, default_value = "reports/features")]
    out: PathBuf,
    /// Print one JSON object a figure
    #[arg(long)]
    json: bool,
}

pub(super) fn features(args: &FeaturesArgs) -> u8 {
    let card = match Card::read(&args.model.join(crate::perception::CARD_FILE)) {
        Ok(card) => card,
        Err(error) => {
            anstream::eprintln!("{error}");
            return exit::CONFIG;
        }
    };
    let count = if args.quick { 160 } else { args.count.unwrap_or(card.data.test) };
    let metrics = match encoder::measure(&args.model, card.data.seed, count) {
        Ok(metrics) => metrics,
        Err(error) => {
            anstream::eprintln!("{error}");
            return exit::FAILED;
        }
    };
    if let Err(error) = write(&args.out, &metrics) {
        anstream::eprintln!("{}: {error}; choose a writable folder with --out", args.out.display());
        return exit::FAILED;
    }
    for (case, value, unit) in rows(&metrics) {
        if args.json {
            let row = json!({"bench": "features", "case": case, "ours": value, "peer": null, "peer_value": null, "unit": unit, "ratio": null});
            anstream::println!("{row}");
        } else {
            anstream::println!("{case:<28} {value:9.4} {unit}");
        }
    }
    anstream::eprintln!("{count} parts; the report is in {}", args.out.display());
    exit::OK
}

fn rows(m: &Metrics) -> Vec<(&'static str, f64, &'static str)> {
    vec![
        ("accuracy-source", m.accuracy, "accuracy"),
        ("sure-source", m.sure, "share"),
        ("accuracy-when-sure-source", m.accuracy_when_sure, "accuracy"),
        ("calibration-source", m.calibration_error, "error"),
        ("segmentation-source", m.segment_iou, "IoU"),
        ("thread-confused-source", thread_confusion(m), "share"),
        ("diameter-source", m.diameter_error, "relative error, median"),
        ("depth-source", m.depth_error, "relative error, median"),
        ("length-source", m.length_error, "relative error, median"),
        ("width-source", m.width_error, "relative error, median"),
        ("pitch-source", m.pitch_error, "relative error, median"),
        ("pitch-measured-source", m.pitch_measured, "share"),
        ("position-source", m.position_error_m * 1e3, "mm, median"),
        ("axis-source", m.axis_error_rad.to_degrees(), "degrees, median"),
    ]
}

/// Share of threaded and smooth walls taken for each other.
fn thread_confusion(m: &Metrics) -> f64 {
    use FeatureClass as C;
    let of = |a: C, b: C| f64::from(m.confusion[a.code() as usize][b.code() as usize]);
    let pairs = [(C::ThreadedHole, C::SmoothHole), (C::ThreadedAxis, C::SmoothAxis)];
    let wrong: f64 = pairs.iter().map(|(a, b)| of(*a, *b) + of(*b, *a)).sum();
    let all: f64 = pairs.iter().flat_map(|(a, b)| [*a, *b]).map(|a| row(m, a)).sum();
    wrong / all.max(1.0)
}

fn row(m: &Metrics, class: FeatureClass) -> f64 {
    m.confusion[class.code() as usize].iter().map(|n| f64::from(*n)).sum()
}

fn write(folder: &Path, metrics: &Metrics) -> std::io::Result<()> {
    std::fs::create_dir_all(folder)?;
    let text = serde_json::to_string_pretty(metrics).map_err(std::io::Error::other)?;
    std::fs::write(folder.join("metrics.json"), text + "\n")?;
    std::fs::write(folder.join("confusion.svg"), confusion(metrics))
}

/// The confusion matrix as a picture: rows true, columns answered, shares of the row.
fn confusion(m: &Metrics) -> String {
    const CELL: usize = 62;
    const LEFT: usize = 130;
    const TOP: usize = 100;
    let side = FEATURE_CLASSES * CELL;
    let (width, height) = (LEFT + side + 20, TOP + side + 30);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" \
         font-family=\"sans-serif\" font-size=\"12\" fill=\"#222\">\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n\
         <text x=\"10\" y=\"22\" font-size=\"15\" font-weight=\"bold\">Rows: what it is. Columns: what was recognised. {:.1} % right</text>\n",
        100.0 * m.accuracy
    );
    for &class in FeatureClass::ALL {
        let i = class.code() as usize;
        let (x, y) = (LEFT + i * CELL + CELL / 2, TOP + i * CELL + CELL / 2 + 4);
        // Writing to a string cannot fail.
        let _ = writeln!(svg, "<text x=\"{}\" y=\"{y}\" text-anchor=\"end\">{class}</text>", LEFT - 8);
        let _ = writeln!(
            svg,
            "<text transform=\"translate({x},{}) rotate(-35)\" text-anchor=\"start\">{class}</text>",
            TOP - 8
        );
        for &other in FeatureClass::ALL {
            let (j, n) = (other.code() as usize, m.confusion[i][other.code() as usize]);
            let share = f64::from(n) / row(m, class).max(1.0);
            let hue = if i == j { "0,114,178" } else { "213,94,0" };
            let strength = if i == j { 0.8 * share } else { (4.0 * share).min(0.9) };
            let _ = writeln!(
                svg,
                "<rect x=\"{}\" y=\"{}\" width=\"{CELL}\" height=\"{CELL}\" fill=\"rgba({hue},{strength:.3})\" stroke=\"#ddd\"/>\
                 <text x=\"{}\" y=\"{y}\" text-anchor=\"middle\">{n}</text>",
                LEFT + j * CELL,
                TOP + i * CELL,
                LEFT + j * CELL + CELL / 2
            );
        }
    }
    svg + "</svg>\n"
}
