//! The simulated person at the bench: hears prompts, walks in, works with both hands, answers.
//!
//! What a prompt asks becomes a list of [`Deed`]s, done one after another; each
//! deed that cannot be done (no part where one was promised) makes the person
//! decline and step back. Between prompts they rest at their stand, and now and
//! then lean into the cell unasked, which is what the separation monitor is for.
//!
//! **Invariant:** walking and reaching keep their speed and acceleration limits,
//! whatever is asked, so the tracked velocities are those of a body.
//! **Invariant:** nobody reaches for a tool that moves.

use std::collections::VecDeque;

use nalgebra::{UnitQuaternion, Vector3};
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rapier3d_f64::prelude::PhysicsWorld;
use tandem_msg::{Answer, FeatureClass, OperatorEvent, Prompt, PromptKind, Stamp};

use super::figure::{CAPSULES, HAND_RADIUS, Limb, figure, hands_at_rest};
use super::glide::Glide;
use super::parts::{Parts, Place};

/// How fast a person gets going, m/s².
const WALK_ACCELERATION: f64 = 1.5;
/// How fast a hand gets going, m/s².
const HAND_ACCELERATION: f64 = 5.0;
/// From the stand, farther than this on the level is out of reach, metres.
const REACH_LEVEL: f64 = 0.88;
/// Between bench edge and someone standing at it, metres.
const BENCH_GAP: f64 = 0.2;
/// A tool that has stood this long is standing, seconds.
const STILL_FOR: f64 = 0.3;
/// Longest wait for a moving tool, and longest try to reach something, seconds.
const PATIENCE: f64 = 20.0;
const REACH_PATIENCE: f64 = 4.0;

/// How the person is and behaves.
#[derive(Clone, Debug)]
pub(super) struct PersonModel {
    /// Ground points, metres: where they rest, where they work.
    pub(super) rest: Vector3<f64>,
    pub(super) work: Vector3<f64>,
    /// What they look at: the middle of the fixture.
    pub(super) focus: Vector3<f64>,
    /// Bench outline: smallest and largest x, y.
    pub(super) bench: [[f64; 2]; 2],
    /// m/s.
    pub(super) walk_speed: f64,
    /// m/s.
    pub(super) hand_speed: f64,
    /// Mean seconds from a prompt to the first move, to fit one part, to look at something.
    pub(super) reaction: f64,
    pub(super) assemble: f64,
    pub(super) inspect: f64,
    /// Relative standard deviation of those times.
    pub(super) spread: f64,
    /// Chance of leaning in unasked, per part presented.
    pub(super) intrusion_probability: f64,
    /// Chance of declining to assemble.
    pub(super) decline_probability: f64,
}

/// Where the hands go.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Hands {
    /// At the sides of the trunk.
    Rest,
    /// In front of the chest.
    Chest,
    /// On the near side of a part, wherever it is.
    Part(usize),
    /// On the near side of where a part belongs.
    Home(usize),
    /// At a point of the cell.
    Point(Vector3<f64>),
}

/// One thing to do; the next begins when it is done.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Deed {
    Wait(f64),
    /// As `Wait`, hands busy.
    Work(f64),
    Walk(Vector3<f64>),
    Reach(Hands),
    /// Walk to where the part, or its home, is within reach.
    Approach(Hands),
    AwaitStillTool,
    /// Pick a part up; from the tool too when `force` says so.
    Take {
        part: usize,
        force: bool,
    },
    /// Get hold of a part in the tool.
    HoldOn(usize),
    AwaitRelease(usize),
    LetGo,
    Seat(usize),
    Secure(usize),
    Say(Answer),
}

enum Progress {
    Going,
    Done,
    Impossible,
}

/// What the person can see in one cycle.
pub(super) struct Sight {
    /// Speed of the tool, m/s.
    pub(super) tool_speed: f64,
    /// The part that stands at its station.
    pub(super) presented: Option<usize>,
    /// Parts presented so far.
    pub(super) presentations: u32,
}

/// The person.
pub(super) struct Person {
    model: PersonModel,
    random: ChaCha8Rng,
    stand: Glide,
    hands: [Glide; 2],
    goal: Hands,
    body: [Limb; CAPSULES],
    velocity: [Vector3<f64>; CAPSULES],
    deeds: VecDeque<Deed>,
    began: Option<Stamp>,
    path: VecDeque<Vector3<f64>>,
    tool_still: f64,
    hand_on: Option<usize>,
    prompt: Prompt,
    event: OperatorEvent,
    presentations: u32,
    intrusion_at: Option<Stamp>,
}

