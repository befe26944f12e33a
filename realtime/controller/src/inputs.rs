//! What was heard, judged before it is used.
//!
//! Header first (heard, own configuration, living writer, in sequence, fresh),
//! then content (finite, in range). What fails is a named cause, the sample is
//! not used, and the last good one stays in force for what still has to be
//! done with it: bringing the arm to rest.

use core::time::Duration;

use tandem_msg::{
    AttachedPart, Freshness, Header, HumanState, JointState, MotionTask, PlantFault, RunMode, Scene, Stamp, StopCause,
    Suspect,
};

use crate::stop::Causes;
use crate::{ControllerInputs, Params};

/// The scene is sent when it changes, so its age says nothing: its writer's heartbeat is the task's stamp.
const SCENE_AGE_MAX: Duration = Duration::from_secs(u32::MAX as u64);

/// One input: last accepted header, and whether the content of that sample is usable.
#[derive(Clone, Copy, Debug, Default)]
struct Track {
    last: Header,
    valid: bool,
}

/// Judgement of one input in one cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Verdict {
    /// May be acted on.
    pub(crate) good: bool,
    /// Another sample than in the previous cycle, and good.
    pub(crate) new: bool,
    /// Its writer is another incarnation than that of the sample before.
    pub(crate) restarted: bool,
}

impl Track {
    fn judge(
        &mut self,
        header: &Header,
        now: Stamp,
        freshness: &Freshness,
        stale: StopCause,
        causes: &mut Causes,
        valid: impl FnOnce() -> bool,
    ) -> Verdict {
        let mut verdict = Verdict::default();
        match header.judge(&self.last, now, freshness) {
            Ok(()) => {
                let new = (header.epoch, header.seq) != (self.last.epoch, self.last.seq);
                verdict.restarted = self.last.heard() && header.epoch != self.last.epoch;
                if new {
                    self.valid = valid();
                    self.last = *header;
                }
                verdict.good = self.valid;
                verdict.new = new && self.valid;
                if !self.valid {
                    causes.add(StopCause::InputInvalid);
                }
            }
            Err(suspect) => causes.add(match suspect {
                Suspect::NeverHeard | Suspect::Stale => stale,
                Suspect::ForeignConfig | Suspect::OldEpoch => StopCause::ForeignWriter,
                Suspect::Reordered | Suspect::FromTheFuture => StopCause::InputInvalid,
            }),
        }
        verdict
    }
}

/// Since when the tracked person has not changed by a bit.
///
/// A tracker that owns up to an uncertainty is never still: what it repeats to the bit is a frozen picture,
/// however fresh its stamp, and as old as when it was first seen.
#[derive(Clone, Copy, Debug, Default)]
struct Picture {
    seen: HumanState,
    since: Stamp,
}

impl Picture {
    fn take(&mut self, human: &HumanState) {
        let same = human.position_sigma > 0.0
            && human.capsule_count > 0
            && (human.capsule_count, &human.capsules) == (self.seen.capsule_count, &self.seen.capsules);
        if !same {
            (self.seen, self.since) = (*human, human.header.stamp);
        }
    }
}

/// Judgement of all inputs in one cycle.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Heard {
    pub(crate) causes: Causes,
    pub(crate) arm: Verdict,
    pub(crate) human: Verdict,
    pub(crate) scene: Verdict,
    pub(crate) task: Verdict,
}

/// Remembers what was heard before.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Watch {
    arm: Track,
    human: Track,
    picture: Picture,
    scene: Track,
    task: Track,
}

