//! The reference table and the strategies a library is first filled with.
//!
//! The paper counts eight assembly modes and four tools (Fig. 4) and names none of
//! them; the names here are ours. A strategy has the four parts of Section 2.1(3):
//! subjects, actions, trajectory (planned for each action when it is due) and sequence.

use crate::read::{Bound, Table, bound};
use tandem_msg::{Coded, FeatureClass, Tool};

/// Declares an enumeration of this crate with its names in files and database.
macro_rules! named {
    ($(#[$meta:meta])* enum $name:ident { $($(#[$vmeta:meta])* $variant:ident = $text:literal,)+ }) => {
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
        pub enum $name { $($(#[$vmeta])* $variant,)+ }
        impl Coded for $name {
            const ALL: &'static [Self] = &[$(Self::$variant,)+];
            fn code(self) -> u32 { self as u32 }
            fn name(self) -> &'static str { match self { $(Self::$variant => $text,)+ } }
        }
        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result { f.pad(self.name()) }
        }
    };
}

named! {
    /// How two parts are joined: the eight modes of Fig. 4.
    enum AssemblyMode {
        /// Turned home along a thread.
        Thread = "thread",
        /// Slid along an axis into or onto a plain fit.
        Insert = "insert",
        /// Forced into an interference fit.
        Press = "press",
        /// Slid along a slot or groove.
        Slide = "slide",
        /// Centred and seated on a taper.
        Taper = "taper",
        /// Snapped into a buckle.
        Snap = "snap",
        /// Laid down, held by its weight or by what follows.
        Lay = "lay",
        /// Stuck on by its own adhesive.
        Stick = "stick",
    }
}

named! {
    /// Who does the final assembly (Section 2.1(3)).
    enum Focus {
        /// The robot.
        Robot = "robot",
        /// The person.
        Human = "human",
    }
}

named! {
    /// The forms of cooperation of Fig. 5: one robot-focused, three human-focused.
    enum Form {
        /// The robot does all of it.
        Robot = "robot",
        /// The person fetches and assembles the part.
        Alone = "alone",
        /// The robot hands the part over, the person assembles it.
        HandOver = "hand_over",
        /// The robot holds the part while the person assembles it.
        Hold = "hold",
    }
}

named! {
    /// Who carries out an action.
    enum Subject {
        /// The robot.
        Robot = "robot",
        /// The person.
        Human = "human",
    }
}

named! {
    /// What is done in one action of a sequence.
    enum Verb {
        /// Couple the tool the reference table asks for.
        ChangeTool = "change_tool",
        /// Take the part from its station.
        Grasp = "grasp",
        /// Carry it to above its place.
        Transfer = "transfer",
        /// Set it down at its place.
        Place = "place",
        /// Join it: turn or press it home.
        Assemble = "assemble",
        /// Offer it to the person.
        HandOver = "hand_over",
        /// Hold it above its place.
        Hold = "hold",
        /// Let go of it and withdraw.
        Release = "release",
        /// Person: fetch the part and assemble it.
        FetchAndAssemble = "fetch_and_assemble",
        /// Person: take the part out of the tool.
        Receive = "receive",
        /// Person: assemble the part that was taken over.
        Finish = "finish",
        /// Person: assemble the part while the robot holds it.
        AssembleHeld = "assemble_held",
    }
}

impl Verb {
    /// Who can do it.
    pub fn subject(self) -> Subject {
        match self {
            Self::FetchAndAssemble | Self::Receive | Self::Finish | Self::AssembleHeld => Subject::Human,
            _ => Subject::Robot,
        }
    }
}

/// One action of a sequence: who does what.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Step {
    /// Who.
    pub subject: Subject,
    /// What.
    pub verb: Verb,
}

/// A closed range of a quantity; the default holds every finite number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Smallest value in it.
    pub min: f64,
    /// Largest value in it.
    pub max: f64,
}

impl Range {
    /// Every quantity this cell can measure.
    pub const ALL: Self = Self { min: 0.0, max: 1e6 };

    /// Whether the value lies in it; never for a value that is not finite.
    pub fn contains(&self, value: f64) -> bool {
        value >= self.min && value <= self.max
    }
}

/// One row of the reference table: feature and parameters to mode and tool (Fig. 4).
#[derive(Clone, Debug, PartialEq)]
pub struct ReferenceRow {
    /// Class of the feature.
    pub class: FeatureClass,
    /// Diameter of the feature, metres.
    pub diameter: Range,
    /// Length of the feature, metres.
    pub length: Range,
    /// Whether the part is oily; `None` when it does not matter.
    pub oily: Option<bool>,
    /// Whether the part is flexible; `None` when it does not matter.
    pub flexible: Option<bool>,
    /// How it is joined.
    pub mode: AssemblyMode,
    /// With which tool.
    pub tool: Tool,
    /// Torque (Nm) or force (N) of the final action; 0 when it needs none.
    pub effort: f64,
}

/// One row of the strategy library.
#[derive(Clone, Debug, PartialEq)]
pub struct StrategyRow {
    /// Lower-case identity, unique in the library.
    pub id: String,
    /// Class of the feature.
    pub class: FeatureClass,
    /// Diameter of the feature, metres.
    pub diameter: Range,
    /// Length of the feature, metres.
    pub length: Range,
    /// Mode it is for.
    pub mode: AssemblyMode,
    /// Tool it needs.
    pub tool: Tool,
    /// Who does the final assembly.
    pub focus: Focus,
    /// Form of cooperation.
    pub form: Form,
    /// Distance between part and person, metres.
    pub distance: Range,
    /// Mass of the part, kg.
    pub mass: Range,
    /// Whether the part is flexible; `None` when it does not matter.
    pub flexible: Option<bool>,
    /// What is done, in order.
    pub steps: Vec<Step>,
}

const LIMIT: f64 = 1e6;
const DIAMETER: Bound = bound("diameter_m", "m", 0.0, LIMIT);
const LENGTH: Bound = bound("length_m", "m", 0.0, LIMIT);
const DISTANCE: Bound = bound("distance_m", "m", 0.0, LIMIT);
const MASS: Bound = bound("mass_kg", "kg", 0.0, LIMIT);
const EFFORT: Bound = bound("effort", "Nm or N", 0.0, 5000.0);

fn range(table: &Table<'_>, bound: &Bound) -> Range {
    if !table.has(bound.key) {
        return Range::ALL;
    }
    let [min, max] = table.numbers(bound);
    if min > max {
        table.refuse(bound.key, &format!("{min}..{max}"), "smaller number first", "swap the two numbers");
    }
    Range { min, max }
}

fn names<T: Coded>(table: &Table<'_>, key: &str) -> Vec<T> {
    let allowed = || T::ALL.iter().map(|variant| variant.name()).collect::<Vec<_>>().join(", ");
    let texts = table.texts(key);
    if texts.is_empty() {
        table.refuse(key, "missing", &allowed(), "list at least one");
    }
    texts
        .iter()
        .filter_map(|text| {
            let found = T::named(text);
            if found.is_none() {
                table.refuse(key, &format!("\"{text}\""), &allowed(), "choose from these names");
            }
            found
        })
        .collect()
}

fn flag_if(table: &Table<'_>, key: &str) -> Option<bool> {
    table.has(key).then(|| table.flag(key))
}

/// Reads `[[reference]]`, one row a class.
pub(crate) fn read_reference(root: &Table<'_>) -> Vec<ReferenceRow> {
    let mut rows = Vec::new();
    for table in root.tables("reference") {
        let template = ReferenceRow {
            class: FeatureClass::Other,
            diameter: range(&table, &DIAMETER),
            length: range(&table, &LENGTH),
            oily: flag_if(&table, "oily"),
            flexible: flag_if(&table, "flexible"),
            mode: table.named("mode").unwrap_or(AssemblyMode::Lay),
            tool: table.named("tool").unwrap_or(Tool::ParallelGripper),
            effort: table.number(&EFFORT),
        };
        if template.tool == Tool::None {
            table.refuse("tool", "\"none\"", "one of the four tools", "name the tool the mode needs");
        }
        if template.tool == Tool::VacuumGripper && template.oily != Some(false) {
            table.refuse("oily", "not false", "false", "suction does not hold an oily part: write `oily = false`");
        }
        for class in names::<FeatureClass>(&table, "classes") {
            rows.push(ReferenceRow { class, ..template.clone() });
        }
    }
    if rows.is_empty() {
        root.refuse("reference", "missing", "at least one row", "add [[reference]] rows");
    }
    rows
}

/// Reads `[[strategy]]`: one row for each class, mode and tool it names and the reference
/// table leads to. Without `modes` or `tools` it is for all that the table leads to.
pub(crate) fn read_strategies(root: &Table<'_>, reference: &[ReferenceRow], rows: &mut Vec<StrategyRow>) {
    for table in root.tables("strategy") {
        let name = table.text("name").unwrap_or_default();
        if !name.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_') || name.len() > 32 {
            let allowed = "at most 32 of a-z, 0-9, _";
            table.refuse("name", &format!("\"{name}\""), allowed, "names are database keys: keep them plain");
        }
        let form: Form = table.named("form").unwrap_or(Form::Robot);
        let focus = if form == Form::Robot { Focus::Robot } else { Focus::Human };
        let mut steps = Vec::new();
        for verb in names::<Verb>(&table, "actions") {
            steps.push(Step { subject: verb.subject(), verb });
        }
        check_sequence(&table, form, &steps);
        let classes: Vec<FeatureClass> = names(&table, "classes");
        let modes: Option<Vec<AssemblyMode>> = table.has("modes").then(|| names(&table, "modes"));
        let tools: Option<Vec<Tool>> = table.has("tools").then(|| names(&table, "tools"));
        let template = StrategyRow {
            id: String::new(),
            class: FeatureClass::Other,
            diameter: range(&table, &DIAMETER),
            length: range(&table, &LENGTH),
            mode: AssemblyMode::Lay,
            tool: Tool::None,
            focus,
            form,
            distance: range(&table, &DISTANCE),
            mass: range(&table, &MASS),
            flexible: flag_if(&table, "flexible"),
            steps,
        };
        let before = rows.len();
        for &class in &classes {
            for found in reference.iter().filter(|found| found.class == class) {
                let (mode, tool) = (found.mode, found.tool);
                let wanted = modes.as_ref().is_none_or(|modes| modes.contains(&mode))
                    && tools.as_ref().is_none_or(|tools| tools.contains(&tool));
                let id = format!("{name}/{class}/{mode}/{tool}");
                if !wanted || rows[before..].iter().any(|row| row.id == id) {
                    continue;
                }
                if rows[..before].iter().any(|row| row.id == id) {
                    table.refuse("name", &format!("\"{name}\""), "a name used once", "give each strategy its own name");
                }
                rows.push(StrategyRow { id, class, mode, tool, ..template.clone() });
            }
        }
        if rows.len() == before && !classes.is_empty() && !reference.is_empty() {
            let advice = "name classes, modes and tools that a row of the reference table leads to";
            table.refuse("classes", &format!("{} classes", classes.len()), "a strategy that can be retrieved", advice);
        }
    }
}

