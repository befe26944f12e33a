//! Named vectors of `f32` in a file, as safetensors has them.

use std::collections::BTreeMap;
use std::io;
use std::path::Path;

use serde_json::{Map, Value, json};

/// What a file holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tensors {
    /// Texts by their name.
    pub notes: BTreeMap<String, String>,
    /// Vectors by their name.
    pub vectors: BTreeMap<String, Vec<f32>>,
}

impl Tensors {
    /// Writes them, in the order of their names, to a new file that then takes the place of the old one.
    ///
    /// # Errors
    /// As of [`std::fs::write`] and [`std::fs::rename`].
    pub fn save(&self, path: &Path) -> io::Result<()> {
        let mut header = Map::new();
        if !self.notes.is_empty() {
            header.insert("__metadata__".into(), json!(self.notes));
        }
        let mut at = 0;
        for (name, vector) in &self.vectors {
            let end = at + 4 * vector.len();
            header.insert(name.clone(), json!({"dtype": "F32", "shape": [vector.len()], "data_offsets": [at, end]}));
            at = end;
        }
        let mut text = Value::Object(header).to_string();
        text.extend(std::iter::repeat_n(' ', text.len().next_multiple_of(8) - text.len()));
        let mut bytes = Vec::with_capacity(8 + text.len() + at);
        bytes.extend_from_slice(&(text.len() as u64).to_le_bytes());
        bytes.extend_from_slice(text.as_bytes());
        for number in self.vectors.values().flatten() {
            bytes.extend_from_slice(&number.to_le_bytes());
        }
        let fresh = path.with_extension("fresh");
        std::fs::write(&fresh, bytes)?;
        std::fs::rename(fresh, path)
    }

    /// Reads a file that [`Tensors::save`] has written.
    ///
    /// # Errors
    /// What cannot be read, or is no such file.
    pub fn load(path: &Path) -> io::Result<Self> {
        let bad = |what: &str| io::Error::new(io::ErrorKind::InvalidData, format!("{}: {what}", path.display()));
        let bytes = std::fs::read(path)?;
        let (size, rest) = bytes.split_first_chunk::<8>().ok_or_else(|| bad("too short"))?;
        let size = usize::try_from(u64::from_le_bytes(*size)).unwrap_or(usize::MAX);
        let (header, data) = rest.split_at_checked(size).ok_or_else(|| bad("its header is cut off"))?;
        let header: Map<String, Value> =
            serde_json::from_slice(header).map_err(|error| bad(&format!("its header is no JSON: {error}")))?;
        let mut tensors = Self::default();
        for (name, value) in header {
            if name == "__metadata__" {
                tensors.notes = serde_json::from_value(value).map_err(|_| bad("notes are texts"))?;
                continue;
            }
            let [from, to]: [usize; 2] = serde_json::from_value(value["data_offsets"].clone())
                .map_err(|_| bad(&format!("{name} says not where it lies")))?;
            let slice = data.get(from..to).filter(|slice| slice.len() % 4 == 0 && value["dtype"] == "F32");
            let slice = slice.ok_or_else(|| bad(&format!("{name} is no vector of F32 within the file")))?;
            let (numbers, _) = slice.as_chunks::<4>();
            tensors.vectors.insert(name, numbers.iter().map(|bytes| f32::from_le_bytes(*bytes)).collect());
        }
        Ok(tensors)
    }

    /// A vector that must be there.
    ///
    /// # Errors
    /// It is not.
    pub fn vector(&self, name: &str) -> io::Result<&[f32]> {
        let missing = || io::Error::new(io::ErrorKind::InvalidData, format!("there is no {name} in it"));
        self.vectors.get(name).map(Vec::as_slice).ok_or_else(missing)
    }

    /// A number that must be among the notes.
    ///
    /// # Errors
    /// It is not.
    pub fn number<T: std::str::FromStr>(&self, name: &str) -> io::Result<T> {
        let missing = || io::Error::new(io::ErrorKind::InvalidData, format!("there is no number {name} in it"));
        self.notes.get(name).and_then(|text| text.parse().ok()).ok_or_else(missing)
    }
}
