//! Every format is read to the same points; what is wrong is named with its place.

use std::path::PathBuf;

use tandem_msg::{Coded, FeatureClass};

use super::*;

/// A paraboloid over a grid, millimetres.
fn points() -> Vec<[f32; 3]> {
    (0..1600).map(|i| [(i % 40) as f32, (i / 40) as f32, 300.0 + 0.01 * ((i % 40) * (i / 40)) as f32]).collect()
}

fn file(name: &str, bytes: &[u8]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let file = folder.path().join(name);
    std::fs::write(&file, bytes).expect("writable");
    (folder, file)
}

fn read_bytes(name: &str, bytes: &[u8]) -> Result<Shape, ReadError> {
    let (_folder, file) = file(name, bytes);
    read(&file, 1e-3)
}

fn ascii() -> String {
    points().iter().map(|[x, y, z]| format!("{x} {y} {z}\n")).collect()
}

fn binary(big_endian: bool) -> Vec<u8> {
    let bytes = |v: f32| if big_endian { v.to_be_bytes() } else { v.to_le_bytes() };
    points().iter().flatten().flat_map(|v| bytes(*v)).collect()
}

fn npy(header: &str, data: &[u8]) -> Vec<u8> {
    let mut out = b"\x93NUMPY\x01\x00".to_vec();
    out.extend((header.len() as u16).to_le_bytes());
    out.extend(header.as_bytes());
    out.extend(data);
    out
}

#[test]
fn every_cloud_format_gives_the_same_points() {
    let ply = |format: &str| {
        format!(
            "ply\nformat {format} 1.0\nelement vertex 1600\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
        )
    };
    let pcd = |data: &str| {
        format!(
            "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 1600\nHEIGHT 1\nPOINTS 1600\nDATA {data}\n"
        )
    };
    let joined = |head: String, data: Vec<u8>| [head.into_bytes(), data].concat();
    let header = "{'descr': '<f4', 'fortran_order': False, 'shape': (1600, 3), }\n";
    let expected: Vec<[f32; 3]> = points().iter().map(|p| p.map(|v| v * 1e-3)).collect();
    for (name, bytes) in [
        ("a.ply", joined(ply("ascii"), ascii().into_bytes())),
        ("b.ply", joined(ply("binary_little_endian"), binary(false))),
        ("c.ply", joined(ply("binary_big_endian"), binary(true))),
        ("d.pcd", joined(pcd("ascii"), ascii().into_bytes())),
        ("e.pcd", joined(pcd("binary"), binary(false))),
        ("f.npy", npy(header, &binary(false))),
    ] {
        match read_bytes(name, &bytes) {
            Ok(Shape::Cloud(cloud)) => {
                let off = cloud.iter().flatten().zip(expected.iter().flatten()).map(|(a, b)| (a - b).abs());
                assert!(cloud.len() == expected.len() && off.fold(0.0, f32::max) < 1e-7, "{name}");
            }
            other => panic!("{name}: {other:?}"),
        }
    }
}

#[test]
fn both_mesh_formats_give_the_same_triangles() {
    let corners = [[0.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, 10.0, 5.0]];
    let mut stl = vec![0_u8; 80];
    stl.extend(1_u32.to_le_bytes());
    stl.extend(
        [0.0_f32; 3]
            .iter()
            .chain(corners.map(|c| c.map(|v: f64| v as f32)).as_flattened())
            .flat_map(|v| v.to_le_bytes()),
    );
    stl.extend([0, 0]);
    let ascii = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 10 0 0\nvertex 0 10 5\nendloop\nendfacet\nendsolid a\n";
    let obj = "v 0 0 0\nv 10 0 0\nv 0 10 5\nf 1/1 2/2 -1/3\n";
    let expected = Shape::Mesh(corners.map(|c| c.map(|v| v * 1e-3)).to_vec(), vec![[0, 1, 2]]);
    for (name, bytes) in [("a.stl", stl.as_slice()), ("b.stl", ascii.as_bytes()), ("c.obj", obj.as_bytes())] {
        assert_eq!(read_bytes(name, bytes).expect(name), expected, "{name}");
    }
}

#[test]
fn what_is_wrong_is_named() {
    let ply = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n1 two 3\n";
    let far = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 99999\n";
    for (name, bytes, message) in [
        ("a.ply", ply.as_bytes().to_vec(), "line 9: two, expected a number"),
        (
            "b.ply",
            far.as_bytes().to_vec(),
            "point 0: (0.001, 0.002, 99.999) m, expected within 10 m of the origin; is --unit right?",
        ),
        ("c.ply", b"ply\nformat ascii 1.0\n".to_vec(), "header: its end is missing, expected a complete header"),
        (
            "d.pcd",
            b"FIELDS x y\nSIZE 4 4\nTYPE F F\nPOINTS 1\nDATA ascii\n1 2\n".to_vec(),
            "FIELDS: fields x, y, expected a field z",
        ),
        (
            "e.npy",
            npy("{'descr': '<i8', 'fortran_order': False, 'shape': (4, 3), }", &[]),
            "descr: <i8, expected <f4, <f8, >f4 or >f8",
        ),
        ("f.obj", b"v 0 0 0\nf 1 2 3\n".to_vec(), "line 2: 2, expected 1 to 1"),
        ("g.stl", vec![7; 100], "header: 100 bytes, 117901063 triangles announced, expected 84 + 50 bytes a triangle"),
        ("h.step", Vec::new(), "name: ending .step, expected .ply, .pcd, .npy, .stl or .obj"),
    ] {
        let error = read_bytes(name, &bytes).expect_err(name).to_string();
        assert!(error.ends_with(&format!("{name}: {message}")), "{error}");
    }
}

