//! One control cycle, from what was heard to what is commanded.

mod follow;
mod recover;
mod renew;
mod task;

use nalgebra::Vector3;
use tandem_clearance::Monitor;
use tandem_kinematics::Chain;
use tandem_msg::{
    ChangeReason, Code, HumanState, JOINTS_MAX, JointCommand, JointState, MotionPhase, MotionStatus, MotionTask,
    Planner, PlantFault, RunMode, Scene, Stamp, StopCategory, StopCause, StopState,
};

use crate::black_box::{BlackBox, Record, StopRecord};
use crate::effector::Effector;
use crate::governor::{Governor, Margin};
use crate::guard::Guard;
use crate::inputs::{Heard, Watch, arm_follows, run_mode};
use crate::job::{Job, Stage, pose};
use crate::motion::Motion;
use crate::pace::Pace;
use crate::plan::{Outlook, Search};
use crate::reach::Reach;
use crate::stop::{Causes, StopMonitor};
use crate::{Params, ParamsError};
use tandem_policy::{Policies, Surroundings};

/// What the controller reads each cycle: the latest value of each service, heard or not.
#[derive(Clone, Copy)]
pub struct ControllerInputs<'a> {
    /// Measured arm.
    pub arm: &'a JointState,
    /// Tracked person.
    pub human: &'a HumanState,
    /// Obstacles.
    pub scene: &'a Scene,
    /// Work.
    pub task: &'a MotionTask,
}

/// What the controller writes each cycle; headers are the shell's.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ControllerOutputs {
    /// To the arm.
    pub command: JointCommand,
    /// To everyone.
    pub status: MotionStatus,
}

/// The controller role. It never grows: some two hundred kilobytes, and the trees of its sampling planner.
#[allow(clippy::disallowed_types, reason = "made at start")]
pub struct Controller {
    chain: Chain,
    params: Params,
    reach: Reach,
    velocity_max: [f64; JOINTS_MAX],
    period: f64,

    watch: Watch,
    arm: JointState,
    human: HumanState,
    scene_key: Option<(u64, u64)>,
    scene_valid: bool,
    plan_is_current: bool,

    stop: StopMonitor,
    job: Job,
    effector: Effector,
    // What is large lies on the heap, since a controller is moved about until it runs.
    search: Box<Search>,
    outlook: Box<Outlook>,
    policies: Policies,
    surroundings: Surroundings,
    /// When a better way was looked for last, and how often one was taken.
    renewed_at: Stamp,
    /// The way in hand is blocked, another one is being looked for, and meanwhile the arm goes on at this share of its speed.
    towards: Option<f64>,
    changes: u32,
    change_reason: ChangeReason,
    motion: Motion,
    guard: Box<Guard>,
    governor: Governor,
    /// Level the law in force was made for.
    law_level: usize,
    pace: Pace,
    /// An internal check failed in this cycle.
    refused: bool,
    /// It failed on a command that was not sent then; counts in the next cycle.
    command_fault: bool,
    started: bool,
    margin: Margin,
    /// Seconds the stop would take that was checked last.
    stopping_time: f64,
    tcp_speed: f64,
    base_from_tcp: tandem_msg::Pose,
    black_box: BlackBox,
}

/// What planning works with: all that the controller has, and the outlook's monitor of `scene` or of a scene `peopled`.
macro_rules! tools {
    ($controller:ident, $outlook:ident) => {
        $crate::plan::Tools {
            chain: &$controller.chain,
            params: &$controller.params,
            reach: &$controller.reach,
            monitor: $controller.outlook.$outlook(),
            policies: &$controller.policies,
            surroundings: &$controller.surroundings,
        }
    };
}
use tools;

