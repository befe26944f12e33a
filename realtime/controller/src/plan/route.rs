//! The hand-made ways across, in the order they are tried.

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::Tools;
use crate::Joints;

/// Routes across.
pub(super) const ROUTES: usize = 6;

/// Via points of a route; `None` when the route does not apply.
pub(super) fn via_points(
    route: usize,
    from: &Joints,
    to: &Joints,
    tools: &Tools<'_>,
    vias: &mut [Joints; 2],
) -> Option<usize> {
    let chain = tools.chain;
    let start = chain.forward(from).base_from_tcp;
    let end = chain.forward(to).base_from_tcp;
    let top = start.translation.z.max(end.translation.z) + tools.params.via_rise;
    let raised = |pose: &Isometry3<f64>| {
        let mut raised = *pose;
        raised.translation.z = top;
        raised
    };
    let middle = |aside: f64| {
        let across = end.translation.vector - start.translation.vector;
        let level = Vector3::new(-across.y, across.x, 0.0);
        let side = level.try_normalize(1e-3).unwrap_or_else(Vector3::y);
        let mut position = start.translation.vector.lerp(&end.translation.vector, 0.5) + side * aside;
        position.z = top;
        let rotation: UnitQuaternion<f64> = start.rotation.try_slerp(&end.rotation, 0.5, 1e-6).unwrap_or(end.rotation);
        Isometry3::from_parts(Translation3::from(position), rotation)
    };
    let mut halfway = *from;
    for (half, to) in halfway.iter_mut().zip(to) {
        *half = 0.5 * (*half + to);
    }
    match route {
        0 => Some(0),
        1 => {
            vias[0] = chain.inverse(&raised(&start), from).ok()?;
            vias[1] = chain.inverse(&raised(&end), to).ok()?;
            Some(2)
        }
        2 => {
            vias[0] = chain.inverse(&middle(0.0), &halfway).ok()?;
            Some(1)
        }
        3 => {
            vias[0] = chain.inverse(&middle(tools.params.via_offset), &halfway).ok()?;
            Some(1)
        }
        4 => {
            vias[0] = chain.inverse(&middle(-tools.params.via_offset), &halfway).ok()?;
            Some(1)
        }
        _ => {
            vias[0] = tools.params.home;
            Some(1)
        }
    }
}
