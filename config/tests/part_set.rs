//! A folder of labelled parts is read as it is written, and every fault of its list is named at once.

use std::path::Path;

use tandem_config::PartSet;
use tandem_msg::FeatureClass;

fn folder(list: &str) -> tempfile::TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    std::fs::write(folder.path().join(PartSet::FILE), list).expect("writable");
    std::fs::write(folder.path().join("nut.stl"), b"not opened here").expect("writable");
    folder
}

#[test]
fn a_list_is_read_as_it_is_written() {
    let folder = folder(
        "unit = \"inch\"\n[[part]]\nfile = \"nut.stl\"\nclass = \"threaded_hole\"\nfamily = \"nut\"\n\
         at_mm = [0, 0, 5.5]\naxis = [0, 1, 0]\nup = [0, 0, 1]\nwidth_mm = 24\n\
         [[part]]\nfile = \"nut.stl\"\nclass = \"other\"\naxis = [1, 0, 0]\n",
    );
    let set = PartSet::load(folder.path()).expect("it is sound");
    assert_eq!(set.unit, 0.0254);
    let [nut, side] = &set.parts[..] else { panic!("{} parts", set.parts.len()) };
    assert_eq!((nut.class, nut.family.as_str()), (FeatureClass::ThreadedHole, "nut"));
    assert_eq!(
        (nut.at, nut.axis, nut.up, nut.width),
        (Some([0.0, 0.0, 5.5e-3]), [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], Some(0.024))
    );
    assert_eq!(nut.file, folder.path().join("nut.stl"));
    // What does not stand there: the whole part, as it lies on its back.
    assert_eq!((side.at, side.axis, side.up, side.width), (None, [1.0, 0.0, 0.0], [1.0, 0.0, 0.0], None));
}

#[test]
fn every_fault_is_named_with_its_place() {
    let faults = |list: &str| -> Vec<String> {
        let folder = folder(list);
        let faults = PartSet::load(folder.path()).expect_err("it is not sound");
        let root = format!("{}/", folder.path().display());
        faults.iter().map(|fault| fault.to_string().replace(&root, "")).collect()
    };
    assert_eq!(
        faults(
            "unit = \"feet\"\n[[part]]\nfile = \"bolt.stl\"\nclass = \"nut\"\nat_mm = [0, 0]\naxis = [0, 0, 0]\nwidth_mm = 0\nwidth = 3\n"
        ),
        [
            "parts.toml:1:8: unit = \"feet\", allowed mm, cm, m, inch; choose one of these names",
            "parts.toml:3:8: part[0].file = \"bolt.stl\", allowed a file of this folder; there is none; name one, or remove this part",
            "parts.toml:4:9: part[0].class = \"nut\", allowed other, threaded_hole, smooth_hole, threaded_axis, smooth_axis, slot, cone, buckle; choose one of these names",
            "parts.toml:5:9: part[0].at_mm = 2 numbers, allowed 3 numbers, each -10000..=10000 mm; write as many numbers as that",
            "parts.toml:6:8: part[0].axis = no direction, allowed a vector that is not 0; point it out of the part",
            "parts.toml:7:12: part[0].width_mm = 0 mm, allowed 0.1..=20000 mm; choose a value within these bounds",
            "parts.toml:8:1: unknown key `part[0].width`; did you mean `width_mm`?",
        ]
    );
    assert_eq!(
        faults("unit = \"mm\"\n"),
        ["parts.toml:1:1: part = no part, allowed at least one [[part]]; list the files of this folder"]
    );
    let absent = PartSet::load(Path::new("/nowhere")).expect_err("there is none").to_string();
    assert_eq!(absent, "/nowhere/parts.toml: no such file; name a file that can be read");
}
