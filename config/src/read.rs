//! Walks a TOML document value by value and keeps every fault it meets.
//!
//! A reader never stops at a fault: it notes it, answers with a value inside the
//! bounds, and goes on, so that one pass over all files finds everything. What the
//! walk did not ask for is reported as an unknown key when the table is dropped.

use crate::fault::Fault;
use nalgebra::{Isometry3, Translation3, UnitQuaternion};
use std::cell::RefCell;
use std::collections::BTreeSet;
use std::ops::Range;
use std::path::Path;
use tandem_msg::Coded;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// The one declaration of a number's place, unit and bounds.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bound {
    /// Key in its table; ends in the unit's name.
    pub(crate) key: &'static str,
    /// Unit as it is printed; empty for pure numbers.
    pub(crate) unit: &'static str,
    /// Smallest allowed value.
    pub(crate) min: f64,
    /// Largest allowed value.
    pub(crate) max: f64,
}

/// Declares a [`Bound`].
pub(crate) const fn bound(key: &'static str, unit: &'static str, min: f64, max: f64) -> Bound {
    Bound { key, unit, min, max }
}

impl Bound {
    fn with_unit(&self, text: &str) -> String {
        if self.unit.is_empty() { text.to_owned() } else { format!("{text} {}", self.unit) }
    }

    fn allowed(&self) -> String {
        self.with_unit(&format!("{}..={}", self.min, self.max))
    }
}

/// Everything read so far: the faults, and the hash over all bytes.
pub(crate) struct Reading {
    faults: RefCell<Vec<Fault>>,
    hasher: RefCell<blake3::Hasher>,
}

/// A file's name and text, kept while its tables are walked.
pub(crate) struct Document {
    /// Name as the user knows it.
    pub(crate) file: String,
    /// Its whole text.
    pub(crate) text: String,
}

impl Reading {
    pub(crate) fn new() -> Self {
        Self { faults: RefCell::default(), hasher: RefCell::new(blake3::Hasher::new()) }
    }

    /// Reads a file and folds it into the hash. `None` and a fault when it cannot be
    /// read; the fault names the value that asked for the file, when there is one.
    pub(crate) fn open(&self, path: &Path, asked: Option<Fault>) -> Option<Document> {
        match std::fs::read(path) {
            Ok(bytes) => {
                let mut hasher = self.hasher.borrow_mut();
                hasher.update(&(bytes.len() as u64).to_le_bytes());
                hasher.update(&bytes);
                match String::from_utf8(bytes) {
                    Ok(text) => Some(Document { file: path.display().to_string(), text }),
                    Err(_) => {
                        self.note(Fault {
                            file: path.display().to_string(),
                            line: 0,
                            column: 0,
                            field: String::new(),
                            found: "not text".into(),
                            allowed: "UTF-8".into(),
                            advice: "save the file as UTF-8 text".into(),
                        });
                        None
                    }
                }
            }
            Err(error) => {
                let why = match error.kind() {
                    std::io::ErrorKind::NotFound => "no such file".to_owned(),
                    _ => error.to_string(),
                };
                let advice = format!("{}: {why}; name a file that can be read", path.display());
                self.note(asked.map_or_else(
                    || Fault {
                        file: path.display().to_string(),
                        line: 0,
                        column: 0,
                        field: String::new(),
                        found: why.clone(),
                        allowed: String::new(),
                        advice: "name a file that can be read".into(),
                    },
                    |fault| Fault { advice, ..fault },
                ));
                None
            }
        }
    }

    /// Folds a file that was read elsewhere into the hash.
    pub(crate) fn fold(&self, path: &Path) {
        let bytes = std::fs::read(path).unwrap_or_default();
        let mut hasher = self.hasher.borrow_mut();
        hasher.update(&(bytes.len() as u64).to_le_bytes());
        hasher.update(&bytes);
    }

    pub(crate) fn note(&self, fault: Fault) {
        self.faults.borrow_mut().push(fault);
    }

    pub(crate) fn note_all(&self, faults: Vec<Fault>) {
        self.faults.borrow_mut().extend(faults);
    }

    /// The hash over all files read, and all faults found.
    pub(crate) fn finish(self) -> (u64, Vec<Fault>) {
        let hash = *self.hasher.into_inner().finalize().as_bytes();
        let first = [hash[0], hash[1], hash[2], hash[3], hash[4], hash[5], hash[6], hash[7]];
        (u64::from_le_bytes(first), self.faults.into_inner())
    }
}

