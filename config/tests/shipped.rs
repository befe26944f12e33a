//! The files that are shipped load, and describe a box that can be built.
use std::path::Path;
use tandem_config::Cell;

#[test]
fn the_shipped_cell_loads() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("cells/s471.toml");
    let cell = Cell::load(&file, None).unwrap_or_else(|faults| panic!("{faults}"));
    assert_eq!(cell.product.parts.len(), 10);
}
