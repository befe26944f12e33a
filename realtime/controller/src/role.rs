//! One control cycle, from what was heard to what is commanded.

use nalgebra::Vector3;
use tandem_clearance::ArmBody;
use tandem_kinematics::Chain;
use tandem_msg::{
    Code, HumanState, JOINTS_MAX, JointCommand, JointState, MotionFailure, MotionPhase, MotionStatus, MotionTask,
    Planner, PlantFault, RunMode, Scene, Stamp, StopCategory, StopCause, StopState,
};
use tandem_trajectory::State;

use crate::effector::{Answer, Effector};
use crate::governor::{Governor, Person};
use crate::guard::Guard;
use crate::inputs::{Heard, Watch, arm_follows, run_mode, task_is_valid};
use crate::job::{Job, Stage, pose};
use crate::law::{Law, Refused};
use crate::motion::Motion;
use crate::plan::{Progress, Search, Tools};
use crate::reach::Reach;
use crate::stop::{Causes, Seen, StopMonitor};
use crate::{Params, ParamsError};
use tandem_clearance::Monitor;

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

/// The controller role. A value of some tens of kilobytes that never grows.
pub struct Controller {
    chain: Chain,
    params: Params,
    reach: Reach,
    velocity_max: [f64; JOINTS_MAX],
    period: f64,

    watch: Watch,
    arm: JointState,
    human_sigma: f64,
    scene_key: Option<(u64, u64)>,
    scene_valid: bool,
    plan_is_current: bool,

    stop: StopMonitor,
    job: Job,
    effector: Effector,
    search: Search,
    planner: Monitor,
    motion: Motion,
    guard: Guard,
    governor: Governor,
    /// Level the law in force was made for.
    law_level: usize,
    /// An internal check failed in this cycle.
    refused: bool,
    started: bool,
    required: f64,
    tcp_speed: f64,
    base_from_tcp: tandem_msg::Pose,
}

impl Controller {
    /// A controller of an arm, at rest and with nothing heard.
    ///
    /// # Errors
    /// Every parameter that is out of range.
    pub fn new(chain: Chain, body: ArmBody, params: Params) -> Result<Self, ParamsError> {
        params.check()?;
        let mut velocity_max = [0.0; JOINTS_MAX];
        for (limit, joint) in velocity_max.iter_mut().zip(chain.joints()) {
            *limit = joint.velocity_max;
        }
        Ok(Self {
            reach: Reach::new(&chain, &body),
            velocity_max,
            period: params.period.as_secs_f64(),
            watch: Watch::default(),
            arm: JointState::default(),
            human_sigma: 0.0,
            scene_key: None,
            scene_valid: false,
            plan_is_current: false,
            stop: StopMonitor::new(params.resume_after_separation, params.separation.resume_delay),
            job: Job::none(),
            effector: Effector::default(),
            search: Search::new(),
            planner: Monitor::new(body),
            motion: Motion::new(&chain),
            guard: Guard::new(&chain, body, params.clearance_min),
            governor: Governor::new(&params.separation),
            law_level: 0,
            refused: false,
            started: false,
            required: 0.0,
            tcp_speed: 0.0,
            base_from_tcp: tandem_msg::Pose::IDENTITY,
            chain,
            params,
        })
    }

