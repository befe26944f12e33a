//! Poses of messages and of linear algebra.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use tandem_msg::Pose;

/// An isometry as it travels in a message.
pub fn pose_of(a_from_b: &Isometry3<f64>) -> Pose {
    let t = a_from_b.translation.vector;
    let q = a_from_b.rotation.quaternion().coords;
    Pose { position: [t.x, t.y, t.z], rotation: [q.x, q.y, q.z, q.w] }
}

/// The isometry of a pose, or `None` when it is not [`Pose::is_valid`].
pub fn isometry_of(pose: &Pose) -> Option<Isometry3<f64>> {
    pose.is_valid().then(|| {
        let [x, y, z, w] = pose.rotation;
        Isometry3::from_parts(
            Translation3::from(pose.position),
            UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z)),
        )
    })
}
