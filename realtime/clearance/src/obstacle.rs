//! Objects of the scene and the carried part, checked and brought into the form the kernels want.

use core::fmt;

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use tandem_msg::{AttachedPart, Capsule, Pose, SCENE_OBJECTS_MAX, SceneObject, ShapeKind};

use crate::hull::Hull;
use crate::kernel::{Core, Near, OrientedBox, Wanted, core_to_core};
use crate::mesh::Mesh;
use crate::shapes::Shapes;

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
    /// The number it gives is of no registered hull or mesh.
    Unregistered {
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
            Self::Unregistered { id } => write!(f, "object {id} names a shape that was not registered at start"),
            Self::Pose { id } => write!(f, "object {id} has a pose that is not finite or not of unit rotation"),
        }
    }
}

impl core::error::Error for SceneFault {}

/// A shape in the frame of its box.
#[derive(Clone, Copy, Debug)]
enum Form {
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
    /// Number among the registered shapes.
    Hull(u32),
    Mesh(u32),
}

/// One object of the scene, or one capsule of a person.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Obstacle {
    pub(crate) id: u32,
    form: Form,
    /// The box that holds it; the object itself when it is a box.
    frame: OrientedBox,
}

impl Obstacle {
    pub(crate) const UNUSED: Self = Self { id: 0, form: Form::Box, frame: OrientedBox::UNUSED };

    pub(crate) fn of(index: usize, object: &SceneObject, shapes: Option<&Shapes>) -> Result<Self, SceneFault> {
        let id = object.id;
        if id == 0 {
            return Err(SceneFault::Identity { index, id });
        }
        let Some(shape) = object.shape.get() else {
            return Err(SceneFault::Shape { id, code: object.shape.raw() });
        };
        let pose = isometry(&object.base_from_object).ok_or(SceneFault::Pose { id })?;
        let [a, b, c] = object.size;
        if shape == ShapeKind::Registered {
            return registered(id, a, &pose, shapes);
        }
        let axes = pose.rotation.to_rotation_matrix().into_inner();
        let centre = pose.translation.vector;
        let counted: &[f64] = match shape {
            ShapeKind::Box => &[a, b, c],
            ShapeKind::Cylinder => &[a, b],
            ShapeKind::Sphere => &[a],
            // A capsule of no length is a sphere.
            ShapeKind::Capsule if b == 0.0 => &[a],
            ShapeKind::Capsule | ShapeKind::Registered => &[a, b],
        };
        if !counted.iter().all(|size| *size > 0.0 && *size <= FAR) {
            return Err(SceneFault::Size { id });
        }
        let (form, half) = match shape {
            ShapeKind::Cylinder => (Form::Cylinder { radius: a, half_length: b }, Vector3::new(a, a, b)),
            ShapeKind::Capsule => {
                let ends = [centre - axes.column(2) * b, centre + axes.column(2) * b];
                (Form::Capsule { ends, radius: a }, Vector3::new(a, a, a + b))
            }
            ShapeKind::Sphere => (Form::Capsule { ends: [centre; 2], radius: a }, Vector3::new(a, a, a)),
            ShapeKind::Box | ShapeKind::Registered => (Form::Box, Vector3::new(a, b, c)),
        };
        Ok(Self { id, form, frame: OrientedBox { centre, axes, half } })
    }

    /// A capsule of a person.
    pub(crate) fn of_person(id: u32, capsule: &Capsule) -> Self {
        let ends = capsule.ends.map(Vector3::from);
        let centre = (ends[0] + ends[1]) * 0.5;
        let frame = OrientedBox { centre, ..OrientedBox::UNUSED };
        Self { id, form: Form::Capsule { ends, radius: capsule.radius }, frame }
    }

    /// Centre and half extents of a box along the base axes that holds the object's core, and the
    /// radius around that core.
    pub(crate) fn bounds(&self) -> (Vector3<f64>, Vector3<f64>, f64) {
        match self.form {
            Form::Capsule { ends, radius } => (self.frame.centre, (ends[1] - ends[0]).abs() * 0.5, radius),
            Form::Box | Form::Cylinder { .. } | Form::Hull(_) | Form::Mesh(_) => {
                (self.frame.centre, self.frame.half_in_base(), 0.0)
            }
        }
    }