impl Person {
    /// A person at rest.
    pub(super) fn new(model: PersonModel, random: ChaCha8Rng) -> Self {
        let hands = hands_at_rest();
        let mut person = Self {
            random,
            stand: Glide::at(model.rest),
            hands: hands.map(Glide::at),
            goal: Hands::Rest,
            body: [Limb::default(); CAPSULES],
            velocity: [Vector3::zeros(); CAPSULES],
            deeds: VecDeque::new(),
            began: None,
            path: VecDeque::new(),
            tool_still: 0.0,
            hand_on: None,
            prompt: Prompt::default(),
            event: OperatorEvent::default(),
            presentations: 0,
            intrusion_at: None,
            model,
        };
        person.body = figure(&person.stand.position, person.heading(), &hands);
        person
    }

    /// Lives one cycle of `dt` seconds.
    pub(super) fn cycle(
        &mut self,
        now: Stamp,
        dt: f64,
        prompt: &Prompt,
        sight: &Sight,
        parts: &mut Parts,
        world: &mut PhysicsWorld,
    ) {
        self.tool_still = if sight.tool_speed < 0.01 { self.tool_still + dt } else { 0.0 };
        if prompt.header.heard() && prompt.id != 0 && prompt.id != self.prompt.id {
            self.prompt = *prompt;
            self.take_up(parts);
        }
        self.maybe_intrude(now, sight.presentations);
        self.carry_on(now, sight, parts, world);
        self.move_body(now, dt, parts);
    }

    /// The part a hand has hold of while the tool may still hold it too.
    pub(super) fn hand_on(&self) -> Option<usize> {
        self.hand_on
    }

    /// Where a part in the hands is, metres.
    pub(super) fn carries_at(&self) -> Vector3<f64> {
        (self.body[4].ends[1] + self.body[7].ends[1]) / 2.0
    }

    /// The body, the velocity of each capsule in m/s, and the ground point below.
    pub(super) fn body(&self) -> (&[Limb; CAPSULES], &[Vector3<f64>; CAPSULES], &Vector3<f64>) {
        (&self.body, &self.velocity, &self.stand.position)
    }

    /// The last answer given.
    pub(super) fn event(&self) -> &OperatorEvent {
        &self.event
    }

    /// Evenly spread over a range.
    fn between(&mut self, range: [f64; 2]) -> f64 {
        range[0] + (range[1] - range[0]) * self.random.random::<f64>()
    }

    /// A time of which `mean` is the mean, spread as this person's times are, seconds.
    fn about(&mut self, mean: f64) -> f64 {
        let drawn: f64 = StandardNormal.sample(&mut self.random);
        mean * (1.0 + self.model.spread * drawn.clamp(-2.5, 2.5)).max(0.2)
    }

