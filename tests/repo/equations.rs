//! Each of the paper's equations is cited where it is coded, as `Eq. (n)`.

use crate::{files, root, text};

#[test]
fn every_equation_is_cited() {
    let sources: Vec<String> = ["src", "realtime", "config", "shm"]
        .iter()
        .flat_map(|folder| files(&root().join(folder), ".rs"))
        .map(|path| text(&path))
        .collect();
    for number in 1..=17 {
        let cited = sources.iter().any(|source| source.contains(&format!("// Eq. ({number})")));
        assert!(cited, "equation ({number}) is not cited as `// Eq. ({number})`");
    }
}
