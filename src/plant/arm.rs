//! The simulated arm: a multibody of rapier3d with a motor in every joint.
//!
//! Each cycle the drives are given a position and a velocity to reach and the
//! world is stepped once, under gravity and with the carried part's mass at the
//! flange. Reduced coordinates keep the joints exact; motors of the
//! acceleration-based model track within 2 mrad at one solver iteration, which is
//! what keeps a step near 10 us. The links carry mass and no colliders: what the
//! arm touches is the referee's to say, and never bends the motion.

use nalgebra::{Isometry3, Matrix3, UnitVector3, Vector3};
use rapier3d_f64::prelude::{
    GenericJointBuilder, JointAxesMask, JointAxis, MassProperties, MotorModel, MultibodyJointHandle, PhysicsWorld,
    RigidBodyBuilder, RigidBodyHandle,
};
use tandem_msg::JOINTS_MAX;

use super::dynamics::{self, Motion};
use super::frames::{body_pose, from_body, vector};

/// Motor stiffness, 1/s²: with the damping below a critically damped pair at 1000 rad/s.
const STIFFNESS: f64 = 1e6;
/// Motor damping, 1/s.
const DAMPING: f64 = 2e3;
/// Free fall, m/s².
pub(super) const GRAVITY: f64 = 9.81;

/// One joint with the link it moves.
#[derive(Clone, Debug)]
pub(super) struct JointModel {
    /// Frame of the joint at position 0, in the frame of the link before it.
    pub(super) parent_from_joint: Isometry3<f64>,
    /// Axis in the joint's own frame.
    pub(super) axis: UnitVector3<f64>,
    /// Slides along the axis when true, turns about it otherwise.
    pub(super) prismatic: bool,
    /// Ends of travel, rad or m.
    pub(super) position: [f64; 2],
    /// rad/s or m/s.
    pub(super) velocity_max: f64,
    /// rad/s² or m/s².
    pub(super) acceleration_max: f64,
    /// Nm or N.
    pub(super) effort_max: f64,
    /// Mass moved by this joint, in its own frame.
    pub(super) link: LinkMass,
}

/// Mass of a rigid body.
#[derive(Clone, Copy, Debug)]
pub(super) struct LinkMass {
    /// kg.
    pub(super) mass: f64,
    /// Centre of mass, metres.
    pub(super) centre: Vector3<f64>,
    /// Inertia about the centre of mass, along the frame's axes, kg m².
    pub(super) inertia: Matrix3<f64>,
}

impl LinkMass {
    /// A solid box about its own centre, seen from a frame in which it stands at `pose`.
    pub(super) fn of_box(mass: f64, half: [f64; 3], pose: &Isometry3<f64>) -> Self {
        let [x, y, z] = half.map(|h| h * h);
        let own = Matrix3::from_diagonal(&Vector3::new(y + z, x + z, x + y)) * (mass / 3.0);
        let turn = pose.rotation.to_rotation_matrix();
        Self { mass, centre: pose.translation.vector, inertia: turn * own * turn.transpose() }
    }

    /// Both bodies as one.
    pub(super) fn with(&self, other: &LinkMass) -> Self {
        let mass = self.mass + other.mass;
        let centre = (self.centre * self.mass + other.centre * other.mass) / mass;
        let shifted = |body: &LinkMass| {
            let r = body.centre - centre;
            body.inertia + (Matrix3::identity() * r.norm_squared() - r * r.transpose()) * body.mass
        };
        Self { mass, centre, inertia: shifted(self) + shifted(other) }
    }

    fn properties(&self) -> MassProperties {
        let m = &self.inertia;
        let columns = [m.column(0), m.column(1), m.column(2)].map(|c| vector(&c.into_owned()));
        let inertia = rapier3d_f64::math::Matrix::from_cols(columns[0], columns[1], columns[2]);
        MassProperties::with_inertia_matrix(vector(&self.centre), self.mass, inertia)
    }
}

