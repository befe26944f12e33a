//! Point clouds: PLY, PCD, NPY.

use super::Fault;

/// A scalar type of a file.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Scalar {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Scalar {
    fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::F64 => 8,
        }
    }

    /// The number in the first bytes, of which there are enough.
    fn number(self, bytes: &[u8], big_endian: bool) -> f64 {
        let mut raw = [0_u8; 8];
        let size = self.size();
        raw[..size].copy_from_slice(&bytes[..size]);
        if big_endian {
            raw[..size].reverse();
        }
        let [a, b, c, d, ..] = raw;
        match self {
            Self::I8 => f64::from(a as i8),
            Self::U8 => f64::from(a),
            Self::I16 => f64::from(i16::from_le_bytes([a, b])),
            Self::U16 => f64::from(u16::from_le_bytes([a, b])),
            Self::I32 => f64::from(i32::from_le_bytes([a, b, c, d])),
            Self::U32 => f64::from(u32::from_le_bytes([a, b, c, d])),
            Self::F32 => f64::from(f32::from_le_bytes([a, b, c, d])),
            Self::F64 => f64::from_le_bytes(raw),
        }
    }
}

/// Columns of a table of points.
struct Columns {
    scalars: Vec<Scalar>,
    /// Which of them are x, y, z.
    xyz: [usize; 3],
}

impl Columns {
    fn new(fields: &[(String, Scalar)], place: &str) -> Result<Self, Fault> {
        let mut xyz = [0; 3];
        for (at, name) in xyz.iter_mut().zip(["x", "y", "z"]) {
            let found = fields.iter().map(|(n, _)| n.as_str()).collect::<Vec<_>>().join(", ");
            *at = fields
                .iter()
                .position(|(n, _)| n == name)
                .ok_or_else(|| Fault::new(place, format!("fields {found}"), format!("a field {name}")))?;
        }
        Ok(Self { scalars: fields.iter().map(|(_, s)| *s).collect(), xyz })
    }

    fn binary(&self, bytes: &[u8], count: usize, big_endian: bool) -> Result<Vec<[f64; 3]>, Fault> {
        let row: usize = self.scalars.iter().map(|s| s.size()).sum();
        let needed = count.checked_mul(row);
        if needed.is_none_or(|needed| bytes.len() < needed) {
            return Err(Fault::new(
                format!("point {}", bytes.len() / row.max(1)),
                format!("{} bytes of data", bytes.len()),
                format!("{count} points of {row} bytes"),
            ));
        }
        let start = self.xyz.map(|k| self.scalars[..k].iter().map(|s| s.size()).sum::<usize>());
        let point = |row: &[u8]| [0, 1, 2].map(|k| self.scalars[self.xyz[k]].number(&row[start[k]..], big_endian));
        Ok(bytes.chunks_exact(row).take(count).map(point).collect())
    }

    /// Rows of text, the first of which is line `first` of the file.
    fn ascii<'a>(
        &self,
        lines: impl Iterator<Item = &'a str>,
        count: usize,
        first: usize,
    ) -> Result<Vec<[f64; 3]>, Fault> {
        let mut points = Vec::new();
        for (i, line) in lines.enumerate().filter(|(_, line)| !line.trim().is_empty()).take(count) {
            let words: Vec<&str> = line.split_whitespace().collect();
            let mut point = [0.0; 3];
            for (v, k) in point.iter_mut().zip(self.xyz) {
                let word = words.get(k).copied().unwrap_or("nothing");
                *v = word.parse().map_err(|_| Fault::new(format!("line {}", first + i), word, "a number"))?;
            }
            points.push(point);
        }
        if points.len() < count {
            return Err(Fault::new("end", format!("{} points", points.len()), format!("{count} points")));
        }
        Ok(points)
    }
}

