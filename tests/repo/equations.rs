//! Each of the paper's equations that is built is cited where it is coded, as `Eq. (n)`.

use crate::{files, root, text};

/// Equations not built yet, with what they belong to. Shrinks; never grows.
const NOT_BUILT: &[(u32, &str)] = &[
    (10, "motion: state"),
    (11, "motion: distance to the goal"),
    (12, "motion: distances to obstacles"),
    (13, "motion: safety"),
    (14, "motion: action"),
    (15, "motion: reward"),
];

#[test]
fn every_equation_is_cited_or_listed_as_not_built() {
    let sources: Vec<String> = ["src", "realtime", "config", "shm"]
        .iter()
        .flat_map(|folder| files(&root().join(folder), ".rs"))
        .map(|path| text(&path))
        .collect();
    for number in 1..=17 {
        let cited = sources.iter().any(|source| source.contains(&format!("// Eq. ({number})")));
        let open = NOT_BUILT.iter().any(|(n, _)| *n == number);
        assert!(cited || open, "equation ({number}) is neither cited as `// Eq. ({number})` nor listed as not built");
        assert!(!(cited && open), "equation ({number}) is cited: take it off the list of what is not built");
    }
}
