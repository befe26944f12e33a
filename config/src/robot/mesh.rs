//! Collision meshes: found and read (STL, OBJ).

use nalgebra::Vector3;
use std::path::{Path, PathBuf};

/// Where the file of a mesh is: `package://NAME/PATH` in one of the package folders (which hold
/// `NAME`, or are `NAME`) or else in one that the URDF itself lies in, `file://` or a path beside the URDF.
///
/// # Errors
/// What was found in place of a file, and what to do.
pub(super) fn resolve(name: &str, urdf: &Path, packages: &[PathBuf]) -> Result<PathBuf, (String, String)> {
    let quoted = format!("\"{name}\"");
    let beside = |path: &str| urdf.parent().unwrap_or(Path::new("")).join(path);
    let mut around: Vec<PathBuf> = Vec::new();
    let tried: Vec<PathBuf> = if let Some(rest) = name.strip_prefix("package://") {
        let (package, inside) = rest.split_once('/').unwrap_or((rest, ""));
        around = urdf.ancestors().skip(1).map(|folder| folder.join(rest)).collect();
        let folders = packages.iter();
        folders
            .flat_map(|folder| {
                let named = folder.file_name().is_some_and(|own| own == package).then(|| folder.join(inside));
                [Some(folder.join(package).join(inside)), named].into_iter().flatten()
            })
            .collect()
    } else if let Some(path) = name.strip_prefix("file://") {
        vec![beside(path)]
    } else if name.contains("://") {
        return Err((quoted, "name it as package://, file:// or a path beside the URDF".into()));
    } else {
        vec![beside(name)]
    };
    if let Some(file) = tried.iter().chain(&around).find(|path| path.is_file()) {
        return Ok(file.clone());
    }
    if tried.is_empty() {
        let advice = "list the folders of packages as robot.packages of the cell, or in ROS_PACKAGE_PATH";
        return Err((quoted, advice.into()));
    }
    let places: Vec<String> = tried.iter().map(|path| path.display().to_string()).collect();
    let advice = "add the file, or list its package's folder as robot.packages of the cell";
    Err((format!("{quoted}, no file at {}", places.join(" or ")), advice.into()))
}

/// The vertices of a mesh file, in its own units.
///
/// # Errors
/// What was found and what to do.
pub(super) fn vertices(file: &Path) -> Result<Vec<Vector3<f64>>, (String, String)> {
    let shown = file.display();
    let bytes = std::fs::read(file).map_err(|error| (format!("{shown}: {error}"), "make it readable".to_owned()))?;
    let ending = file.extension().map(|ending| ending.to_string_lossy().to_lowercase()).unwrap_or_default();
    let points = match ending.as_str() {
        "stl" => stl(&bytes),
        "obj" => obj(&bytes),
        _ => return Err((format!("{shown}"), "save the mesh as STL or OBJ".into())),
    };
    match points {
        Some(points) if points.len() < 3 => Err((format!("{shown}, no triangles"), "write the mesh anew".into())),
        Some(points) if points.iter().flatten().any(|x| !x.is_finite()) => {
            Err((format!("{shown}, vertices that are not finite"), "write the mesh anew".into()))
        }
        Some(points) => Ok(points),
        None => Err((format!("{shown}, which is broken"), "write the mesh anew".into())),
    }
}

/// Binary or ASCII; a binary file may begin with `solid` too, but its length tells.
fn stl(bytes: &[u8]) -> Option<Vec<Vector3<f64>>> {
    const HEAD: usize = 84;
    const TRIANGLE: usize = 50;
    let count = bytes.get(80..HEAD).and_then(|count| Some(u32::from_le_bytes(count.try_into().ok()?) as usize));
    if let Some(count) = count.filter(|count| bytes.len() >= HEAD.saturating_add(count.saturating_mul(TRIANGLE))) {
        let number = |at: &[u8]| at.try_into().map_or(f64::NAN, |bytes| f64::from(f32::from_le_bytes(bytes)));
        let corner = |at: &[u8]| Vector3::new(number(&at[..4]), number(&at[4..8]), number(&at[8..12]));
        let triangles = bytes[HEAD..].chunks_exact(TRIANGLE).take(count);
        return Some(triangles.flat_map(|triangle| triangle[12..48].chunks_exact(12).map(corner)).collect());
    }
    let text = std::str::from_utf8(bytes).ok().filter(|text| text.trim_start().starts_with("solid"))?;
    text.lines().filter_map(|line| line.trim().strip_prefix("vertex ")).map(three_numbers).collect()
}

fn obj(bytes: &[u8]) -> Option<Vec<Vector3<f64>>> {
    let text = String::from_utf8_lossy(bytes);
    text.lines().filter_map(|line| line.trim().strip_prefix("v ")).map(three_numbers).collect()
}

fn three_numbers(text: &str) -> Option<Vector3<f64>> {
    let mut numbers = text.split_whitespace().map(|number| number.parse::<f64>().ok());
    Some(Vector3::new(numbers.next()??, numbers.next()??, numbers.next()??))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle_stl() -> Vec<u8> {
        let mut bytes = b"solid but binary".to_vec();
        bytes.resize(80, b' ');
        bytes.extend(1_u32.to_le_bytes());
        for number in [0.0_f32, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.0, 0.5] {
            bytes.extend(number.to_le_bytes());
        }
        bytes.extend([0, 0]);
        bytes
    }

    /// The three ways a triangle is written.
    #[test]
    fn meshes_are_read() {
        let expected = [Vector3::zeros(), Vector3::x(), Vector3::new(0.0, 2.0, 0.5)];
        let ascii = b"solid t\nfacet normal 0 0 1\n outer loop\n  vertex 0 0 0\n vertex 1 0 0\n vertex 0 2e0 5e-1\n";
        assert_eq!(stl(&triangle_stl()).as_deref(), Some(&expected[..]));
        assert_eq!(stl(ascii).as_deref(), Some(&expected[..]));
        assert_eq!(obj(b"# t\nv 0 0 0\nvn 9 9 9\nv 1 0 0\nv 0 2 0.5\nf 1 2 3\n").as_deref(), Some(&expected[..]));
        assert_eq!(stl(&triangle_stl()[..100]), None, "cut short");
        assert_eq!(obj(b"v 0 0\n"), None);
    }
}