/// Lines of a header up to and with the one that `ends` it, and what comes after.
fn header(bytes: &[u8], ends: impl Fn(&str) -> bool) -> Result<(Vec<&str>, &[u8]), Fault> {
    let (mut lines, mut rest) = (Vec::new(), bytes);
    while let Some(at) = rest.iter().position(|b| *b == b'\n') {
        let line = std::str::from_utf8(&rest[..at])
            .map_err(|_| Fault::new(format!("line {}", lines.len() + 1), "bytes that are no text", "a header"))?
            .trim_end();
        rest = &rest[at + 1..];
        lines.push(line);
        if ends(line) {
            return Ok((lines, rest));
        }
    }
    Err(Fault::new("header", "its end is missing", "a complete header"))
}

fn text(bytes: &[u8]) -> Result<&str, Fault> {
    std::str::from_utf8(bytes).map_err(|e| Fault::new(format!("byte {}", e.valid_up_to()), "no text", "text"))
}

fn number<T: std::str::FromStr>(word: Option<&&str>, place: &str) -> Result<T, Fault> {
    let word = word.copied().unwrap_or("nothing");
    word.parse().map_err(|_| Fault::new(place, word, "a number"))
}

/// Vertices of a PLY file, ascii or binary of either order.
pub(super) fn ply(bytes: &[u8]) -> Result<Vec<[f64; 3]>, Fault> {
    let (lines, data) = header(bytes, |line| line == "end_header")?;
    if lines[0] != "ply" {
        return Err(Fault::new("line 1", lines[0], "ply"));
    }
    let (mut format, mut count, mut fields) = ("", None, Vec::new());
    let mut element = 0;
    for (i, line) in lines.iter().enumerate() {
        let place = format!("line {}", i + 1);
        let words: Vec<&str> = line.split_whitespace().collect();
        match words[..] {
            ["format", f, ..] => format = f,
            ["element", name, ..] => {
                element += 1;
                if name == "vertex" {
                    if element > 1 {
                        return Err(Fault::new(place, "vertices after another element", "vertices first"));
                    }
                    count = Some(number::<usize>(words.get(2), &place)?);
                }
            }
            ["property", "list", ..] if element <= 1 => {
                return Err(Fault::new(place, "a list of a vertex", "one number a property"));
            }
            ["property", kind, name] if element <= 1 => {
                let scalar = match kind {
                    "char" | "int8" => Scalar::I8,
                    "uchar" | "uint8" => Scalar::U8,
                    "short" | "int16" => Scalar::I16,
                    "ushort" | "uint16" => Scalar::U16,
                    "int" | "int32" => Scalar::I32,
                    "uint" | "uint32" => Scalar::U32,
                    "float" | "float32" => Scalar::F32,
                    "double" | "float64" => Scalar::F64,
                    other => return Err(Fault::new(place, other, "a PLY scalar type")),
                };
                fields.push((name.to_owned(), scalar));
            }
            _ => {}
        }
    }
    let count = count.ok_or_else(|| Fault::new("header", "no element vertex", "one"))?;
    let columns = Columns::new(&fields, "header")?;
    match format {
        "ascii" => columns.ascii(text(data)?.lines(), count, lines.len() + 1),
        "binary_little_endian" => columns.binary(data, count, false),
        "binary_big_endian" => columns.binary(data, count, true),
        other => Err(Fault::new("format", other, "ascii, binary_little_endian or binary_big_endian")),
    }
}

