//! Convex cores, and bodies that are a core padded by a radius.

use nalgebra::Vector3;

use super::gjk::{self, Wanted};
use super::{Near, OrientedBox, box_to_box, point_to_segment, segment_to_cylinder, segment_to_segment};
use crate::hull::Hull;

/// A convex core where it is, base frame.
#[derive(Clone, Copy)]
pub(crate) enum Core<'a> {
    /// Ends; equal for a point.
    Segment([Vector3<f64>; 2]),
    Box(OrientedBox),
    /// Upright in its frame, with flat caps.
    Cylinder {
        frame: OrientedBox,
        radius: f64,
        half_length: f64,
    },
    /// Points in the frame of the box around them.
    Hull {
        frame: OrientedBox,
        hull: &'a Hull,
    },
    Triangle([Vector3<f64>; 3]),
}

impl Core<'_> {
    /// A point of the core that lies farthest along a direction.
    pub(crate) fn support(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        match self {
            Self::Segment(ends) => {
                let second = direction.dot(&(ends[1] - ends[0])) > 0.0;
                ends[usize::from(second)]
            }
            Self::Box(solid) => {
                let along = solid.axes.tr_mul(direction);
                solid.outwards(along.zip_map(&solid.half, |along, half| half.copysign(along)))
            }
            Self::Cylinder { frame, radius, half_length } => {
                let along = frame.axes.tr_mul(direction);
                let across = (along.x * along.x + along.y * along.y).sqrt();
                let scale = if across > 0.0 { radius / across } else { 0.0 };
                frame.outwards(Vector3::new(along.x * scale, along.y * scale, half_length.copysign(along.z)))
            }
            Self::Hull { frame, hull } => frame.outwards(hull.support(&frame.axes.tr_mul(direction))),
            Self::Triangle(corners) => {
                let [a, b, c] = corners.map(|corner| corner.dot(direction));
                if a >= b && a >= c {
                    corners[0]
                } else if b >= c {
                    corners[1]
                } else {
                    corners[2]
                }
            }
        }
    }

    pub(crate) fn centre(&self) -> Vector3<f64> {
        match self {
            Self::Segment(ends) => (ends[0] + ends[1]) * 0.5,
            Self::Box(frame) | Self::Cylinder { frame, .. } | Self::Hull { frame, .. } => frame.centre,
            Self::Triangle(corners) => (corners[0] + corners[1] + corners[2]) / 3.0,
        }
    }

    /// Normals of faces the core is known to have; zero where there is none.
    pub(super) fn normals(&self) -> [Vector3<f64>; 3] {
        match self {
            Self::Segment(_) | Self::Hull { .. } => [Vector3::zeros(); 3],
            Self::Box(frame) | Self::Cylinder { frame, .. } => {
                [0, 1, 2].map(|axis| frame.axes.column(axis).into_owned())
            }
            Self::Triangle([a, b, c]) => {
                let normal = (b - a).cross(&(c - a)).try_normalize(0.0).unwrap_or_else(Vector3::zeros);
                [normal, Vector3::zeros(), Vector3::zeros()]
            }
        }
    }

    /// Half extents along the base axes, about [`Core::centre`]; not asked of triangles.
    pub(crate) fn half_in_base(&self) -> Vector3<f64> {
        match self {
            Self::Segment(ends) => (ends[1] - ends[0]).abs() * 0.5,
            Self::Box(frame) | Self::Cylinder { frame, .. } | Self::Hull { frame, .. } => frame.half_in_base(),
            Self::Triangle(corners) => {
                let centre = self.centre();
                corners.iter().fold(Vector3::zeros(), |half, corner| half.sup(&(corner - centre).abs()))
            }
        }
    }

    /// The same core seen from the frame of a box.
    pub(crate) fn seen_from(&self, frame: &OrientedBox) -> Self {
        let turned = |own: &OrientedBox| OrientedBox {
            centre: frame.inwards(&own.centre),
            axes: frame.axes.tr_mul(&own.axes),
            half: own.half,
        };
        match *self {
            Self::Segment(ends) => Self::Segment(ends.map(|end| frame.inwards(&end))),
            Self::Box(own) => Self::Box(turned(&own)),
            Self::Cylinder { frame: own, radius, half_length } => {
                Self::Cylinder { frame: turned(&own), radius, half_length }
            }
            Self::Hull { frame: own, hull } => Self::Hull { frame: turned(&own), hull },
            Self::Triangle(corners) => Self::Triangle(corners.map(|corner| frame.inwards(&corner))),
        }
    }
}

/// Nearest points of two cores, or `None` when they are farther apart than wanted. In closed form where
/// there is one; `towards` guides the search elsewhere.
#[inline]
pub(crate) fn core_to_core(first: &Core, second: &Core, towards: Option<Vector3<f64>>, wanted: Wanted) -> Option<Near> {
    match (first, second) {
        (Core::Segment(a), Core::Segment(b)) if b[0] == b[1] => Some(point_to_segment(&b[0], a).swapped()),
        (Core::Segment(a), Core::Segment(b)) => Some(segment_to_segment(a, b)),
        (Core::Segment(a), Core::Box(b)) => Some(b.near_segment(a)),
        (Core::Box(a), Core::Segment(b)) => Some(a.near_segment(b).swapped()),
        (Core::Segment(a), Core::Cylinder { frame, radius, half_length }) => {
            let local = [frame.inwards(&a[0]), frame.inwards(&a[1])];
            Some(segment_to_cylinder(&local, *radius, *half_length).mapped(|point| frame.outwards(point)))
        }
        (Core::Box(a), Core::Box(b)) => box_to_box(a, b, wanted.limit),
        _ => {
            let towards = towards.unwrap_or_else(|| first.centre() - second.centre());
            gjk::core_to_core(first, second, towards, wanted)
        }
    }
}
