//! Poses in the two spellings the plant needs: linear algebra and physics engine.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use rapier3d_f64::math::{Pose as BodyPose, Rotation, Vector};

/// An isometry as the physics engine takes it.
pub(super) fn body_pose(isometry: &Isometry3<f64>) -> BodyPose {
    let q = isometry.rotation.quaternion();
    BodyPose::from_parts(vector(&isometry.translation.vector), Rotation::from_xyzw(q.i, q.j, q.k, q.w))
}

/// A pose of the physics engine as an isometry.
pub(super) fn from_body(pose: &BodyPose) -> Isometry3<f64> {
    let (t, q) = (pose.translation, pose.rotation);
    Isometry3::from_parts(
        Translation3::new(t.x, t.y, t.z),
        UnitQuaternion::new_unchecked(Quaternion::new(q.w, q.x, q.y, q.z)),
    )
}

/// A vector as the physics engine takes it.
pub(super) fn vector(v: &Vector3<f64>) -> Vector {
    Vector::new(v.x, v.y, v.z)
}

/// How far two frames are apart: metres between the origins, radians between the axes.
pub(super) fn apart(a: &Isometry3<f64>, b: &Isometry3<f64>) -> (f64, f64) {
    ((a.translation.vector - b.translation.vector).norm(), a.rotation.angle_to(&b.rotation))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Neither spelling loses or turns anything.
    #[test]
    fn a_pose_survives_both_spellings() {
        let it = Isometry3::new(Vector3::new(0.1, -0.2, 0.3), Vector3::new(0.4, 0.5, -0.6));
        let (metres, radians) = apart(&it, &from_body(&body_pose(&it)));
        assert!(metres < 1e-15 && radians < 1e-7, "{metres} m, {radians} rad");
    }
}
