//! Line charts as SVG: panels one above the other over a common axis.
//!
//! For the pictures the command line makes of what it measured. No fonts, no
//! bitmaps: what shows the file has both.

use std::fmt::Write;
use std::io;
use std::path::Path;

/// Width of a figure and of its margins, and height of a panel and of the gaps, in pixels.
const WIDTH: f64 = 900.0;
const LEFT: f64 = 70.0;
const RIGHT: f64 = 150.0;
const TOP: f64 = 40.0;
const PANEL: f64 = 150.0;
const GAP: f64 = 22.0;
const BOTTOM: f64 = 42.0;
/// Colours told apart by people who do not see all of them (Okabe and Ito).
const COLOURS: [&str; 6] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9"];

/// A figure.
#[derive(Clone, Debug, Default)]
pub struct Figure {
    /// Line above the panels.
    pub title: String,
    /// What the common axis shows, with its unit.
    pub x_label: String,
    /// From top to bottom.
    pub panels: Vec<Panel>,
    /// Stretches of the common axis that are shaded.
    pub bands: Vec<Band>,
}

/// One set of axes.
#[derive(Clone, Debug, Default)]
pub struct Panel {
    /// What it shows, with its unit.
    pub y_label: String,
    /// Largest value shown; what lies above is cut. The data's own when not given.
    pub y_max: Option<f64>,
    /// Lines, in the order of their colours.
    pub lines: Vec<Line>,
}

/// One line.
#[derive(Clone, Debug, Default)]
pub struct Line {
    /// Its name in the legend.
    pub name: String,
    /// Points; a value that is not finite interrupts it.
    pub points: Vec<[f64; 2]>,
}

/// A shaded stretch of the common axis.
#[derive(Clone, Debug, Default)]
pub struct Band {
    /// Where it begins and ends.
    pub from_to: [f64; 2],
    /// Written at its top.
    pub name: String,
}

impl Figure {
    /// Writes [`Self::svg`] into a file, and makes its folder.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save(&self, file: &Path) -> io::Result<()> {
        if let Some(folder) = file.parent() {
            std::fs::create_dir_all(folder)?;
        }
        std::fs::write(file, self.svg())
    }

    /// The figure as an SVG document.
    pub fn svg(&self) -> String {
        let height = TOP + self.panels.len() as f64 * (PANEL + GAP) - GAP + BOTTOM;
        let x = Axis::of(self.panels.iter().flat_map(|panel| panel.values(0)), false);
        let mut svg = String::new();
        // Writing to a string cannot fail.
        let _ = writeln!(
            svg,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" width=\"{WIDTH}\" height=\"{height}\" \
             font-family=\"sans-serif\" font-size=\"12\" fill=\"#222\">\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>"
        );
        text(&mut svg, [LEFT, TOP - 16.0], "start\" font-size=\"15\" font-weight=\"bold", &self.title);
        for (index, panel) in self.panels.iter().enumerate() {
            let top = TOP + index as f64 * (PANEL + GAP);
            panel.draw(&mut svg, top, &x, if index == 0 { &self.bands[..] } else { &[] }, &self.bands);
        }
        let bottom = height - BOTTOM;
        for tick in x.ticks() {
            text(&mut svg, [x.at(tick, LEFT, WIDTH - RIGHT), bottom + 16.0], "middle", &label(tick, x.step));
        }
        text(&mut svg, [(LEFT + WIDTH - RIGHT) / 2.0, bottom + 34.0], "middle", &self.x_label);
        svg.push_str("</svg>\n");
        svg
    }
}

