//! How the files read: no unfinished code, no paths of one machine, one concept a file.

use crate::{files, root, shown, text};

/// Words that mark unfinished or switched-off code, spelt so that this file does not find itself.
fn banned() -> Vec<String> {
    [("to", "do!("), ("unimpl", "emented!("), ("#[ig", "nore"), ("#[should", "_panic"), ("FIX", "ME"), ("db", "g!(")]
        .iter()
        .map(|(head, tail)| format!("{head}{tail}"))
        .collect()
}

#[test]
fn nothing_is_unfinished_or_switched_off() {
    for path in files(root(), ".rs") {
        let source = text(&path);
        for word in banned() {
            assert!(!source.contains(&word), "{}: contains `{word}`", shown(&path));
        }
    }
}

#[test]
fn no_file_names_a_folder_of_one_machine() {
    let home = ["/ho", "me/"].concat();
    let shared = ["../sha", "red"].concat();
    for ending in [".rs", ".toml", ".md", ".json", ".urdf", "run"] {
        for path in files(root(), ending) {
            let source = text(&path);
            assert!(
                !source.contains(&home) && !source.contains(&shared),
                "{}: names a folder of one machine",
                shown(&path)
            );
        }
    }
}

/// One concept a file: a file past this length holds several.
#[test]
fn no_source_file_is_longer_than_six_hundred_lines() {
    for path in files(root(), ".rs") {
        let lines = text(&path).lines().count();
        assert!(lines <= 600, "{}: {lines} lines", shown(&path));
    }
}
