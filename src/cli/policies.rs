//! `tandem eval policies`: Fig. 10 on our data. What learned motion is worth beside hand-made and planned paths.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;

use clap::Args;
use serde_json::json;
use tandem_config::{Cell, PolicyCard, PolicyModel};
use tandem_motion::{self as motion, Candidate, Extent, Method, Point, Row, Split, Subtask, World};

use super::train::MethodName;
use super::{check, exit};
use crate::plot;

#[derive(Args)]
pub(super) struct PoliciesArgs {
    /// Cell file: arm, layout, and the products' folder
    #[arg(default_value = "config/cells/s471.toml")]
    cell: PathBuf,
    /// Product whose subtasks are the tests
    #[arg(long, default_value = "s472")]
    product: String,
    /// Tests of each subtask
    #[arg(long, default_value_t = 500, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    tests: u32,
    /// Twenty tests a subtask
    #[arg(long)]
    quick: bool,
    /// Policies only, and only as the cell moves them: for very many tests; no page is written
    #[arg(long)]
    shielded: bool,
    /// Policies of these methods only
    #[arg(long, value_enum, value_delimiter = ',', default_values = ["ac", "pnn", "fine-tuned"])]
    method: Vec<MethodName>,
    /// Seed of the tests
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Folder of trainings, as `tandem train policy` leaves it
    #[arg(long, default_value = "reports/policies")]
    trained: PathBuf,
    /// Folder of installed models: tested where there is no training
    #[arg(long, default_value = "config/models")]
    models: PathBuf,
    /// Folder for policies.json, policies.svg and policies.md
    #[arg(long, default_value = "reports/policies")]
    out: PathBuf,
    /// Print one JSON object a row
    #[arg(long)]
    json: bool,
}

