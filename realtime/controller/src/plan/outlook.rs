//! What is planned around: the scene, and for a way that is renewed under way the people in it as well.
//!
//! A person counts as their body parts, each grown by the separation it is owed and stretched to where it will be in a
//! moment at its present speed. They are objects like any other here, so whoever plans keeps away from them.

use nalgebra::{UnitQuaternion, Vector3};
use tandem_clearance::Monitor;
use tandem_kinematics::LinkPoses;
use tandem_msg::{Capsule, Code, Pose, SCENE_OBJECTS_MAX, SceneObject, ShapeKind};

/// Ids of body parts, from here on.
const FIRST_ID: u32 = 0x7fff_ff00;
/// How far ahead body parts are stretched, s.
const AHEAD: f64 = 0.3;

/// The scene as planners see it.
pub(crate) struct Outlook {
    monitor: Monitor,
    objects: [SceneObject; SCENE_OBJECTS_MAX],
    count: usize,
    /// Whether people are in it at present.
    peopled: bool,
}

impl Outlook {
    pub(crate) fn new(monitor: Monitor) -> Self {
        Self { monitor, objects: [SceneObject::default(); SCENE_OBJECTS_MAX], count: 0, peopled: false }
    }

    /// Takes the objects of a scene; says whether it is one.
    pub(crate) fn set_scene(&mut self, objects: &[SceneObject]) -> bool {
        self.count = 0;
        for (slot, object) in self.objects.iter_mut().zip(objects) {
            *slot = *object;
            self.count += 1;
        }
        self.peopled = false;
        self.monitor.set_scene(objects).is_ok()
    }

    /// The scene by itself.
    pub(crate) fn scene(&mut self) -> &mut Monitor {
        if self.peopled {
            // It was accepted when it came.
            let _ = self.monitor.set_scene(&self.objects[..self.count]);
            self.peopled = false;
        }
        &mut self.monitor
    }

    /// Puts people in, owed `separation` metres; false when there is no room for them all.
    pub(crate) fn with_people(&mut self, people: &[Capsule], separation: f64) -> bool {
        let mut objects = self.objects;
        let mut count = self.count;
        for (capsule, id) in people.iter().zip(FIRST_ID..) {
            let Some(slot) = objects.get_mut(count) else { return false };
            *slot = grown(capsule, separation, id);
            count += 1;
        }
        self.peopled = true;
        self.monitor.set_scene(&objects[..count]).is_ok()
    }

    /// The scene with whoever was put in last.
    pub(crate) fn peopled(&mut self) -> &mut Monitor {
        &mut self.monitor
    }

    /// Smallest distance to what is planned around at present, metres.
    pub(crate) fn clearance(&self, poses: &LinkPoses) -> f64 {
        self.monitor.clearance(poses).distance
    }
}

/// A capsule around a body part from where it is to where it will be, grown by `separation`.
fn grown(capsule: &Capsule, separation: f64, id: u32) -> SceneObject {
    let half_way = 0.5 * AHEAD * Vector3::from(capsule.velocity);
    let [a, b] = capsule.ends.map(|end| Vector3::from(end) + half_way);
    let along = b - a;
    let turn = UnitQuaternion::rotation_between(&Vector3::z(), &along)
        .unwrap_or_else(|| UnitQuaternion::from_axis_angle(&Vector3::x_axis(), core::f64::consts::PI));
    let [x, y, z, w] = turn.coords.into();
    SceneObject {
        id,
        shape: Code::of(ShapeKind::Capsule),
        size: [capsule.radius + separation + half_way.norm(), 0.5 * along.norm(), 0.0],
        base_from_object: Pose { position: ((a + b) / 2.0).into(), rotation: [x, y, z, w] },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Wherever a body part is between now and then, the object that stands for it reaches as far beyond as it is owed.
    #[test]
    fn a_body_part_is_inside_of_what_stands_for_it() {
        let capsule = Capsule { ends: [[0.3, -0.2, 0.1], [0.5, 0.1, 0.9]], radius: 0.08, velocity: [-0.7, 1.1, 0.2] };
        for (velocity, ends) in [
            (capsule.velocity, capsule.ends),
            ([0.0; 3], [capsule.ends[0]; 2]),
            ([0.0, 0.0, 1.0], [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]),
        ] {
            let object = grown(&Capsule { velocity, ends, ..capsule }, 0.25, 1);
            let [radius, half, _] = object.size;
            let pose = crate::job::isometry(&object.base_from_object);
            for step in 0..=10 {
                let time = AHEAD * f64::from(step) / 10.0;
                for end in ends {
                    let point = Vector3::from(end) + time * Vector3::from(velocity);
                    let local = pose.inverse_transform_point(&point.into());
                    let axis = Vector3::new(0.0, 0.0, local.z.clamp(-half, half));
                    assert!((local.coords - axis).norm() + capsule.radius + 0.25 <= radius + 1e-9, "{velocity:?}");
                }
            }
        }
    }
}