impl Watch {
    pub(crate) fn judge(
        &mut self,
        now: Stamp,
        inputs: &ControllerInputs<'_>,
        params: &Params,
        speeds: &[f64],
    ) -> Heard {
        let fresh = |age_max| Freshness { age_max, config_hash: params.config_hash };
        let mut causes = Causes::default();
        let arm = self.arm.judge(
            &inputs.arm.header,
            now,
            &fresh(params.arm_age_max),
            StopCause::ArmStale,
            &mut causes,
            || arm_is_valid(inputs.arm, speeds),
        );
        let mut human = self.human.judge(
            &inputs.human.header,
            now,
            &fresh(params.human_age_max),
            StopCause::HumanStale,
            &mut causes,
            || human_is_valid(inputs.human),
        );
        if human.new {
            self.picture.take(inputs.human);
        }
        if human.good && self.picture.since.age_at(now) > params.human_age_max {
            causes.add(StopCause::HumanStale);
            human.good = false;
        }
        let task = self.task.judge(
            &inputs.task.header,
            now,
            &fresh(params.supervisor_age_max),
            StopCause::SupervisorStale,
            &mut causes,
            || inputs.task.run.get().is_some(),
        );
        let scene = self.scene.judge(
            &inputs.scene.header,
            now,
            &fresh(SCENE_AGE_MAX),
            StopCause::SceneInvalid,
            &mut causes,
            || scene_is_valid(inputs.scene),
        );
        if causes.has(StopCause::SupervisorStale) {
            // Who writes the scene is silent: that says it all.
            causes.remove(StopCause::SceneInvalid);
        }
        Heard { causes, arm, human, scene, task }
    }

    /// Age of what is known of the tracked person, seconds.
    pub(crate) fn human_age(&self, now: Stamp) -> f64 {
        self.picture.since.age_at(now).as_secs_f64()
    }
}

/// Finite, of the right arm, and no joint faster than three times its limit.
fn arm_is_valid(arm: &JointState, speeds: &[f64]) -> bool {
    arm.joint_count as usize == speeds.len()
        && arm.fault.get().is_some()
        && arm.effector.phase.get().is_some()
        && arm.position[..speeds.len()].iter().all(|position| position.abs() <= 100.0)
        && arm.velocity.iter().zip(speeds).all(|(velocity, limit)| velocity.abs() <= 3.0 * limit)
}

/// No more capsules than fit, all finite, none larger or faster than a person.
fn human_is_valid(human: &HumanState) -> bool {
    let count = human.capsule_count as usize;
    count <= human.capsules.len()
        && (0.0..=1.0).contains(&human.position_sigma)
        && human.capsules[..count].iter().all(|capsule| {
            capsule.ends.as_flattened().iter().all(|x| x.abs() <= 100.0)
                && capsule.radius > 0.0
                && capsule.radius <= 1.0
                && capsule.velocity.iter().all(|v| v.abs() <= 20.0)
        })
}

/// Counts within the array; shapes are judged where they are used.
fn scene_is_valid(scene: &Scene) -> bool {
    scene.object_count as usize <= scene.objects.len()
}

fn attached_is_valid(part: &AttachedPart) -> bool {
    part.present == 0
        || (part.tcp_from_part.is_valid()
            && part.tcp_from_part.position.iter().all(|x| x.abs() <= 2.0)
            && part.half_extents.iter().all(|x| (0.0..=2.0).contains(x))
            && part.mass.is_finite())
}

/// Whether a task can be carried out as it stands.
pub(crate) fn task_is_valid(task: &MotionTask) -> bool {
    task.subtask.get().is_some()
        && task.action.get().is_some()
        && task.tool.get().is_some()
        && task.base_from_tcp.is_valid()
        && task.base_from_tcp.position.iter().all(|x| x.abs() <= 10.0)
        && (0.0..=1.0).contains(&task.approach)
        && (0.0..=1.0).contains(&task.retract)
        && task.speed > 0.0
        && task.speed <= 1.0
        && task.value.is_finite()
        && attached_is_valid(&task.attached_before)
        && attached_is_valid(&task.attached_after)
}

/// The mode asked for; a number that means nothing is a halt.
pub(crate) fn run_mode(task: &MotionTask) -> RunMode {
    task.run.get().unwrap_or(RunMode::Halt)
}

/// Whether the arm says that it follows our commands.
pub(crate) fn arm_follows(arm: &JointState, since: Stamp) -> bool {
    arm.fault.is(PlantFault::None) && arm.command_seq != 0 && arm.command_stamp >= since
}