impl Controller {
    /// A controller of an arm, at rest and with nothing heard. What stands for the arm's shape is its capsules,
    /// or with a [`Monitor`] that knows the hulls in them, those.
    ///
    /// # Errors
    /// Every parameter that is out of range.
    #[allow(clippy::disallowed_types, reason = "made at start")]
    pub fn new(chain: Chain, arm: impl Into<Monitor>, params: Params) -> Result<Self, ParamsError> {
        params.check()?;
        let arm = arm.into();
        let mut velocity_max = [0.0; JOINTS_MAX];
        for (limit, joint) in velocity_max.iter_mut().zip(chain.joints()) {
            *limit = joint.velocity_max;
        }
        Ok(Self {
            reach: Reach::new(&chain, arm.body()),
            velocity_max,
            period: params.period.as_secs_f64(),
            watch: Watch::default(),
            arm: JointState::default(),
            human: HumanState::default(),
            scene_key: None,
            scene_valid: false,
            plan_is_current: false,
            stop: StopMonitor::new(params.resume_after_separation, params.separation.resume_delay),
            job: Job::none(),
            effector: Effector::default(),
            search: Box::new(Search::new()),
            outlook: Box::new(Outlook::new(arm.clone())),
            policies: Policies::default(),
            surroundings: Surroundings::default(),
            renewed_at: Stamp(0),
            towards: None,
            changes: 0,
            change_reason: ChangeReason::None,
            motion: Motion::new(&chain),
            guard: Box::new(Guard::new(&chain, arm, params.clearance_min)),
            governor: Governor::new(&params.separation),
            law_level: 0,
            pace: Pace::new(),
            refused: false,
            command_fault: false,
            started: false,
            margin: Margin::NOBODY,
            stopping_time: 0.0,
            tcp_speed: 0.0,
            base_from_tcp: tandem_msg::Pose::IDENTITY,
            black_box: BlackBox::new(params.period, chain.joint_count()),
            chain,
            params,
        })
    }

    /// Gives it policies that are asked for the way across before anybody else; an arm that has not the joints they
    /// move goes without.
    pub fn set_policies(&mut self, policies: Policies) {
        if self.chain.joint_count() == tandem_policy::DOF {
            self.policies = policies;
        }
    }

    /// Runs one cycle: reads the latest inputs, writes the next command and the status.
    ///
    /// # Realtime
    /// Bounded; no allocation, lock, system call or panic.
    pub fn cycle(&mut self, now: Stamp, inputs: &ControllerInputs<'_>, outputs: &mut ControllerOutputs) {
        self.refused = core::mem::take(&mut self.command_fault);
        if !self.started {
            // What the arm did for a controller before this one is no answer to this one.
            self.started = true;
            self.motion.slack_anew(now);
        }
        let heard = self.watch.judge(now, inputs, &self.params, &self.velocity_max[..self.chain.joint_count()]);
        let mut causes = heard.causes;
        self.absorb(inputs, &heard, &mut causes);
        let brake = self.brakes(heard.arm.good);
        self.engage(now, &heard, brake, &mut causes);
        self.take_task(now, inputs.task, &heard);
        let run = if heard.task.good { run_mode(inputs.task) } else { RunMode::Halt };
        let replaced = heard.task.good && !self.job.is_of(inputs.task);
        let go = self.stop.running()
            && matches!(run, RunMode::Run | RunMode::Reduced)
            && !replaced
            && self.job.abandon.is_none();
        self.advance_task(now, go, heard.arm.good);
        self.renew(now, go);
        self.pace.update(now, run == RunMode::Reduced, self.guard.people().nearest.distance, &self.params);
        self.follow(now, go, &heard, inputs.task.reset_count, causes);
        self.job.clearance_min = self.job.clearance_min.min(self.guard.clearance().distance);
        self.command(now, heard.arm.good, &mut outputs.command);
        self.status(now, &mut outputs.status);
        self.black_box.record(&self.record(now, &outputs.status), self.stop.count(), self.stop.category());
    }

    /// The record of a stop that has not been fetched yet. It is to be given back when it has been written down.
    ///
    /// # Realtime
    /// The box changes hands, nothing else.
    #[allow(clippy::disallowed_types, reason = "made at start")]
    pub fn fetch_stop(&mut self) -> Option<Box<StopRecord>> {
        self.black_box.fetch()
    }

    /// The records of stops at the end of a run, one a call, the last of them as far as it got. Nothing is recorded
    /// after that.
    #[allow(clippy::disallowed_types, reason = "made at start")]
    pub fn last_stops(&mut self) -> Option<Box<StopRecord>> {
        self.black_box.end()
    }