/// A plate as a mesh, looked at from above: every ray meets it at the distance of the camera.
#[test]
fn meshes_are_scanned_from_where_they_are_looked_at() {
    let obj = "v -10 -10 0\nv 10 -10 0\nv 10 10 0\nv -10 10 0\nf 1 2 3 4\n";
    let shape = read_bytes("plate.obj", obj.as_bytes()).expect("it is sound");
    let view = View { half_width: Some(0.005), ..View::default() };
    let cloud = in_camera(&shape, Some(&view)).expect("rays can be traced");
    assert!(cloud.len() > 9_800, "{} points: nearly every ray meets the plate", cloud.len());
    let mean = cloud.iter().map(|p| f64::from(p[2])).sum::<f64>() / cloud.len() as f64;
    assert!((mean - 0.04).abs() < 1e-3, "{mean}");
}

/// The same stands on a carrier as far below it as its lowest corner, and hides what is behind it.
#[test]
fn a_mesh_stands_on_a_carrier() {
    let obj = "v -10 -10 0\nv 10 -10 0\nv 10 10 0\nv -10 10 0\nv 0 0 -20\nf 1 2 3 4\nf 1 2 5\n";
    let shape = read_bytes("roof.obj", obj.as_bytes()).expect("it is sound");
    let view = View { at: Some([0.0; 3]), half_width: Some(0.03), ..View::default() };
    for look in 0..4 {
        let cloud = in_camera(&shape, Some(&View { look, ..view })).expect("rays can be traced");
        let again = in_camera(&shape, Some(&View { look, ..view })).expect("rays can be traced");
        assert_eq!(cloud, again);
        // Distances along the view of the plate's middle, and of the carrier below.
        let near = cloud.iter().filter(|p| (p[2] - 0.24).abs() < 0.008).count();
        let far = cloud.iter().filter(|p| p[2] > 0.248).count();
        assert!(near > 500 && far > 3000, "look {look}: {near} and {far} points");
    }
}

/// Every look at a folder's parts is counted once, under its true class, and counted alike again.
#[test]
fn a_labelled_folder_is_scored() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    // A square post on a plate.
    let post = |half: f64, low: f64, high: f64, first: usize| -> String {
        let corner = |i: usize| [(i & 1, half), (i >> 1 & 1, half)].map(|(s, h)| if s == 1 { h } else { -h });
        let vertices: String = (0..8)
            .map(|i| format!("v {} {} {}\n", corner(i)[0], corner(i)[1], if i < 4 { low } else { high }))
            .collect();
        let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [1, 3, 7, 5], [3, 2, 6, 7], [2, 0, 4, 6]];
        let faces: String =
            faces.iter().map(|f| format!("f {}\n", f.map(|i| (i + first).to_string()).join(" "))).collect();
        vertices + &faces
    };
    let obj = post(15.0, -5.0, 0.0, 1) + &post(4.0, 0.0, 12.0, 9);
    std::fs::write(folder.path().join("post.obj"), &obj).expect("writable");
    let mesh = read(&folder.path().join("post.obj"), 1e-3).expect("it is sound");
    let cloud = in_camera(&mesh, None).expect("rays can be traced");
    let bytes: Vec<u8> = cloud.iter().flatten().flat_map(|v| (v * 1e3).to_le_bytes()).collect();
    let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({}, 3), }}\n", cloud.len());
    std::fs::write(folder.path().join("post.npy"), npy(&header, &bytes)).expect("writable");
    let list = "[[part]]\nfile = \"post.obj\"\nclass = \"other\"\nat_mm = [0, 0, 0]\nwidth_mm = 36\n\
                [[part]]\nfile = \"post.npy\"\nclass = \"cone\"\n";
    std::fs::write(folder.path().join("parts.toml"), list).expect("writable");

    let set = tandem_config::PartSet::load(folder.path()).expect("it is sound");
    let model = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("config/models/s471");
    let mut perception = crate::perception::Perception::load(&model).expect("the shipped model loads");
    let mut answers = Vec::new();
    let mut run = || score(&mut perception, &set, 3, |_, seen| answers.push(seen.len())).expect("they are sound");
    let (first, again) = (run(), run());
    assert_eq!(first, again);
    assert_eq!(answers, [3, 1, 3, 1], "a mesh is looked at three times, a cloud once");
    assert_eq!(first.looks, 4);
    let row = |class: FeatureClass| first.confusion[class.code() as usize].iter().sum::<u32>();
    assert_eq!((row(FeatureClass::Other), row(FeatureClass::Cone)), (3, 1));
    let hits: u32 = (0..8).map(|c| first.confusion[c][c]).sum();
    assert_eq!(first.right, hits);
    assert_eq!(first.accuracy(), f64::from(hits) / 4.0);
}

/// No bytes make a reader panic.
#[test]
fn garbage_is_refused() {
    let seeds: Vec<Vec<u8>> = vec![
        b"ply\nformat binary_little_endian 1.0\nelement vertex 9999999999999\nproperty float x\nproperty float y\nproperty float z\nend_header\n".to_vec(),
        b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 99999999999999999\nDATA binary\n".to_vec(),
        npy("{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999999, 3), }", &[0; 64]),
    ];
    for bytes in seeds.iter().chain([&Vec::new(), &vec![0; 3], &vec![0xff; 300], &b"ply".to_vec()]) {
        for cut in [0, bytes.len() / 2, bytes.len()] {
            for ending in ["ply", "pcd", "npy", "stl", "obj"] {
                assert!(read_bytes(&format!("x.{ending}"), &bytes[..cut]).is_err(), "{ending}, {cut} bytes");
            }
        }
    }
}