impl Document {
    /// Parses the text; syntax faults are noted, and what could be understood is returned.
    pub(crate) fn parse<'d>(&'d self, reading: &'d Reading) -> Spanned<DeTable<'d>> {
        let (root, errors) = DeTable::parse_recoverable(&self.text);
        for error in errors {
            let (line, column) = self.place(error.span().map_or(0, |span| span.start));
            reading.note(Fault {
                file: self.file.clone(),
                line,
                column,
                field: String::new(),
                found: format!("not TOML: {}", error.message()),
                allowed: String::new(),
                advice: "mend the syntax".into(),
            });
        }
        root
    }

    /// The table at the root of a parsed document.
    pub(crate) fn root<'d>(&'d self, reading: &'d Reading, parsed: &'d Spanned<DeTable<'d>>) -> Table<'d> {
        Table {
            reading,
            document: self,
            path: String::new(),
            start: parsed.span().start,
            entries: parsed.get_ref(),
            taken: RefCell::default(),
        }
    }

    /// Line and column, both from 1, of a byte offset.
    fn place(&self, offset: usize) -> (usize, usize) {
        let before = &self.text[..self.text.floor_char_boundary(offset)];
        let line_start = before.rfind('\n').map_or(0, |at| at + 1);
        (before.matches('\n').count() + 1, before[line_start..].chars().count() + 1)
    }
}

/// One table of a document under inspection.
pub(crate) struct Table<'d> {
    reading: &'d Reading,
    document: &'d Document,
    path: String,
    start: usize,
    entries: &'d DeTable<'d>,
    taken: RefCell<BTreeSet<String>>,
}

impl<'d> Table<'d> {
    fn field(&self, key: &str) -> String {
        if self.path.is_empty() { key.to_owned() } else { format!("{}.{key}", self.path) }
    }

    fn take(&self, key: &str) -> Option<&'d Spanned<DeValue<'d>>> {
        self.taken.borrow_mut().insert(key.to_owned());
        self.entries.get(key)
    }

    /// Whether the key stands in the file.
    pub(crate) fn has(&self, key: &str) -> bool {
        self.taken.borrow_mut().insert(key.to_owned());
        self.entries.contains_key(key)
    }

    fn fault_in(&self, span: Range<usize>, field: String, found: String, allowed: &str, advice: &str) -> Fault {
        let (line, column) = self.document.place(span.start);
        Fault {
            file: self.document.file.clone(),
            line,
            column,
            field,
            found,
            allowed: allowed.to_owned(),
            advice: advice.to_owned(),
        }
    }

    /// A fault at the value of `key` (or at the table when it is absent), not yet noted.
    pub(crate) fn fault_at(&self, key: &str, found: &str, allowed: &str, advice: &str) -> Fault {
        let span = self.entries.get(key).map_or(self.start..self.start, Spanned::span);
        self.fault_in(span, self.field(key), found.to_owned(), allowed, advice)
    }

    /// Notes a fault at the value of `key`.
    pub(crate) fn refuse(&self, key: &str, found: &str, allowed: &str, advice: &str) {
        self.reading.note(self.fault_at(key, found, allowed, advice));
    }

    fn missing(&self, key: &str, allowed: &str) {
        self.refuse(key, "missing", allowed, "add it");
    }

    fn wrong_type(&self, key: &str, value: &Spanned<DeValue<'_>>, wanted: &str) {
        let found = kind_of(value);
        self.reading.note(self.fault_in(value.span(), self.field(key), found, wanted, "write it as that"));
    }

    fn check(&self, bound: &Bound, field: String, value: &Spanned<DeValue<'_>>) -> f64 {
        let (number, text) = match value.get_ref() {
            DeValue::Float(float) => (float.as_str().replace('_', "").parse::<f64>().ok(), float.to_string()),
            DeValue::Integer(integer) => {
                let digits = integer.as_str().replace('_', "");
                (i64::from_str_radix(&digits, integer.radix()).ok().map(|n| n as f64), integer.to_string())
            }
            _ => {
                let found = kind_of(value);
                let fault = self.fault_in(value.span(), field, found, &bound.allowed(), "write a number");
                self.reading.note(fault);
                return bound.min;
            }
        };
        match number {
            Some(number) if (bound.min..=bound.max).contains(&number) => number,
            _ => {
                let advice = "choose a value within these bounds";
                let found = bound.with_unit(&text);
                self.reading.note(self.fault_in(value.span(), field, found, &bound.allowed(), advice));
                bound.min
            }
        }
    }

