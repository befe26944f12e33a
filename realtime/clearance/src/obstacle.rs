//! Objects of the scene and the carried part, checked and brought into the form the kernels want.

use core::fmt;

use nalgebra::{Isometry3, Matrix3, Quaternion, Translation3, UnitQuaternion, Vector3};
use tandem_msg::{AttachedPart, Pose, SCENE_OBJECTS_MAX, SceneObject, ShapeKind};

use crate::kernel::{Near, OrientedBox, box_to_box, point_to_segment, segment_to_cylinder, segment_to_segment};

/// Numbers past this, in metres, are taken for garbage.
pub(crate) const FAR: f64 = 1e4;

/// Why a scene was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SceneFault {
    /// More objects than a scene has room for.
    TooMany {
        /// Objects given.
        count: usize,
    },
    /// An object has the number 0, or one that another has.
    Identity {
        /// Index of the object.
        index: usize,
        /// Its number.
        id: u32,
    },
    /// An object's shape is not known.
    Shape {
        /// The object.
        id: u32,
        /// The code it gave.
        code: u32,
    },
    /// A size that counts is not a number of metres above 0.
    Size {
        /// The object.
        id: u32,
    },
    /// The pose is not finite, or its quaternion not of unit length.
    Pose {
        /// The object.
        id: u32,
    },
}

impl fmt::Display for SceneFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::TooMany { count } => write!(f, "the scene has {count} objects, allowed 0..={SCENE_OBJECTS_MAX}"),
            Self::Identity { index, id } => {
                write!(f, "object {index} of the scene has id = {id}, allowed above 0 and used once")
            }
            Self::Shape { id, code } => write!(f, "object {id} has shape = {code}, which no shape has"),
            Self::Size { id } => write!(f, "object {id} has a size that is not finite and above 0 m"),
            Self::Pose { id } => write!(f, "object {id} has a pose that is not finite or not of unit rotation"),
        }
    }
}

impl core::error::Error for SceneFault {}

/// A shape in the frame of its box.
#[derive(Clone, Copy, Debug)]
enum Solid {
    Box,
    /// Along z, with flat caps.
    Cylinder {
        radius: f64,
        half_length: f64,
    },
    /// Ends of the segment in the base frame; a sphere has them in one place.
    Capsule {
        ends: [Vector3<f64>; 2],
        radius: f64,
    },
}

/// One object of the scene.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Obstacle {
    pub(crate) id: u32,
    solid: Solid,
    /// The box that holds it; the object itself when it is a box.
    hull: OrientedBox,
}

impl Obstacle {
    pub(crate) const UNUSED: Self = Self { id: 0, solid: Solid::Box, hull: OrientedBox::UNUSED };

    pub(crate) fn of(index: usize, object: &SceneObject) -> Result<Self, SceneFault> {
        let id = object.id;
        if id == 0 {
            return Err(SceneFault::Identity { index, id });
        }
        let Some(shape) = object.shape.get() else {
            return Err(SceneFault::Shape { id, code: object.shape.raw() });
        };
        let pose = isometry(&object.base_from_object).ok_or(SceneFault::Pose { id })?;
        let [a, b, c] = object.size;
        let axes = pose.rotation.to_rotation_matrix().into_inner();
        let centre = pose.translation.vector;
        let counted: &[f64] = match shape {
            ShapeKind::Box => &[a, b, c],
            ShapeKind::Cylinder => &[a, b],
            ShapeKind::Sphere => &[a],
            // A capsule of no length is a sphere.
            ShapeKind::Capsule if b == 0.0 => &[a],
            ShapeKind::Capsule => &[a, b],
        };
        if !counted.iter().all(|size| *size > 0.0 && *size <= FAR) {
            return Err(SceneFault::Size { id });
        }
        let (solid, half) = match shape {
            ShapeKind::Box => (Solid::Box, Vector3::new(a, b, c)),
            ShapeKind::Cylinder => (Solid::Cylinder { radius: a, half_length: b }, Vector3::new(a, a, b)),
            ShapeKind::Capsule => {
                let ends = [centre - axes.column(2) * b, centre + axes.column(2) * b];
                (Solid::Capsule { ends, radius: a }, Vector3::new(a, a, a + b))
            }
            ShapeKind::Sphere => (Solid::Capsule { ends: [centre; 2], radius: a }, Vector3::new(a, a, a)),
        };
        Ok(Self { id, solid, hull: OrientedBox { centre, axes, half } })
    }