    /// Runs one cycle: reads the latest inputs, writes the next command and the status.
    ///
    /// # Realtime
    /// Bounded; no allocation, lock, system call or panic.
    pub fn cycle(&mut self, now: Stamp, inputs: &ControllerInputs<'_>, outputs: &mut ControllerOutputs) {
        self.refused = false;
        if !self.started {
            // What the arm did for a controller before this one is no answer to this one.
            self.started = true;
            self.motion.slack_anew(now);
        }
        let heard = self.watch.judge(now, inputs, &self.params, &self.velocity_max[..self.chain.joint_count()]);
        let mut causes = heard.causes;
        self.absorb(inputs, &heard, &mut causes);
        let brake = self.brakes(&heard);
        self.engage(now, &heard, brake, &mut causes);
        self.take_task(now, inputs.task, &heard);
        let run = if heard.task.good { run_mode(inputs.task) } else { RunMode::Halt };
        let replaced = heard.task.good && !self.job.is_of(inputs.task);
        let go = self.stop.running() && run == RunMode::Run && !replaced && self.job.abandon.is_none();
        self.advance_task(now, go, heard.arm.good);
        self.follow(now, go, &heard, inputs.task.reset_count, causes);
        self.job.clearance_min = self.job.clearance_min.min(self.guard.clearance().distance);
        self.command(now, heard.arm.good, &mut outputs.command);
        self.status(now, &mut outputs.status);
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
            self.human_sigma = inputs.human.position_sigma;
        }
        if heard.scene.good {
            let key = (inputs.scene.header.epoch, inputs.scene.version);
            if self.scene_key != Some(key) {
                self.scene_key = Some(key);
                self.plan_is_current = false;
                let guarded = self.guard.set_scene(inputs.scene);
                self.scene_valid = guarded && self.planner.set_scene(inputs.scene.objects()).is_ok();
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
    fn brakes(&self, heard: &Heard) -> bool {
        let stopped = match (self.stop.state(), self.stop.category()) {
            (StopState::Running, _) | (_, StopCategory::Two) => false,
            (_, StopCategory::Zero) => true,
            (state, StopCategory::One) => state == StopState::Stopped,
        };
        (stopped && self.stop.armed()) || (self.motion.slack_since().is_some() && !heard.arm.good)
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
        if matches!(self.job.stage, Stage::Leg(_) | Stage::Planning { .. }) {
            self.job.stage = Stage::Planning { begun: false };
        }
    }

    /// Takes a new task once the arm is at rest.
    fn take_task(&mut self, now: Stamp, task: &MotionTask, heard: &Heard) {
        let standing = self.motion.law().is_none_or(|law| law.finished());
        if heard.task.good && !self.job.is_of(task) && standing {
            if self.motion.law().is_some() {
                self.motion.rest();
            }
            self.job = self.job.next(task, now, task.id == 0 || task_is_valid(task));
            if task.id != 0 {
                self.guard.set_context(self.job.attached(), &self.job.touch_at_start());
            }
        }
    }

    /// Goes on with the task where no motion is due: plan, settle, act, end.
    fn advance_task(&mut self, now: Stamp, go: bool, arm_good: bool) {
        let standing = self.motion.at_rest() || self.motion.law().is_some_and(|law| law.finished());
        if let Some(failure) = self.job.abandon
            && standing
        {
            self.job.abandon = None;
            if self.motion.law().is_some() {
                self.motion.rest();
            }
            self.job.end(failure, now);
        }
        if arm_good {
            self.watch_part(now);
        }
        match self.job.stage {
            Stage::Planning { begun } if go && self.motion.at_rest() => self.plan(now, begun),
            Stage::Leg(index) => self.finish_leg(now, index),
            Stage::Settling { since } if go && since.age_at(now) >= self.params.settle => {
                if self.job.acts() {
                    self.effector.begin(&self.job.task, &self.arm.effector);
                    self.job.stage = Stage::Acting { since: now };
                } else {
                    self.withdraw(now);
                }
            }
            Stage::Acting { since } if arm_good => match self.effector.answer(&self.arm.effector) {
                Answer::Done => self.withdraw(now),
                Answer::Failed => self.job.end(MotionFailure::ActionFailed, now),
                Answer::Waiting if since.age_at(now) > self.params.action_timeout => {
                    self.job.end(MotionFailure::ActionTimeout, now);
                }
                Answer::Waiting => {}
            },
            _ => {}
        }
    }

    /// A carried part that the sensor no longer sees ends the task.
    fn watch_part(&mut self, now: Stamp) {
        let carrying = self.job.attached().present == 1
            && matches!(self.job.stage, Stage::Planning { .. } | Stage::Leg(_) | Stage::Settling { .. });
        if !carrying || self.arm.effector.holding != 0 {
            self.job.dark_since = None;
            return;
        }
        let since = *self.job.dark_since.get_or_insert(now);
        if since.age_at(now) >= self.params.part_lost_after {
            self.job.abandon = Some(MotionFailure::PartLost);
        }
    }

    /// Searches a path, a few steps a cycle.
    fn plan(&mut self, now: Stamp, begun: bool) {
        let Some((_, version)) = self.scene_key else { return };
        if !self.scene_valid || version < self.job.task.scene_version {
            return;
        }
        if !begun {
            self.search.begin(&self.motion.set().position, &self.job.goal(&self.params.home));
            self.job.stage = Stage::Planning { begun: true };
            self.plan_is_current = true;
        }
        let mut tools =
            Tools { chain: &self.chain, params: &self.params, reach: &self.reach, monitor: &mut self.planner };
        match self.search.work(&mut tools) {
            Progress::Searching => {}
            Progress::Failed(failure) => self.job.end(failure, now),
            Progress::Found => {
                if !self.job.away {
                    self.job.expected = self.job.elapsed(now) + self.search.duration();
                }
                self.begin_leg(now, 0);
            }
        }
    }

    /// Enters a stretch, or what comes after the last.
    fn begin_leg(&mut self, now: Stamp, from: usize) {
        let mut index = from;
        // Stretches of no length are left out.
        while self.search.legs().get(index).is_some_and(|leg| leg.path.length() <= 0.0) {
            index += 1;
        }
        let Some(leg) = self.search.legs().get(index) else {
            if self.motion.law().is_some() {
                self.motion.rest();
            }
            if self.job.away {
                self.job.end(MotionFailure::None, now);
            } else {
                self.guard.set_context(self.job.attached(), &self.job.touch());
                self.job.stage = Stage::Settling { since: now };
            }
            return;
        };
        let usable = leg.limits.are_usable();
        let prepared = self.motion.follow(&leg.path, &leg.limits).and_then(|()| self.governor.take(&leg.limits));
        if !usable || prepared.is_err() {
            self.refused = true;
            self.motion.rest();
            self.job.end(MotionFailure::Unreachable, now);
            return;
        }
        self.guard.take(leg, self.job.attached(), self.plan_is_current);
        self.law_level = 0;
        self.job.stage = Stage::Leg(index);
    }

    /// Enters the next stretch where this one has ended, or plans anew where it is blocked.
    fn finish_leg(&mut self, now: Stamp, index: usize) {
        /// Rest within this of the end is the end.
        const END: f64 = 1e-9;
        let Some(law) = self.motion.law() else { return };
        if !law.finished() {
            return;
        }
        if law.state().position >= self.motion.path().length() - END {
            self.begin_leg(now, index + 1);
        } else if self.guard.blocked() {
            self.motion.rest();
            self.plan_anew();
        }
    }

    /// The action is done: withdraw, or end.
    fn withdraw(&mut self, now: Stamp) {
        self.job.away = true;
        self.guard.set_context(self.job.attached(), &self.job.touch());
        if self.job.retracts() {
            self.job.stage = Stage::Planning { begun: false };
        } else {
            self.job.end(MotionFailure::None, now);
        }
    }

    /// Makes the next set-point, checks it, and sends it or the stop that was checked before it.
    fn follow(&mut self, now: Stamp, go: bool, heard: &Heard, reset_count: u32, mut causes: Causes) {
        self.motion.slow(self.period);
        let mut next = None;
        let mut choice = 0;
        if let Some(law) = self.motion.law() {
            match self.next_law(&law, go) {
                Ok(law) => {
                    let level = self.check(now, &law, &mut causes);
                    choice = if go { level } else { 0 };
                    next = Some(law);
                }
                Err(Refused) => self.refused = true,
            }
        } else {
            self.guard.measure(&self.chain, &self.motion.set().position);
            let person = self.person(now);
            self.required =
                if person.distance == f64::INFINITY { 0.0 } else { self.governor.required_at_rest(&person) };
            self.governor.watch_at_rest(now, &person);
        }
        if self.refused {
            causes.add(StopCause::Internal);
        }
        if self.stop.cause() == StopCause::Separation && !self.governor.enough() {
            // The cause lasts until there is room to start again, not only until the arm stands.
            causes.add(StopCause::Separation);
        }
        let before = self.stop.state();
        let cause = self.stop.cause();
        let state = self.stop.update(
            now,
            &Seen {
                causes,
                standstill: self.motion.standstill(),
                reset_count: heard.task.good.then_some(reset_count),
                supervisor_restarted: heard.task.restarted,
            },
        );
        if before == StopState::Stopped && state == StopState::Running && cause != StopCause::Separation {
            // What was planned may be why it stopped.
            if self.motion.law().is_some() {
                self.motion.rest();
                next = None;
            }
            self.plan_anew();
        }
        if state != StopState::Running {
            choice = 0;
            if self.stop.category() == StopCategory::Zero {
                self.leave(now);
                next = None;
            } else if let Some(law) = self.motion.law() {
                next = self.stopped(&law);
            }
        } else if choice == 0
            && next.is_some_and(|law| !law.stopping())
            && let Some(law) = self.motion.law()
        {
            next = self.stopped(&law);
        }
        self.law_level = choice;
        if let Some(law) = next {
            let set = self.motion.set_point(&law.state());
            self.motion.commit(law, &set);
        }
    }

    /// The law one period on, for the level chosen in the cycle before.
    fn next_law(&self, law: &Law, go: bool) -> Result<Law, Refused> {
        let level = if go { self.law_level } else { 0 };
        let next = law.at_level(level, Governor::share(level), self.motion.path().length(), self.motion.limits())?;
        Ok(next.advanced(self.period))
    }

    /// A stop from where the law is now, one period on.
    fn stopped(&mut self, law: &Law) -> Option<Law> {
        match law.at_level(0, 0.0, self.motion.path().length(), self.motion.limits()) {
            Ok(stop) => Some(stop.advanced(self.period)),
            Err(Refused) => {
                self.refused = true;
                None
            }
        }
    }

    /// Checks a set-point on the path before it goes out; returns the level for the cycle after.
    fn check(&mut self, now: Stamp, law: &Law, causes: &mut Causes) -> usize {
        let state = law.state();
        let Ok(stop) = Law::stop_from(state, self.motion.limits()) else {
            self.refused = true;
            return 0;
        };
        let moving = state.velocity > 0.0;
        let set = self.motion.set_point(&state);
        self.refused |= !self.is_sound(&set.position, &set.velocity);

        self.guard.measure(&self.chain, &set.position);
        if moving && !(self.guard.clearance().distance >= self.guard.floor()) {
            causes.add(StopCause::Clearance);
        }
        self.guard.sweep(&self.chain, self.motion.path(), state.position, stop.end);
        let known = self.guard.clear_to() + 1e-9 >= stop.end;
        if moving && !known && self.guard.blocked() {
            causes.add(StopCause::Clearance);
        }

        let person = self.person(now);
        let level = self.separate(now, &state, &stop, &person, moving, causes);
        if known && !self.guard.blocked() { level } else { 0 }
    }

    /// The separation part of the check.
    fn separate(
        &mut self,
        now: Stamp,
        state: &State,
        stop: &crate::law::Stop,
        person: &Person,
        moving: bool,
        causes: &mut Causes,
    ) -> usize {
        let mut gradient = 0.0;
        self.required = 0.0;
        if person.distance != f64::INFINITY {
            let ahead = self.governor.look_ahead(state, stop).min(self.motion.path().length());
            let way = ahead - state.position;
            if way > 1e-9 {
                let there = self.guard.distance_at(&self.chain, &self.motion.path().at(ahead).position);
                gradient = ((person.distance - there) / way).max(0.0);
            }
            let braking = (stop.end - state.position).max(0.0);
            self.required = self.governor.required(person, state.velocity, braking, stop.duration, gradient);
            if moving && !(person.distance >= self.required) {
                causes.add(StopCause::Separation);
            }
        }
        self.governor.choose(now, person, gradient, state.velocity, self.required)
    }

    fn person(&self, now: Stamp) -> Person {
        Person::new(self.guard.separation(), self.watch.human_age(now), self.human_sigma, &self.params.separation)
    }

    /// The last line of defence against a fault in here: finite, no faster than the joints may go.
    fn is_sound(&self, position: &[f64; JOINTS_MAX], velocity: &[f64; JOINTS_MAX]) -> bool {
        /// Rounding.
        const SLACK: f64 = 1.01;
        position.iter().all(|position| position.is_finite())
            && velocity.iter().zip(&self.velocity_max).all(|(velocity, limit)| velocity.abs() <= limit * SLACK)
    }

    fn command(&self, now: Stamp, arm_good: bool, command: &mut JointCommand) {
        let set = self.motion.set();
        let header = command.header;
        let slack = self.motion.slack_since().is_some();
        let stopped = match (self.stop.state(), self.stop.category()) {
            (StopState::Running, _) | (_, StopCategory::Two) => false,
            (_, StopCategory::Zero) => true,
            (state, StopCategory::One) => state == StopState::Stopped,
        };
        let brake = (stopped && self.stop.armed()) || (slack && !arm_good);
        *command = JointCommand {
            header,
            valid_until: now.after(self.params.command_validity),
            joint_count: self.chain.joint_count() as u32,
            brake: u32::from(brake),
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
        let (clearance, separation) = (self.guard.clearance(), self.guard.separation());
        let nearest = if separation.distance < clearance.distance {
            [separation.link as u32, 1000 + separation.capsule as u32]
        } else {
            [clearance.link as u32, clearance.object]
        };
        let planned = !matches!(self.job.stage, Stage::Idle | Stage::Planning { .. });
        *status = MotionStatus {
            header: status.header,
            task_id: self.job.task.id,
            phase: Code::of(self.job.phase(leg)),
            failure: Code::of(self.job.failure()),
            planner: Code::of(if planned { Planner::Manual } else { Planner::None }),
            stop: Code::of(self.stop.state()),
            cause: Code::of(self.stop.cause()),
            category: Code::of(self.stop.category()),
            standstill: u32::from(self.motion.standstill()),
            stop_count: self.stop.count(),
            reset_seen: self.stop.reset_seen(),
            nearest,
            clearance: clearance.distance,
            clearance_min: self.job.clearance_min,
            separation: separation.distance,
            separation_required: self.required,
            speed: Governor::share(self.law_level) * self.job.task.speed,
            tcp_speed: self.tcp_speed,
            elapsed: self.job.elapsed(now),
            expected: self.job.expected,
            scene_version: self.scene_key.map_or(0, |(_, version)| version),
            base_from_tcp: self.base_from_tcp,
        };
    }
}