/// The arm as the plant knows it.
#[derive(Clone, Debug)]
pub(super) struct ArmModel {
    /// Joints from the base outwards, at most [`JOINTS_MAX`].
    pub(super) joints: Vec<JointModel>,
    /// Tool centre point in the frame of the last link.
    pub(super) flange_from_tcp: Isometry3<f64>,
    /// Where it stands at the start, rad.
    pub(super) home: [f64; JOINTS_MAX],
}

/// What the joints do, per joint: rad, rad/s, Nm.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Measured {
    pub(super) position: [f64; JOINTS_MAX],
    pub(super) velocity: [f64; JOINTS_MAX],
    pub(super) effort: [f64; JOINTS_MAX],
}

/// The arm in the world.
pub(super) struct Arm {
    model: ArmModel,
    bodies: Vec<RigidBodyHandle>,
    joints: Vec<MultibodyJointHandle>,
    load: Option<LinkMass>,
    driven: ([f64; JOINTS_MAX], [f64; JOINTS_MAX]),
    measured: Measured,
    base_from_link: [Isometry3<f64>; JOINTS_MAX + 1],
}

impl Arm {
    /// Builds the arm into the world, standing still at home.
    pub(super) fn new(model: ArmModel, world: &mut PhysicsWorld) -> Self {
        let base = world.insert_body(RigidBodyBuilder::fixed());
        let mut bodies = vec![base];
        let mut joints = Vec::new();
        for joint in &model.joints {
            let body = RigidBodyBuilder::dynamic()
                .additional_mass_properties(joint.link.properties())
                .can_sleep(false)
                .build();
            let body = world.insert_body(body);
            let parent = bodies[joints.len()];
            // The engine's joints move along or about their own x axis.
            let joint_from_axis = Isometry3::from_parts(
                Default::default(),
                nalgebra::UnitQuaternion::rotation_between(&Vector3::x(), &joint.axis).unwrap_or_else(|| {
                    nalgebra::UnitQuaternion::from_axis_angle(&Vector3::y_axis(), core::f64::consts::PI)
                }),
            );
            let (locked, axis) = if joint.prismatic {
                (JointAxesMask::LOCKED_PRISMATIC_AXES, JointAxis::LinX)
            } else {
                (JointAxesMask::LOCKED_REVOLUTE_AXES, JointAxis::AngX)
            };
            let data = GenericJointBuilder::new(locked)
                .local_frame1(body_pose(&(joint.parent_from_joint * joint_from_axis)))
                .local_frame2(body_pose(&joint_from_axis))
                .motor_model(axis, MotorModel::AccelerationBased)
                .set_motor(axis, 0.0, 0.0, STIFFNESS, DAMPING)
                .motor_max_force(axis, joint.effort_max)
                .build();
            if let Some(handle) = world.multibody_joints.insert(parent, body, data, true) {
                joints.push(handle);
            }
            bodies.push(body);
        }
        let mut arm = Self {
            measured: Measured::default(),
            base_from_link: [Isometry3::identity(); JOINTS_MAX + 1],
            load: None,
            driven: ([f64::NAN; JOINTS_MAX], [f64::NAN; JOINTS_MAX]),
            bodies,
            joints,
            model,
        };
        arm.place_at_home(world);
        arm
    }

    fn place_at_home(&mut self, world: &mut PhysicsWorld) {
        let home = self.model.home;
        let count = self.joint_count();
        if let Some((multibody, _)) = self.joints.last().and_then(|&j| world.multibody_joints.get_mut(j)) {
            // The first pass tells the multibody that its root is fixed; only then are its joints counted right.
            multibody.forward_kinematics(&world.bodies, true);
            multibody.apply_displacements(&home[..count]);
            multibody.forward_kinematics(&world.bodies, true);
            multibody.update_rigid_bodies(&mut world.bodies, true);
        }
        self.drive(world, &home, &[0.0; JOINTS_MAX]);
        self.measured.position = home;
        self.read(world, 1.0);
    }

