//! Compiles ruckig's C++ with -O3 and joints known at compile time, as a C++ program uses it. The sources
//! are those that come with the crate `ruckig`.

use std::{env, error::Error, path::Path, process::Command};

fn main() -> Result<(), Box<dyn Error>> {
    println!("cargo:rerun-if-changed=src/ruckig.cpp");
    let output = Command::new(env::var("CARGO")?)
        .args(["metadata", "--format-version", "1", "--offline", "--locked", "--manifest-path"])
        .arg(Path::new(&env::var("CARGO_MANIFEST_DIR")?).join("Cargo.toml"))
        .output()?;
    let metadata: serde_json::Value = serde_json::from_slice(&output.stdout)?;
    let packages = metadata["packages"].as_array().ok_or("cargo metadata lists no packages")?;
    let manifest =
        packages.iter().find(|package| package["name"] == "ruckig").and_then(|it| it["manifest_path"].as_str());
    let root = Path::new(manifest.ok_or("the crate ruckig is no dependency")?).parent().ok_or("no folder")?;
    let mut build = cc::Build::new();
    build.cpp(true).std("c++20").opt_level(3).include(root.join("include")).warnings(false);
    // Apart from the copy that the crate `ruckig` links, which has the client of its cloud compiled in.
    build.define("ruckig", "ruckig_static");
    for order in ["position_first", "position_second", "position_third", "velocity_second", "velocity_third"] {
        for step in ["step1", "step2"] {
            build.file(root.join(format!("src/ruckig/{order}_{step}.cpp")));
        }
    }
    build.file(root.join("src/ruckig/brake.cpp")).file("src/ruckig.cpp").compile("ruckig_static");
    Ok(())
}
