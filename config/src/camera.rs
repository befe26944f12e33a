//! The depth camera above the stations.

use crate::read::{Bound, Table, bound};

const DISTANCE: Bound = bound("distance_m", "m", 0.1, 1.5);
const FIELD: Bound = bound("field_of_view_rad", "rad", 0.1, 2.0);
const PIXELS: Bound = bound("pixels", "", 32.0, 1024.0);
const RANGE_SIGMA: Bound = bound("range_sigma_m", "m", 0.0, 0.01);
const DROPOUT: Bound = bound("dropout", "", 0.0, 0.9);

/// The depth camera that looks at a presented part along its inspection view.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Camera {
    /// Distance from the lens to the part's feature, metres.
    pub distance: f64,
    /// Full opening angle of its square image, radians.
    pub field_of_view: f64,
    /// Rows and columns of the image.
    pub pixels: u32,
    /// Standard deviation of a range, metres.
    pub range_sigma: f64,
    /// Share of pixels without an answer.
    pub dropout: f64,
}

impl Camera {
    pub(crate) fn read(layout: &Table<'_>) -> Self {
        let mut out = Self { distance: 0.4, field_of_view: 0.8, pixels: 160, range_sigma: 0.0, dropout: 0.0 };
        let Some(table) = layout.table("camera") else {
            return out;
        };
        out.distance = table.number(&DISTANCE);
        out.field_of_view = table.number(&FIELD);
        out.pixels = table.whole(&PIXELS);
        out.range_sigma = table.number(&RANGE_SIGMA);
        out.dropout = table.number(&DROPOUT);
        out
    }
}
