//! The reference robots in their scenes as the planner's tests and benches need them: capsule models of the UR5 and the
//! Panda, the person standing among the obstacles.
#![allow(dead_code, unreachable_pub, clippy::disallowed_types, reason = "each test uses its part; tests may allocate")]

#[path = "../../../clearance/tests/reference/mod.rs"]
mod clearance;

use clearance::{Links, robots};
use nalgebra::Vector3;
use tandem_clearance::{ArmBody, Monitor};
use tandem_kinematics::{Chain, JOINTS_MAX};
use tandem_msg::{SCENE_OBJECTS_MAX, SceneObject};

pub type Joints = [f64; JOINTS_MAX];

pub struct Robot {
    pub chain: Chain,
    pub body: ArmBody,
    arm: clearance::Robot,
}

impl Robot {
    pub fn new(name: &str) -> Self {
        let arm = robots().into_iter().find(|robot| robot.name == name).expect("a reference robot");
        Self { chain: arm.chain, body: *arm.monitor(Links::Capsules, true).body(), arm }
    }

    /// Numbers of the scenes that have so many obstacles.
    pub fn scenes(&self, obstacles: usize) -> Vec<String> {
        let mut ids: Vec<String> = self.arm.scene_rows.iter().map(|row| row[0].clone()).collect();
        ids.dedup();
        ids.retain(|id| self.arm.scene_rows.iter().filter(|row| row[0] == *id).count() == obstacles);
        ids
    }

    /// The obstacles of a scene, the person among them as capsules that stand still; of 50 the two that are
    /// farthest from the arm are left out, since a scene has room for 48.
    pub fn objects(&self, scene: &str) -> Vec<SceneObject> {
        let mut objects = self.arm.scene_of_objects(scene);
        let from_base = |object: &SceneObject| Vector3::from(object.base_from_object.position).norm();
        while objects.len() > SCENE_OBJECTS_MAX {
            let farthest =
                (0..objects.len()).max_by(|a, b| from_base(&objects[*a]).total_cmp(&from_base(&objects[*b])));
            objects.remove(farthest.expect("there are some"));
        }
        objects
    }

    pub fn monitor(&self, scene: &str) -> Monitor {
        let mut monitor = Monitor::new(self.body);
        monitor.set_scene(&self.objects(scene)).expect("a reference scene is sound");
        monitor
    }

    /// The next position within half a turn of zero that keeps the margin; `None` when hardly any does.
    pub fn free(&self, monitor: &Monitor, margin: f64, draws: &mut Lehmer) -> Option<Joints> {
        for _ in 0..20_000 {
            let mut position = [0.0; JOINTS_MAX];
            for (slot, joint) in position.iter_mut().zip(self.chain.joints()) {
                let (least, most) =
                    (joint.position_min.max(-std::f64::consts::PI), joint.position_max.min(std::f64::consts::PI));
                *slot = least + (most - least) * draws.share();
            }
            if monitor.is_clear(&self.chain.forward(&position), margin) {
                return Some(position);
            }
        }
        None
    }

    /// Two of them.
    pub fn free_pair(&self, monitor: &Monitor, margin: f64, draws: &mut Lehmer) -> Option<[Joints; 2]> {
        Some([self.free(monitor, margin, draws)?, self.free(monitor, margin, draws)?])
    }
}

/// Lehmer's generator with the constants of Park and Miller: enough to draw test cases.
pub struct Lehmer(pub u64);

impl Lehmer {
    pub fn share(&mut self) -> f64 {
        self.0 = self.0 * 48_271 % 0x7FFF_FFFF;
        self.0 as f64 / f64::from(0x7FFF_FFFF)
    }
}