/// Points of a PCD file, ascii or binary.
pub(super) fn pcd(bytes: &[u8]) -> Result<Vec<[f64; 3]>, Fault> {
    let (lines, data) = header(bytes, |line| line.starts_with("DATA"))?;
    let field = |name: &str| -> Result<Vec<&str>, Fault> {
        let line = lines.iter().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
        let line = line.ok_or_else(|| Fault::new("header", format!("no {name}"), format!("a line {name}")))?;
        Ok(line.split_whitespace().collect())
    };
    let (names, sizes, kinds) = (field("FIELDS")?, field("SIZE")?, field("TYPE")?);
    let counts = field("COUNT").unwrap_or_else(|_| vec!["1"; names.len()]);
    let mut fields = Vec::new();
    for (i, name) in names.iter().enumerate() {
        let at = |list: &[&str]| list.get(i).copied().unwrap_or("nothing").to_owned();
        let scalar = match (at(&kinds).as_str(), at(&sizes).as_str()) {
            ("F", "4") => Scalar::F32,
            ("F", "8") => Scalar::F64,
            ("I", "1") => Scalar::I8,
            ("U", "1") => Scalar::U8,
            ("I", "2") => Scalar::I16,
            ("U", "2") => Scalar::U16,
            ("I", "4") => Scalar::I32,
            ("U", "4") => Scalar::U32,
            (kind, size) => {
                let found = format!("type {kind} of size {size}");
                return Err(Fault::new(format!("field {name}"), found, "F of 4 or 8, I or U of 1, 2 or 4"));
            }
        };
        let count: usize = number(counts.get(i), &format!("count of field {name}"))?;
        if count > 4096 {
            return Err(Fault::new(format!("count of field {name}"), count.to_string(), "at most 4096"));
        }
        fields.extend((0..count).map(|k| (if k == 0 { (*name).to_owned() } else { String::new() }, scalar)));
    }
    let count: usize = number(field("POINTS")?.first(), "POINTS")?;
    let columns = Columns::new(&fields, "FIELDS")?;
    match field("DATA")?[..] {
        ["ascii"] => columns.ascii(text(data)?.lines(), count, lines.len() + 1),
        ["binary"] => columns.binary(data, count, false),
        ref other => Err(Fault::new("DATA", other.join(" "), "ascii or binary")),
    }
}

/// Rows of an NPY array of floats, N × 3 or wider, in C order.
pub(super) fn npy(bytes: &[u8]) -> Result<Vec<[f64; 3]>, Fault> {
    let magic = bytes.get(..8).filter(|m| m.starts_with(b"\x93NUMPY"));
    let major = magic.ok_or_else(|| Fault::new("byte 0", "another beginning", "an NPY file"))?[6];
    let (width, from) = if major == 1 { (2, 10) } else { (4, 12) };
    let size = bytes.get(8..8 + width).map(|b| b.iter().rev().fold(0_usize, |n, b| n << 8 | usize::from(*b)));
    let header = size.and_then(|size| bytes.get(from..from + size));
    let header = text(header.ok_or_else(|| Fault::new("header", "cut off", "a complete header"))?)?;
    let value = |key: &str| {
        let at = header.find(&format!("'{key}':"))?;
        Some(header[at + key.len() + 3..].trim_start())
    };
    let kind = value("descr").and_then(|v| v.split('\'').nth(1)).unwrap_or("nothing");
    let (scalar, big_endian) = match kind {
        "<f4" => (Scalar::F32, false),
        "<f8" => (Scalar::F64, false),
        ">f4" => (Scalar::F32, true),
        ">f8" => (Scalar::F64, true),
        other => return Err(Fault::new("descr", other, "<f4, <f8, >f4 or >f8")),
    };
    if value("fortran_order").is_some_and(|v| v.starts_with("True")) {
        return Err(Fault::new("fortran_order", "True", "False"));
    }
    let shape = value("shape").and_then(|v| v.strip_prefix('(')?.split(')').next()).unwrap_or_default();
    let sides: Vec<usize> = shape.split(',').filter_map(|s| s.trim().parse().ok()).collect();
    let [rows, columns @ 3..=1024] = sides[..] else {
        return Err(Fault::new("shape", format!("({shape})"), "(N, 3) or wider"));
    };
    let columns = Columns { scalars: vec![scalar; columns], xyz: [0, 1, 2] };
    columns.binary(&bytes[from + header.len()..], rows, big_endian)
}
