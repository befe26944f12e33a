//! Collision meshes: found, read (STL, OBJ) and wrapped in one capsule each.
//!
//! **Invariant:** a capsule holds every vertex of its mesh, so all of it.

use nalgebra::{Matrix3, Vector3};
use std::path::{Path, PathBuf};

/// Where the file of a mesh is: `package://NAME/PATH` in one of the package folders (which hold
/// `NAME`, or are `NAME`), `file://` or a path beside the URDF.
///
/// # Errors
/// What was found in place of a file, and what to do.
pub(super) fn resolve(name: &str, urdf: &Path, packages: &[PathBuf]) -> Result<PathBuf, (String, String)> {
    let quoted = format!("\"{name}\"");
    let beside = |path: &str| urdf.parent().unwrap_or(Path::new("")).join(path);
    let tried: Vec<PathBuf> = if let Some(rest) = name.strip_prefix("package://") {
        let (package, inside) = rest.split_once('/').unwrap_or((rest, ""));
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
    if let Some(file) = tried.iter().find(|path| path.is_file()) {
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

/// Ends and radius of a capsule.
pub(super) type Capsule = ([Vector3<f64>; 2], f64);

/// A small capsule around points: the least over the principal and the coordinate axes, then over
/// axes turned a little from the best, ever less. The axis is looked for with the mesh's outermost
/// points, its ends and radius are those that all points need.
pub(super) fn around(all: &[Vector3<f64>]) -> Capsule {
    let points = &outermost(all)[..];
    let centre = points.iter().sum::<Vector3<f64>>() / points.len().max(1) as f64;
    let spread: Matrix3<f64> = points.iter().map(|p| (p - centre) * (p - centre).transpose()).sum();
    let principal = spread.symmetric_eigen().eigenvectors;
    let coordinate = Matrix3::identity();
    let mut axis = Vector3::z();
    let mut best = along(points, points, &axis);
    let mut take = |candidate: Vector3<f64>, axis: &mut Vector3<f64>| {
        let fitted = along(points, points, &candidate);
        let better = volume(&fitted) < volume(&best);
        if better {
            (best, *axis) = (fitted, candidate);
        }
        better
    };
    for candidate in principal.column_iter().chain(coordinate.column_iter()) {
        take(candidate.into_owned(), &mut axis);
    }
    let mut tilt = 0.2;
    while tilt > 1e-3 {
        let u = axis.cross(&if axis.x.abs() < 0.7 { Vector3::x() } else { Vector3::y() }).normalize();
        let v = axis.cross(&u);
        let turned = [u, -u, v, -v].map(|to| (axis + to * tilt).normalize());
        if !turned.into_iter().any(|candidate| take(candidate, &mut axis)) {
            tilt /= 2.0;
        }
    }
    along(points, all, &axis)
}

/// The farthest points in directions spread evenly over the sphere (a Fibonacci lattice).
fn outermost(points: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    const DIRECTIONS: u32 = 256;
    const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
    let farthest = |index: u32| {
        let z = 1.0 - (2.0 * f64::from(index) + 1.0) / f64::from(DIRECTIONS);
        let (sin, cos) = (GOLDEN_ANGLE * f64::from(index)).sin_cos();
        let direction = Vector3::new((1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z);
        points.iter().copied().max_by(|a, b| direction.dot(a).total_cmp(&direction.dot(b)))
    };
    let mut found: Vec<Vector3<f64>> = (0..DIRECTIONS).filter_map(farthest).collect();
    found.sort_by(|a, b| {
        a.as_slice()
            .iter()
            .zip(b.as_slice())
            .fold(std::cmp::Ordering::Equal, |order, (a, b)| order.then(a.total_cmp(b)))
    });
    found.dedup();
    found
}

fn volume((ends, radius): &Capsule) -> f64 {
    std::f64::consts::PI * radius * radius * ((ends[1] - ends[0]).norm() + 4.0 / 3.0 * radius)
}

/// The capsule around `all` along an axis, centred on some of the points: as thin as their shadow, then
/// as short as that lets it be.
fn along(points: &[Vector3<f64>], all: &[Vector3<f64>], axis: &Vector3<f64>) -> Capsule {
    /// Room for the rounding of the sums below, added when the ends are found.
    const ROUNDING: f64 = 1e-9;
    let shadow = |p: &Vector3<f64>| p - axis * axis.dot(p);
    let farthest = |of: &[Vector3<f64>], from: &Vector3<f64>| {
        let distance = |p: &&Vector3<f64>| (shadow(p) - from).norm_squared();
        of.iter().max_by(|a, b| distance(a).total_cmp(&distance(b))).map_or(*from, shadow)
    };
    // The smallest circle around the shadow, nearly: a centre that runs to the farthest point in
    // ever smaller steps (Bădoiu and Clarkson). The radius is what that centre needs.
    let mut centre = farthest(points, &Vector3::zeros());
    for step in 1..200 {
        centre += (farthest(points, &centre) - centre) / f64::from(step + 1);
    }
    let radius = (farthest(all, &centre) - centre).norm();
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    for p in all {
        let room = (radius * radius - (shadow(p) - centre).norm_squared()).max(0.0).sqrt();
        low = low.min(axis.dot(p) + room);
        high = high.max(axis.dot(p) - room);
    }
    if low > high {
        low = 0.5 * (low + high);
        high = low;
    }
    ([centre + axis * low, centre + axis * high], radius + ROUNDING)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn holds((ends, radius): &Capsule, point: &Vector3<f64>) -> bool {
        let along = ends[1] - ends[0];
        let share = (along.dot(&(point - ends[0])) / along.norm_squared().max(1e-300)).clamp(0.0, 1.0);
        (point - ends[0] - along * share).norm() <= *radius
    }

    proptest! {
        /// Every vertex is held, whatever the points.
        #[test]
        fn a_capsule_holds_its_mesh(points in prop::collection::vec([-1.0..1.0_f64, -0.2..0.2, -0.05..0.05], 3..60)) {
            let points: Vec<Vector3<f64>> = points.into_iter().map(Vector3::from).collect();
            let capsule = around(&points);
            prop_assert!(points.iter().all(|point| holds(&capsule, point)), "{capsule:?}");
        }

        /// Points of a capsule are wrapped by hardly more than that capsule.
        #[test]
        fn a_capsule_is_found_again(
            axis in [-1.0..1.0_f64, -1.0..1.0, -1.0..1.0], length in 0.1..0.6_f64, radius in 0.03..0.1_f64,
        ) {
            let axis = Vector3::from(axis);
            prop_assume!(axis.norm() > 0.2);
            let axis = axis.normalize();
            let turn = nalgebra::UnitQuaternion::rotation_between(&Vector3::z(), &axis).unwrap_or_default();
            let mut points = Vec::new();
            for ring in 0..=16 {
                let polar = std::f64::consts::PI * f64::from(ring) / 16.0;
                for spoke in 0..24 {
                    let (sin, cos) = (std::f64::consts::TAU * f64::from(spoke) / 24.0).sin_cos();
                    let side = length / 2.0 * if ring <= 8 { 1.0 } else { -1.0 };
                    let ball = Vector3::new(polar.sin() * cos, polar.sin() * sin, polar.cos()) * radius;
                    points.push(turn * (ball + Vector3::z() * side));
                }
            }
            let true_volume = volume(&([Vector3::zeros(), Vector3::z() * length], radius));
            let found = around(&points);
            prop_assert!(volume(&found) < 1.1 * true_volume, "{found:?} for {length}, {radius}");
        }
    }

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