    /// A number within its bounds; a fault and the lower bound otherwise.
    pub(crate) fn number(&self, bound: &Bound) -> f64 {
        match self.take(bound.key) {
            Some(value) => self.check(bound, self.field(bound.key), value),
            None => {
                self.missing(bound.key, &bound.allowed());
                bound.min
            }
        }
    }

    /// As [`Table::number`], or `absent` when the key does not stand there.
    pub(crate) fn number_or(&self, bound: &Bound, absent: f64) -> f64 {
        if self.has(bound.key) { self.number(bound) } else { absent }
    }

    /// A whole number within its bounds.
    pub(crate) fn whole(&self, bound: &Bound) -> u32 {
        let number = self.number(bound);
        if number.fract() != 0.0 {
            self.refuse(bound.key, &bound.with_unit(&number.to_string()), "whole numbers", "drop the fraction");
        }
        number as u32
    }

    /// `N` numbers, each within the same bounds.
    pub(crate) fn numbers<const N: usize>(&self, bound: &Bound) -> [f64; N] {
        let allowed = format!("{N} numbers, each {}", bound.allowed());
        let Some(value) = self.take(bound.key) else {
            self.missing(bound.key, &allowed);
            return [bound.min; N];
        };
        match value.get_ref().as_array() {
            Some(array) if array.len() == N => {
                let mut out = [bound.min; N];
                for (index, item) in array.iter().enumerate() {
                    out[index] = self.check(bound, format!("{}[{index}]", self.field(bound.key)), item);
                }
                out
            }
            Some(array) => {
                let found = format!("{} numbers", array.len());
                self.refuse(bound.key, &found, &allowed, "write as many numbers as that");
                [bound.min; N]
            }
            None => {
                self.wrong_type(bound.key, value, &allowed);
                [bound.min; N]
            }
        }
    }

    /// As many numbers as stand there, each within the same bounds.
    pub(crate) fn list(&self, bound: &Bound) -> Vec<f64> {
        let Some(value) = self.take(bound.key) else { return Vec::new() };
        let Some(array) = value.get_ref().as_array() else {
            self.wrong_type(bound.key, value, &format!("numbers, each {}", bound.allowed()));
            return Vec::new();
        };
        let item = |(index, item)| self.check(bound, format!("{}[{index}]", self.field(bound.key)), item);
        array.iter().enumerate().map(item).collect()
    }

    /// A text that is not empty.
    pub(crate) fn text(&self, key: &str) -> Option<String> {
        let Some(value) = self.take(key) else {
            self.missing(key, "a text");
            return None;
        };
        match value.get_ref().as_str() {
            Some("") => {
                self.refuse(key, "\"\"", "a text", "write one");
                None
            }
            Some(text) => Some(text.to_owned()),
            None => {
                self.wrong_type(key, value, "a text");
                None
            }
        }
    }

    /// As [`Table::text`], or `None` without a fault when the key does not stand there.
    pub(crate) fn text_if(&self, key: &str) -> Option<String> {
        if self.has(key) { self.text(key) } else { None }
    }

    /// A list of texts; empty when the key does not stand there.
    pub(crate) fn texts(&self, key: &str) -> Vec<String> {
        let Some(value) = self.take(key) else {
            return Vec::new();
        };
        let Some(array) = value.get_ref().as_array() else {
            self.wrong_type(key, value, "a list of texts");
            return Vec::new();
        };
        let mut out = Vec::new();
        for item in array.iter() {
            match item.get_ref().as_str() {
                Some(text) => out.push(text.to_owned()),
                None => self.wrong_type(key, item, "a list of texts"),
            }
        }
        out
    }

    /// A truth value; a fault and `false` when it is missing or something else.
    pub(crate) fn flag(&self, key: &str) -> bool {
        match self.take(key) {
            Some(value) => value.get_ref().as_bool().unwrap_or_else(|| {
                self.wrong_type(key, value, "true or false");
                false
            }),
            None => {
                self.missing(key, "true or false");
                false
            }
        }
    }

    /// One of an enumeration's names.
    pub(crate) fn named<T: Coded>(&self, key: &str) -> Option<T> {
        let text = self.text(key)?;
        let found = T::named(&text);
        if found.is_none() {
            let names: Vec<_> = T::ALL.iter().map(|variant| variant.name()).collect();
            self.refuse(key, &format!("\"{text}\""), &names.join(", "), "choose one of these names");
        }
        found
    }

    /// As [`Table::named`], or `None` without a fault when the key does not stand there.
    pub(crate) fn named_if<T: Coded>(&self, key: &str) -> Option<T> {
        if self.has(key) { self.named(key) } else { None }
    }

