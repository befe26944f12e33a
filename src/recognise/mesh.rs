//! Meshes: STL, OBJ.

use super::Fault;

type Triangles = (Vec<[f64; 3]>, Vec<[u32; 3]>);

/// Bytes before the triangles of a binary STL file, and of each of them.
const STL_HEAD: usize = 84;
const STL_TRIANGLE: usize = 50;

/// Triangles of an STL file, binary or ascii.
pub(super) fn stl(bytes: &[u8]) -> Result<Triangles, Fault> {
    let count = bytes.get(80..84).and_then(|b| b.try_into().ok()).map(u32::from_le_bytes);
    // Some binary files begin with "solid" too: their length tells.
    let binary = count.is_some_and(|c| bytes.len() as u64 == STL_HEAD as u64 + STL_TRIANGLE as u64 * u64::from(c));
    if !binary && bytes.trim_ascii_start().starts_with(b"solid") {
        return ascii_stl(bytes);
    }
    let Some(count) = count.filter(|_| binary) else {
        let found = format!("{} bytes, {} triangles announced", bytes.len(), count.unwrap_or(0));
        return Err(Fault::new("header", found, "84 + 50 bytes a triangle"));
    };
    let mut corners = Vec::with_capacity(3 * count as usize);
    for triangle in bytes[STL_HEAD..].chunks_exact(STL_TRIANGLE) {
        let number = |i: usize| f64::from(f32::from_le_bytes(std::array::from_fn(|k| triangle[4 * i + k])));
        corners.extend((1..4).map(|corner| [0, 1, 2].map(|k| number(3 * corner + k))));
    }
    Ok(alone(corners))
}

fn ascii_stl(bytes: &[u8]) -> Result<Triangles, Fault> {
    let mut corners = Vec::new();
    for (i, line) in String::from_utf8_lossy(bytes).lines().enumerate() {
        if let Some(rest) = line.trim_start().strip_prefix("vertex") {
            corners.push(point(rest.split_whitespace(), i)?);
        }
    }
    if corners.len() % 3 != 0 {
        return Err(Fault::new("end", format!("{} vertices", corners.len()), "three a facet"));
    }
    Ok(alone(corners))
}

/// Corners that follow each other by threes.
fn alone(corners: Vec<[f64; 3]>) -> Triangles {
    let triangles = (0..corners.len() as u32 / 3).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
    (corners, triangles)
}

fn point<'a>(mut words: impl Iterator<Item = &'a str>, line: usize) -> Result<[f64; 3], Fault> {
    let mut out = [0.0; 3];
    for v in &mut out {
        let word = words.next().unwrap_or("nothing");
        *v = word.parse().map_err(|_| Fault::new(format!("line {}", line + 1), word, "a number"))?;
    }
    Ok(out)
}

/// Faces of an OBJ file, polygons as fans.
pub(super) fn obj(bytes: &[u8]) -> Result<Triangles, Fault> {
    let (mut corners, mut triangles) = (Vec::new(), Vec::new());
    for (i, line) in String::from_utf8_lossy(bytes).lines().enumerate() {
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => corners.push(point(words, i)?),
            Some("f") => {
                let place = || format!("line {}", i + 1);
                let mut face: Vec<u32> = Vec::new();
                for word in words {
                    // "7/1/3", or counted back from the last: "-1".
                    let index: i64 = word
                        .split('/')
                        .next()
                        .and_then(|w| w.parse().ok())
                        .ok_or_else(|| Fault::new(place(), word, "an index"))?;
                    let at = if index < 0 { corners.len() as i64 + index } else { index - 1 };
                    if at < 0 || at >= corners.len() as i64 {
                        return Err(Fault::new(place(), word, format!("1 to {}", corners.len())));
                    }
                    face.push(at as u32);
                }
                if face.len() < 3 {
                    return Err(Fault::new(place(), format!("{} corners", face.len()), "at least three"));
                }
                triangles.extend(face[1..].windows(2).map(|pair| [face[0], pair[0], pair[1]]));
            }
            _ => {}
        }
    }
    Ok((corners, triangles))
}