    /// What the prompt asks, as deeds. A prompt replaces what was under way.
    fn take_up(&mut self, parts: &Parts) {
        let part = self.prompt.part_index as usize;
        let reaction = self.about(self.model.reaction);
        let work = self.about(self.model.assemble);
        let look = self.about(self.model.inspect);
        let unwilling = self.random.random::<f64>() < self.model.decline_probability;
        let asked = Vector3::from(self.prompt.base_from_part.position);
        let said = self.prompt.base_from_part.is_valid() && asked.norm() > 0.1;
        let meeting = Hands::Point(if said { asked } else { self.model.focus });
        self.deeds.clear();
        self.path.clear();
        self.began = None;
        self.hand_on = None;
        let kind = self.prompt.kind.get().unwrap_or(PromptKind::None);
        let known = part < parts.count();
        let script: &[Deed] = match kind {
            PromptKind::None => &[],
            PromptKind::Identify => &[Deed::Wait(reaction + look), Deed::Say(Answer::Done)],
            PromptKind::Inspect => {
                &[Deed::Wait(reaction), Deed::Say(Answer::Started), Deed::Wait(look), Deed::Say(Answer::Done)]
            }
            _ if !known => &[Deed::Wait(reaction), Deed::Say(Answer::Declined)],
            PromptKind::Assemble | PromptKind::Receive | PromptKind::AssembleHeld if unwilling => {
                &[Deed::Wait(reaction), Deed::Say(Answer::Declined)]
            }
            PromptKind::Assemble => &[
                Deed::Wait(reaction),
                Deed::Say(Answer::Started),
                Deed::Approach(Hands::Part(part)),
                Deed::Reach(Hands::Part(part)),
                Deed::Take { part, force: false },
                Deed::Reach(Hands::Chest),
                Deed::Approach(Hands::Home(part)),
                Deed::Reach(Hands::Home(part)),
                Deed::Work(work),
                Deed::Seat(part),
                Deed::Reach(Hands::Rest),
                Deed::Walk(self.model.rest),
                Deed::Say(Answer::Done),
            ],
            PromptKind::Receive => &[
                Deed::Wait(reaction),
                Deed::Say(Answer::Started),
                Deed::Approach(meeting),
                Deed::AwaitStillTool,
                Deed::Reach(Hands::Part(part)),
                Deed::HoldOn(part),
                Deed::Say(Answer::Holding),
                Deed::AwaitRelease(part),
                Deed::Reach(Hands::Chest),
                Deed::LetGo,
                Deed::Approach(Hands::Home(part)),
                Deed::Reach(Hands::Home(part)),
                Deed::Work(work),
                Deed::Seat(part),
                Deed::Reach(Hands::Rest),
                Deed::Walk(self.model.rest),
                Deed::Say(Answer::Done),
            ],
            PromptKind::AssembleHeld => &[
                Deed::Wait(reaction),
                Deed::Say(Answer::Started),
                Deed::Approach(meeting),
                Deed::AwaitStillTool,
                Deed::Reach(Hands::Part(part)),
                Deed::HoldOn(part),
                Deed::Work(work),
                Deed::Secure(part),
                Deed::LetGo,
                Deed::Reach(Hands::Rest),
                Deed::Walk(self.model.rest),
                Deed::Say(Answer::Done),
            ],
            PromptKind::TakeOver => &[
                Deed::Wait(reaction),
                Deed::Say(Answer::Started),
                Deed::Approach(Hands::Part(part)),
                Deed::AwaitStillTool,
                Deed::Reach(Hands::Part(part)),
                Deed::Take { part, force: true },
                Deed::Reach(Hands::Chest),
                Deed::Approach(Hands::Home(part)),
                Deed::Reach(Hands::Home(part)),
                Deed::Work(work),
                Deed::Seat(part),
                Deed::Reach(Hands::Rest),
                Deed::Walk(self.model.rest),
                Deed::Say(Answer::Done),
            ],
        };
        self.step_clear();
        self.deeds.extend(script);
    }

    /// Someone interrupted inside the cell draws their hands back first.
    fn step_clear(&mut self) {
        if self.goal != Hands::Rest {
            self.deeds.push_back(Deed::Reach(Hands::Rest));
        }
    }

    fn maybe_intrude(&mut self, now: Stamp, presentations: u32) {
        if presentations != self.presentations {
            self.presentations = presentations;
            let (chance, delay) = (self.random.random::<f64>(), self.between([2.0, 8.0]));
            let comes = chance < self.model.intrusion_probability;
            self.intrusion_at = comes.then(|| now.after(core::time::Duration::from_secs_f64(delay)));
        }
        if self.deeds.is_empty() && self.intrusion_at.is_some_and(|at| now >= at) {
            self.intrusion_at = None;
            let stay = self.between([1.0, 3.0]);
            let near = self.model.focus + Vector3::new(0.18, 0.0, 0.2);
            self.deeds.extend([
                Deed::Walk(self.model.work),
                Deed::Reach(Hands::Point(near)),
                Deed::Wait(stay),
                Deed::Reach(Hands::Rest),
                Deed::Walk(self.model.rest),
            ]);
        }
    }

    fn carry_on(&mut self, now: Stamp, sight: &Sight, parts: &mut Parts, world: &mut PhysicsWorld) {
        while let Some(&deed) = self.deeds.front() {
            let began = *self.began.get_or_insert(now);
            let first = began == now;
            let elapsed = began.age_at(now).as_secs_f64();
            match self.pursue(deed, first, elapsed, sight, parts, world) {
                Progress::Going => break,
                Progress::Done => {
                    self.deeds.pop_front();
                    self.began = None;
                }
                Progress::Impossible => {
                    self.deeds.clear();
                    self.began = None;
                    self.hand_on = None;
                    let back = [Deed::Reach(Hands::Rest), Deed::Walk(self.model.rest), Deed::Say(Answer::Declined)];
                    self.deeds.extend(back);
                }
            }
        }
    }

