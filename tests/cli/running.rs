//! Looking at cells when none runs; what is seen of one that runs is in `tests/live`.

use crate::bench::Files;

#[test]
fn a_cell_that_is_not_running_has_its_own_exit_code() {
    let files = Files::new();
    let answer = files.tandem(&["status", "no-such-cell"]);
    assert_eq!((answer.code, answer.out.as_str()), (Some(4), ""), "{answer:?}");
    assert!(answer.err.starts_with("no-such-cell is not running; "), "{answer:?}");
    let answer = files.tandem(&["status", "cells/none.toml", "--json"]);
    assert_eq!(answer.code, Some(3), "{answer:?}");
}

/// `top` draws; into a pipe there is nothing to draw on.
#[test]
fn top_needs_a_terminal() {
    let answer = Files::new().tandem(&["top"]);
    assert_eq!(answer.code, Some(2), "{answer:?}");
    assert!(answer.err.contains("tandem status --json"), "{answer:?}");
}
