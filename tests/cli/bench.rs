//! A copy of the shipped files that a test may spoil, and the command run on it.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// A copy of `config/` in a folder of its own.
pub(crate) struct Files {
    folder: tempfile::TempDir,
}

/// What the command answered.
#[derive(Debug)]
pub(crate) struct Answer {
    pub(crate) code: Option<i32>,
    pub(crate) out: String,
    pub(crate) err: String,
}

impl Files {
    pub(crate) fn new() -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("config");
        for part in ["cells", "products", "strategies", "robots", "models/s471"] {
            let to = folder.path().join(part);
            fs::create_dir_all(&to).expect("a folder in the temporary folder");
            for entry in fs::read_dir(config.join(part)).expect("the shipped folder is there") {
                let entry = entry.expect("the shipped folder can be listed").path();
                if entry.is_file() {
                    fs::copy(&entry, to.join(entry.file_name().expect("a file has a name"))).expect("a file is copied");
                }
            }
        }
        Self { folder }
    }

    pub(crate) fn path(&self, file: &str) -> PathBuf {
        self.folder.path().join(file)
    }

    /// Replaces a text that must be there.
    pub(crate) fn replace(&self, file: &str, from: &str, to: &str) {
        let path = self.path(file);
        let text = fs::read_to_string(&path).expect("a shipped file is text");
        assert!(text.contains(from), "{file} does not contain {from:?}");
        fs::write(&path, text.replacen(from, to, 1)).expect("a copied file can be written");
    }

    /// Runs `tandem` in the folder, with a state folder of its own.
    pub(crate) fn tandem(&self, args: &[&str]) -> Answer {
        tandem(self.folder.path(), args)
    }
}

/// Runs `tandem` in a folder.
pub(crate) fn tandem(folder: &Path, args: &[&str]) -> Answer {
    let Output { status, stdout, stderr } = Command::new(env!("CARGO_BIN_EXE_tandem"))
        .args(args)
        .current_dir(folder)
        .env("XDG_STATE_HOME", folder.join("state"))
        .env("NO_COLOR", "1")
        .output()
        .expect("the command can be run");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("the command speaks UTF-8");
    Answer { code: status.code(), out: text(stdout), err: text(stderr) }
}