    fn pursue(
        &mut self,
        deed: Deed,
        first: bool,
        elapsed: f64,
        sight: &Sight,
        parts: &mut Parts,
        world: &mut PhysicsWorld,
    ) -> Progress {
        let done_if = |yes: bool| if yes { Progress::Done } else { Progress::Going };
        let possible = |yes: bool| if yes { Progress::Done } else { Progress::Impossible };
        match deed {
            Deed::Wait(seconds) | Deed::Work(seconds) => done_if(elapsed >= seconds),
            Deed::Walk(to) => {
                if first {
                    self.set_out(to);
                }
                done_if(self.path.is_empty())
            }
            Deed::Approach(hands) => {
                if first {
                    let there = self.point_of(hands, parts);
                    self.set_out(self.stand_for(&there));
                }
                done_if(self.path.is_empty())
            }
            Deed::Reach(hands) => {
                self.goal = hands;
                done_if(!first && (self.hands_there(parts) || elapsed > REACH_PATIENCE))
            }
            Deed::AwaitStillTool if self.tool_still >= STILL_FOR => Progress::Done,
            Deed::AwaitStillTool if elapsed > PATIENCE => Progress::Impossible,
            Deed::AwaitStillTool => Progress::Going,
            Deed::Take { part, force } => {
                let within_rights = force || parts.place(part) != Place::Tool;
                let there =
                    !matches!(parts.place(part), Place::Product) && (force || parts.place(part) != Place::Store);
                if parts.place(part) == Place::Product {
                    return Progress::Done;
                }
                if within_rights && there {
                    parts.take_by_hand(world, part);
                }
                possible(within_rights && there)
            }
            Deed::HoldOn(part) => {
                self.hand_on = Some(part);
                possible(parts.place(part) == Place::Tool)
            }
            Deed::AwaitRelease(part) => match parts.place(part) {
                Place::Person => Progress::Done,
                Place::Tool => Progress::Going,
                _ => Progress::Impossible,
            },
            Deed::LetGo => {
                self.hand_on = None;
                Progress::Done
            }
            Deed::Seat(part) => {
                let has_it = parts.place(part) == Place::Person;
                if has_it {
                    parts.seat(world, part);
                }
                possible(has_it || parts.place(part) == Place::Product)
            }
            Deed::Secure(part) => {
                // Let go of early, the part is in the person's hands: it goes home from there.
                match parts.place(part) {
                    Place::Tool => parts.secure(part),
                    Place::Person => parts.seat(world, part),
                    Place::Product => {}
                    _ => return Progress::Impossible,
                }
                Progress::Done
            }
            Deed::Say(answer) => {
                self.say(answer, sight, parts);
                Progress::Done
            }
        }
    }

    fn say(&mut self, answer: Answer, sight: &Sight, parts: &Parts) {
        let part = self.prompt.part_index as usize;
        let mut answer = answer;
        let mut class = FeatureClass::Other;
        if self.prompt.kind.is(PromptKind::Identify) {
            // A person tells the features of a part apart by looking at it, if it is there.
            match parts.model(part).filter(|_| sight.presented == Some(part)) {
                Some(model) => class = model.class,
                None => answer = Answer::Declined,
            }
        }
        self.event = OperatorEvent {
            header: self.event.header,
            prompt_id: self.prompt.id,
            answer: answer.into(),
            class: class.into(),
            reserved: 0,
        };
    }

    /// A ground point from which `there` can be reached: the work stand, or beside the bench.
    fn stand_for(&self, there: &Vector3<f64>) -> Vector3<f64> {
        let level = |a: &Vector3<f64>| (a - there).xy().norm();
        if level(&self.model.work) <= REACH_LEVEL {
            return self.model.work;
        }
        let [[x_min, x_max], [y_min, y_max]] = self.model.bench;
        let y = if there.y < (y_min + y_max) / 2.0 { y_min - BENCH_GAP } else { y_max + BENCH_GAP };
        Vector3::new(there.x.clamp(x_min, x_max), y, self.model.work.z)
    }

    /// Sets out for a ground point, round the bench's front corners where it stands in the way.
    fn set_out(&mut self, to: Vector3<f64>) {
        let [[_, x_max], [y_min, y_max]] = self.model.bench;
        let from = self.stand.position;
        let beside = |p: &Vector3<f64>| p.x < x_max + BENCH_GAP / 2.0;
        let corner = |p: &Vector3<f64>| {
            let y = if p.y < (y_min + y_max) / 2.0 { y_min - BENCH_GAP } else { y_max + BENCH_GAP };
            Vector3::new(x_max + BENCH_GAP, y, p.z)
        };
        self.path.clear();
        let same_side = beside(&from) && beside(&to) && corner(&from) == corner(&to);
        if beside(&from) && !same_side {
            self.path.push_back(corner(&from));
        }
        if beside(&to) && !same_side {
            self.path.push_back(corner(&to));
        }
        self.path.push_back(to);
    }

