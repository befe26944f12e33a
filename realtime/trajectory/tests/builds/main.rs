//! The crate as other settings of the compiler build it: the same bits from each, and no way to panic.
//!
//! Both tests call the compiler that builds this one, and say so where there is none.
#![allow(clippy::disallowed_types, clippy::disallowed_macros, reason = "a test may allocate and print")]

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Output},
};

/// What `digest.rs` prints twice, in every build and on every machine: change it with the solver.
const DIGEST: &str = "0xca6d0131f9905d57";

const STD: [&str; 2] = ["--cfg", r#"feature="std""#];
const RELEASE: [&str; 2] = ["-Copt-level=3", "-Cpanic=abort"];
const DEBUG: [&str; 3] = ["-Copt-level=0", "-Cdebug-assertions=on", "-Coverflow-checks=on"];

/// A folder for what is compiled, and the flags it is compiled with.
struct Build {
    folder: PathBuf,
    flags: Vec<&'static str>,
}

impl Build {
    /// Compiles the crate itself; `None` without a compiler.
    fn new(name: &str, flags: &[&[&'static str]]) -> Option<Self> {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
        fs::create_dir_all(&folder).expect("the folder for tests is writable");
        let build = Build { folder, flags: flags.concat() };
        let crate_flags = ["--crate-name=tandem_trajectory", "--crate-type=rlib", "-Cembed-bitcode=no"];
        build.compile("src/lib.rs", &crate_flags, "--emit=link,obj").then_some(build)
    }

    /// Compiles a source of this package; `false` without a compiler.
    fn compile(&self, source: &str, flags: &[&str], emit: &str) -> bool {
        let mut compiler = Command::new(std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into()));
        compiler.args(["--edition=2024", "-Ccodegen-units=1", "-Awarnings", emit]).args(&self.flags).args(flags);
        compiler.arg("-L").arg(&self.folder).arg("--out-dir").arg(&self.folder);
        match compiler.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join(source)).output() {
            Ok(Output { status, stderr, .. }) => {
                assert!(status.success(), "{source}: {}", String::from_utf8_lossy(&stderr));
                true
            }
            Err(error) => {
                eprintln!("skipped: no compiler ({error})");
                false
            }
        }
    }

    /// Compiles and runs the program; its output.
    fn digest(&self) -> String {
        self.compile("tests/builds/digest.rs", &["--extern=tandem_trajectory"], "--emit=link");
        let output = Command::new(self.folder.join("digest")).output().expect("just built");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8_lossy(&output.stdout).trim().into()
    }
}

/// Debug, release, for this very processor, and without `std`; and the second time as the first.
#[test]
fn every_build_calculates_the_same_bits() {
    let builds: [(&str, &[&[&str]]); 4] = [
        ("debug", &[&STD, &DEBUG]),
        ("release", &[&STD, &RELEASE]),
        ("native", &[&STD, &RELEASE, &["-Ctarget-cpu=native"]]),
        ("core", &[&RELEASE]),
    ];
    for (name, flags) in builds {
        let Some(build) = Build::new(name, flags) else { return };
        assert_eq!(build.digest(), format!("{DIGEST} {DIGEST}"), "{name}");
    }
}

/// The objects of all that a cycle calls name no function that panics: whatever `core` panics with is called by a
/// symbol that says so.
#[test]
fn nothing_in_the_release_object_can_panic() {
    let Some(build) = Build::new("surface", &[&STD, &RELEASE]) else { return };
    let flags = ["--extern=tandem_trajectory", "--crate-type=lib"];
    build.compile("tests/builds/surface.rs", &flags, "--emit=obj");
    for (object, name) in [("tandem_trajectory.o", "first_covering"), ("surface.o", "minimum_durations")] {
        let bytes = fs::read(build.folder.join(object)).expect("just built");
        let mentions = |name: &str| bytes.windows(name.len()).any(|window| window == name.as_bytes());
        assert!(mentions(name), "{object} is not what was compiled: {name} is missing");
        for panic in ["panicking", "panic_fmt", "slice_index_fail", "unwrap_failed", "expect_failed", "_fail"] {
            assert!(!mentions(panic), "{object} can panic: {panic}");
        }
    }
}
