//! Both looks at a cloud: the whole view, and closer where the first saw the feature.
//!
//! A view shows a feature at some distance, so that most of the points kept are of what is
//! around it. Sampled once more from the dense cloud within a ball about its first segment, the
//! same network sees it several times finer, and always at about the same size. Their logits are
//! averaged; segment and fit are those of the closer one.

use tandem_msg::{FEATURE_CLASSES, FeatureClass};

use super::fit::{Fit, Room, fit};
use super::model::{Answer, Model};
use super::sample::{Sample, Sampler, squared, sub};

/// Radius of the ball in radii of the segment: so much of its surroundings a feature needs.
const MARGIN: f32 = 1.7;
/// Sampled points a segment has at least.
const SEGMENT_MIN: usize = 12;
/// A ball as large as this share of the view shows nothing new.
const NEARER: f32 = 0.9;

/// A ball, metres, in the camera frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Centre.
    pub centre: [f32; 3],
    /// Radius.
    pub radius: f32,
}

/// The points of a cloud inside a ball.
#[derive(Clone, Debug, Default)]
pub struct Cut {
    /// The points.
    pub points: Vec<[f32; 3]>,
    /// Index of each in the cloud.
    pub index: Vec<u16>,
}

impl Cut {
    /// Cuts the ball out of the cloud.
    pub fn fill(&mut self, cloud: &[[f32; 3]], ball: &Ball) {
        let limit = ball.radius * ball.radius;
        self.points.clear();
        self.points.reserve(cloud.len());
        self.index.clear();
        self.index.reserve(cloud.len());
        for (i, p) in cloud.iter().enumerate() {
            if squared(sub(*p, ball.centre)) < limit {
                self.points.push(*p);
                self.index.push(i as u16);
            }
        }
    }
}

/// What was seen last, and room to look again.
#[derive(Clone, Debug, Default)]
pub struct Sight {
    sampler: Sampler,
    sample: Sample,
    answer: Answer,
    /// The closer look, if `closer`.
    cut: Cut,
    near_sample: Sample,
    near_answer: Answer,
    closer: bool,
    column: Vec<f32>,
    room: Room,
}

impl Sight {
    /// Looks at a cloud (finite points, metres, camera frame); false when there is too little to look at.
    ///
    /// Allocates nothing once it has seen a cloud as large.
    pub fn see(&mut self, model: &mut Model, cloud: &[[f32; 3]]) -> bool {
        self.closer = false;
        self.room.clear();
        if !self.sampler.sample(cloud, &mut self.sample) || !model.answer(&self.sample, &mut self.answer) {
            return false;
        }
        if self.near_sample.points.is_empty() {
            // Room for a closer look, whichever cloud is the first to need one.
            self.near_sample.clone_from(&self.sample);
            self.near_answer.clone_from(&self.answer);
            self.cut.points.reserve(cloud.len());
            self.cut.index.reserve(cloud.len());
            self.column.reserve(cloud.len());
        }
        if let Some(ball) = ball(cloud, &self.sample, &self.answer.segment, &mut self.column) {
            self.cut.fill(cloud, &ball);
            self.closer = self.sampler.sample(&self.cut.points, &mut self.near_sample)
                && model.answer(&self.near_sample, &mut self.near_answer);
        }
        true
    }

    /// Class logits of both looks, their mean.
    pub fn logits(&self) -> [f32; FEATURE_CLASSES] {
        let first = self.answer.logits;
        if !self.closer {
            return first;
        }
        std::array::from_fn(|c| 0.5 * (first[c] + self.near_answer.logits[c]))
    }

    /// Pose and dimensions of a feature of this class, fitted to what was seen of it from nearest; of a
    /// slot to the whole view, since the surface has to be seen beyond both its ends. Allocates nothing.
    pub fn fit(&self, cloud: &[[f32; 3]], class: FeatureClass) -> Option<Fit> {
        if self.closer && class != FeatureClass::Slot {
            fit(&self.cut.points, &self.near_sample, &self.near_answer.segment, class, &self.room)
        } else {
            fit(cloud, &self.sample, &self.answer.segment, class, &self.room)
        }
    }

    /// Whether each point of the last look is of the feature.
    pub fn segment(&self) -> &[bool] {
        if self.closer { &self.near_answer.segment } else { &self.answer.segment }
    }

    /// Index in the cloud of a point of the last look.
    pub fn source(&self, point: usize) -> usize {
        if self.closer {
            usize::from(self.cut.index[usize::from(self.near_sample.source[point])])
        } else {
            usize::from(self.sample.source[point])
        }
    }
}

/// The ball worth a closer look about a segment; `None` when the segment is next to nothing or
/// fills the view already. `column` is room.
pub fn ball(cloud: &[[f32; 3]], sample: &Sample, segment: &[bool], column: &mut Vec<f32>) -> Option<Ball> {
    let on = sample.source.iter().zip(segment).filter(|(_, s)| **s).map(|(&i, _)| cloud[usize::from(i)]);
    let count = segment.iter().filter(|s| **s).count();
    if count < SEGMENT_MIN {
        return None;
    }
    let at = |share: f32| ((count - 1) as f32 * share) as usize;
    let centre = [0, 1, 2].map(|axis| {
        column.clear();
        column.extend(on.clone().map(|p| p[axis]));
        column.sort_unstable_by(f32::total_cmp);
        // Between the outermost that are not stray.
        0.5 * (column[at(0.04)] + column[at(0.96)])
    });
    column.clear();
    column.extend(on.map(|p| squared(sub(p, centre))));
    let radius = MARGIN * column.select_nth_unstable_by(at(0.95), f32::total_cmp).1.sqrt();
    (radius > 1e-6 && radius < NEARER * sample.scale).then_some(Ball { centre, radius })
}
