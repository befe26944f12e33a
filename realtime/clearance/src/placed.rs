//! The arm where it is, with what it carries.

use nalgebra::{Matrix3, Vector3};
use tandem_kinematics::{JOINTS_MAX, LinkPoses};

use crate::body::HULL_OUTSIDE;
use crate::kernel::{Core, Near, OrientedBox, Wanted, core_to_core};
use crate::obstacle::{CarriedPart, FAR, Obstacle, box_at};
use crate::shapes::Shapes;
use crate::{ArmBody, LINK_CAPSULES_MAX};

/// What a body of the arm is.
#[derive(Clone, Copy, PartialEq)]
enum Form {
    Capsule,
    /// A registered hull in a capsule.
    Hull(u32),
    /// The carried part: a registered hull, or with 0 a box.
    Part(u32),
}

/// A body of the arm where the arm is: one capsule of a link, or the carried part.
#[derive(Clone, Copy)]
pub(crate) struct Placed {
    /// Of the capsule's segment; not used of a part.
    pub(crate) ends: [Vector3<f64>; 2],
    pub(crate) centre: Vector3<f64>,
    /// Half extents along the base axes: of the segment, or of the part.
    pub(crate) half: Vector3<f64>,
    /// Radius around those.
    pub(crate) radius: f64,
    pub(crate) link: usize,
    /// Whether it may touch what a task names.
    pub(crate) tool: bool,
    form: Form,
}

impl Placed {
    const UNUSED: Self = Self {
        ends: [Vector3::new(0.0, 0.0, 0.0); 2],
        centre: Vector3::new(0.0, 0.0, 0.0),
        half: Vector3::new(0.0, 0.0, 0.0),
        radius: 0.0,
        link: 0,
        tool: false,
        form: Form::Capsule,
    };

    pub(crate) fn is_part(&self) -> bool {
        matches!(self.form, Form::Part(_))
    }

    /// Points and a radius: whatever moves with the body's frame goes no farther than what lies within that
    /// radius of one of those. A capsule is round, so only its axis counts.
    pub(crate) fn extent(&self) -> ([Vector3<f64>; 2], f64) {
        match self.form {
            Form::Capsule => (self.ends, 0.0),
            Form::Hull(_) => (self.ends, self.radius),
            Form::Part(_) => ([self.centre; 2], self.half.norm()),
        }
    }

    /// Squared distance between the boxes around the cores of two bodies.
    #[inline]
    pub(crate) fn squared_gap(&self, other: &Self) -> f64 {
        ((self.centre - other.centre).abs() - self.half - other.half).sup(&Vector3::zeros()).norm_squared()
    }
}

/// All bodies of the arm; the carried part is the last.
pub(crate) struct PlacedArm<'a> {
    bodies: [Placed; LINK_CAPSULES_MAX + 1],
    count: usize,
    part: OrientedBox,
    body: &'a ArmBody,
    poses: &'a LinkPoses,
    shapes: Option<&'a Shapes>,
}

impl<'a> PlacedArm<'a> {
    /// The arm at these poses with its part, the capsules not placed yet.
    #[inline]
    pub(crate) fn new(
        body: &'a ArmBody,
        part: Option<&CarriedPart>,
        poses: &'a LinkPoses,
        shapes: Option<&'a Shapes>,
    ) -> Self {
        let mut arm = Self {
            bodies: [Placed::UNUSED; LINK_CAPSULES_MAX + 1],
            count: body.capsules().len(),
            part: OrientedBox::UNUSED,
            body,
            poses,
            shapes,
        };
        if let Some(part) = part {
            arm.part = part.at(&poses.base_from_tcp);
            arm.bodies[arm.count] = Placed {
                centre: arm.part.centre,
                half: arm.part.half_in_base(),
                link: poses.count.min(JOINTS_MAX),
                tool: true,
                form: Form::Part(part.hull),
                ..Placed::UNUSED
            };
            arm.count += 1;
        }
        arm
    }

    /// Places all capsules; false when a number is not finite or absurd.
    #[inline]
    pub(crate) fn place(&mut self) -> bool {
        let tcp = &self.poses.base_from_tcp;
        let mut sound = is_near(&tcp.translation.vector) && tcp.rotation.coords.iter().all(|x| x.is_finite());
        let mut turn = Matrix3::identity();
        let mut turned = usize::MAX;
        for (index, capsule) in self.body.capsules().iter().enumerate() {
            if turned != capsule.link {
                (turn, turned) = (self.turn(capsule.link), capsule.link);
            }
            let [first, second] = self.place_one(index, &turn).ends;
            sound &= is_near(&first) & is_near(&second);
        }
        sound
    }

    /// Places one capsule.
    pub(crate) fn place_capsule(&mut self, index: usize) -> &Placed {
        let turn = self.turn(self.body.capsules()[index].link);
        self.place_one(index, &turn)
    }

    fn turn(&self, link: usize) -> Matrix3<f64> {
        *self.poses.base_from_link[link.min(JOINTS_MAX)].rotation.to_rotation_matrix().matrix()
    }

