//! Signed distances of part bodies.

use nalgebra::Isometry3;

use tandem_config::Body;

/// A body, evaluated at points of the feature frame.
#[derive(Clone, Debug)]
pub(crate) struct BodySolid {
    shape: Shape,
    /// Rows of the rotation part_from_feature.
    rotation: [[f32; 3]; 3],
    origin: [f32; 3],
}

#[derive(Clone, Debug)]
enum Shape {
    /// Half extents.
    Box([f32; 3]),
    /// Half extents, walls, floor.
    Tray([f32; 3], f32, f32),
    /// Half extents outer and inner, half height.
    Ring([f32; 2], [f32; 2], f32),
    /// Radius, half height, sides of a prism about it.
    Cylinder(f32, f32, u8),
    /// Half length of the centre line, radius.
    Cable(f32, f32),
}

impl BodySolid {
    /// `sides` makes a prism of a cylinder.
    pub(crate) fn new(body: &Body, sides: u8, part_from_feature: &Isometry3<f64>) -> Self {
        let half = |v: f64| (0.5 * v) as f32;
        let shape = match body {
            Body::Box { size } => Shape::Box(size.map(half)),
            Body::Tray { size, wall, floor } => Shape::Tray(size.map(half), *wall as f32, *floor as f32),
            Body::Ring { outer, inner, height } => Shape::Ring(outer.map(half), inner.map(half), half(*height)),
            Body::Cylinder { radius, height } => Shape::Cylinder(*radius as f32, half(*height), sides),
            Body::Cable { length, radius } => Shape::Cable(half(*length - 2.0 * radius), *radius as f32),
        };
        let matrix = part_from_feature.rotation.to_rotation_matrix();
        let rotation = [0, 1, 2].map(|r| [0, 1, 2].map(|c| matrix[(r, c)] as f32));
        let origin = [0, 1, 2].map(|i| part_from_feature.translation.vector[i] as f32);
        Self { shape, rotation, origin }
    }

    /// Signed distance, metres, at a point of the feature frame.
    #[inline]
    pub(crate) fn distance(&self, p: [f32; 3]) -> f32 {
        let row = |i: usize| {
            let r = self.rotation[i];
            r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + self.origin[i]
        };
        let (x, y, z) = (row(0), row(1), row(2));
        match &self.shape {
            Shape::Box(half) => cuboid([x, y, z], *half),
            Shape::Tray(half, wall, floor) => {
                let cavity = extrude(rectangle([x, y], [half[0] - wall, half[1] - wall]), floor - half[2] - z);
                cuboid([x, y, z], *half).max(-cavity)
            }
            Shape::Ring(outer, inner, height) => {
                let frame = rectangle([x, y], *outer).max(-rectangle([x, y], *inner));
                extrude(frame, z.abs() - height)
            }
            Shape::Cable(run, radius) => {
                let past = (y.abs() - run).max(0.0);
                (x * x + past * past + z * z).sqrt() - radius
            }
            Shape::Cylinder(radius, height, sides) => extrude(prism([x, y], *radius, *sides), z.abs() - height),
        }
    }
}

/// Box of half extents `half` about the origin.
#[inline]
pub(crate) fn cuboid(p: [f32; 3], half: [f32; 3]) -> f32 {
    let q = [p[0].abs() - half[0], p[1].abs() - half[1], p[2].abs() - half[2]];
    let inside = q[0].max(q[1]).max(q[2]);
    if inside <= 0.0 {
        return inside;
    }
    let o = q.map(|v| v.max(0.0));
    (o[0] * o[0] + o[1] * o[1] + o[2] * o[2]).sqrt()
}

/// Rectangle of half extents `half` about the origin.
#[inline]
pub(crate) fn rectangle(p: [f32; 2], half: [f32; 2]) -> f32 {
    extrude(p[0].abs() - half[0], p[1].abs() - half[1])
}

/// Lower bound of the distance to a regular polygon about the origin, flat towards +x, with this radius of the
/// circle inside it; to the circle itself without sides.
#[inline]
pub(crate) fn prism([x, y]: [f32; 2], radius: f32, sides: u8) -> f32 {
    let rho = (x * x + y * y).sqrt();
    if sides == 0 {
        return rho - radius;
    }
    let sector = core::f32::consts::TAU / f32::from(sides);
    let angle = y.atan2(x);
    rho * (angle - sector * (angle / sector).round()).cos() - radius
}

/// Joins a distance in a plane and one along its normal into that of the prism.
#[inline]
pub(crate) fn extrude(across: f32, along: f32) -> f32 {
    if across > 0.0 && along > 0.0 { (across * across + along * along).sqrt() } else { across.max(along) }
}
