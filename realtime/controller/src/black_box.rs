//! What led to a stop: the controller's own record of its last seconds, kept until somebody fetches it.
//!
//! Every cycle goes into a ring. Some time after a stop began the ring is sealed and recording goes on in a
//! second one. Whoever runs the controller fetches the sealed ring, writes it down where writing may take its
//! time, and gives it back; while it is away, nothing further can be sealed, only recorded.
//!
//! Rings are boxes that change hands, so none of this copies or allocates in a cycle.
#![allow(
    clippy::disallowed_types,
    clippy::disallowed_macros,
    reason = "the boxes are made at start; after that they only change hands"
)]

use core::time::Duration;

use tandem_msg::{
    HUMAN_CAPSULES_MAX, HumanState, JOINTS_MAX, MotionPhase, SafetyMode, Stamp, StopCategory, StopCause, StopState,
};

/// Recorded before the cycle in which a stop begins, and from there on.
const BEFORE: Duration = Duration::from_millis(2_000);
const AFTER: Duration = Duration::from_millis(500);

/// One cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Record {
    /// Time of the cycle.
    pub now: Stamp,
    /// State of the stop, and why.
    pub stop: StopState,
    /// What it stopped for, or would.
    pub cause: StopCause,
    /// Mode of the limits.
    pub mode: SafetyMode,
    /// Where the task in hand stands.
    pub phase: MotionPhase,
    /// The task in hand.
    pub task_id: u32,
    /// Joints as measured, rad (or m) and per s.
    pub measured: [[f64; JOINTS_MAX]; 2],
    /// Joints as commanded: position, velocity, acceleration.
    pub commanded: [[f64; JOINTS_MAX]; 3],
    /// Share of the path's speed in force.
    pub speed: f64,
    /// Distance to the scene or the arm itself, metres.
    pub clearance: f64,
    /// Link and object of that pair; object 0 is the arm itself.
    pub clearance_pair: [u32; 2],
    /// Distance of the pair of a link and a body part that has least to spare, metres; +∞ with nobody in view.
    pub separation: f64,
    /// What is owed to that pair, metres.
    pub separation_required: f64,
    /// Its link, and the index of the person's capsule.
    pub separation_pair: [u32; 2],
    /// Seconds the stop from here takes.
    pub stopping_time: f64,
    /// Age of what was known of the person, s.
    pub human_age: f64,
    /// Their capsules in use.
    pub human_count: u32,
    /// Both ends, metres, of each.
    pub human: [[[f32; 3]; 2]; HUMAN_CAPSULES_MAX],
}

/// A stop and the cycles around it.
pub struct StopRecord {
    /// Number of the stop since the controller was started, from 1.
    pub number: u32,
    /// When it began.
    pub began: Stamp,
    /// Its first cause.
    pub cause: StopCause,
    /// How the arm was stopped.
    pub category: StopCategory,
    /// Joints of the arm.
    pub joint_count: usize,
    /// Time from one cycle to the next.
    pub period: Duration,
    records: Box<[Record]>,
    /// Where the next goes, and whether the ring has been filled once.
    next: usize,
    full: bool,
}

impl StopRecord {
    fn new(period: Duration, joint_count: usize) -> Self {
        let cycles = (BEFORE + AFTER).as_nanos() / period.as_nanos().max(1);
        Self {
            number: 0,
            began: Stamp(0),
            cause: StopCause::None,
            category: StopCategory::Two,
            joint_count,
            period,
            records: vec![Record::EMPTY; cycles as usize + 1].into(),
            next: 0,
            full: false,
        }
    }

    /// The cycles, oldest first.
    pub fn cycles(&self) -> impl Iterator<Item = &Record> {
        let (newer, older) = self.records.split_at(self.next.min(self.records.len()));
        (if self.full { older } else { &[] }).iter().chain(newer)
    }

    fn push(&mut self, record: &Record) {
        if let Some(slot) = self.records.get_mut(self.next) {
            *slot = *record;
        }
        self.next += 1;
        if self.next >= self.records.len() {
            (self.next, self.full) = (0, true);
        }
    }
}

impl Record {
    pub(crate) const EMPTY: Self = Self {
        now: Stamp(0),
        stop: StopState::Stopped,
        cause: StopCause::None,
        mode: SafetyMode::Normal,
        phase: MotionPhase::Idle,
        task_id: 0,
        measured: [[0.0; JOINTS_MAX]; 2],
        commanded: [[0.0; JOINTS_MAX]; 3],
        speed: 0.0,
        clearance: f64::INFINITY,
        clearance_pair: [0; 2],
        separation: f64::INFINITY,
        separation_required: 0.0,
        separation_pair: [0; 2],
        stopping_time: 0.0,
        human_age: 0.0,
        human_count: 0,
        human: [[[0.0; 3]; 2]; HUMAN_CAPSULES_MAX],
    };
}

