//! Straight motions of the joints, swept from coarse to fine.
//!
//! A stretch of a motion is looked at in its middle. No point of a link travels farther from there to
//! either end than `Σ wⱼ (Rⱼ + travel of the joints beyond j)`, with `wⱼ` the turn of joint j and `Rⱼ`
//! the largest distance of the link from its axis in the middle, so what stands farther off than that is
//! never met on the whole stretch and is not looked at again. Of what is left the nearest says how much around
//! the middle is clear; the rest is two shorter stretches. So long motions cost few looks where there
//! is room, and what they run into is mostly met in the first.

#![allow(clippy::neg_cmp_op_on_partial_ord, reason = "`!(a > b)` is meant: what is no number fails the check")]

use nalgebra::Vector3;
use tandem_kinematics::{Chain, JOINTS_MAX, JointKind, LinkPoses};
use tandem_msg::SCENE_OBJECTS_MAX;

use crate::kernel::Wanted;
use crate::placed::PlacedArm;
use crate::{LINK_CAPSULES_MAX, Monitor, SELF_PAIRS_MAX};

/// Looks along one motion; a motion that needs more is called not clear.
const LOOKS_MAX: u32 = 4_096;
/// Stretches that may wait: every one is at most half as long as the one it is part of.
const OPEN_MAX: usize = 24;

const _: () = assert!(SCENE_OBJECTS_MAX <= 64 && LINK_CAPSULES_MAX <= 32 && SELF_PAIRS_MAX <= 192);

/// How a sweep stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Swept {
    /// There is more to look at.
    More,
    /// Clear all the way.
    Clear,
    /// Too near to something.
    Blocked,
}

/// What has still to be told from a stretch: one bit a pair.
#[derive(Clone, Copy, Debug)]
struct Pairs {
    /// Of each capsule of the arm, the objects.
    objects: [u64; LINK_CAPSULES_MAX],
    /// The pairs of the arm's own capsules.
    own: [u64; 3],
    /// The objects the carried part is checked with.
    part_objects: u64,
    /// The capsules of the arm it is checked with.
    part_capsules: u64,
}

/// A stretch, in shares of the motion.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    middle: f64,
    half: f64,
    pairs: Pairs,
}

impl Stretch {
    const NONE: Self = Self {
        middle: 0.0,
        half: 0.0,
        pairs: Pairs { objects: [0; LINK_CAPSULES_MAX], own: [0; 3], part_objects: 0, part_capsules: 0 },
    };
}

/// A sweep under way, a look at a time, for those who have only so much time in a cycle.
///
/// Between the first look and the last neither the monitor's scene, part and permissions nor the chain
/// may change.
#[derive(Clone, Debug)]
pub struct MotionSweep {
    from: [f64; JOINTS_MAX],
    along: [f64; JOINTS_MAX],
    margin: f64,
    resolution: f64,
    open: [Stretch; OPEN_MAX],
    count: usize,
    looks: u32,
    blocked: bool,
}

impl MotionSweep {
    /// A sweep of nothing.
    pub fn new() -> Self {
        Self {
            from: [0.0; JOINTS_MAX],
            along: [0.0; JOINTS_MAX],
            margin: 0.0,
            resolution: 0.0,
            open: [Stretch::NONE; OPEN_MAX],
            count: 0,
            looks: 0,
            blocked: false,
        }
    }

    /// Begins the motion from `from` to `to`, straight in joint positions; as [`Monitor::path_is_clear`].
    pub fn begin(
        &mut self,
        monitor: &Monitor,
        from: &[f64; JOINTS_MAX],
        to: &[f64; JOINTS_MAX],
        margin: f64,
        resolution: f64,
    ) {
        self.from = *from;
        self.along = core::array::from_fn(|joint| to[joint] - from[joint]);
        self.margin = margin;
        self.resolution = resolution;
        self.looks = 0;
        let finite = self.from.iter().chain(&self.along).all(|position| position.is_finite());
        self.blocked = !finite || !margin.is_finite() || !(resolution > 0.0) || !monitor.is_sound();
        self.count = 1;
        self.open[0] = Stretch { middle: 0.5, half: 0.5, pairs: Pairs::of(monitor) };
    }

