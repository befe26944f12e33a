//! A cell: everything its files say, checked.

use crate::controller;
use crate::fault::Faults;
use crate::human::Human;
use crate::layout::Layout;
use crate::perception::Perception;
use crate::plant::Plant;
use crate::policies;
use crate::product::{self, Product};
use crate::read::{Bound, Reading, Table, bound};
use crate::robot::{Collision, Robot, RobotOptions};
use crate::strategy::{self, ReferenceRow, StrategyRow};
use crate::supervisor::Supervisor;
use crate::timing::{Realtime, Timing};
use std::path::{Component, Path, PathBuf};
use tandem_controller::Params;
use tandem_policy::Policies;

const HOME: Bound = bound("home_rad", "rad", -6.3, 6.3);
const ACCELERATION: Bound = bound("acceleration_max_rad_s2", "rad/s2", 0.1, 100.0);
const JERK: Bound = bound("jerk_max_rad_s3", "rad/s3", 1.0, 10_000.0);

/// Where the strategy library and the journal are kept.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Store {
    /// `sqlite:` or `mysql:` URL; `None` is a SQLite file in the user's state folder.
    pub url: Option<String>,
}

/// Everything the files of a cell say. [`Cell::load`] is the only way to make one.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Cell {
    /// Name of the cell, lower case.
    pub name: String,
    /// The cell file, as named by the user.
    pub file: PathBuf,
    /// Hash of all files read, blake3 cut to 64 bits: peers of another configuration are refused.
    pub hash: u64,
    /// The arm.
    pub robot: Robot,
    /// Limits and margins of the controller, with this cell's hash, period and resting configuration.
    pub controller: Params,
    /// When each role runs.
    pub timing: Timing,
    /// What is asked of the operating system.
    pub realtime: Realtime,
    /// What stands where.
    pub layout: Layout,
    /// The person.
    pub human: Human,
    /// The simulated hardware.
    pub plant: Plant,
    /// Recognition.
    pub perception: Perception,
    /// The supervisor's policy.
    pub supervisor: Supervisor,
    /// Where the library and the journal are kept.
    pub store: Store,
    /// Precomputed policies of the product, as far as there are any.
    pub policies: Policies,
    /// What is assembled.
    pub product: Product,
    /// Feature and parameters to mode and tool.
    pub reference: Vec<ReferenceRow>,
    /// What the strategy library is first filled with.
    pub strategies: Vec<StrategyRow>,
}

impl Cell {
    /// Reads a cell file and every file it names. `product` replaces the product the
    /// cell file names: a name in its products folder, or a path to a `.toml` file.
    ///
    /// # Errors
    /// All faults of all files.
    pub fn load(path: &Path, product: Option<&str>) -> Result<Self, Faults> {
        let reading = Reading::new();
        let cell = read(path, product, &reading);
        let (hash, faults) = reading.finish();
        match cell {
            Some(mut cell) if faults.is_empty() => {
                cell.hash = hash;
                cell.controller.config_hash = hash;
                cell.controller.home = cell.robot.home;
                // Link 0 does not move.
                cell.controller.moving_mass = cell.robot.links.iter().skip(1).map(|link| link.mass).sum();
                Ok(cell)
            }
            _ => Err(Faults::new(faults)),
        }
    }
}