    #[inline]
    fn place_one(&mut self, index: usize, turn: &Matrix3<f64>) -> &Placed {
        let capsule = &self.body.capsules()[index];
        let origin = &self.poses.base_from_link[capsule.link.min(JOINTS_MAX)].translation.vector;
        let [first, second] = &capsule.ends;
        let ends = [turn * Vector3::from(*first) + origin, turn * Vector3::from(*second) + origin];
        let hull = if self.shapes.is_some() { self.body.hulls()[index] } else { 0 };
        self.bodies[index] = Placed {
            ends,
            centre: (ends[0] + ends[1]) * 0.5,
            half: (ends[1] - ends[0]).abs() * 0.5,
            radius: if hull > 0 { capsule.radius + HULL_OUTSIDE } else { capsule.radius },
            link: capsule.link,
            tool: capsule.tool,
            form: if hull > 0 { Form::Hull(hull) } else { Form::Capsule },
        };
        &self.bodies[index]
    }

    /// The capsules of the links in their order, then the part if there is one.
    pub(crate) fn bodies(&self) -> &[Placed] {
        &self.bodies[..self.count.min(LINK_CAPSULES_MAX + 1)]
    }

    /// The carried part.
    pub(crate) fn part(&self) -> Option<&Placed> {
        self.bodies().last().filter(|body| body.is_part())
    }

    /// The core of a body and the radius around it.
    fn core(&self, body: &Placed) -> (Core<'_>, f64) {
        let capsule = (Core::Segment(body.ends), body.radius);
        let hull = |number: u32| self.shapes.and_then(|shapes| shapes.hull(number));
        match body.form {
            Form::Capsule => capsule,
            Form::Hull(number) => hull(number).map_or(capsule, |hull| {
                let pose = &self.poses.base_from_link[body.link.min(JOINTS_MAX)];
                (Core::Hull { frame: box_at(pose, hull.centre, hull.half), hull }, 0.0)
            }),
            Form::Part(number) => match hull(number) {
                Some(hull) => (Core::Hull { frame: self.part, hull }, 0.0),
                None => (Core::Box(self.part), 0.0),
            },
        }
    }

    /// Of a hull: how far its capsule is from the obstacle, as a bound that is cheap.
    #[inline]
    pub(crate) fn apart_at_least(&self, body: &Placed, obstacle: &Obstacle) -> Option<f64> {
        if !matches!(body.form, Form::Hull(_)) || !obstacle.is_quick() {
            return None;
        }
        let capsule = Core::Segment(body.ends);
        Some(obstacle.near(&capsule, body.radius, None, Wanted::ALL, self.shapes)?.distance)
    }

    /// Of two links, one or both a hull: how far their capsules are apart.
    #[inline]
    pub(crate) fn apart_at_least_each_other(&self, first: &Placed, second: &Placed) -> Option<f64> {
        let [a, b] = [first, second].map(|body| Core::Segment(body.ends));
        let hull = matches!(first.form, Form::Hull(_)) || matches!(second.form, Form::Hull(_));
        let near = (hull && !first.is_part() && !second.is_part()).then(|| core_to_core(&a, &b, None, Wanted::ALL));
        Some(near??.distance - first.radius - second.radius)
    }

    /// Nearest points of a body (first) and an obstacle (second), or `None` when farther apart than wanted.
    #[inline]
    pub(crate) fn near(&self, body: &Placed, obstacle: &Obstacle, wanted: Wanted) -> Option<Near> {
        let capsule = Core::Segment(body.ends);
        if body.form == Form::Capsule {
            return obstacle.near(&capsule, body.radius, None, wanted, self.shapes);
        }
        let mut towards = None;
        if !body.is_part() && obstacle.is_quick() {
            // The capsule around the hull mostly is far enough off, and if not shows the way.
            let apart = Wanted { limit: wanted.limit, enough: 0.0 };
            let around = obstacle.near(&capsule, body.radius, None, apart, self.shapes)?;
            if around.distance > wanted.limit {
                return None;
            }
            towards = way_from(&around);
        }
        let (core, radius) = self.core(body);
        obstacle.near(&core, radius, towards, wanted, self.shapes)
    }

    /// Nearest points of two bodies, or `None` when farther apart than wanted.
    #[inline]
    pub(crate) fn near_each_other(&self, first: &Placed, second: &Placed, wanted: Wanted) -> Option<Near> {
        let mut towards = None;
        if !first.is_part() && !second.is_part() {
            let around = core_to_core(&Core::Segment(first.ends), &Core::Segment(second.ends), None, wanted)?
                .padded(first.radius, second.radius);
            if around.distance > wanted.limit || (first.form, second.form) == (Form::Capsule, Form::Capsule) {
                return Some(around);
            }
            towards = way_from(&around);
        }
        let ((first, radius), (second, around)) = (self.core(first), self.core(second));
        Some(core_to_core(&first, &second, towards, wanted.of_cores(radius + around))?.padded(radius, around))
    }
}

#[inline]
fn is_near(point: &Vector3<f64>) -> bool {
    (point.x.abs() <= FAR) & (point.y.abs() <= FAR) & (point.z.abs() <= FAR)
}

/// The way from the second to the first, whether they overlap or not.
fn way_from(near: &Near) -> Option<Vector3<f64>> {
    let way = near.on_first - near.on_second;
    (way.norm_squared() > 0.0).then(|| if near.distance < 0.0 { -way } else { way })
}