    /// Looks once: in the middle of one stretch.
    pub fn look(&mut self, chain: &Chain, monitor: &Monitor) -> Swept {
        if self.blocked || self.looks >= LOOKS_MAX {
            return Swept::Blocked;
        }
        let Some(last) = self.count.checked_sub(1) else { return Swept::Clear };
        self.looks += 1;
        self.count = last;
        let mut stretch = self.open[last];
        let position = core::array::from_fn(|joint| self.from[joint] + stretch.middle * self.along[joint]);
        let poses = chain.forward(&position);
        let mut look = Look {
            monitor,
            margin: self.margin,
            resolution: self.resolution,
            wander: Wander::new(chain, &poses, &self.along, stretch.half),
            poses: &poses,
            clear_share: 1.0,
        };
        if !poses.is_finite() || !look.sift(&mut stretch.pairs) {
            self.blocked = true;
            return Swept::Blocked;
        }
        if look.clear_share < 1.0 {
            if last + 2 > OPEN_MAX {
                self.blocked = true;
                return Swept::Blocked;
            }
            let half = 0.5 * stretch.half * (1.0 - look.clear_share);
            let aside = stretch.half - half;
            self.open[last] = Stretch { middle: stretch.middle + aside, half, ..stretch };
            self.open[last + 1] = Stretch { middle: stretch.middle - aside, half, ..stretch };
            self.count = last + 2;
        }
        if self.count == 0 { Swept::Clear } else { Swept::More }
    }
}

impl Default for MotionSweep {
    fn default() -> Self {
        Self::new()
    }
}

impl Pairs {
    /// All that the arm and its part must not touch.
    fn of(monitor: &Monitor) -> Self {
        let objects = monitor.scene().all();
        let all = if objects.is_empty() { 0 } else { u64::MAX >> (64 - objects.len()) };
        let touchable = objects
            .iter()
            .enumerate()
            .filter(|(_, obstacle)| monitor.may_touch(obstacle.id))
            .fold(0, |bits, (index, _)| bits | 1 << index);
        let mut pairs = Stretch::NONE.pairs;
        for (slot, capsule) in pairs.objects.iter_mut().zip(monitor.body().capsules()) {
            *slot = match capsule {
                capsule if capsule.link == 0 => 0,
                capsule if capsule.tool => all & !touchable,
                _ => all,
            };
        }
        for (index, _) in monitor.body().self_pairs().enumerate() {
            pairs.own[index / 64] |= 1 << (index % 64);
        }
        if monitor.has_part() {
            pairs.part_objects = all & !touchable;
            pairs.part_capsules = (1 << monitor.body().capsules().len()) - 1;
        }
        pairs
    }
}

/// How far points of the arm get from the middle of a stretch to either of its ends.
struct Wander {
    /// Origin and direction of each joint's axis in the middle, base frame.
    axes: [(Vector3<f64>, Vector3<f64>); JOINTS_MAX],
    slides: [bool; JOINTS_MAX],
    /// How far each joint moves.
    turns: [f64; JOINTS_MAX],
}

impl Wander {
    fn new(chain: &Chain, poses: &LinkPoses, along: &[f64; JOINTS_MAX], half: f64) -> Self {
        let mut wander = Self {
            axes: [(Vector3::zeros(), Vector3::zeros()); JOINTS_MAX],
            slides: [false; JOINTS_MAX],
            turns: [0.0; JOINTS_MAX],
        };
        for (index, joint) in chain.joints().iter().enumerate() {
            let pose = &poses.base_from_link[index + 1];
            wander.axes[index] = (pose.translation.vector, pose.rotation * joint.axis.into_inner());
            wander.slides[index] = joint.kind == JointKind::Prismatic;
            wander.turns[index] = along[index].abs() * half;
        }
        wander
    }

    /// Bound for all points within `around` of one of `points`, moved by the joints `first..link`.
    fn of(&self, points: &[Vector3<f64>], around: f64, first: usize, link: usize) -> f64 {
        let mut travel = 0.0;
        // From the outermost joint inwards: each swings what those beyond it have displaced already.
        for joint in (first..link.min(JOINTS_MAX)).rev() {
            let turn = self.turns[joint];
            if self.slides[joint] {
                travel += turn;
            } else if turn > 0.0 {
                let (origin, axis) = &self.axes[joint];
                let lever = points.iter().map(|point| (point - origin).cross(axis).norm_squared()).fold(0.0, f64::max);
                travel += turn * (lever.sqrt() + around + travel);
            }
        }
        travel
    }
}

/// One look at the pairs of a stretch.
struct Look<'a> {
    monitor: &'a Monitor,
    poses: &'a LinkPoses,
    margin: f64,
    resolution: f64,
    wander: Wander,
    /// Share of the stretch, around its middle, that is clear of every pair left.
    clear_share: f64,
}