    /// How many joints move.
    pub(super) fn joint_count(&self) -> usize {
        self.model.joints.len()
    }

    /// Sets what the motors strive for, rad and rad/s, and tells whether that is anything new.
    pub(super) fn drive(
        &mut self,
        world: &mut PhysicsWorld,
        position: &[f64; JOINTS_MAX],
        velocity: &[f64; JOINTS_MAX],
    ) -> bool {
        if self.driven == (*position, *velocity) {
            return false;
        }
        self.driven = (*position, *velocity);
        for (index, (&handle, model)) in self.joints.iter().zip(&self.model.joints).enumerate() {
            let Some((multibody, link)) = world.multibody_joints.get_mut(handle) else { continue };
            let Some(link) = multibody.link_mut(link) else { continue };
            let axis = if model.prismatic { JointAxis::LinX } else { JointAxis::AngX };
            let motor = &mut link.joint.data.motors[axis as usize];
            motor.target_pos = position[index];
            motor.target_vel = velocity[index];
        }
        true
    }

    /// A cycle in which nothing moved.
    pub(super) fn stand(&mut self) {
        self.measured.velocity = [0.0; JOINTS_MAX];
    }

    /// Takes a load into the tool, or drops it: its mass and centre in the frame of the last link.
    pub(super) fn set_load(&mut self, world: &mut PhysicsWorld, load: Option<LinkMass>) {
        self.load = load;
        let (Some(model), Some(&body)) = (self.model.joints.last(), self.bodies.last()) else { return };
        let mass = load.map_or(model.link, |load| model.link.with(&load));
        if let Some(body) = world.bodies.get_mut(body) {
            body.set_additional_mass_properties(mass.properties(), true);
        }
    }

    /// Reads joints and frames after a step of `dt` seconds.
    ///
    /// The velocity is how far the joints went: the engine's own differs from it by
    /// what its solver takes back after each step. The effort is what inverse dynamics asks of the motors for the motion
    /// that was seen: the engine keeps no record of its motors' impulses.
    pub(super) fn read(&mut self, world: &PhysicsWorld, dt: f64) {
        let before = self.measured;
        let Some((multibody, _)) = self.joints.last().and_then(|&j| world.multibody_joints.get(j)) else { return };
        let mut motion = Motion::default();
        for (index, (&handle, model)) in self.joints.iter().zip(&self.model.joints).enumerate() {
            let Some((_, link_id)) = world.multibody_joints.get(handle) else { continue };
            let Some(link) = multibody.link(link_id) else { continue };
            let coordinates = link.joint.coords();
            motion.position[index] = coordinates[if model.prismatic { 0 } else { 3 }];
            motion.velocity[index] = (motion.position[index] - before.position[index]) / dt;
            motion.acceleration[index] = (motion.velocity[index] - before.velocity[index]) / dt;
        }
        for (frame, &body) in self.base_from_link.iter_mut().zip(&self.bodies) {
            if let Some(body) = world.bodies.get(body) {
                *frame = from_body(body.position());
            }
        }
        self.measured = Measured {
            position: motion.position,
            velocity: motion.velocity,
            effort: dynamics::effort(&self.model.joints, self.load.as_ref(), &motion),
        };
    }

    /// What the joints did in the last step, without noise.
    pub(super) fn measured(&self) -> &Measured {
        &self.measured
    }

    /// Frames of the base (first) and of the link each joint moves.
    pub(super) fn base_from_link(&self) -> &[Isometry3<f64>] {
        &self.base_from_link[..=self.joint_count()]
    }

    /// Where the tool centre point truly is.
    pub(super) fn base_from_tcp(&self) -> Isometry3<f64> {
        self.base_from_link[self.joint_count()] * self.model.flange_from_tcp
    }

    /// Tool centre point in the frame of the last link.
    pub(super) fn flange_from_tcp(&self) -> &Isometry3<f64> {
        &self.model.flange_from_tcp
    }
}