    /// Centre and half extents of a box along the base axes that holds the object.
    pub(crate) fn bounds(&self) -> (Vector3<f64>, Vector3<f64>) {
        let half = match self.solid {
            Solid::Capsule { ends, radius } => (ends[1] - ends[0]).abs() * 0.5 + Vector3::repeat(radius),
            Solid::Box | Solid::Cylinder { .. } => self.hull.half_in_base(),
        };
        (self.hull.centre, half)
    }

    /// Nearest points of a capsule (first) and this object (second), base coordinates.
    #[inline]
    pub(crate) fn near_capsule(&self, ends: &[Vector3<f64>; 2], radius: f64) -> Near {
        match &self.solid {
            Solid::Box => self.hull.near_segment(ends).padded(radius, 0.0),
            Solid::Cylinder { radius: own, half_length } => {
                let local = [self.hull.inwards(&ends[0]), self.hull.inwards(&ends[1])];
                segment_to_cylinder(&local, *own, *half_length)
                    .mapped(|point| self.hull.outwards(point))
                    .padded(radius, 0.0)
            }
            Solid::Capsule { ends: own, radius: around } => capsule_to_capsule(ends, radius, own, *around),
        }
    }

    /// Nearest points of a box (first) and this object (second), or `None` when farther than `enough`.
    pub(crate) fn near_box(&self, part: &OrientedBox, enough: f64) -> Option<Near> {
        match &self.solid {
            Solid::Box => box_to_box(part, &self.hull, enough),
            Solid::Capsule { ends, radius } => Some(part.near_segment(ends).padded(*radius, 0.0).swapped()),
            Solid::Cylinder { radius, half_length } => self.cylinder_to_box(part, *radius, *half_length, enough),
        }
    }

    /// The cylinder lies in each of the boxes around it, so the largest of their distances is not too
    /// large: one box that faces the part, one that stands at 45° to it.
    fn cylinder_to_box(&self, part: &OrientedBox, radius: f64, half_length: f64, enough: f64) -> Option<Near> {
        let towards = self.hull.inwards(&part.centre);
        let across = towards.x.hypot(towards.y);
        let (cos, sin) = if across > 1e-9 { (towards.x / across, towards.y / across) } else { (1.0, 0.0) };
        let diagonal = core::f64::consts::FRAC_1_SQRT_2;
        let mut farthest: Option<Near> = None;
        for (cos, sin) in [(cos, sin), ((cos - sin) * diagonal, (cos + sin) * diagonal)] {
            let turn = Matrix3::new(cos, -sin, 0.0, sin, cos, 0.0, 0.0, 0.0, 1.0);
            let around = OrientedBox {
                centre: self.hull.centre,
                axes: self.hull.axes * turn,
                half: Vector3::new(radius, radius, half_length),
            };
            let near = box_to_box(part, &around, enough)?;
            if farthest.is_none_or(|other| near.distance > other.distance) {
                farthest = Some(near);
            }
        }
        farthest
    }
}

/// Nearest points of two capsules.
#[inline]
pub(crate) fn capsule_to_capsule(
    first: &[Vector3<f64>; 2],
    first_radius: f64,
    second: &[Vector3<f64>; 2],
    second_radius: f64,
) -> Near {
    let near = if second[0] == second[1] {
        point_to_segment(&second[0], first).swapped()
    } else {
        segment_to_segment(first, second)
    };
    near.padded(first_radius, second_radius)
}

/// The carried part: the box's pose on the TCP and its half extents.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CarriedBox {
    pub(crate) tcp_from_part: Isometry3<f64>,
    pub(crate) half: Vector3<f64>,
}

impl CarriedBox {
    /// The part, or `None` when a number of it cannot be.
    pub(crate) fn of(part: &AttachedPart) -> Option<Self> {
        let fits = part.half_extents.iter().all(|half| *half > 0.0 && *half <= FAR);
        let tcp_from_part = isometry(&part.tcp_from_part)?;
        fits.then(|| Self { tcp_from_part, half: Vector3::from(part.half_extents) })
    }

    /// The box where the TCP is.
    pub(crate) fn at(&self, base_from_tcp: &Isometry3<f64>) -> OrientedBox {
        let pose = base_from_tcp * self.tcp_from_part;
        OrientedBox {
            centre: pose.translation.vector,
            axes: pose.rotation.to_rotation_matrix().into_inner(),
            half: self.half,
        }
    }
}

/// A pose of a message, or `None` when it is none.
fn isometry(pose: &Pose) -> Option<Isometry3<f64>> {
    let near = pose.position.iter().all(|x| x.abs() <= FAR);
    let [x, y, z, w] = pose.rotation;
    (near && pose.is_valid()).then(|| {
        let rotation = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
        Isometry3::from_parts(Translation3::from(Vector3::from(pose.position)), rotation)
    })
}