/// What a curve shows, and its name.
type Measure = (&'static str, fn(&Point) -> f64);

/// Curves of a subtask: method, seed, points.
type Curves = Vec<(Method, u64, Vec<Point>)>;

/// How the policies of a method came to be: by which command, but for the subtask.
type Trainings = BTreeMap<String, u64>;

pub(super) fn policies(args: &PoliciesArgs) -> u8 {
    let world = match Cell::load(&args.cell, Some(&args.product)) {
        Ok(cell) => World::new(cell),
        Err(faults) => return check::report_faults(&faults, args.json),
    };
    let tests = if args.quick { args.tests.min(20) } else { args.tests } as usize;
    let mut rows = Vec::new();
    let mut curves = BTreeMap::new();
    let (mut blocked, mut trainings) = (BTreeMap::new(), Trainings::new());
    for subtask in Subtask::ALL {
        let (candidates, of_subtask) = match candidates(args, &world, subtask, &mut trainings) {
            Ok(found) => found,
            Err(error) => {
                anstream::eprintln!("{error}");
                return exit::CONFIG;
            }
        };
        let scenes = motion::scenes(&world, subtask, Split::Test, args.seed, tests);
        blocked.insert(subtask.name(), scenes.iter().filter(|scene| scene.straight_blocked).count());
        let extent = if args.shielded { Extent::ShieldedPolicies } else { Extent::All };
        for row in motion::evaluate(&world, subtask.name(), &scenes, &candidates, extent) {
            print(&row, args.json);
            rows.push(row);
        }
        curves.insert(subtask.name(), of_subtask);
    }
    if args.shielded {
        let contacts = pooled(rows.iter().map(|row| row.contact));
        anstream::eprintln!(
            "{} contacts in {} shielded motions of {} scenes: at most {:.4} % (95 %)",
            contacts.count,
            contacts.of,
            Subtask::ALL.len() * tests,
            1e2 * contacts.interval[1]
        );
        return exit::OK;
    }
    match write(args, tests, &rows, &curves, &blocked, &trainings) {
        Ok(()) => exit::OK,
        Err(error) => {
            anstream::eprintln!("{}: {error}; choose a writable folder with --out", args.out.display());
            exit::FAILED
        }
    }
}

/// The policies of a subtask, and how they came to be.
fn candidates(
    args: &PoliciesArgs,
    world: &World,
    subtask: Subtask,
    trainings: &mut Trainings,
) -> std::io::Result<(Vec<Candidate>, Curves)> {
    let product = &world.cell.product.name;
    let (mut candidates, mut curves) = (Vec::new(), Curves::new());
    let of = |model: PolicyModel| Candidate {
        method: model.card.method,
        seed: model.card.seed,
        shape: model.shape,
        numbers: model.numbers,
    };
    for (name, method) in args.method.iter().map(|name| (name, name.method())) {
        for seed in 1..=100 {
            let folder = motion::folder(&args.trained, product, subtask, method, seed);
            if !folder.join(motion::CURVE).exists() {
                break;
            }
            let model = PolicyModel::load(&folder, subtask.name())?;
            let PolicyCard { product, scenes, updates, .. } = &model.card;
            let method_name =
                clap::ValueEnum::to_possible_value(name).map_or(String::new(), |name| name.get_name().into());
            let command = format!("--product {product} --method {method_name} --scenes {scenes} --updates {updates}");
            let runs = trainings.entry(command).or_default();
            *runs = seed.max(*runs);
            candidates.push(of(model));
            let curve = std::fs::read(folder.join(motion::CURVE))?;
            curves.push((method, seed, serde_json::from_slice(&curve)?));
        }
    }
    let installed = args.models.join(product);
    if candidates.is_empty() && PolicyModel::files(&installed, subtask.name())[0].exists() {
        candidates.push(of(PolicyModel::load(&installed, subtask.name())?));
    }
    Ok((candidates, curves))
}

fn print(row: &Row, as_json: bool) {
    if as_json {
        let case = format!("{} {} {}", row.subtask, row.method, if row.shielded { "shielded" } else { "alone" });
        let line = json!({"bench": "policies", "case": case, "ours": row.reached.rate, "peer": "manual",
            "peer_value": null, "unit": "reached", "ratio": row.time_over_manual, "row": row});
        anstream::println!("{line}");
        return;
    }
    // Many shielded tests are made without times.
    let times = if row.time_s.is_nan() {
        String::new()
    } else {
        let Row { time_s, time_over_manual, time_over_planner, .. } = row;
        format!("  {time_s:.2} s, {time_over_manual:.2} of manual, {time_over_planner:.2} of planner")
    };
    anstream::println!(
        "{:9} {:10} seed {} {:8} reached {:5.1} %  contact {:5.2} % ({:.2}..{:.2}){times}",
        row.subtask,
        row.method,
        row.seed,
        if row.shielded { "shielded" } else { "alone" },
        1e2 * row.reached.rate,
        1e2 * row.contact.rate,
        1e2 * row.contact.interval[0],
        1e2 * row.contact.interval[1]
    );
}

fn write(
    args: &PoliciesArgs,
    tests: usize,
    rows: &[Row],
    curves: &BTreeMap<&str, Curves>,
    blocked: &BTreeMap<&str, usize>,
    trainings: &Trainings,
) -> std::io::Result<()> {
    std::fs::create_dir_all(&args.out)?;
    let report = json!({"product": args.product, "tests": tests, "seed": args.seed, "straight_line_blocked": blocked, "rows": rows, "curves": curves});
    std::fs::write(args.out.join("policies.json"), format!("{report:#}\n"))?;
    figure(curves).save(&args.out.join("policies.svg"))?;
    std::fs::write(args.out.join("policies.md"), page(args, tests, rows, curves, blocked, trainings))
}

/// Reward, success and loss over the episodes, a line a method: the median of its seeds.
fn figure(curves: &BTreeMap<&str, Curves>) -> plot::Figure {
    let mut panels = Vec::new();
    for (subtask, curves) in curves {
        let measures: [Measure; 3] = [
            ("reward a step", |point| point.reward),
            ("reached", |point| point.success),
            ("TD error squared", |point| f64::from(point.critic_loss)),
        ];
        for (label, measure) in measures {
            let lines = [Method::Ac, Method::Pnn, Method::FineTuned].into_iter().filter_map(|method| {
                let of: Vec<&Vec<Point>> = curves.iter().filter(|(m, ..)| *m == method).map(|(.., c)| c).collect();
                let length = of.iter().map(|curve| curve.len()).min()?;
                let middle = |index: usize, of_point: &dyn Fn(&Point) -> f64| {
                    motion::median(of.iter().map(|curve| of_point(&curve[index])))
                };
                let points = (0..length)
                    .map(|index| [middle(index, &|point| point.episodes as f64), middle(index, &measure)])
                    .collect();
                Some(plot::Line { name: method.name().into(), points })
            });
            let y_max = (label == "TD error squared").then_some(40.0);
            panels.push(plot::Panel { y_label: format!("{subtask}: {label}"), y_max, lines: lines.collect() });
        }
    }
    plot::Figure {
        title: "Learning to move: median of the seeds, validation scenes".into(),
        x_label: "episodes".into(),
        panels,
        bands: Vec::new(),
    }
}

/// First episode from which on a curve stays at or above a level of success.
fn reaches(curve: &[Point], level: f64) -> Option<u64> {
    let below = curve.iter().rposition(|point| point.success < level).map_or(0, |index| index + 1);
    curve.get(below).map(|point| point.episodes)
}

fn page(
    args: &PoliciesArgs,
    tests: usize,
    rows: &[Row],
    curves: &BTreeMap<&str, Curves>,
    blocked: &BTreeMap<&str, usize>,
    trainings: &Trainings,
) -> String {
    let mut page = String::from("# Learned motion, measured\n\n");
    let _ = writeln!(
        page,
        "Made by `tandem eval policies --product {} --tests {tests} --seed {} --out {}`. Tests are scenes nothing was trained on or chosen by; \
         \"alone\" makes every motion the policy asks for and counts contacts, \"shielded\" refuses those that are not clear and takes them anew, shorter and led off what they met, for every method alike. \
         Times are at the joints' limits, medians of the ratios to the hand-made path and to the sampling planner's in the same scene.\n",
        args.product,
        args.seed,
        args.out.display()
    );
    for (options, runs) in trainings {
        let _ = writeln!(page, "    tandem train policy --subtask all {options} --runs {runs}");
    }
    if !trainings.is_empty() {
        page.push_str("\nmade the policies, on the columns of the first product where they are built on.\n\n");
    }
    let shares: Vec<String> = blocked
        .iter()
        .map(|(subtask, count)| format!("{subtask} {:.0} %", 1e2 * *count as f64 / tests as f64))
        .collect();
    let _ = writeln!(page, "Scenes whose straight joint line touches something: {}.\n", shares.join(", "));
    page.push_str(
        "Of a method with several seeds the rates are those of all their tests together, with the worst seed beside them, and the \
         times are medians over the seeds; policies.json has every seed.\n\n\
         | subtask | method | seeds | | reached % (95 %) | worst | contact % (95 %) | worst | s | of manual | of planner |\n\
         |---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for of_method in rows.chunk_by(|a, b| (&a.subtask, &a.method, a.shielded) == (&b.subtask, &b.method, b.shielded)) {
        let rate = |of: fn(&Row) -> motion::Rate, worst: fn(f64, f64) -> f64| {
            let all = pooled(of_method.iter().map(of));
            let [low, high] = all.interval.map(|end| 1e2 * end);
            let worst = of_method.iter().map(|row| of(row).rate).reduce(worst).unwrap_or(f64::NAN);
            format!("{:.1} ({low:.1}–{high:.1}) | {:.1}", 1e2 * all.rate, 1e2 * worst)
        };
        let time = |of: fn(&Row) -> f64| motion::median(of_method.iter().map(of));
        let first = &of_method[0];
        let _ = writeln!(
            page,
            "| {} | {} | {} | {} | {} | {} | {:.2} | {:.2} | {:.2} |",
            first.subtask,
            first.method,
            if first.seed == 0 { "–".into() } else { of_method.len().to_string() },
            if first.shielded { "shielded" } else { "alone" },
            rate(|row| row.reached, f64::min),
            rate(|row| row.contact, f64::max),
            time(|row| row.time_s),
            time(|row| row.time_over_manual),
            time(|row| row.time_over_planner)
        );
    }
    page.push_str("\n![curves](policies.svg)\n\n## Episodes to a common level of success\n\nFrom which episode on the curve of every seed stays at or above the level; validation scenes, nothing refused. The ratio is that of the medians, to the actor-critic without earlier columns.\n\n| subtask | level | method | each seed | median | ratio |\n|---|---|---|---|---|---|\n");
    for (subtask, curves) in curves {
        for level in [0.7, 0.8, 0.85, 0.9, 0.95] {
            let episodes = |method: Method| -> Vec<Option<u64>> {
                curves.iter().filter(|(m, ..)| *m == method).map(|(.., curve)| reaches(curve, level)).collect()
            };
            // A seed that never came there counts as later than all others.
            let middle =
                |of: &[Option<u64>]| motion::median(of.iter().map(|at| at.map_or(f64::INFINITY, |at| at as f64)));
            let alone = middle(&episodes(Method::Ac));
            for method in [Method::Ac, Method::Pnn, Method::FineTuned] {
                let of_method = episodes(method);
                if of_method.is_empty() {
                    continue;
                }
                let named = |at: &Option<u64>| at.map_or("not".into(), |at| at.to_string());
                let each: Vec<String> = of_method.iter().map(named).collect();
                let (each, name, middle) = (each.join(", "), method.name(), middle(&of_method));
                let ratio = if middle.is_finite() && alone.is_finite() {
                    format!("{:.2}", middle / alone)
                } else {
                    "–".into()
                };
                let middle = if middle.is_finite() { format!("{middle:.0}") } else { "not".into() };
                let _ = writeln!(page, "| {subtask} | {level} | {name} | {each} | {middle} | {ratio} |");
            }
        }
    }
    page
}

/// The rate of all tests together.
fn pooled(rates: impl Iterator<Item = motion::Rate>) -> motion::Rate {
    let (count, of) = rates.fold((0, 0), |(count, of), rate| (count + rate.count, of + rate.of));
    motion::Rate::new(count, of)
}
