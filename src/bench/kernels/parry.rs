//! The same question put to parry3d: the smallest distance of all pairs, skipping those whose bounding boxes are
//! farther apart than the best so far.

use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::glamx::{DPose3, DQuat, DVec3};
use parry3d_f64::query;
use parry3d_f64::shape::{Ball, Capsule as Stadium, Cuboid, Cylinder, Shape};
use tandem_clearance::ArmBody;
use tandem_kinematics::LinkPoses;
use tandem_msg::{Capsule, SceneObject, ShapeKind};

pub(super) struct Peer {
    /// The arm's capsules with their links.
    own: Vec<(usize, Stadium)>,
    others: Vec<(Box<dyn Shape>, DPose3, Aabb)>,
    pairs: Vec<[usize; 2]>,
}

impl Peer {
    pub(super) fn of(body: &ArmBody, objects: &[SceneObject], person: &[Capsule]) -> Self {
        let stadium =
            |ends: [[f64; 3]; 2], radius| Stadium::new(DVec3::from_array(ends[0]), DVec3::from_array(ends[1]), radius);
        let placed = |shape: Box<dyn Shape>, place: DPose3| {
            let bounds = shape.compute_aabb(&place);
            (shape, place, bounds)
        };
        let things = objects.iter().map(|object| {
            let [a, b, c] = object.size;
            let [x, y, z, w] = object.base_from_object.rotation;
            let (rotation, translation) =
                (DQuat::from_xyzw(x, y, z, w), DVec3::from_array(object.base_from_object.position));
            // parry's cylinders stand along y, ours along z.
            let upright = rotation * DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2);
            match object.shape.get() {
                Some(ShapeKind::Box) => {
                    placed(Box::new(Cuboid::new(DVec3::new(a, b, c))), DPose3 { rotation, translation })
                }
                Some(ShapeKind::Cylinder) => {
                    placed(Box::new(Cylinder::new(b, a)), DPose3 { rotation: upright, translation })
                }
                _ => placed(Box::new(Ball::new(a)), DPose3 { rotation, translation }),
            }
        });
        let people = person.iter().map(|one| placed(Box::new(stadium(one.ends, one.radius)), DPose3::IDENTITY));
        Self {
            own: body.capsules().iter().map(|one| (one.link, stadium(one.ends, one.radius))).collect(),
            others: things.chain(people).collect(),
            pairs: body.self_pairs().collect(),
        }
    }

    /// 0 where something touches.
    pub(super) fn distance(&self, poses: &LinkPoses) -> f64 {
        let place = |link: usize| {
            let pose = &poses.base_from_link[link];
            let q = pose.rotation.coords;
            let rotation = DQuat::from_xyzw(q.x, q.y, q.z, q.w);
            DPose3 { rotation, translation: DVec3::from_array(pose.translation.vector.into()) }
        };
        let placed: Vec<(DPose3, Aabb)> =
            self.own.iter().map(|(link, shape)| (place(*link), shape.compute_aabb(&place(*link)))).collect();
        let gap = |a: &Aabb, b: &Aabb| {
            ((a.center() - b.center()).abs() - a.half_extents() - b.half_extents()).max(DVec3::ZERO).length()
        };
        let asked = |a: &DPose3, one: &dyn Shape, b: &DPose3, other: &dyn Shape| {
            query::distance(a, one, b, other).map_or(f64::INFINITY, |found| found.distance)
        };
        let mut best = f64::INFINITY;
        // The base is fixed to what it stands on.
        for ((_, own), (pose, bounds)) in self.own.iter().zip(&placed).filter(|((link, _), _)| *link > 0) {
            for (shape, at, other) in &self.others {
                if gap(bounds, other) < best {
                    best = best.min(asked(pose, own, at, &**shape));
                }
            }
        }
        for &[a, b] in &self.pairs {
            if gap(&placed[a].1, &placed[b].1) < best {
                best = best.min(asked(&placed[a].0, &self.own[a].1, &placed[b].0, &self.own[b].1));
            }
        }
        best
    }
}
