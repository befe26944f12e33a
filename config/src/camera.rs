//! The depth camera above the stations.

use crate::read::{Bound, Table, bound};

const DISTANCE: Bound = bound("distance_m", "m", 0.1, 1.5);
const RANGE_SIGMA: Bound = bound("range_sigma_m", "m", 0.0, 0.01);
const DROPOUT: Bound = bound("dropout", "", 0.0, 0.9);

/// The depth camera that looks at a presented part along its inspection view; its field follows the feature's size.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct Camera {
    /// Distance from the lens to the part's feature, metres.
    pub distance: f64,
    /// Standard deviation of a range, metres.
    pub range_sigma: f64,
    /// Share of points without an answer.
    pub dropout: f64,
}

impl Camera {
    pub(crate) fn read(layout: &Table<'_>) -> Self {
        let mut out = Self { distance: 0.4, range_sigma: 0.0, dropout: 0.0 };
        let Some(table) = layout.table("camera") else {
            return out;
        };
        out.distance = table.number(&DISTANCE);
        out.range_sigma = table.number(&RANGE_SIGMA);
        out.dropout = table.number(&DROPOUT);
        out
    }
}