fn read(path: &Path, product: Option<&str>, reading: &Reading) -> Option<Cell> {
    let document = reading.open(path, None)?;
    let parsed = document.parse(reading);
    let root = document.root(reading, &parsed);
    let folder = path.parent().unwrap_or(Path::new(""));

    // Every part is read before any is missed, so that one pass reports all faults.
    let name = root.text("name");
    let timing = Timing::read(&root);
    let controller = controller::read(&root, &timing);
    let realtime = Realtime::read(&root);
    let layout = Layout::read(&root);
    let human = Human::read(&root);
    let plant = Plant::read(&root);
    let perception = Perception::read(&root, folder);
    let supervisor = Supervisor::read(&root);
    let store = read_store(&root);
    let robot = read_robot(&root, folder, reading);
    let product = layout.as_ref().and_then(|layout| read_product(&root, product, folder, layout, reading));
    let policies = root
        .text_if("policies")
        .zip(product.as_ref())
        .map(|(models, product)| policies::read(&beside(folder, &models).join(&product.name), reading));
    let (reference, strategies) = read_strategies(&root, folder, reading);
    if reference.is_empty() || strategies.is_empty() {
        let found = format!("{} reference rows, {} strategies", reference.len(), strategies.len());
        root.refuse("strategies", &found, "at least one of each", "list the files of config/strategies");
    }

    let (mut perception, product) = (perception, product?);
    // A product that was transferred to is recognised by its own model.
    if let (Some(perception), Some(model)) = (&mut perception, &product.model) {
        perception.model.clone_from(model);
    }
    Some(Cell {
        name: name?,
        file: path.to_owned(),
        hash: 0,
        robot: robot?,
        controller,
        timing,
        realtime,
        layout: layout?,
        human: human?,
        plant: plant?,
        perception: perception?,
        supervisor: supervisor?,
        store,
        policies: policies.unwrap_or_default(),
        product,
        reference,
        strategies,
    })
}

/// The arm of the `[robot]` table: a URDF, and what the cell adds to it.
fn read_robot(root: &Table<'_>, folder: &Path, reading: &Reading) -> Option<Robot> {
    let table = root.table("robot")?;
    let file = beside(folder, &table.text("urdf")?);
    let list = |bound: &Bound| table.has(bound.key).then(|| table.list(bound));
    let options = RobotOptions {
        tcp: table.text_if("tcp"),
        home: list(&HOME),
        acceleration_max: list(&ACCELERATION),
        jerk_max: list(&JERK),
        locked: table.texts("locked"),
        packages: package_folders(folder, &table.texts("packages")),
        collision: read_collision(&table),
        srdf: read_srdf(&table, folder, reading),
    };
    let found = format!("\"{}\"", file.display());
    let document = reading.open(&file, Some(table.fault_at("urdf", &found, "a URDF file", "")))?;
    let robot = Robot::parse(&file, &document.text, &options).map_err(|faults| reading.note_all(faults)).ok()?;
    for mesh in &robot.meshes {
        reading.fold(mesh);
    }
    let joints = robot.chain.joint_count();
    for (key, list) in
        [(HOME.key, &options.home), (ACCELERATION.key, &options.acceleration_max), (JERK.key, &options.jerk_max)]
    {
        if let Some(list) = list.as_ref().filter(|list| list.len() != joints) {
            let found = format!("{} numbers", list.len());
            table.refuse(key, &found, &format!("{joints} numbers"), "write one for each moving joint, base first");
        }
    }
    for (index, joint) in robot.chain.joints().iter().enumerate() {
        let Some(position) = options.home.as_ref().and_then(|home| home.get(index)) else { continue };
        let (min, max) = (joint.position_min, joint.position_max);
        if !(min..=max).contains(position) {
            let allowed = format!("{min}..={max} rad");
            let advice = "keep the resting configuration within the joint's limits";
            table.refuse(HOME.key, &format!("{position} rad for {}", robot.joint_names[index]), &allowed, advice);
        }
    }
    Some(robot)
}

/// What stands for the collision geometry; capsules where the cell does not say.
fn read_collision(table: &Table<'_>) -> Collision {
    match table.text_if("collision").as_deref() {
        Some("hulls") => Collision::Hulls,
        Some("capsules") | None => Collision::Capsules,
        Some(other) => {
            table.refuse("collision", &format!("\"{other}\""), "capsules, hulls", "choose one of these names");
            Collision::Capsules
        }
    }
}

