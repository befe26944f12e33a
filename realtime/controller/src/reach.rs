//! How far points of the arm stand from the axes that move them.

use tandem_clearance::ArmBody;
use tandem_kinematics::{Chain, JointKind};
use tandem_msg::{AttachedPart, JOINTS_MAX};

use crate::Joints;

/// Largest distance of a link's geometry from its frame. The radius does not count: a capsule's surface moves as its segment does.
fn extent(body: &ArmBody, link: usize) -> f64 {
    let of_link = body.capsules().iter().filter(|capsule| capsule.link == link);
    of_link.flat_map(|capsule| &capsule.ends).map(norm).fold(0.0, f64::max)
}

fn norm(v: &[f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// For each joint, the largest distance from its frame to any point it moves, whatever the others do.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reach {
    /// To the farthest collision geometry, metres.
    body: Joints,
    /// To the TCP, metres.
    tcp: Joints,
    prismatic: [bool; JOINTS_MAX],
}

impl Reach {
    pub(crate) fn new(chain: &Chain, body: &ArmBody) -> Self {
        let joints = chain.joints();
        let mut reach = Self { body: [0.0; JOINTS_MAX], tcp: [0.0; JOINTS_MAX], prismatic: [false; JOINTS_MAX] };
        for (index, joint) in joints.iter().enumerate() {
            reach.prismatic[index] = joint.kind == JointKind::Prismatic;
            let mut along = 0.0;
            for link in index + 1..=joints.len() {
                if link > index + 1 {
                    along += joints[link - 1].parent_from_joint.translation.vector.norm();
                    if joints[link - 1].kind == JointKind::Prismatic {
                        along += joints[link - 1].position_max.abs().max(joints[link - 1].position_min.abs());
                    }
                }
                reach.body[index] = reach.body[index].max(along + extent(body, link));
            }
            reach.tcp[index] = along + chain.tool().translation.vector.norm();
        }
        reach
    }

    /// Travel of the farthest point of arm and carried part per joint movement, metres per rad (or per metre).
    pub(crate) fn with(&self, part: &AttachedPart) -> Joints {
        let part = if part.present == 1 { norm(&part.half_extents) + norm(&part.tcp_from_part.position) } else { 0.0 };
        let mut reach = [0.0; JOINTS_MAX];
        for (index, reach) in reach.iter_mut().enumerate() {
            *reach = if self.prismatic[index] { 1.0 } else { self.body[index].max(self.tcp[index] + part) };
        }
        reach
    }
}