impl Panel {
    fn values(&self, axis: usize) -> impl Iterator<Item = f64> + '_ {
        self.lines.iter().flat_map(move |line| line.points.iter().map(move |point| point[axis]))
    }

    fn draw(&self, svg: &mut String, top: f64, x: &Axis, named: &[Band], bands: &[Band]) {
        let cut = self.y_max.unwrap_or(f64::INFINITY);
        let y = Axis::of(self.values(1).map(|value| value.min(cut)), true);
        let (right, bottom) = (WIDTH - RIGHT, top + PANEL);
        for band in bands {
            let [from, to] = band.from_to.map(|at| x.at(at, LEFT, right).clamp(LEFT, right));
            let _ = writeln!(
                svg,
                "<rect x=\"{from:.1}\" y=\"{top}\" width=\"{:.1}\" height=\"{PANEL}\" fill=\"#f0e442\" fill-opacity=\"0.25\"/>",
                to - from
            );
        }
        for band in named {
            let at = x.at((band.from_to[0] + band.from_to[1]) / 2.0, LEFT, right);
            text(svg, [at, top + 13.0], "middle\" fill=\"#665c00", &band.name);
        }
        for tick in y.ticks() {
            let at = y.at(tick, bottom, top);
            let _ = writeln!(svg, "<line x1=\"{LEFT}\" y1=\"{at:.1}\" x2=\"{right}\" y2=\"{at:.1}\" stroke=\"#ddd\"/>");
            text(svg, [LEFT - 6.0, at + 4.0], "end", &label(tick, y.step));
        }
        let _ = writeln!(
            svg,
            "<path d=\"M{LEFT} {top}V{bottom}H{right}\" fill=\"none\" stroke=\"#222\"/>\n\
             <text transform=\"translate(16 {:.1}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
            (top + bottom) / 2.0,
            escaped(&self.y_label)
        );
        for (index, line) in self.lines.iter().enumerate() {
            let colour = COLOURS[index % COLOURS.len()];
            let mut path = String::new();
            let mut pen_down = false;
            for &[at, value] in &line.points {
                if !(at.is_finite() && value.is_finite()) {
                    pen_down = false;
                    continue;
                }
                let command = if pen_down { 'L' } else { 'M' };
                let _ = write!(path, "{command}{:.1} {:.1}", x.at(at, LEFT, right), y.at(value.min(cut), bottom, top));
                pen_down = true;
            }
            let _ = writeln!(
                svg,
                "<path d=\"{path}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.6\" stroke-linejoin=\"round\"/>"
            );
            let at = top + 12.0 + 17.0 * index as f64;
            let _ = writeln!(svg, "<path d=\"M{:.1} {at}h16\" stroke=\"{colour}\" stroke-width=\"2.5\"/>", right + 8.0);
            text(svg, [right + 29.0, at + 4.0], "start", &line.name);
        }
    }
}

/// A range with round numbers on it.
struct Axis {
    min: f64,
    max: f64,
    step: f64,
}

impl Axis {
    /// Holds all finite values; `padded` to whole steps, and down to 0 when none lies below.
    fn of(values: impl Iterator<Item = f64>, padded: bool) -> Self {
        let (min, max) = values
            .filter(|value| value.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(min, max), value| (min.min(value), max.max(value)));
        let (min, max) = match (min <= max, padded) {
            (false, _) => (0.0, 1.0),
            (true, true) => (min.min(0.0), max.max(0.0)),
            (true, false) => (min, max),
        };
        let max = if max > min { max } else { min + 1.0 };
        let rough = (max - min) / if padded { 4.0 } else { 8.0 };
        let power = 10.0_f64.powf(rough.log10().floor());
        let step = [1.0, 2.0, 5.0, 10.0].into_iter().map(|m| m * power).find(|step| *step >= rough).unwrap_or(rough);
        if padded {
            Self { min: (min / step).floor() * step, max: (max / step).ceil() * step, step }
        } else {
            Self { min, max, step }
        }
    }

    fn ticks(&self) -> impl Iterator<Item = f64> + '_ {
        let (first, last) = ((self.min / self.step).ceil() as i64, (self.max / self.step + 1e-9).floor() as i64);
        (first..=last).map(|k| k as f64 * self.step)
    }

    fn at(&self, value: f64, from: f64, to: f64) -> f64 {
        from + (value - self.min) / (self.max - self.min) * (to - from)
    }
}

/// A tick with as many places as its step has.
fn label(tick: f64, step: f64) -> String {
    let places = (-step.log10().floor()).max(0.0) as usize;
    format!("{tick:.places$}")
}

/// `anchor` may go on with further attributes.
fn text(svg: &mut String, [x, y]: [f64; 2], anchor: &str, words: &str) {
    let _ = writeln!(svg, "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\">{}</text>", escaped(words));
}

fn escaped(words: &str) -> String {
    words.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figure(points: Vec<[f64; 2]>) -> String {
        let line = Line { name: "a < b".into(), points };
        let panel = Panel { y_label: "way (m)".into(), y_max: Some(2.0), lines: vec![line] };
        Figure { title: "T".into(), x_label: "time (s)".into(), panels: vec![panel], bands: Vec::new() }.svg()
    }

    /// Ends of the data lie on the ends of the axes, what is above the cut on the cut, gaps begin a new stroke.
    #[test]
    fn points_stand_where_they_should() {
        let svg = figure(vec![[0.0, 0.0], [5.0, 1.0], [6.0, f64::NAN], [10.0, 9.0]]);
        let (left, right, bottom) = (LEFT, WIDTH - RIGHT, TOP + PANEL);
        let middle = (left + right) / 2.0;
        let path = format!("M{left:.1} {bottom:.1}L{middle:.1} {:.1}M{right:.1} {TOP:.1}", bottom - PANEL / 2.0);
        assert!(svg.contains(&path), "{path} in {svg}");
        assert!(svg.contains("a &lt; b") && svg.contains(">2.0<") && svg.contains(">10<"));
    }

    #[test]
    fn no_data_is_an_empty_figure() {
        let svg = figure(Vec::new());
        assert!(svg.starts_with("<svg") && svg.ends_with("</svg>\n") && !svg.contains("NaN"));
    }
}