    /// Depths in it that are answered, though a shorter way may lead out along an axis of the base.
    pub(crate) fn deepest(&self) -> f64 {
        match self.form {
            Form::Box | Form::Capsule { .. } | Form::Hull(_) => 0.0,
            Form::Cylinder { radius, .. } => radius,
            Form::Mesh(_) => f64::INFINITY,
        }
    }

    /// Whether a capsule's distance to it has a closed form.
    pub(crate) fn is_quick(&self) -> bool {
        !matches!(self.form, Form::Hull(_) | Form::Mesh(_))
    }

    pub(crate) fn centre(&self) -> Vector3<f64> {
        self.frame.centre
    }

    /// Nearest points of a body (first), given by its core and the radius around it, and this object
    /// (second), base coordinates; `None` when they are farther apart than wanted.
    #[inline]
    pub(crate) fn near(
        &self,
        core: &Core,
        radius: f64,
        towards: Option<Vector3<f64>>,
        wanted: Wanted,
        shapes: Option<&Shapes>,
    ) -> Option<Near> {
        let (own, around) = match self.form {
            Form::Box => (Core::Box(self.frame), 0.0),
            Form::Cylinder { radius, half_length } => (Core::Cylinder { frame: self.frame, radius, half_length }, 0.0),
            Form::Capsule { ends, radius } => (Core::Segment(ends), radius),
            Form::Hull(number) => {
                let Some(hull) = shapes.and_then(|shapes| shapes.hull(number)) else { return Some(Near::LOST) };
                (Core::Hull { frame: self.frame, hull }, 0.0)
            }
            Form::Mesh(number) => {
                let Some(mesh) = shapes.and_then(|shapes| shapes.mesh(number)) else { return Some(Near::LOST) };
                let near = mesh.near(&core.seen_from(&self.frame), wanted.of_cores(radius))?;
                return Some(near.mapped(|point| self.frame.outwards(point)).padded(radius, 0.0));
            }
        };
        Some(core_to_core(core, &own, towards, wanted.of_cores(radius + around))?.padded(radius, around))
    }
}

/// An object that is a registered shape.
fn registered(id: u32, number: f64, pose: &Isometry3<f64>, shapes: Option<&Shapes>) -> Result<Obstacle, SceneFault> {
    // What is no whole number turns into one that differs from it.
    let whole = number as u32;
    let found = shapes.filter(|_| f64::from(whole) == number).and_then(|shapes| {
        let hull = |hull: &Hull| (Form::Hull(whole), box_at(pose, hull.centre, hull.half));
        let mesh = |mesh: &Mesh| (Form::Mesh(whole), box_at(pose, mesh.centre, mesh.half));
        shapes.hull(whole).map(hull).or_else(|| shapes.mesh(whole).map(mesh))
    });
    let (form, frame) = found.ok_or(SceneFault::Unregistered { id })?;
    Ok(Obstacle { id, form, frame })
}

/// A box given by its middle and half extents in a frame.
pub(crate) fn box_at(pose: &Isometry3<f64>, centre: Vector3<f64>, half: Vector3<f64>) -> OrientedBox {
    let axes = pose.rotation.to_rotation_matrix().into_inner();
    OrientedBox { centre: axes * centre + pose.translation.vector, axes, half }
}

/// The carried part: the pose on the TCP of the box around it, and the hull in it when it is no box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CarriedPart {
    tcp_from_part: Isometry3<f64>,
    centre: Vector3<f64>,
    half: Vector3<f64>,
    /// Number among the registered shapes; 0 is the box itself.
    pub(crate) hull: u32,
}

impl CarriedPart {
    /// The part, or `None` when a number of it cannot be.
    pub(crate) fn of(part: &AttachedPart, shapes: Option<&Shapes>) -> Option<Self> {
        let tcp_from_part = isometry(&part.tcp_from_part)?;
        let (centre, half) = if part.shape == 0 {
            let fits = part.half_extents.iter().all(|half| *half > 0.0 && *half <= FAR);
            fits.then(|| (Vector3::zeros(), Vector3::from(part.half_extents)))?
        } else {
            let hull = shapes?.hull(part.shape)?;
            (hull.centre, hull.half)
        };
        Some(Self { tcp_from_part, centre, half, hull: part.shape })
    }

    /// The box around the part where the TCP is.
    pub(crate) fn at(&self, base_from_tcp: &Isometry3<f64>) -> OrientedBox {
        box_at(&(base_from_tcp * self.tcp_from_part), self.centre, self.half)
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
