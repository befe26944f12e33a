//! Poses, capsules and the objects of a scene. Lengths in metres.

use crate::Code;
use crate::coded::coded;

/// Place and orientation of one frame in another; named `a_from_b` where used.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct Pose {
    /// Origin of the inner frame in the outer one, metres.
    pub position: [f64; 3],
    /// Unit quaternion, order x y z w.
    pub rotation: [f64; 4],
}

impl Pose {
    /// The frame itself.
    pub const IDENTITY: Self = Self { position: [0.0; 3], rotation: [0.0, 0.0, 0.0, 1.0] };

    /// Whether every number is finite and the quaternion has unit length within 1e-6.
    pub fn is_valid(&self) -> bool {
        let squared: f64 = self.rotation.iter().map(|x| x * x).sum();
        self.position.iter().all(|x| x.is_finite()) && (squared - 1.0).abs() < 2e-6
    }
}

impl Default for Pose {
    fn default() -> Self {
        Self::IDENTITY
    }
}

/// A sphere swept along a segment, with the velocity of the body it covers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct Capsule {
    /// Ends of the segment, metres.
    pub ends: [[f64; 3]; 2],
    /// Radius, metres.
    pub radius: f64,
    /// Velocity of the body, m/s.
    pub velocity: [f64; 3],
}

coded! {
    /// Shapes of scene objects; the meaning of `SceneObject::size`, in metres, follows each.
    pub enum ShapeKind {
        /// Half extents along x, y, z.
        Box = 0, "box";
        /// Radius, half length along local z, unused.
        Cylinder = 1, "cylinder";
        /// Radius, half length of the segment along local z, unused.
        Capsule = 2, "capsule";
        /// Radius, unused, unused.
        Sphere = 3, "sphere";
        /// Number of a hull or mesh that was registered at start, unused, unused.
        Registered = 4, "registered";
    }
}

/// One thing the arm must not touch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct SceneObject {
    /// Identity, unique in the scene, never 0; named in reports and in `MotionTask::touch`.
    pub id: u32,
    /// Shape.
    pub shape: Code<ShapeKind>,
    /// Extents as [`ShapeKind`] says, metres.
    pub size: [f64; 3],
    /// Where it stands.
    pub base_from_object: Pose,
}