/// The rings, and whose turn it is.
pub(crate) struct BlackBox {
    recording: Option<Box<StopRecord>>,
    spare: Option<Box<StopRecord>>,
    sealed: Option<Box<StopRecord>>,
    person: Person,
    /// Stops counted so far, and when the one that is being recorded began.
    stops: u32,
    began: Option<Stamp>,
}

/// The person as heard last.
struct Person {
    count: u32,
    ends: [[[f32; 3]; 2]; HUMAN_CAPSULES_MAX],
}

impl BlackBox {
    pub(crate) fn new(period: Duration, joint_count: usize) -> Self {
        let ring = || Some(Box::new(StopRecord::new(period, joint_count)));
        Self {
            recording: ring(),
            spare: ring(),
            sealed: None,
            person: Person { count: 0, ends: [[[0.0; 3]; 2]; HUMAN_CAPSULES_MAX] },
            stops: 0,
            began: None,
        }
    }

    /// Takes the person as heard.
    pub(crate) fn see(&mut self, human: &HumanState) {
        self.person.count = human.capsule_count.min(HUMAN_CAPSULES_MAX as u32);
        for (ends, capsule) in self.person.ends.iter_mut().zip(&human.capsules).take(self.person.count as usize) {
            *ends = capsule.ends.map(|end| end.map(|x| x as f32));
        }
    }

    /// Records a cycle, told how many stops there have been and how the present one is made.
    pub(crate) fn record(&mut self, cycle: &Record, stops: u32, category: StopCategory) {
        let Some(ring) = &mut self.recording else { return };
        let now = cycle.now;
        ring.push(&Record { human_count: self.person.count, human: self.person.ends, ..*cycle });
        if stops > self.stops {
            self.stops = stops;
            // A stop within the time of another is part of its story.
            if self.began.is_none() {
                self.began = Some(now);
                (ring.number, ring.began, ring.cause, ring.category) = (stops, now, cycle.cause, category);
            }
        }
        let over = self.began.is_some_and(|began| began.age_at(now) >= AFTER);
        if over && self.sealed.is_none() && self.spare.is_some() {
            self.began = None;
            self.sealed = self.recording.take();
            self.recording = self.spare.take();
        }
    }

    /// The sealed ring, if there is one.
    pub(crate) fn fetch(&mut self) -> Option<Box<StopRecord>> {
        self.sealed.take()
    }

    /// The ring of a stop at the end of a run, however lately it began; nothing is recorded after this.
    pub(crate) fn end(&mut self) -> Option<Box<StopRecord>> {
        self.sealed.take().or_else(|| self.began.take().and(self.recording.take()))
    }

    /// Takes a ring back that has been written down.
    pub(crate) fn give_back(&mut self, mut ring: Box<StopRecord>) {
        (ring.next, ring.full) = (0, false);
        self.spare = Some(ring);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cycle(box_: &mut BlackBox, ms: u64, stops: u32) {
        let record = Record { now: Stamp(ms * 1_000_000), cause: StopCause::Separation, ..Record::EMPTY };
        box_.record(&record, stops, StopCategory::Two);
    }

    /// The two seconds before a stop and the half second after it, in order and without a gap; a stop while the first is
    /// away is kept until there is a ring again.
    #[test]
    fn a_stop_is_kept_with_what_led_to_it() {
        let mut recorder = BlackBox::new(Duration::from_millis(1), 6);
        for ms in 0..10_000 {
            assert!(recorder.fetch().is_none(), "{ms} ms");
            cycle(&mut recorder, ms, u32::from(ms >= 9_600));
        }
        (10_000..10_101).for_each(|ms| cycle(&mut recorder, ms, 1));
        let first = recorder.fetch().expect("a stop is over for half a second");
        assert_eq!((first.number, first.began, first.cause), (1, Stamp(9_600_000_000), StopCause::Separation));
        let times: Vec<u64> = first.cycles().map(|record| record.now.0 / 1_000_000).collect();
        assert_eq!(times, (7_600..=10_100).collect::<Vec<_>>());
        (10_101..12_000).for_each(|ms| cycle(&mut recorder, ms, 2));
        assert!(recorder.fetch().is_none(), "the other ring is still away");
        recorder.give_back(first);
        cycle(&mut recorder, 12_000, 2);
        let second = recorder.fetch().expect("there is a ring again");
        assert_eq!((second.number, second.began, second.cycles().count()), (2, Stamp(10_101_000_000), 1_900));
        recorder.give_back(second);
        (12_001..12_100).for_each(|ms| cycle(&mut recorder, ms, 3));
        let last = recorder.end().expect("the run ends a tenth of a second after a stop");
        assert_eq!((last.number, last.cycles().count()), (3, 99));
        assert!(recorder.end().is_none());
    }
}