    /// The table under `key`.
    pub(crate) fn table(&self, key: &str) -> Option<Table<'d>> {
        let Some(value) = self.take(key) else {
            self.missing(key, "a table");
            return None;
        };
        let inner = self.inner(self.field(key), value);
        if inner.is_none() {
            self.wrong_type(key, value, "a table");
        }
        inner
    }

    /// The tables of the list under `key`; empty, without a fault, when it does not stand there.
    pub(crate) fn tables(&self, key: &str) -> Vec<Table<'d>> {
        let Some(value) = self.take(key) else {
            return Vec::new();
        };
        let Some(array) = value.get_ref().as_array() else {
            self.wrong_type(key, value, "a list of tables");
            return Vec::new();
        };
        let mut out = Vec::new();
        for (index, item) in array.iter().enumerate() {
            match self.inner(format!("{}[{index}]", self.field(key)), item) {
                Some(table) => out.push(table),
                None => self.wrong_type(key, item, "a list of tables"),
            }
        }
        out
    }

    fn inner(&self, path: String, value: &'d Spanned<DeValue<'d>>) -> Option<Table<'d>> {
        Some(Table {
            reading: self.reading,
            document: self.document,
            path,
            start: value.span().start,
            entries: value.get_ref().as_table()?,
            taken: RefCell::default(),
        })
    }

    /// A pose: `position_m` and, when it is turned, `rpy_rad` (fixed-axis roll, pitch, yaw).
    pub(crate) fn pose(&self, key: &str) -> Isometry3<f64> {
        self.table(key).map_or_else(Isometry3::identity, |table| table.own_pose())
    }

    /// The pose whose numbers stand directly in this table.
    pub(crate) fn own_pose(&self) -> Isometry3<f64> {
        const POSITION: Bound = bound("position_m", "m", -5.0, 5.0);
        const TURN: Bound = bound("rpy_rad", "rad", -6.3, 6.3);
        let position: [f64; 3] = self.numbers(&POSITION);
        let [roll, pitch, yaw] = if self.has(TURN.key) { self.numbers(&TURN) } else { [0.0; 3] };
        Isometry3::from_parts(Translation3::from(position), UnitQuaternion::from_euler_angles(roll, pitch, yaw))
    }

    /// The key of this table that begins with `stem`.
    pub(crate) fn key_beginning_with(&self, stem: &str) -> Option<String> {
        self.entries.keys().map(|key| key.get_ref().to_string()).find(|key| key.starts_with(stem))
    }
}

impl Drop for Table<'_> {
    fn drop(&mut self) {
        let taken = self.taken.borrow();
        for (key, _) in self.entries.iter() {
            let name = key.get_ref().as_ref();
            if !taken.contains(name) {
                let advice = match nearest(name, &taken) {
                    Some(known) => format!("did you mean `{known}`?"),
                    None if taken.is_empty() => "remove it".to_owned(),
                    None => {
                        let known: Vec<_> = taken.iter().map(String::as_str).collect();
                        format!("remove it, or use one of: {}", known.join(", "))
                    }
                };
                self.reading.note(self.fault_in(key.span(), self.field(name), "unknown".into(), "", &advice));
            }
        }
    }
}

/// What stands there instead, with its article.
fn kind_of(value: &Spanned<DeValue<'_>>) -> String {
    let kind = value.get_ref().type_str();
    let article = if kind.starts_with(['a', 'i']) { "an" } else { "a" };
    format!("{article} {kind}")
}

/// The known key that differs from `name` only in its unit, or by at most two letters.
fn nearest<'k>(name: &str, known: &'k BTreeSet<String>) -> Option<&'k str> {
    let stem = |key: &str| -> String {
        const UNITS: [&str; 20] = [
            "us", "ms", "ns", "s", "hz", "m", "mm", "cm", "rad", "deg", "kg", "g", "n", "nm", "rpm", "s2", "s3", "min",
            "pct", "percent",
        ];
        let mut words: Vec<&str> = key.split('_').collect();
        while words.len() > 1 && words.last().is_some_and(|word| UNITS.contains(word)) {
            words.pop();
        }
        words.join("_")
    };
    let by_stem = known.iter().find(|key| stem(key) == stem(name));
    by_stem
        .or_else(|| {
            let near = known.iter().map(|key| (distance(name, key), key)).min()?;
            (near.0 <= 2).then_some(near.1)
        })
        .map(String::as_str)
}

/// Levenshtein distance.
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let next = (diagonal + usize::from(x != *y)).min(row[j] + 1).min(row[j + 1] + 1);
            diagonal = row[j + 1];
            row[j + 1] = next;
        }
    }
    row[b.len()]
}