/// The folders of the cell file, beside it, then those of ROS_PACKAGE_PATH.
fn package_folders(folder: &Path, named: &[String]) -> Vec<PathBuf> {
    let of_environment = std::env::var_os("ROS_PACKAGE_PATH").unwrap_or_default();
    let named = named.iter().map(|name| beside(folder, name));
    named.chain(std::env::split_paths(&of_environment).filter(|path| !path.as_os_str().is_empty())).collect()
}

fn read_srdf(table: &Table<'_>, folder: &Path, reading: &Reading) -> Option<(PathBuf, String)> {
    let file = beside(folder, &table.text_if("srdf")?);
    let found = format!("\"{}\"", file.display());
    let document = reading.open(&file, Some(table.fault_at("srdf", &found, "an SRDF file", "")))?;
    Some((file, document.text))
}

fn read_store(root: &Table<'_>) -> Store {
    if !root.has("store") {
        return Store { url: None };
    }
    let url = root.table("store").and_then(|table| {
        let url = table.text_if("url")?;
        if !["sqlite:", "mysql:", "mariadb:"].iter().any(|scheme| url.starts_with(scheme)) {
            let scheme = url.split(':').next().unwrap_or_default();
            let advice = "write sqlite://FILE or mysql://USER@HOST/DATABASE";
            table.refuse("url", &format!("\"{scheme}:…\""), "sqlite:, mysql: or mariadb:", advice);
        }
        Some(url)
    });
    Store { url }
}

fn read_product(
    root: &Table<'_>,
    chosen: Option<&str>,
    folder: &Path,
    layout: &Layout,
    reading: &Reading,
) -> Option<Product> {
    let products = root.text("products").map(|products| beside(folder, &products));
    let named = root.text("product");
    let name = chosen.map(str::to_owned).or(named)?;
    let file = if name.ends_with(".toml") { PathBuf::from(&name) } else { products?.join(format!("{name}.toml")) };
    let found = format!("\"{name}\"");
    let asked = chosen.is_none().then(|| root.fault_at("product", &found, "a product of the products folder", ""));
    let document = reading.open(&file, asked)?;
    let parsed = document.parse(reading);
    let table = document.root(reading, &parsed);
    let folder = file.parent().unwrap_or(Path::new(""));
    let properties = table.text("properties").and_then(|properties| {
        let properties = beside(folder, &properties);
        let found = format!("\"{}\"", properties.display());
        reading.open(&properties, Some(table.fault_at("properties", &found, "a JSON file", "")))
    });
    Some(product::read(&table, folder, properties.as_ref(), layout, reading))
}

/// Reads the strategy files: all reference rows first, for the strategies refer to them.
fn read_strategies(root: &Table<'_>, folder: &Path, reading: &Reading) -> (Vec<ReferenceRow>, Vec<StrategyRow>) {
    let documents: Vec<_> = root
        .texts("strategies")
        .iter()
        .filter_map(|written| {
            let file = beside(folder, written);
            let found = format!("\"{}\"", file.display());
            reading.open(&file, Some(root.fault_at("strategies", &found, "a strategy file", "")))
        })
        .collect();
    let parsed: Vec<_> = documents.iter().map(|document| document.parse(reading)).collect();
    let roots: Vec<_> =
        documents.iter().zip(&parsed).map(|(document, parsed)| document.root(reading, parsed)).collect();
    let reference: Vec<_> =
        roots.iter().filter(|root| root.has("reference")).flat_map(strategy::read_reference).collect();
    let mut strategies = Vec::new();
    for root in &roots {
        strategy::read_strategies(root, &reference, &mut strategies);
    }
    (reference, strategies)
}

/// A path as written in a file of `folder`, without detours.
pub(crate) fn beside(folder: &Path, written: &str) -> PathBuf {
    let mut out = PathBuf::new();
    for component in folder.join(written).components() {
        match component {
            Component::ParentDir if matches!(out.components().next_back(), Some(Component::Normal(_))) => {
                out.pop();
            }
            Component::CurDir => {}
            other => out.push(other),
        }
    }
    out
}