    /// Takes the record of a stop back.
    #[allow(clippy::disallowed_types, reason = "made at start")]
    pub fn give_back(&mut self, record: Box<StopRecord>) {
        self.black_box.give_back(record);
    }

    /// Keeps what may be used of this cycle's samples.
    fn absorb(&mut self, inputs: &ControllerInputs<'_>, heard: &Heard, causes: &mut Causes) {
        if heard.arm.new {
            self.arm = *inputs.arm;
            for beyond in self.chain.joint_count()..JOINTS_MAX {
                self.arm.position[beyond] = 0.0;
                self.arm.velocity[beyond] = 0.0;
            }
            let (poses, jacobian) = self.chain.jacobian(&self.arm.position);
            let velocity = nalgebra::SVector::<f64, JOINTS_MAX>::from(self.arm.velocity);
            let twist = jacobian * velocity;
            self.tcp_speed = Vector3::new(twist[0], twist[1], twist[2]).norm();
            self.base_from_tcp = pose(&poses.base_from_tcp);
        }
        if heard.human.new {
            self.guard.set_human(inputs.human);
            let count = (inputs.human.capsule_count as usize).min(inputs.human.capsules.len());
            self.surroundings.set_person(&inputs.human.capsules[..count]);
            self.human = *inputs.human;
            self.black_box.see(inputs.human);
        }
        if heard.scene.good {
            let key = (inputs.scene.header.epoch, inputs.scene.version);
            if self.scene_key != Some(key) {
                self.scene_key = Some(key);
                self.plan_is_current = false;
                self.drop_renewal();
                self.renewed_at = Stamp(0);
                self.surroundings.set_scene(inputs.scene.objects());
                self.scene_valid = match self.params.workspace.enclose(inputs.scene) {
                    Some((objects, count)) => {
                        let guarded = self.guard.set_scene(&objects[..count]);
                        guarded && self.outlook.set_scene(&objects[..count])
                    }
                    None => false,
                };
                if let Stage::Planning { begun } = &mut self.job.stage {
                    *begun = false;
                }
            }
            if !self.scene_valid {
                causes.add(StopCause::SceneInvalid);
            }
        }
    }

    /// Whether this controller asks for closed brakes.
    fn brakes(&self, arm_good: bool) -> bool {
        let stopped = match (self.stop.state(), self.stop.category()) {
            (StopState::Running, _) | (_, StopCategory::Two) => false,
            (_, StopCategory::Zero) => true,
            (state, StopCategory::One) => state == StopState::Stopped,
        };
        (stopped && self.stop.armed()) || (self.motion.slack_since().is_some() && !arm_good)
    }

    /// Follows the arm in and out of its brakes, and judges how it follows.
    fn engage(&mut self, now: Stamp, heard: &Heard, brake: bool, causes: &mut Causes) {
        if brake {
            self.leave(now);
            self.motion.slack_anew(now);
        }
        if heard.arm.restarted {
            // Another incarnation of the arm: where it is has nothing to do with where it was sent.
            causes.add(StopCause::PlantBraked);
            self.leave(now);
        }
        let Some(since) = self.motion.slack_since() else {
            if heard.arm.good {
                self.judge_arm(now, causes);
            }
            return;
        };
        if !heard.arm.good {
            return;
        }
        self.motion.mirror(&self.arm);
        self.effector.adopt(&self.arm.effector);
        if brake {
            return;
        }
        if arm_follows(&self.arm, since) {
            self.refused |= self.motion.engage(&self.arm).is_err();
        } else if since.age_at(now) > self.params.engage_timeout {
            causes.add(StopCause::PlantBraked);
        }
    }

    /// Tracking error, joint limits and brakes of an arm that is asked to follow.
    fn judge_arm(&mut self, now: Stamp, causes: &mut Causes) {
        let set = *self.motion.set();
        for (index, joint) in self.chain.joints().iter().enumerate() {
            let measured = self.arm.position[index];
            if !((measured - set.position[index]).abs() <= self.params.tracking_error_max) {
                causes.add(StopCause::TrackingError);
            }
            let tolerance = self.params.joint_limit_tolerance;
            let above = measured > joint.position_max + tolerance && set.velocity[index] > 0.0;
            let below = measured < joint.position_min - tolerance && set.velocity[index] < 0.0;
            if above || below {
                causes.add(StopCause::JointLimit);
            }
        }
        if !self.arm.fault.is(PlantFault::None) {
            causes.add(StopCause::PlantBraked);
            self.leave(now);
        }
    }

