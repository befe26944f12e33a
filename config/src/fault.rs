//! What is wrong with a cell's files, told so that it can be mended.

use serde::Serialize;
use std::fmt;

/// One fault of one file: where, what was found, what is allowed, what to do.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct Fault {
    /// File as it was named on the command line or in the file that asked for it.
    pub file: String,
    /// Line from 1; 0 when the fault is of the file as a whole.
    pub line: usize,
    /// Column from 1, in characters; 0 when the fault is of the file as a whole.
    pub column: usize,
    /// Dotted path of the value; empty when the fault is of the file as a whole.
    pub field: String,
    /// The value with its unit, or a word such as `missing`.
    pub found: String,
    /// What may stand there, with its unit; empty when the advice says it all.
    pub allowed: String,
    /// What to do.
    pub advice: String,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.file)?;
        if self.line > 0 {
            write!(f, ":{}:{}", self.line, self.column)?;
        }
        f.write_str(": ")?;
        match (self.field.as_str(), self.found.as_str()) {
            ("", found) => f.write_str(found)?,
            (field, "missing") => write!(f, "{field} is missing")?,
            (field, "unknown") => write!(f, "unknown key `{field}`")?,
            (field, found) => write!(f, "{field} = {found}")?,
        }
        if !self.allowed.is_empty() {
            write!(f, ", allowed {}", self.allowed)?;
        }
        write!(f, "; {}", self.advice)
    }
}

/// Every fault of every file of a cell, in the order of file, line and column.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(transparent)]
pub struct Faults(Vec<Fault>);

impl Faults {
    pub(crate) fn new(mut faults: Vec<Fault>) -> Self {
        faults.sort();
        faults.dedup();
        Self(faults)
    }

    /// The faults, never none.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = &Fault> {
        self.0.iter()
    }
}

impl fmt::Display for Faults {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (index, fault) in self.0.iter().enumerate() {
            if index > 0 {
                f.write_str("\n")?;
            }
            write!(f, "{fault}")?;
        }
        Ok(())
    }
}

impl std::error::Error for Faults {}