    fn point_of(&self, hands: Hands, parts: &Parts) -> Vector3<f64> {
        match hands {
            Hands::Part(part) => parts.base_from_part(part).translation.vector,
            Hands::Home(part) => {
                parts.model(part).map_or(self.model.focus, |model| model.base_from_place.translation.vector)
            }
            Hands::Point(point) => point,
            Hands::Rest | Hands::Chest => self.stand.position,
        }
    }

    fn heading(&self) -> f64 {
        let ahead = self.model.focus - self.stand.position;
        ahead.y.atan2(ahead.x)
    }

    /// Goals of both hands in the frame of the stand.
    fn hand_goals(&self, parts: &Parts) -> [Vector3<f64>; 2] {
        let chest = [Vector3::new(0.35, 0.10, 1.10), Vector3::new(0.35, -0.10, 1.10)];
        let (pose, half) = match self.goal {
            Hands::Rest => return hands_at_rest(),
            Hands::Chest => return chest,
            Hands::Part(part) => {
                // A part in these very hands cannot be reached for.
                if parts.place(part) == Place::Person {
                    return chest;
                }
                (parts.base_from_part(part), parts.model(part).map_or([0.05; 3], |model| model.half_extents))
            }
            Hands::Home(part) => match parts.model(part) {
                Some(model) => (model.base_from_place, model.half_extents),
                None => return chest,
            },
            Hands::Point(point) => (nalgebra::Isometry3::translation(point.x, point.y, point.z), [0.0; 3]),
        };
        let centre = pose.translation.vector;
        let level = |v: Vector3<f64>| Vector3::new(v.x, v.y, 0.0).try_normalize(1e-6).unwrap_or_else(Vector3::x);
        let near = level(self.stand.position - centre);
        let aside = Vector3::z().cross(&near);
        let extent = |along: &Vector3<f64>| -> f64 {
            let own = pose.rotation.inverse() * along;
            own.x.abs() * half[0] + own.y.abs() * half[1] + own.z.abs() * half[2]
        };
        let touch = centre + near * (extent(&near) + HAND_RADIUS);
        let spread = extent(&aside).clamp(HAND_RADIUS, 0.12);
        // Facing the part, the left hand lies on the far side of `aside`.
        let back = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -self.heading());
        [-1.0, 1.0].map(|side| back * (touch + aside * (side * spread) - self.stand.position))
    }

    fn hands_there(&self, parts: &Parts) -> bool {
        let goals = self.hand_goals(parts);
        self.hands.iter().zip(&goals).all(|(hand, goal)| (hand.position - goal).norm() < 0.01)
    }

    fn move_body(&mut self, now: Stamp, dt: f64, parts: &Parts) {
        if let Some(&to) = self.path.front() {
            if self.stand.step(&to, self.model.walk_speed, WALK_ACCELERATION, dt) {
                self.path.pop_front();
            }
        } else {
            let here = self.stand.position;
            self.stand.step(&here, self.model.walk_speed, WALK_ACCELERATION, dt);
        }
        let goals = self.hand_goals(parts);
        let busy = matches!(self.deeds.front(), Some(Deed::Work(_)));
        let turn = now.as_secs_f64() * core::f64::consts::TAU;
        let stir = if busy { Vector3::new(0.0, 0.02 * turn.sin(), 0.02 * turn.cos()) } else { Vector3::zeros() };
        for (hand, goal) in self.hands.iter_mut().zip(&goals) {
            hand.step(&(goal + stir), self.model.hand_speed, HAND_ACCELERATION, dt);
        }
        let hands = [self.hands[0].position, self.hands[1].position];
        let body = figure(&self.stand.position, self.heading(), &hands);
        for ((velocity, before), after) in self.velocity.iter_mut().zip(&self.body).zip(&body) {
            // A capsule's ends differ in speed; the separation is owed to the faster.
            let ends = [0, 1].map(|end| (after.ends[end] - before.ends[end]) / dt);
            *velocity = if ends[0].norm_squared() > ends[1].norm_squared() { ends[0] } else { ends[1] };
        }
        self.body = body;
    }
}