    /// Gives up the path and goes slack; the task will be planned anew from where the arm is then.
    fn leave(&mut self, now: Stamp) {
        self.motion.slacken(now);
        self.plan_anew();
    }

    fn plan_anew(&mut self) {
        if matches!(self.job.stage, Stage::Leg(_) | Stage::Planning { .. } | Stage::Recovering) {
            self.job.stage = Stage::Planning { begun: false };
        }
    }

    fn command(&self, now: Stamp, arm_good: bool, command: &mut JointCommand) {
        let set = self.motion.set();
        let header = command.header;
        *command = JointCommand {
            header,
            next_due: now.after(self.params.period * self.params.late_command_periods),
            valid_until: now.after(self.params.command_validity),
            joint_count: self.chain.joint_count() as u32,
            brake: u32::from(self.brakes(arm_good)),
            position: set.position,
            velocity: set.velocity,
            acceleration: set.acceleration,
            effector: self.effector.command(),
        };
    }

    fn status(&self, now: Stamp, status: &mut MotionStatus) {
        let leg = match self.job.stage {
            Stage::Leg(index) => self.search.legs().get(index).map_or(MotionPhase::Idle, |leg| leg.phase),
            _ => MotionPhase::Idle,
        };
        let (clearance, nearest) = (self.guard.clearance(), self.guard.people().nearest);
        let nearest = if nearest.distance < clearance.distance {
            [nearest.link as u32, 1000 + nearest.capsule as u32]
        } else {
            [clearance.link as u32, clearance.object]
        };
        let planned = !matches!(self.job.stage, Stage::Idle | Stage::Planning { .. });
        *status = MotionStatus {
            header: status.header,
            task_id: self.job.task.id,
            phase: Code::of(self.job.phase(leg)),
            failure: Code::of(self.job.failure()),
            planner: Code::of(if planned { self.search.planner() } else { Planner::None }),
            stop: Code::of(self.stop.state()),
            cause: Code::of(self.stop.cause()),
            category: Code::of(self.stop.category()),
            standstill: u32::from(self.motion.standstill()),
            stop_count: self.stop.count(),
            reset_seen: self.stop.reset_seen(),
            mode: Code::of(self.pace.mode()),
            changes: self.changes,
            change_reason: Code::of(self.change_reason),
            led_by: if planned { self.search.led_by() } else { 0 },
            nearest,
            clearance: clearance.distance,
            clearance_min: self.job.clearance_min,
            separation: self.margin.pair.distance,
            separation_required: self.margin.owed,
            stopping_time: self.stopping_time,
            speed: self.share() * self.job.task.speed,
            tcp_speed: self.tcp_speed,
            elapsed: self.job.elapsed(now),
            expected: self.job.expected,
            scene_version: self.scene_key.map_or(0, |(_, version)| version),
            base_from_tcp: self.base_from_tcp,
        };
    }

    /// This cycle for the black box, but for the person, whom it has seen itself.
    fn record(&self, now: Stamp, status: &MotionStatus) -> Record {
        let (set, clearance, pair) = (self.motion.set(), self.guard.clearance(), &self.margin.pair);
        Record {
            now,
            stop: self.stop.state(),
            cause: self.stop.cause(),
            mode: self.pace.mode(),
            phase: status.phase.get().unwrap_or(MotionPhase::Idle),
            task_id: self.job.task.id,
            measured: [self.arm.position, self.arm.velocity],
            commanded: [set.position, set.velocity, set.acceleration],
            speed: status.speed,
            clearance: clearance.distance,
            clearance_pair: [clearance.link as u32, clearance.object],
            separation: self.margin.pair.distance,
            separation_required: self.margin.owed,
            separation_pair: [pair.link as u32, pair.capsule as u32],
            stopping_time: self.stopping_time,
            human_age: self.watch.human_age(now),
            ..Record::EMPTY
        }
    }
}
