//! The report: a page, its pictures, its figures.

use std::fmt::Write as _;
use std::path::Path;

use tandem_msg::{Coded, FEATURE_CLASSES, FeatureClass};

use super::{Findings, row, rows};
use crate::learning::transfer::protocol::{BUDGET, LABELS, Method, TEST, UNLABELLED};
use crate::learning::transfer::run::Outcome;
use crate::perception::card::Metrics;
use crate::plot::{Figure, Line, Panel};

pub(super) fn write(folder: &Path, findings: &Findings) -> std::io::Result<()> {
    std::fs::create_dir_all(folder)?;
    let metrics = serde_json::json!({"source": findings.source, "target": findings.target});
    let text = serde_json::to_string_pretty(&metrics).map_err(std::io::Error::other)?;
    std::fs::write(folder.join("metrics.json"), text + "\n")?;
    for (domain, metrics) in [("source", &findings.source), ("target", &findings.target)] {
        std::fs::write(folder.join(format!("confusion-{domain}.svg")), confusion(metrics))?;
    }
    if !findings.outcomes.is_empty() {
        curves(&findings.outcomes).save(&folder.join("transfer.svg"))?;
    }
    std::fs::write(folder.join("features.md"), page(findings))
}

/// Loss and accuracy on the way, of each method with labels, mean over the seeds.
fn curves(outcomes: &[Outcome]) -> Figure {
    let mut panels: Vec<Panel> = [("loss", Some(2.5)), ("accuracy", Some(1.0))]
        .into_iter()
        .map(|(what, y_max)| Panel { y_label: what.to_owned(), y_max, lines: Vec::new() })
        .collect();
    for method in [Method::Dqn, Method::Dan, Method::Dann, Method::Finetune, Method::Random, Method::Greedy] {
        let of: Vec<&Outcome> = outcomes.iter().filter(|o| o.method == method && o.labels == LABELS).collect();
        let length = of.iter().map(|o| o.trace.len()).min().unwrap_or(0);
        for (i, panel) in panels.iter_mut().enumerate() {
            let mean = |at: usize, what: usize| of.iter().map(|o| o.trace[at][what]).sum::<f64>() / of.len() as f64;
            let points = (0..length).map(|at| [mean(at, 0), mean(at, 1 + i)]).collect();
            panel.lines.push(Line { name: method.to_string(), points });
        }
    }
    Figure {
        title: format!("Transfer with {LABELS} labels a class, on validation"),
        x_label: "share of the budget".to_owned(),
        panels,
        bands: Vec::new(),
    }
}

fn page(findings: &Findings) -> String {
    let (quick, [source, target]) = (if findings.quick { " --quick" } else { "" }, findings.counts);
    let mut out = format!(
        "# Features: recognised, measured, carried to another product\n\n\
         ```\ntandem eval features{quick} --report docs/features\n```\n\n\
         Source: any part, the plant's camera. Target: the eleven part types of the S472 G box in other sizes, under another\n\
         scanner, by the model that ships for it. Test parts are none of those anything was fitted on or chosen by.\n\n\
         | | source, {source} parts | target, {target} parts |\n|---|---|---|\n",
    );
    // Writing to a string cannot fail.
    for ((case, source, unit), (_, target, _)) in rows(&findings.source).into_iter().zip(rows(&findings.target)) {
        let _ = writeln!(out, "| {case}, {unit} | {source:.4} | {target:.4} |");
    }
    let _ = writeln!(out, "\n![source](confusion-source.svg)\n![target](confusion-target.svg)");
    if findings.rows.is_empty() {
        return out;
    }
    let _ = writeln!(
        out,
        "\n## Ways of transfer\n\nAccuracy on {TEST} test parts of the target, from cloud to feature, mean ± standard deviation over the seeds.\n\
         Every method starts from the same source encoder, sees the same {UNLABELLED} unlabelled parts and, in the second column,\n\
         the same {LABELS} labelled ones a class, and may spend the same {BUDGET} looks (a look forward counts one, forward and back three);\n\
         random and greedy choose among the moves of dqn.\n\n\
         | method | no labels | {LABELS} labels a class | seeds |\n|---|---|---|---|"
    );
    for method in Method::ALL {
        let of = |labels: usize| findings.rows.iter().find(|row| row.method == method && row.labels == labels);
        let cell =
            |labels| of(labels).map_or("–".to_owned(), |row| format!("{:.3} ± {:.3}", row.mean(), row.spread()));
        let seeds = of(0).or(of(LABELS)).map_or(0, |row| row.accuracies.len());
        let _ = writeln!(out, "| {method} | {} | {} | {seeds} |", cell(0), cell(LABELS));
    }
    let _ = writeln!(out, "\n![losses and accuracies on the way](transfer.svg)");
    out
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
