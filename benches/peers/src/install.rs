//! Peers from public packages, made once below `target/peers`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::Absent;

/// `target/peers` of this checkout.
fn folder() -> PathBuf {
    let default = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target");
    std::env::var_os("CARGO_TARGET_DIR").map_or_else(default, PathBuf::from).join("peers")
}

/// A Python of its own, with packages.
#[derive(Clone, Debug)]
pub struct Python {
    venv: PathBuf,
}

impl Python {
    /// A command that runs this Python.
    pub fn command(&self) -> Command {
        Command::new(self.venv.join("bin/python"))
    }

    /// The folder its packages are in; wheels of C++ libraries bring their headers in
    /// `cmeel.prefix/include` there.
    ///
    /// # Errors
    /// When Python does not answer.
    pub fn packages(&self) -> Result<PathBuf, Absent> {
        let mut command = self.command();
        let path = run(command.args(["-c", "import sysconfig; print(sysconfig.get_paths()['purelib'])"]))?;
        Ok(PathBuf::from(path.trim()))
    }
}

/// A Python environment called `name` with these packages (`name==version`) from PyPI.
///
/// # Errors
/// No `python3`, no `venv`, no network, no such package: the last line of what the tool said.
pub fn python(name: &str, packages: &[&str]) -> Result<Python, Absent> {
    let venv = folder().join(name);
    let python = Python { venv: venv.clone() };
    once(&venv.join("installed"), &packages.join("\n"), || {
        eprintln!("installing {} into {}", packages.join(", "), venv.display());
        run(Command::new("python3").args(["-m", "venv", "--clear"]).arg(&venv))?;
        run(python.command().args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]).args(packages))?;
        Ok(())
    })?;
    Ok(python)
}

/// What PyTorch imports, and the CUDA libraries its wheel cannot do without; the rest are stood in for.
const PYTORCH: &str = "torch==2.15.0";
const PYTORCH_NEEDS: [&str; 6] = ["typing_extensions", "sympy", "networkx", "jinja2", "fsspec", "filelock"];
const PYTORCH_CUDA: [&str; 2] = ["nvidia-cuda-runtime", "nvidia-cuda-cupti"];

/// A Python environment called `name` with these packages and PyTorch, of which only the processor's part works: the
/// wheel (540 MB) comes without the 3 GB of CUDA libraries it names.
///
/// # Errors
/// As [`python`]; no `gcc`, no binutils.
pub fn pytorch(name: &str, packages: &[&str]) -> Result<Python, Absent> {
    let python = python(name, &[packages, &PYTORCH_NEEDS].concat())?;
    let stubs = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/stubs.py");
    once(&python.venv.join("pytorch"), PYTORCH, || {
        eprintln!("installing {PYTORCH} into {}", python.venv.display());
        let pip = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps", PYTORCH];
        run(python.command().args(pip).args(PYTORCH_CUDA))?;
        run(python.command().arg(stubs)).map(drop)
    })?;
    Ok(python)
}

/// Compiles one C++ file with `g++ -O3 -march=native -DNDEBUG` and these flags; answers the program.
///
/// # Errors
/// No `g++`, or it refuses the file.
pub fn cpp(source: &Path, flags: &[String]) -> Result<PathBuf, Absent> {
    let stem = source.file_stem().unwrap_or_default();
    let program = folder().join("cpp").join(stem);
    let text = fs::read_to_string(source).map_err(|error| Absent(format!("{}: {error}", source.display())))?;
    once(&program.with_extension("made"), &format!("{}\n{text}", flags.join("\n")), || {
        eprintln!("compiling {}", source.display());
        let mut command = Command::new("g++");
        command.args(["-std=c++17", "-O3", "-march=native", "-DNDEBUG"]).arg(source).args(flags);
        run(command.arg("-o").arg(&program)).map(drop)
    })?;
    Ok(program)
}

/// Builds the Rust peers of a manifest outside the workspace (so that nobody else compiles what it
/// needs) and answers the program, which is called as its package.
///
/// # Errors
/// When cargo cannot fetch or build it.
pub fn cargo(manifest: &Path) -> Result<PathBuf, Absent> {
    let target = folder().join("cargo");
    let text = fs::read_to_string(manifest).map_err(|error| Absent(format!("{}: {error}", manifest.display())))?;
    let name = text.lines().find_map(|line| line.strip_prefix("name = ")).unwrap_or_default().trim_matches('"');
    eprintln!("building {name}");
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    run(command
        .args(["build", "--release", "--quiet", "--manifest-path"])
        .arg(manifest)
        .arg("--target-dir")
        .arg(&target))?;
    Ok(target.join("release").join(name))
}

/// Makes something unless `mark` says that it was made from the same `recipe`.
fn once(mark: &Path, recipe: &str, make: impl FnOnce() -> Result<(), Absent>) -> Result<(), Absent> {
    if fs::read_to_string(mark).is_ok_and(|made| made == recipe) {
        return Ok(());
    }
    let io = |error: std::io::Error| Absent(format!("{}: {error}", mark.display()));
    fs::create_dir_all(mark.parent().unwrap_or(mark)).map_err(io)?;
    make()?;
    fs::write(mark, recipe).map_err(io)
}

/// Runs a command to its end; its output, or the last line it complained with.
fn run(command: &mut Command) -> Result<String, Absent> {
    let name = command.get_program().to_string_lossy().into_owned();
    let output = command.output().map_err(|error| Absent(format!("{name}: {error}")))?;
    if output.status.success() {
        return Ok(String::from_utf8_lossy(&output.stdout).into_owned());
    }
    let said = String::from_utf8_lossy(&output.stderr);
    let complaint = said.lines().find(|line| line.contains("error")).or(said.lines().last()).unwrap_or_default();
    Err(Absent(format!("{name}: {complaint}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The same recipe is made once, another anew, and what failed is tried again.
    #[test]
    fn a_recipe_is_made_once() {
        let folder = std::env::temp_dir().join(format!("tandem-peers-{}", std::process::id()));
        let mark = folder.join("made");
        let mut made = 0;
        let failed = once(&mark, "a", || Err(Absent("no network".into())));
        assert_eq!(failed, Err(Absent("no network".into())));
        for recipe in ["a", "a", "b"] {
            once(&mark, recipe, || {
                made += 1;
                Ok(())
            })
            .expect("it can be made");
        }
        fs::remove_dir_all(&folder).expect("the folder was made above");
        assert_eq!(made, 2);
    }

    /// A tool that refuses is quoted; one that is not there is named.
    #[test]
    fn complaints_are_passed_on() {
        let refused = run(Command::new("sh").args(["-c", "echo 'x: error: no header' >&2; echo done >&2; exit 1"]));
        assert_eq!(refused, Err(Absent("sh: x: error: no header".into())));
        let missing = run(&mut Command::new("no-such-tool")).expect_err("there is none");
        assert!(missing.to_string().starts_with("no-such-tool: "), "{missing}");
    }
}
