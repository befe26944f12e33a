//! What each prompt asks of a person, as a list of deeds.

use nalgebra::Vector3;
use tandem_msg::{Answer, PromptKind};

/// Where the hands go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Hands {
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
pub(super) enum Deed {
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

/// What a script is written from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Task {
    /// Index of the part.
    pub(super) part: usize,
    /// Where the robot offers or holds it.
    pub(super) meeting: Hands,
    /// Ground point to step back to, metres.
    pub(super) rest: Vector3<f64>,
    /// Seconds to react, to fit the part, to look at something.
    pub(super) reaction: f64,
    pub(super) work: f64,
    pub(super) look: f64,
    /// Whether they will assemble.
    pub(super) willing: bool,
}

impl Task {
    /// The deeds of a prompt; `known` says whether the part is one of the product's.
    pub(super) fn script(&self, kind: PromptKind, known: bool) -> Vec<Deed> {
        let &Self { part, meeting, reaction, look, work, .. } = self;
        let assembling = matches!(kind, PromptKind::Assemble | PromptKind::Receive | PromptKind::AssembleHeld);
        if (assembling || kind == PromptKind::TakeOver) && !known || assembling && !self.willing {
            return vec![Deed::Wait(reaction), Deed::Say(Answer::Declined)];
        }
        let begin = [Deed::Wait(reaction), Deed::Say(Answer::Started)];
        let end = [Deed::Reach(Hands::Rest), Deed::Walk(self.rest), Deed::Say(Answer::Done)];
        let fit =
            [Deed::Approach(Hands::Home(part)), Deed::Reach(Hands::Home(part)), Deed::Work(work), Deed::Seat(part)];
        let middle = match kind {
            PromptKind::None => return Vec::new(),
            PromptKind::Identify => return vec![Deed::Wait(reaction + look), Deed::Say(Answer::Done)],
            PromptKind::Inspect => return [&begin[..], &[Deed::Wait(look), Deed::Say(Answer::Done)]].concat(),
            PromptKind::Assemble => {
                let fetch = [
                    Deed::Approach(Hands::Part(part)),
                    Deed::Reach(Hands::Part(part)),
                    Deed::Take { part, force: false },
                    Deed::Reach(Hands::Chest),
                ];
                [&fetch[..], &fit].concat()
            }
            PromptKind::Receive => {
                let receive = [
                    Deed::Approach(meeting),
                    Deed::AwaitStillTool,
                    Deed::Reach(Hands::Part(part)),
                    Deed::HoldOn(part),
                    Deed::Say(Answer::Holding),
                    Deed::AwaitRelease(part),
                    Deed::Reach(Hands::Chest),
                    Deed::LetGo,
                ];
                [&receive[..], &fit].concat()
            }
            PromptKind::AssembleHeld => vec![
                Deed::Approach(meeting),
                Deed::AwaitStillTool,
                Deed::Reach(Hands::Part(part)),
                Deed::HoldOn(part),
                Deed::Work(work),
                Deed::Secure(part),
                Deed::LetGo,
            ],
            PromptKind::TakeOver => {
                let take = [
                    Deed::Approach(Hands::Part(part)),
                    Deed::AwaitStillTool,
                    Deed::Reach(Hands::Part(part)),
                    Deed::Take { part, force: true },
                    Deed::Reach(Hands::Chest),
                ];
                [&take[..], &fit].concat()
            }
        };
        [&begin[..], &middle, &end].concat()
    }
}