impl Look<'_> {
    /// Drops the pairs that cannot meet on the stretch; false when one is too near.
    fn sift(&mut self, pairs: &mut Pairs) -> bool {
        let monitor = self.monitor;
        let arm = monitor.body().capsules();
        let mut used = pairs.part_capsules;
        for (index, [a, b]) in monitor.body().self_pairs().enumerate() {
            if pairs.own[index / 64] >> (index % 64) & 1 == 1 {
                used |= 1 << a | 1 << b;
            }
        }
        let mut placed = monitor.unplaced(self.poses);
        let mut travels = [0.0; LINK_CAPSULES_MAX];
        // From the tool inwards: what moves farthest meets something first.
        for (index, capsule) in arm.iter().enumerate().rev() {
            if pairs.objects[index] == 0 && used >> index & 1 == 0 {
                continue;
            }
            let (points, around) = placed.place_capsule(index).extent();
            travels[index] = self.wander.of(&points, around, 0, capsule.link);
            if !self.sift_objects(&placed, index, travels[index], &mut pairs.objects[index]) {
                return false;
            }
        }
        for (index, [a, b]) in monitor.body().self_pairs().enumerate() {
            let bit = 1 << (index % 64);
            if pairs.own[index / 64] & bit == 0 {
                continue;
            }
            let (near, far) = if arm[a].link < arm[b].link { (a, b) } else { (b, a) };
            match self.sift_own(&placed, near, far, travels[far]) {
                Some(true) => {}
                Some(false) => pairs.own[index / 64] &= !bit,
                None => return false,
            }
        }
        let part_index = arm.len();
        let Some(part) = placed.part() else { return true };
        let (points, around) = part.extent();
        let travel = self.wander.of(&points, around, 0, part.link);
        if !self.sift_objects(&placed, part_index, travel, &mut pairs.part_objects) {
            return false;
        }
        let mut left = pairs.part_capsules;
        while left != 0 {
            let index = left.trailing_zeros() as usize;
            left &= left - 1;
            // The part hangs on its own link.
            if arm[index].link < part.link {
                match self.sift_own(&placed, index, part_index, travel) {
                    Some(true) => continue,
                    Some(false) => {}
                    None => return false,
                }
            }
            pairs.part_capsules &= !(1 << index);
        }
        true
    }

    /// Two bodies of the arm, the first nearer to its base: whether they may still meet, `None` when they
    /// are too near. `travel` is how far the second gets.
    fn sift_own(&mut self, arm: &PlacedArm, near: usize, far: usize, travel: f64) -> Option<bool> {
        let (near, far) = (&arm.bodies()[near], &arm.bodies()[far]);
        let reach = self.margin + near.radius + far.radius + travel;
        if !(near.squared_gap(far) < reach * reach) {
            return Some(false);
        }
        // Joints that move both do not move them against each other.
        let (points, around) = far.extent();
        let travel = self.wander.of(&points, around, near.link, far.link);
        match arm.near_each_other(near, far, self.wanted(travel)) {
            Some(found) => self.weigh(found.distance, travel),
            None => Some(false),
        }
    }

    fn sift_objects(&mut self, arm: &PlacedArm, body: usize, travel: f64, objects: &mut u64) -> bool {
        let body = &arm.bodies()[body];
        let scene = self.monitor.scene();
        let mut left = *objects;
        while left != 0 {
            let index = left.trailing_zeros() as usize;
            left &= left - 1;
            let reach = self.margin + body.radius + scene.around(index) + travel;
            let mut keep = false;
            if scene.squared_gap(index, &body.centre, &body.half) < reach * reach
                && let Some(near) = arm.near(body, &scene.all()[index], self.wanted(travel))
            {
                match self.weigh(near.distance, travel) {
                    Some(kept) => keep = kept,
                    None => return false,
                }
            }
            if !keep {
                *objects &= !(1 << index);
            }
        }
        true
    }

    /// What is farther than `travel` past the margin is never met, and how far within it does not matter.
    fn wanted(&self, travel: f64) -> Wanted {
        Wanted { limit: self.margin + travel, enough: self.margin }
    }

    /// Whether a pair this far apart may still meet; `None` when it is too near.
    fn weigh(&mut self, distance: f64, travel: f64) -> Option<bool> {
        let room = distance - self.margin;
        // Written so that what is no number is too near.
        if !(room > 0.0) {
            return None;
        }
        if room > travel {
            return Some(false);
        }
        if travel <= self.resolution {
            return None;
        }
        // Travel grows faster than the stretch, so a share of one is at most that share of the other.
        self.clear_share = self.clear_share.min(room / travel);
        Some(true)
    }
}

impl Monitor {
    /// Whether the motion from `from` to `to`, straight in joint positions, keeps more than `margin`
    /// metres to scene and arm itself all the way, within `resolution` metres.
    ///
    /// True means it does, between looks as well. Where less than `resolution` is left the motion may be
    /// called not clear, so a motion that keeps `margin + resolution` is found clear (unless it takes
    /// more than some thousand looks).
    pub fn path_is_clear(
        &self,
        chain: &Chain,
        from: &[f64; JOINTS_MAX],
        to: &[f64; JOINTS_MAX],
        margin: f64,
        resolution: f64,
    ) -> bool {
        let mut sweep = MotionSweep::new();
        sweep.begin(self, from, to, margin, resolution);
        loop {
            match sweep.look(chain, self) {
                Swept::More => {}
                Swept::Clear => return true,
                Swept::Blocked => return false,
            }
        }
    }
}