/// A sequence must be one the dispatcher can carry out: it begins and ends with empty hands.
fn check_sequence(table: &Table<'_>, form: Form, steps: &[Step]) {
    use Verb as V;
    let verbs: Vec<Verb> = steps.iter().map(|step| step.verb).collect();
    let allowed: &[&[Verb]] = match form {
        Form::Robot => &[
            &[V::ChangeTool, V::Grasp, V::Transfer, V::Place],
            &[V::ChangeTool, V::Grasp, V::Transfer, V::Place, V::Assemble],
        ],
        Form::Alone => &[&[V::FetchAndAssemble]],
        Form::HandOver => &[&[V::ChangeTool, V::Grasp, V::HandOver, V::Receive, V::Release, V::Finish]],
        Form::Hold => &[&[V::ChangeTool, V::Grasp, V::Hold, V::AssembleHeld, V::Release]],
    };
    if !allowed.contains(&verbs.as_slice()) {
        let join = |verbs: &[Verb]| verbs.iter().map(|verb| verb.name()).collect::<Vec<_>>().join(", ");
        let choices: Vec<String> = allowed.iter().map(|verbs| format!("[{}]", join(verbs))).collect();
        table.refuse(
            "actions",
            &format!("[{}]", join(&verbs)),
            &choices.join(" or "),
            &format!("write a sequence of form {form}"),
        );
    }
}
