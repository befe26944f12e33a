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

use nalgebra::Vector3;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use rapier3d_f64::prelude::PhysicsWorld;
use tandem_msg::{Answer, FeatureClass, OperatorEvent, Prompt, PromptKind, Stamp};

use super::parts::{Parts, Place};

mod figure;
mod glide;
mod movement;
mod script;
mod tracker;

use figure::{figure, hands_at_rest};
use glide::Glide;
use script::{Deed, Hands, Task};

pub(super) use figure::{CAPSULES, Limb};
pub(super) use tracker::Tracker;

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
        let asked = Vector3::from(self.prompt.base_from_part.position);
        let said = self.prompt.base_from_part.is_valid() && asked.norm() > 0.1;
        let task = Task {
            part: self.prompt.part_index as usize,
            meeting: Hands::Point(if said { asked } else { self.model.focus }),
            rest: self.model.rest,
            reaction: self.about(self.model.reaction),
            work: self.about(self.model.assemble),
            look: self.about(self.model.inspect),
            willing: self.random.random::<f64>() >= self.model.decline_probability,
        };
        self.deeds.clear();
        self.path.clear();
        self.began = None;
        self.hand_on = None;
        self.step_clear();
        let kind = self.prompt.kind.get().unwrap_or(PromptKind::None);
        self.deeds.extend(task.script(kind, task.part < parts.count()));
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
}
